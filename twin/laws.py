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
    found = np.empty((len(laws), 4, len(temperatures)))
    _psi(table.places, table.numbers, table.copper, every_place(temperatures, boundaries), found)
    return found[:, 0], found[:, 2]


def every_place(temperatures: Floats, boundaries: Floats) -> Floats:
    """(n + b, N): a place's temperatures side by side."""
    found: Floats = np.concatenate([temperatures.T, boundaries.T])
    return found


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _psi(places: Integers, numbers: Floats, copper: Floats, at: Floats, found: Floats) -> None:
    for w in range(len(places)):
        psi_of(places[w], numbers[w], copper, at, found[w])


@numba.njit(error_model="numpy", nogil=True, cache=True)
def psi_of(place: Integers, number: Floats, copper: Floats, at: Floats, found: Floats) -> None:
    """psi of one law and its slopes with T_a, T_b and T_m: `found` (4, N), of `every_place`."""
    a, b, own, other = place[0], place[1], place[2], place[3]
    slope, reference, tilt = number[0], number[1], number[2]
    tilted, linked = not np.isnan(tilt), b != NOBODY
    alpha, cold = copper[0], copper[1]
    inside, outside, elsewhere = at[a], at[b if linked else a], at[other if other != NOBODY else a]
    share = 0.5 if linked else 1.0
    for k in range(at.shape[1]):
        value, by_a, by_b, by_other = 1.0, 0.0, 0.0, 0.0
        if linked:
            value, by_a, by_b = outside[k] - inside[k], -1.0, 1.0
        if own != 0:
            factor, change = 1 + alpha * (inside[k] - cold), alpha
            if own < 0:
                factor, change = 1 / factor, -alpha / factor**2
            by_a, by_b, value = by_a * factor + value * change, by_b * factor, value * factor
        if other != NOBODY:
            factor = 1 + slope * (elsewhere[k] - reference)
            by_a, by_b, by_other, value = by_a * factor, by_b * factor, value * slope, value * factor
        if tilted:
            factor = share * (inside[k] + (outside[k] if linked else 0.0)) - tilt
            by_a, by_b, by_other = by_a * factor + value * share, by_b * factor, by_other * factor
            if linked:
                by_b += value * share
            value *= factor
        found[0, k], found[1, k], found[2, k], found[3, k] = value, by_a, by_b, by_other
