"""Moments up to which two tests ran alike, so that what the motor's file has wrong is the same in both.

A motor that has settled: every input was constant for a while and is equal, with boundaries of about the same
temperature. Or a motor with the same past, as when a driving cycle is repeated: since the first move of an input, the
means of every input and every product of inputs over each five minutes are about the same, and those of the
boundaries.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from twin.fitting.recorded import Floats, Test

HELD_S = 900.0  # inputs are constant for so long before a settled moment, a common past is at least so long
WINDOW_S = 300.0  # a common past is compared in means over so long; one test may stand so much longer before it moves
CONSTANT = 0.02  # of the largest value of its kind: what stays within so much is constant, two so near are equal
MOVES = 0.05  # of the largest value of its kind: an input so far from its first value has moved
SAME_K = 5.0  # boundaries that differ by no more are about the same


@dataclass(frozen=True)
class Alike:
    """Two tests, and how many steps of each lie before the moments. `inputs` of the first where both settled there,
    dimensionless; None where they have the same past instead."""

    tests: tuple[int, int]
    steps: tuple[int, int]
    inputs: Mapping[str, float] | None


def alike_moments(tests: Sequence[Test]) -> Iterator[Alike]:
    """All settled moments of every two tests; where there are none, the end of their common past."""
    largest = _largest(tests)
    held = [_held(test, largest) for test in tests]
    for first, second in combinations(range(len(tests)), 2):
        pair = tests[first], tests[second]
        both = [steps for steps in product(held[first], held[second]) if _equal(pair, steps, largest)]
        for steps in both:
            yield Alike((first, second), steps, _inputs(tests[first], steps[0]))
        if not both and (past := _common_past(pair, largest)):
            yield Alike((first, second), past, None)


def _largest(tests: Sequence[Test]) -> dict[str, float]:
    """Input -> the largest value of its kind over all tests: the parts of a current are small beside the whole."""
    every = [(name, float(np.abs(values).max())) for test in tests for name, values in test.inputs.items()]
    return {name: max(value for other, value in every if _kind(other) == _kind(name)) for name, _ in every}


def _kind(name: str) -> str:
    """`current` of `current_d`."""
    return name.partition("_")[0]


def _inputs(test: Test, steps: int) -> dict[str, float]:
    return {name: float(values[steps - 1]) for name, values in test.inputs.items()}


def _held(test: Test, largest: Mapping[str, float]) -> list[int]:
    """The ends of stretches of constant inputs."""
    constant = np.ones(len(test.frame.features), dtype=np.bool_)
    for name, values in test.inputs.items():
        constant &= _constant(values, round(HELD_S / test.frame.step_s), 2 * CONSTANT * largest[name])
    return (np.flatnonzero(constant & ~np.append(constant[1:], False)) + 1).tolist()


def _constant(values: Floats, steps: int, most: float) -> NDArray[np.bool_]:
    """(N,) whether the last `steps` values, this one included, are apart by no more than `most`."""
    found = np.zeros(len(values), dtype=np.bool_)
    if len(values) >= steps:
        windows = np.lib.stride_tricks.sliding_window_view(values, steps)
        found[steps - 1 :] = windows.max(axis=1) - windows.min(axis=1) <= most
    return found


def _equal(pair: tuple[Test, Test], steps: tuple[int, int], largest: Mapping[str, float]) -> bool:
    (first, one), (second, other) = zip(pair, steps, strict=True)
    ours, theirs = _inputs(first, one), _inputs(second, other)
    if ours.keys() != theirs.keys():
        return False
    apart = first.frame.boundaries[one - 1] - second.frame.boundaries[other - 1]
    near = (abs(value - theirs[name]) <= CONSTANT * largest[name] for name, value in ours.items())
    return all(near) and bool((np.abs(apart) <= SAME_K).all())


def _common_past(pair: tuple[Test, Test], largest: Mapping[str, float]) -> tuple[int, int] | None:
    """The steps of both up to the end of their common past; None where it is too short, or one stood much longer before
    its first move."""
    first, second = pair
    begins = _first_move(first, largest), _first_move(second, largest)
    stood_s = [begin * test.frame.step_s for begin, test in zip(begins, pair, strict=True)]
    if first.inputs.keys() != second.inputs.keys() or abs(stood_s[0] - stood_s[1]) > WINDOW_S:
        return None
    ours, theirs = _means(first, begins[0]), _means(second, begins[1])
    count = min(len(ours), len(theirs))
    differ = (np.abs(ours[:count] - theirs[:count]) > _may_differ(first, ours, theirs, largest)).any(axis=1)
    windows = int(differ.argmax()) if differ.any() else count
    if windows * WINDOW_S < HELD_S:
        return None
    return begins[0] + windows * _window(first), begins[1] + windows * _window(second)


def _first_move(test: Test, largest: Mapping[str, float]) -> int:
    """The first step at which an input is far from its first value; 0 where none ever is."""
    moved = [np.abs(values - values[0]) > MOVES * largest[name] for name, values in test.inputs.items()]
    return int(np.any(moved, axis=0).argmax())


def _window(test: Test) -> int:
    return round(WINDOW_S / test.frame.step_s)


def _means(test: Test, begin: int) -> Floats:
    """(W, columns) of each window from step `begin` on: the boundaries, the inputs by name, then their products."""
    inputs = [test.inputs[name] for name in sorted(test.inputs)]
    columns = np.column_stack([test.frame.boundaries, *inputs, test.frame.features])[begin:]
    whole = len(columns) // _window(test)
    windows: Floats = columns[: whole * _window(test)].reshape(whole, _window(test), columns.shape[1])
    return np.asarray(windows.mean(axis=1))


def _may_differ(test: Test, ours: Floats, theirs: Floats, largest: Mapping[str, float]) -> Floats:
    """By how much each column of `_means` may: (columns,)."""
    boundaries = np.full(test.frame.boundaries.shape[1], SAME_K)
    inputs = [CONSTANT * largest[name] for name in sorted(test.inputs)]
    products = slice(boundaries.size + len(inputs), None)
    heats = CONSTANT * np.abs(np.concatenate([ours, theirs])[:, products]).max(axis=0, initial=0.0)
    return np.concatenate([boundaries, inputs, heats])
