"""Tests that contradict each other: they ran alike up to a moment, and a sensor read further apart there than it, the
coolant and the inputs may differ from one test to the next.

Alike are two moments at which every input was constant for a while and is equal, with boundaries of about the same
temperature. The motor has settled there, so that what its file has wrong is the same in both and drops out. With e
the mean residual of a channel before a moment, nothing fitted, and a what one unit of each number that a test brings
along (its start, offsets, clocks, boundaries and inputs) does to it,

    D = e_1 - e_2,    var D = a_1' S a_1 + a_2' S a_2 + s_1^2 + s_2^2

where S are the prior variances of these numbers, and s what an alike moment may differ by all the same: the less the
better the file knows the motor. Two tests contradict each other where |D| is above FAR standard deviations.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from twin.fitting.model import Columns, Model
from twin.fitting.recorded import Floats, Test

HELD_S, WINDOW_S = 900.0, 300.0  # inputs are constant for so long before a moment, and readings are means over so long
CONSTANT = 0.02  # of the largest value of its kind: what stays within so much is constant, two so near are equal
SAME_K = 5.0  # boundaries that differ by no more are about the same
SETTLED_K = 0.5  # a residual that moves by more from one half of the window to the other has not settled
LEFT_K, LEFT = 0.3, 0.05  # sd: an alike moment may differ by so much all the same, and by a share of the residual
FAR = 4.0  # standard deviations


@dataclass(frozen=True)
class Contradiction:
    """Two tests and the moments [s] up to which they ran alike. `channel` reads `differ_K` more at the first than the
    second lets it, `sd_K` the standard deviation of that; `inputs` at the first, dimensionless."""

    channel: str
    tests: tuple[int, int]
    at_s: tuple[float, float]
    differ_K: float
    sd_K: float
    inputs: Mapping[str, float]


@dataclass(frozen=True)
class _Moment:
    """The end of a stretch of constant inputs, and channel -> (mean residual [K], its variance) before it."""

    test: int
    at_s: float
    inputs: Mapping[str, float]
    boundaries: Floats
    seen: Mapping[str, tuple[float, float]]


def contradictions(model: Model) -> list[Contradiction]:
    """Of every two tests and channel the worst, those first that are furthest beyond what may be. Raises
    `DivergedError`."""
    largest = _largest(model.tests)
    worst: dict[tuple[int, int, str], Contradiction] = {}
    for first, second in combinations(_moments(model, largest), 2):
        if first.test != second.test and _alike(first, second, largest):
            for one in _compared(first, second):
                key = (*one.tests, one.channel)
                worst[key] = max(worst.get(key, one), one, key=_beyond)
    real = [one for one in worst.values() if _beyond(one) > FAR]
    return sorted(real, key=_beyond, reverse=True)


def _beyond(one: Contradiction) -> float:
    return abs(one.differ_K) / one.sd_K


def _compared(first: _Moment, second: _Moment) -> Iterator[Contradiction]:
    for channel in first.seen.keys() & second.seen.keys():
        (mean, variance), (other_mean, other_variance) = first.seen[channel], second.seen[channel]
        sd = float(np.sqrt(variance + other_variance))
        tests, at_s = (first.test, second.test), (first.at_s, second.at_s)
        yield Contradiction(channel, tests, at_s, mean - other_mean, sd, first.inputs)


def _largest(tests: Sequence[Test]) -> dict[str, float]:
    """Input -> the largest value of its kind over all tests: the parts of a current are small beside the whole."""
    every = [(name, float(np.abs(values).max())) for test in tests for name, values in test.inputs.items()]
    return {name: max(value for other, value in every if _kind(other) == _kind(name)) for name, _ in every}


def _kind(name: str) -> str:
    """`current` of `current_d`."""
    return name.partition("_")[0]


def _moments(model: Model, largest: Mapping[str, float]) -> Iterator[_Moment]:
    parts = model.linearise(np.zeros(len(model.parameters)))
    for number, test in enumerate(model.tests):
        step_s = test.frame.step_s
        constant = np.ones(len(test.frame.features), dtype=np.bool_)
        for name, values in test.inputs.items():
            constant &= _constant(values, round(HELD_S / step_s), 2 * CONSTANT * largest[name])
        for k in np.flatnonzero(constant & ~np.append(constant[1:], False)).tolist():
            at_s = (k + 1) * step_s
            inputs = {name: float(values[k]) for name, values in test.inputs.items()}
            seen = {p.series.channel: _seen(model, p, at_s) for p in parts if p.series.session == number}
            settled = {c.name: one for c in test.channels if (one := seen.get(c.name)) is not None}
            yield _Moment(number, at_s, inputs, test.frame.boundaries[k], settled)


def _constant(values: Floats, steps: int, most: float) -> NDArray[np.bool_]:
    """(N,) whether the last `steps` values, this one included, are apart by no more than `most`."""
    found = np.zeros(len(values), dtype=np.bool_)
    if len(values) >= steps:
        windows = np.lib.stride_tricks.sliding_window_view(values, steps)
        found[steps - 1 :] = windows.max(axis=1) - windows.min(axis=1) <= most
    return found


def _alike(first: _Moment, second: _Moment, largest: Mapping[str, float]) -> bool:
    if first.inputs.keys() != second.inputs.keys():
        return False
    near = (abs(value - second.inputs[name]) <= CONSTANT * largest[name] for name, value in first.inputs.items())
    return all(near) and bool((np.abs(first.boundaries - second.boundaries) <= SAME_K).all())


def _seen(model: Model, part: Columns, at_s: float) -> tuple[float, float] | None:
    """Mean residual [K] of a channel before a moment and its variance; None where it is not there or not settled."""
    there = (part.series.t_s > at_s - WINDOW_S) & (part.series.t_s <= at_s)
    own = np.array([model.parameters[place].test is not None for place in part.at])
    residual, columns = part.series.y[there], part.columns[there][:, own]
    early, late = np.array_split(residual, 2)
    if not early.size or abs(late.mean() - early.mean()) > SETTLED_K:
        return None
    mean, moved = float(residual.mean()), columns.mean(axis=0) * model.sd[part.at[own]]
    return mean, float(moved @ moved) + LEFT_K**2 + (LEFT * mean) ** 2
