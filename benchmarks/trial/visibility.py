"""How well a hidden effect can be seen, whatever method looks for it.

What is left after calibration at a healthy mode counts: the same specimen without effects on the same drives, fitted as
every diagnosis begins. There v (N,) is the whitened column of the true cause per unit of amplitude, P takes out all
that a healthy motor may do (`twin.diagnosis.evidence`), and x (N,) is what the effect alone does to the readings, for
an error of a reading, a clock or an input as far as d goes size times v:

    J = v'P v,   s = v'P x,   d = |s| / sqrt(J).

The *expected ln BF* is what the true cause gains on readings that this fit predicts with x added, without noise: two
full fits, with it and without, under the noise and the widths of the healthy mode. The straight line through the mode,

    s^2 sigma^2 / (2 (1 + J sigma^2)) - ln(1 + J sigma^2) / 2

under the candidate's own prior sd sigma, promises more where a coefficient of the file does the same as the cause: that
grows by a factor, so each watt more costs it less. Noise adds at most 1/2 on average. Off the library v is x itself and
the line with sigma 1 is an upper bound. An exchange of channels has no size, and what is no candidate and moves no
reading has no column: both have none of this.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.trial.campaigns import Course, middles
from benchmarks.trial.cases import READ_WRONG, either_way
from plant import Effect
from replay.studies.diagnosis.question import Campaign
from twin.diagnosis.evidence import log_bayes_factor
from twin.diagnosis.posterior_mode import stacked
from twin.diagnosis.refined import calibrated
from twin.diagnosis.rounds import compared
from twin.differences.candidates import Candidate
from twin.differences.proposals import Proposals
from twin.fitting.actions import Parameter
from twin.fitting.fit import NEAR_ENOUGH, Fit, fit
from twin.fitting.model import Columns, Model, Test

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


def strength(mode: Fit, candidates: Sequence[Candidate], effect: Effect, moved: Sequence[Course]) -> float | None:
    """d of an effect at a healthy mode, `moved` what it does to the readings of each session; None where it has
    none."""
    line = _line(mode, candidates, effect, moved)
    return None if line is None else line.d


def seen(mode: Fit, candidates: Sequence[Candidate], effect: Effect, moved: Sequence[Course]) -> Seen:
    """How well an effect can be seen at a healthy mode, `moved` as for `strength`."""
    line = _line(mode, candidates, effect, moved)
    if line is None:
        return Seen(effect.cause, effect.size)
    if line.j <= 0.0:
        return Seen(effect.cause, effect.size, 0.0, 0.0)
    if line.own is None:
        expected = float(log_bayes_factor(*(np.array([value]) for value in (line.s, line.j, 1.0, 0)))[0])
    else:
        expected = _expected(mode, *line.own, line)
    return Seen(effect.cause, effect.size, line.d, expected)


@dataclass(frozen=True)
class _Line:
    """An effect on the straight line through a healthy mode: J and s; what it does to the rows of each of `parts`
    (`shifts`); and the candidate that is its `own`, with its parameter."""

    j: float
    s: float
    parts: Sequence[Columns]
    shifts: Sequence[Floats]
    own: tuple[Candidate, Parameter] | None

    @property
    def d(self) -> float:
        return abs(self.s) / self.j**0.5 if self.j > 0.0 else 0.0


def _line(mode: Fit, candidates: Sequence[Candidate], effect: Effect, moved: Sequence[Course]) -> _Line | None:
    own = [c for c in candidates if either_way(str(c.cause)) == either_way(effect.cause) and not c.discrete][:1]
    parameters = [Proposals(mode.model, mode.beta).parameter(c) for c in own]
    parts = mode.model.linearise(mode.beta, parameters)
    if effect.kind in READ_WRONG:
        if not parameters:
            return None
        shifts = _read_wrong(mode, parameters, effect.size)
    else:
        shifts = [_moved(mode.model, part, moved) for part in parts]
    projector, v, _ = stacked(mode, parts)
    x = np.concatenate(
        [mode.model.whitened(p.series, one[:, None])[:, 0] for p, one in zip(parts, shifts, strict=True)]
    )
    column = v[:, 0] if parameters else x
    j = float(projector.inner(column, column))
    s = effect.size * j if effect.kind in READ_WRONG else float(projector.inner(column, x))
    return _Line(j, s, parts, shifts, next(zip(own, parameters, strict=True), None))


def _expected(mode: Fit, candidate: Candidate, parameter: Parameter, line: _Line) -> float:
    """What a cause gains on readings without noise, each row moved by its shift; its search begins where the line has
    it."""
    amplitude = line.s / (line.j + 1 / parameter.sd**2)
    model = Model(
        mode.model.network, _as_predicted(mode, line.parts, line.shifts), mode.model.parameters, mode.model.noise
    )
    inside = float(np.clip(amplitude, 0.9 * parameter.low, 0.9 * parameter.high)) or 1e-3 * parameter.sd
    without = fit(model, mode.beta, NEAR_ENOUGH)
    begun = [np.append(beta, inside) for beta in (mode.beta, without.beta)]
    found = [fit(model.plus([parameter]), beta, NEAR_ENOUGH) for beta in begun]
    best = max(found, key=lambda one: one.log_evidence)
    return compared(best, without, candidate, parameter, len(mode.beta)).log_bayes_factor


def _read_wrong(mode: Fit, parameters: Sequence[Parameter], size: float) -> list[Floats]:
    """What an error of the bench of this size does to the rows of each channel."""
    with_it = mode.model.plus(parameters).residuals(np.append(mode.beta, size))
    return [before.y - after.y for before, after in zip(mode.series, with_it, strict=True)]


def _as_predicted(mode: Fit, parts: Sequence[Columns], shifts: Sequence[Floats]) -> list[Test]:
    """The tests as a fit predicts their readings, each row moved by its shift."""
    moved = {(p.series.session, p.series.channel): shift - p.series.y for p, shift in zip(parts, shifts, strict=True)}
    tests = []
    for number, test in enumerate(mode.model.tests):
        channels = []
        for channel in test.channels:
            cut = channel.blocks(test.frame.step_s)
            by_block = np.zeros(len(cut.there))
            by_block[cut.there] = moved[number, channel.name]
            by_step = np.repeat(by_block, cut.length)[: len(channel.measured)]
            channels.append(replace(channel, measured=channel.measured + by_step))
        tests.append(replace(test, channels=tuple(channels)))
    return tests


def _moved(model: Model, part: Columns, moved: Sequence[Course]) -> Floats:
    """What an effect does to the rows of a channel; to what the file says of a node, nothing."""
    if not part.series.measured:
        return np.zeros(len(part.series.y))
    test = model.tests[part.series.session]
    channel = next(c for c in test.channels if c.name == part.series.channel)
    course = moved[part.series.session][channel.name]
    steps = len(test.frame.features)
    at_steps = np.interp(middles(steps * test.frame.step_s, test.frame.step_s), middles(len(course)), course)
    return channel.blocks(test.frame.step_s).measured(at_steps)
