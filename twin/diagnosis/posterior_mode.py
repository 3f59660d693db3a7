"""A model at the mode of its posterior: candidates' columns there, whitened, and how slow and how warm the motor is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twin.diagnosis.evidence import Projector
from twin.diagnosis.reml import says_wrong_form
from twin.differences.candidates import Candidate
from twin.differences.proposals import Proposals
from twin.fitting.actions import Parameter
from twin.fitting.fit import Fit
from twin.fitting.model import Columns, Floats, Model, Test
from twin.fitting.recorded import METER_SHARE


def linearised(
    current: Fit, candidates: Sequence[Candidate]
) -> tuple[list[Candidate], list[Parameter], Sequence[Columns], list[str]]:
    """The candidates that move a reading, their parameters, the series with their columns (`extra`) at a fit, and the
    ids of candidates whose columns are not finite."""
    proposals = Proposals(current.model, current.beta)
    chosen = [c for c in candidates if not c.discrete and (not c.repeated or _is_repeated(c, current.model.tests))]
    parameters = [proposals.parameter(c) for c in chosen]
    parts = current.model.linearise(current.beta, parameters)
    stack = np.concatenate([p.extra for p in parts])
    finite = np.isfinite(stack).all(axis=0)
    dropped = [str(c.cause) for c, ok in zip(chosen, finite, strict=True) if not ok]
    kept = np.flatnonzero(finite & (np.abs(stack).max(axis=0) > 1e-9))
    parts = [Columns(p.series, p.at, p.columns, p.extra[:, kept]) for p in parts]
    return [chosen[i] for i in kept], [parameters[i] for i in kept], parts, dropped


def _is_repeated(candidate: Candidate, tests: Sequence[Test]) -> bool:
    """Whether two tests of one kind differ in what the candidate goes with. Tests of two kinds do not count: what the
    file's form has wrong differs between them too."""
    seen = {(test.kind, test.course.get(candidate.cause.law, 0.0)) for test in tests}
    return len(seen) > len({kind for kind, _ in seen})


def stacked(current: Fit, parts: Sequence[Columns]) -> tuple[Projector, Floats, Floats]:
    """The projector of the free parameters, the whitened columns of candidates (N, c), and the whitened residual (N,)
    referred back to the prior mean."""
    model, beta, free = current.model, current.beta, current.free
    a_rows, v_rows, e_rows = [], [], []
    for part in parts:
        white = model.whitened(part.series, np.column_stack([part.series.y, part.columns, part.extra]))
        e, own, v = np.split(white, [1, 1 + len(part.at)], axis=1)
        a = np.zeros((len(white), beta.size))
        a[:, part.at] = own
        a_rows.append(a[:, free])
        e_rows.append(e[:, 0])
        v_rows.append(v)
    a = np.concatenate(a_rows)
    return Projector.of(a, 1 / model.sd[free] ** 2), np.concatenate(v_rows), np.concatenate(e_rows) + a @ beta[free]


def slowest_mode_s(current: Fit) -> float:
    """The longest time constant of the fitted network at the mean of its tests [s]."""
    return max(current.model.slowest_s(s, current.beta) for s in range(len(current.model.tests)))


def is_wrong_in_form(model: Model) -> bool:
    """Whether what a model leaves of any thermometer says that its form is wrong (`twin.diagnosis.reml`)."""
    return says_wrong_form(model.noise, channel_rises(model))


def rises(model: Model) -> dict[str, float]:
    """Channel -> how far it rises over the coldest boundary, at least 1 K; of a meter in its rows' unit, all of it."""
    return channel_rises(model) | {meter.name: 1 / METER_SHARE for test in model.tests for meter in test.meters}


def channel_rises(model: Model) -> dict[str, float]:
    """As `rises`, of thermometers alone."""
    rise: dict[str, float] = {}
    for test in model.tests:
        for channel in test.channels:
            hottest = channel.measured[channel.samples > 0].max(initial=test.coldest_degC)
            rise[channel.name] = max(rise.get(channel.name, 1.0), float(hottest) - test.coldest_degC)
    return rise
