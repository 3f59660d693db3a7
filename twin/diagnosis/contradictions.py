"""Tests that contradict each other: they ran alike up to a moment, and a sensor read further apart there than it, the
coolant and the inputs may differ from one test to the next.

What the motor's file has wrong is the same at both moments and drops out. With e the mean residual of a channel before
a moment, nothing fitted, and a what one unit of each number that a test brings along (its start, offsets, clocks,
boundaries and inputs) does to it,

    D = e_1 - e_2,    var D = a_1' S a_1 + a_2' S a_2 + s_1^2 + s_2^2

where S are the prior variances of these numbers, and s what an alike moment may differ by all the same: the less the
better the file knows the motor. Two tests contradict each other where |D| is above FAR standard deviations.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from twin.diagnosis.alike import WINDOW_S, Alike, alike_moments
from twin.fitting.model import Columns, Model

SETTLED_K = 0.5  # a residual that moves by more from one half of the window to the other has not settled
LEFT_K, LEFT = 0.3, 0.05  # sd: an alike moment may differ by so much all the same, and by a share of the residual
FAR = 4.0  # standard deviations


@dataclass(frozen=True)
class Contradiction:
    """Two tests and the moments [s] up to which they ran alike. `channel` reads `differ_K` more at the first than the
    second lets it, `sd_K` the standard deviation of that; `inputs` at the first, dimensionless, None where the two have
    the same past and had not settled."""

    channel: str
    tests: tuple[int, int]
    at_s: tuple[float, float]
    differ_K: float
    sd_K: float
    inputs: Mapping[str, float] | None


def contradictions(model: Model) -> list[Contradiction]:
    """The worst of every two tests and channel, those first that are furthest beyond what may be. Raises
    `DivergedError`."""
    parts = {(p.series.session, p.series.channel): p for p in model.linearise(np.zeros(len(model.parameters)))}
    worst: dict[tuple[int, int, str], Contradiction] = {}
    for moments in alike_moments(model.tests):
        for one in _compared(model, parts, moments):
            key = (*one.tests, one.channel)
            worst[key] = max(worst.get(key, one), one, key=_beyond)
    real = [one for one in worst.values() if _beyond(one) > FAR]
    return sorted(real, key=_beyond, reverse=True)


def _beyond(one: Contradiction) -> float:
    return abs(one.differ_K) / one.sd_K


def _compared(model: Model, parts: Mapping[tuple[int, str], Columns], alike: Alike) -> Iterator[Contradiction]:
    """Each channel that both tests read there."""
    first, second = (model.tests[number] for number in alike.tests)
    at_s = alike.steps[0] * first.frame.step_s, alike.steps[1] * second.frame.step_s
    of_second = {channel.name for channel in second.channels}
    for channel in (one.name for one in first.channels if one.name in of_second):
        one, other = (
            _seen(model, parts[number, channel], end_s, alike.inputs is not None)
            for number, end_s in zip(alike.tests, at_s, strict=True)
        )
        if one is not None and other is not None:
            sd = float(np.sqrt(one[1] + other[1]))
            yield Contradiction(channel, alike.tests, at_s, one[0] - other[0], sd, alike.inputs)


def _seen(model: Model, part: Columns, at_s: float, settled: bool) -> tuple[float, float] | None:
    """Mean residual [K] of a channel before a moment and its variance; None where it is not there, or not `settled`
    where it should be."""
    there = (part.series.t_s > at_s - WINDOW_S) & (part.series.t_s <= at_s)
    own = np.array([model.parameters[place].test is not None for place in part.at])
    residual, columns = part.series.y[there], part.columns[there][:, own]
    early, late = np.array_split(residual, 2)
    if not early.size or (settled and abs(late.mean() - early.mean()) > SETTLED_K):
        return None
    mean, moved = float(residual.mean()), columns.mean(axis=0) * model.sd[part.at[own]]
    return mean, float(moved @ moved) + LEFT_K**2 + (LEFT * mean) ** 2
