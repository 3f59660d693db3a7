"""How well a hidden effect can be seen, whatever method looks for it.

What is left after calibration at a healthy mode counts: the same specimen without effects on the same drives, fitted as
every diagnosis begins. There v (N,) is the whitened column of the true cause per unit of amplitude and P takes out all
that a healthy motor may do (`twin.diagnosis.evidence`). With x (N,) what the effect alone does to the readings,

    J = v'P v,   s = v'P x,   d = |s| / sqrt(J),
    expected ln BF = s^2 sigma^2 / (2 (1 + J sigma^2)) - ln(1 + J sigma^2) / 2

under the candidate's own prior sd sigma, one-sided where it has a sign: the evidence that a diagnosis would find in
readings without noise; noise adds at most 1/2 on average. An error of a reading, a clock or an input is x = size v.
Off the library v is x itself with sigma 1: what a candidate of just this course would have. An exchange of channels has
no size, and what is no candidate and moves no reading has no column: both have none of this.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.trial.campaigns import Course, middles
from benchmarks.trial.cases import READ_WRONG, either_way
from plant import Effect
from replay.studies.diagnosis.question import Campaign
from twin.diagnosis.evidence import log_bayes_factor
from twin.diagnosis.posterior_mode import stacked
from twin.diagnosis.refined import calibrated
from twin.differences.candidates import Candidate
from twin.differences.proposals import Proposals
from twin.fitting.fit import Fit
from twin.fitting.model import Columns, Model

Floats = NDArray[np.float64]

EDGES = (3.0, 8.0)  # of the expected ln BF
BANDS = ("below 3", "3 to 8", "8 and more")
VISIBLE = BANDS[-1]


@dataclass(frozen=True)
class Seen:
    """A hidden cause with its size, `d` and expected ln BF; None where it has no size or no column."""

    cause: str
    size: float
    d: float | None = None
    log_bf: float | None = None

    @property
    def band(self) -> str | None:
        """Which of BANDS its expected ln BF is in."""
        return None if self.log_bf is None else BANDS[int(np.searchsorted(EDGES, self.log_bf, side="right"))]


def healthy_mode(campaign: Campaign) -> Fit:
    """The fit of a campaign without effects, as every diagnosis begins."""
    return calibrated(campaign.healthy, campaign.candidates, lambda _: None)


def seen(mode: Fit, candidates: Sequence[Candidate], effect: Effect, moved: Sequence[Course]) -> Seen:
    """How well an effect can be seen at a healthy mode, `moved` what it does to the readings of each session."""
    own = [c for c in candidates if either_way(str(c.cause)) == either_way(effect.cause)][:1]
    proposals = Proposals(mode.model, mode.beta)
    parameters = [proposals.parameter(c) for c in own if not c.discrete]
    parts = mode.model.linearise(mode.beta, parameters)
    projector, v, _ = stacked(mode, parts)
    sigma, sign = (parameters[0].sd, own[0].sign) if parameters else (1.0, 0)
    if effect.kind in READ_WRONG:
        if not parameters:
            return Seen(effect.cause, effect.size)
        x = effect.size * v[:, 0]
    else:
        x = np.concatenate([_moved(mode.model, part, moved) for part in parts])
    column = v[:, 0] if parameters else x
    j, s = float(projector.inner(column, column)), float(projector.inner(column, x))
    if j <= 0.0:
        return Seen(effect.cause, effect.size, 0.0, 0.0)
    expected = log_bayes_factor(*(np.array([value]) for value in (s, j, sigma, sign)))
    return Seen(effect.cause, effect.size, abs(s) / j**0.5, float(expected[0]))


def _moved(model: Model, part: Columns, moved: Sequence[Course]) -> Floats:
    """What an effect does to the rows of a channel, whitened; to what the file says of a node, nothing."""
    if not part.series.measured:
        return np.zeros(len(part.series.y))
    test = model.tests[part.series.session]
    channel = next(c for c in test.channels if c.name == part.series.channel)
    course = moved[part.series.session][channel.name]
    steps = len(test.frame.features)
    at_steps = np.interp(middles(steps * test.frame.step_s, test.frame.step_s), middles(len(course)), course)
    x = channel.blocks(test.frame.step_s).measured(at_steps)
    whitened: Floats = model.whitened(part.series, x[:, None])[:, 0]
    return whitened
