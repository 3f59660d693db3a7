"""Which candidates a test shows as a multiple of something else: their columns need not be made.

A candidate may do what a parameter of the vector does, as a scaled loss does that is free already. And where speed and
load stand still or go on and off, all heats at one place that go with powers of them go on and off alike.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.fitting.actions import Action, Added, Attached, Parameter
from twin.fitting.model import Floats, Test

Courses = Mapping[str, tuple[bytes, float]]  # of a product of features: how it goes, whatever its size, and its largest


@dataclass(frozen=True)
class Multiples:
    """Candidates (m,) as multiples: each is `times` (m,) what stands at its `place` (m,) among the vector's parameters
    (P,) and the candidates `made` (k,) behind them."""

    made: tuple[Parameter, ...]
    place: NDArray[np.intp]
    times: Floats

    @classmethod
    def of(cls, candidates: Sequence[Parameter], vector: Sequence[Parameter], test: Test) -> Multiples:
        """Exact: actions are equal, or features go alike to the last bit. A candidate of one recorded test is nothing
        in another."""
        rows = {**test.features, "constant": np.ones(len(test.frame.features))}
        courses = {name: _course(row) for name, row in rows.items()}
        there: dict[Hashable, tuple[int, float]] = {}
        for p, parameter in enumerate(vector):
            if not isinstance(parameter.action, Attached):  # in the vector it is a state of its own
                kind, size = _kind(parameter.action, courses)
                there[kind] = p, size
        made, place, times = list[Parameter](), np.zeros(len(candidates), dtype=np.intp), np.zeros(len(candidates))
        for i, candidate in enumerate(candidates):
            if candidate.test is None:
                kind, size = _kind(candidate.action, courses)
                if kind not in there:
                    there[kind] = len(vector) + len(made), size
                    made.append(candidate)
                place[i], times[i] = there[kind][0], size / there[kind][1]
        return cls(tuple(made), place, times)


def _kind(action: Action, courses: Courses) -> tuple[Hashable, float]:
    """Actions of one kind show as multiples of each other, as their sizes are."""
    if isinstance(action, Added) and action.rms:
        course, most = courses[action.feature]
        return (action.places, action.own, course), most / action.rms
    return action, 1.0


def _course(row: Floats) -> tuple[bytes, float]:
    """Form and size of a row of `Courses`; the size of one that is 0 throughout is 1."""
    most = float(np.abs(row).max()) or 1.0
    return (row / most).tobytes(), most
