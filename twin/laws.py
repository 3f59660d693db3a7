"""Heat of one place as a function of temperatures, and its slopes: what a march is assembled from.

The heat into node a (and, in a link between nodes, out of node b) is `value(t) psi(T)`, psi a product of

    1 in a source, T_b - T_a in a link;
    1 + alpha (T_a - r) in copper, or its inverse;
    1 + s (T_m - r), m the node of a temperature factor;
    T_a - r, or (T_a + T_b) / 2 - r in a link, where the law is the slope of another with temperature.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from twin.network import Copper
from twin.structure import NOBODY, Group, Parameters

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Law:
    """`a` takes the heat; `b`: NOBODY in a source, a node, or n + boundary. `own`: +1 copper, -1 its inverse, else 0. `other`,
    `slope`, `reference`: the temperature factor, NOBODY where there is none. `tilt`: reference [degC] of a slope law, or None.
    `one_way`: the heat is not taken out of b (a mass that follows, weighed elsewhere)."""

    a: int
    b: int = NOBODY
    own: int = 0
    other: int = NOBODY
    slope: float = 0.0
    reference: float = 0.0
    tilt: float | None = None
    one_way: bool = False

    @classmethod
    def of(cls, group: Group, values: Parameters, index: int) -> Law:
        """The law of a network's group."""
        slope, reference = values.factors[index]
        return cls(group.a, group.b, group.own, group.other, float(slope), float(reference))

    @property
    def affine(self) -> bool:
        """Whether psi is linear in the temperatures, so that its slopes are all of it."""
        factors = [self.b != NOBODY, self.own != 0, self.other != NOBODY, self.tilt is not None]
        return sum(factors) <= 1 and self.own >= 0


@dataclass(frozen=True)
class Table:
    """Laws as a compiled loop reads them. `places` (L, 5): a, b, own, other, 1 where one way; `numbers` (L, 3): slope,
    reference, tilt (NaN: none); `copper` (2,): alpha [1/K], reference [degC]."""

    places: Integers
    numbers: Floats
    copper: Floats

    @classmethod
    def of(cls, laws: Sequence[Law], copper: Copper) -> Table:
        return cls(
            np.array([(w.a, w.b, w.own, w.other, w.one_way) for w in laws], dtype=np.int64).reshape(-1, 5),
            np.array([(w.slope, w.reference, np.nan if w.tilt is None else w.tilt) for w in laws]).reshape(-1, 3),
            np.array([copper.alpha_per_K, copper.reference_degC]),
        )


def psi(laws: Sequence[Law], copper: Copper, temperatures: Floats, boundaries: Floats) -> tuple[Floats, Floats]:
    """psi (L, N) of the laws at temperatures (N, n) [degC] with boundaries (N, b) [degC], and its slope with T_b (L, N)."""
    table = Table.of(laws, copper)
    value, slope = np.empty((2, len(laws), len(temperatures)))
    _psi(table.places, table.numbers, table.copper, temperatures, boundaries, value, slope)
    return value, slope


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _psi(
    places: Integers,
    numbers: Floats,
    copper: Floats,
    temperatures: Floats,
    boundaries: Floats,
    value: Floats,
    slope: Floats,
) -> None:
    for w in range(len(places)):
        for k in range(len(temperatures)):
            value[w, k], _, slope[w, k], _ = psi_at(places[w], numbers[w], copper, temperatures[k], boundaries[k])


@numba.njit(error_model="numpy", nogil=True, cache=True)
def psi_at(
    place: Integers, number: Floats, copper: Floats, temperatures: Floats, boundaries: Floats
) -> tuple[float, float, float, float]:
    """psi of one law at one time, and its slopes with T_a, T_b and T_m."""
    n = temperatures.size
    a, b, own, other = place[0], place[1], place[2], place[3]
    inside = temperatures[a]
    outside = 0.0
    if b >= n:
        outside = boundaries[b - n]
    elif b != NOBODY:
        outside = temperatures[b]
    value, by_a, by_b, by_other = 1.0, 0.0, 0.0, 0.0
    if b != NOBODY:
        value, by_a, by_b = outside - inside, -1.0, 1.0
    if own:
        resistance = 1 + copper[0] * (inside - copper[1])
        factor, change = resistance, copper[0]
        if own < 0:
            factor, change = 1 / resistance, -copper[0] / resistance**2
        by_a, by_b, value = by_a * factor + value * change, by_b * factor, value * factor
    if other != NOBODY:
        factor = 1 + number[0] * (temperatures[other] - number[1])
        by_a, by_b, by_other, value = by_a * factor, by_b * factor, value * number[0], value * factor
    if not np.isnan(number[2]):
        share = 1.0 if b == NOBODY else 0.5
        factor = share * (inside + outside) - number[2]
        by_a, by_b, by_other = by_a * factor + value * share, by_b * factor, by_other * factor
        if b != NOBODY:
            by_b += value * share
        value *= factor
    return value, by_a, by_b, by_other
