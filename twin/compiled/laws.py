"""The laws of a network as a table, and what they give at many states: what marches and accounts of heat are made from.

The heat into node a (and, in a link between nodes, out of node b) is `amount(t) psi(T)`. psi is the heat of
`twin.motor.heat_laws` at an amount of 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from twin.compiled.heat import heats
from twin.compiled.structure import Group, Parameters, Ramps
from twin.motor.heat_laws import AFFINE, NUMBER
from twin.motor.network import NOBODY, Copper

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Law:
    """The law of one place. Node `a` takes the heat; `b` is the link's other end, a node or n + boundary, NOBODY in a
    source.

    `law`: a name of `twin.motor.heat_laws.LAWS`. `other`, `slope` [1/K], `reference` [degC]: the temperature factor,
    `other` NOBODY where there is none. `one_way`: the heat is not taken out of b, as that is fluid that flows on, or a
    mass that follows and is weighed elsewhere. `fluid`: as in `twin.compiled.structure.Group`.
    """

    a: int
    b: int
    law: str = "linear"
    other: int = NOBODY
    slope: float = 0.0
    reference: float = 0.0
    one_way: bool = False
    fluid: Ramps = ()

    @classmethod
    def of(cls, group: Group, values: Parameters, index: int) -> Law:
        """The law of a network's group."""
        slope, reference = (float(value) for value in values.factors[index])
        return cls(group.a, group.b, group.law, group.other, slope, reference, one_way=group.one_way, fluid=group.fluid)

    @property
    def affine(self) -> bool:
        """Whether psi is linear in the temperatures, so that its slopes are all of it."""
        return self.law in AFFINE and (self.law == "source" or self.other == NOBODY)


@dataclass(frozen=True)
class Table:
    """Laws as a compiled loop reads them, a row a law.

    `places` (L, 6): a, b, number of the law (`NUMBER`), other, 1 where one way, knots of the fluid. `numbers` (L, 2 +
    2 most knots): slope, reference, the knots, the rises (`twin.compiled.structure.Ramps`).
    `copper` (2,): alpha [1/K], reference [degC]. A loss in copper at node 2 of a network, with a factor of 0.1 %/K of
    node 3 about 40 degC, is the row 2, -1, NUMBER["copper"], 3, 0, 0 and the row 0.001, 40.
    """

    places: Integers
    numbers: Floats
    copper: Floats

    @classmethod
    def of(cls, laws: Sequence[Law], copper: Copper) -> Table:
        places = [(w.a, w.b, NUMBER[w.law], w.other, w.one_way, len(w.fluid)) for w in laws]
        numbers = np.zeros((len(laws), 2 + 2 * max((len(w.fluid) for w in laws), default=0)))
        for own, w in zip(numbers, laws, strict=True):
            own[:2] = w.slope, w.reference
            own[2 : 2 + 2 * len(w.fluid)] = [*(degC for degC, _ in w.fluid), *(rise for _, rise in w.fluid)]
        alpha = np.array([copper.alpha_per_K, copper.reference_degC])
        return cls(np.array(places, dtype=np.int64).reshape(-1, 6), numbers, alpha)


def psi(table: Table, temperatures: Floats, boundaries: Floats) -> tuple[Floats, Floats]:
    """psi (L, N) of laws at temperatures (N, n) [degC] with boundaries (N, b) [degC], and its slope (L, N) with the
    temperature at b."""
    found = np.empty((2, len(table.places), len(temperatures)))
    _psi(table.places, table.numbers, table.copper, every_place(temperatures, boundaries), found)
    return found[0], found[1]


def every_place(temperatures: Floats, boundaries: Floats) -> Floats:
    """(n + b, N) [degC]: a row a node, then a row a boundary, so that a place's temperatures lie side by side."""
    return np.ascontiguousarray(np.concatenate([temperatures.T, boundaries.T]))


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _psi(places: Integers, numbers: Floats, copper: Floats, at: Floats, found: Floats) -> None:
    one = np.empty((4, at.shape[1]))
    for w in range(len(places)):
        psi_of(places[w], numbers[w], copper, at, one)
        own = 1.0 if places[w, 3] == places[w, 1] else 0.0  # where the temperature factor is of b too
        for k in range(at.shape[1]):
            found[0, w, k], found[1, w, k] = one[0, k], one[2, k] + own * one[3, k]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def psi_of(place: Integers, number: Floats, copper: Floats, at: Floats, found: Floats) -> None:
    """psi of one law and its slopes with T_a, T_b and T_m, into `found` (4, K), in K steps; `at` as `every_place`
    gives it, `place` and `number` a row of a `Table`."""
    a, b, law, other, knots = place[0], place[1], place[2], place[3], place[5]
    end, third = b if b != NOBODY else a, other if other != NOBODY else a
    heats(law, at, a, end, third, 0, copper[0], copper[1], number[0], number[1], number[2:], knots, found)
