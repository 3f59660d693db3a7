"""A model at the mode of its posterior: candidates' columns there, whitened, and how slow and how warm the motor is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twin.diagnosis.evidence import Projector
from twin.differences.candidates import Candidate
from twin.differences.proposals import Proposals
from twin.fitting.actions import Parameter
from twin.fitting.fit import Fit
from twin.fitting.model import Columns, Floats, Model, Test
from twin.fitting.recorded import METER_SHARE


def linearised(
    current: Fit, candidates: Sequence[Candidate]
) -> tuple[list[Candidate], list[Parameter], Sequence[Columns], list[str]]:
    """Candidates that move a reading, their parameters and columns at a fit,
    and the ids of those whose columns are not finite."""
    proposals = Proposals(current.model, current.beta)
    chosen = [c for c in candidates if not c.discrete and (not c.repeated or _is_repeated(c, current.model.tests))]
    parameters = [proposals.parameter(c) for c in chosen]
    parts = current.model.linearise(current.beta, parameters)
    stack = np.concatenate([p.extra for p in parts])
    good = np.isfinite(stack).all(axis=0) & (np.abs(stack).max(axis=0) > 1e-9)
    dropped = [str(c.cause) for c, ok in zip(chosen, np.isfinite(stack).all(axis=0), strict=True) if not ok]
    kept = np.flatnonzero(good)
    parts = [Columns(p.series, p.at, p.columns, p.extra[:, kept]) for p in parts]
    return [chosen[i] for i in kept], [parameters[i] for i in kept], parts, dropped


def _is_repeated(candidate: Candidate, tests: Sequence[Test]) -> bool:
    """Whether two tests of one kind differ in what the candidate goes with: between kinds,
    the file's form differs too."""
    seen = {(test.kind, test.course.get(candidate.cause.law, 0.0)) for test in tests}
    return len(seen) > len({kind for kind, _ in seen})


def stacked(current: Fit, parts: Sequence[Columns]) -> tuple[Projector, Floats, Floats]:
    """The projector of the free parameters, the whitened columns of candidates (N, c), and the whitened residual (N,)
    referred back to the prior mean."""
    model, beta = current.model, current.beta
    free = current.free
    a_rows, v_rows, e_rows = [], [], []
    for part in parts:
        white = model.whitened(part.series, np.column_stack([part.series.y, part.columns, part.extra]))
        p = part.columns.shape[1]
        a = np.zeros((len(white), beta.size))
        a[:, part.at] = white[:, 1 : 1 + p]
        a_rows.append(a)
        e_rows.append(white[:, 0])
        v_rows.append(white[:, 1 + p :])
    a = np.concatenate(a_rows)[:, free]
    return Projector.of(a, 1 / model.sd[free] ** 2), np.concatenate(v_rows), np.concatenate(e_rows) + a @ beta[free]


def slowest_mode_s(current: Fit) -> float:
    """The longest time constant of the fitted network at the mean of its tests [s]."""
    return max(current.model.slowest_s(s, current.beta) for s in range(len(current.model.tests)))


def rises(model: Model) -> dict[str, float]:
    """Channel -> how far it rises over the coldest boundary, at least 1 K."""
    rise: dict[str, float] = {}
    for test in model.tests:
        coldest = float(test.frame.boundaries.mean(axis=0).min())
        for channel in test.channels:
            hottest = channel.measured[channel.output.samples > 0].max(initial=coldest)
            rise[channel.name] = max(rise.get(channel.name, 1.0), float(hottest) - coldest)
        rise |= {meter.name: 1 / METER_SHARE for meter in test.meters}
    return rise
