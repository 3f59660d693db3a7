"""Kept tests under a fitted motor: what a test brings along is estimated from its first 10 %, the rest predicted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twin.diagnosis.gain import Kept, opened_s
from twin.differences.everyday import of_test
from twin.fitting.actions import Parameter
from twin.fitting.fit import Fit
from twin.fitting.model import Floats, Model, Test


@dataclass(frozen=True)
class Prediction:
    """One channel of one kept test after its opening: `t_s` (B,) [s], `residual` (B,) [K] measured minus predicted."""

    test: int
    channel: str
    t_s: Floats
    residual: Floats


@dataclass(frozen=True)
class KeptTests:
    """`scored`: one a test, for `twin.diagnosis.gain.held_out_gain`; `predictions`: one a test and channel."""

    scored: tuple[Kept, ...]
    predictions: tuple[Prediction, ...]


def kept_tests(found: Fit | None, model: Model, tests: Sequence[Test]) -> KeptTests:
    """Score and predict tests that nothing was learnt from, with a fit's motor and sensors (None: the file's own),
    under the noise of `model`."""
    fitted = zip(found.model.parameters, found.beta, strict=True) if found else ()
    shared = [(p, b) for p, b in fitted if p.test is None]
    own = [p for number, test in enumerate(tests) for p in of_test(model.network, test, number)]
    parameters: list[Parameter] = [*(p for p, _ in shared), *own]
    kept = Model(model.network, tests, parameters, model.noise)
    beta = np.array([*(b for _, b in shared), *np.zeros(len(own))])
    first = len(shared)
    parts = kept.linearise(beta)
    step = np.zeros_like(beta)
    scored = []
    for number in range(len(tests)):
        mine = [part for part in parts if part.series.session == number]
        at = mine[0].at[mine[0].at >= first]
        plain = [np.column_stack([part.series.y, part.columns[:, part.at >= first]]) for part in mine]
        white = np.concatenate([kept.whitened(part.series, x) for part, x in zip(mine, plain, strict=True)])
        t, e, a = np.concatenate([part.series.t_s for part in mine]), white[:, 0], white[:, 1:]
        precision = 1 / kept.sd[at] ** 2
        scored.append(Kept(t, e, a, precision))
        opening = t <= opened_s(t)
        information = np.diag(precision) + a[opening].T @ a[opening]
        step[at] = np.linalg.solve(information, a[opening].T @ e[opening])
    predictions = []
    for part in parts:
        after = part.series.t_s > opened_s(part.series.t_s)
        left = part.series.y - part.columns @ step[part.at]
        predictions.append(Prediction(part.series.session, part.series.channel, part.series.t_s[after], left[after]))
    return KeptTests(tuple(scored), tuple(predictions))
