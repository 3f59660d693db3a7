"""Heat of one place as a function of temperatures, and its slopes: what a march is assembled from.

The heat into node a (and, in a link between nodes, out of node b) is `value(t) psi(T)`, psi a product of

    1 in a source, T_b - T_a in a link, or what the link's law makes of them (`twin.motor.drops`);
    the heat capacity of the fluid that comes out of b, relative, in a circuit;
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

from twin.compiled.structure import Group, Knots, Parameters
from twin.motor.drops import LINEAR, between, drop
from twin.motor.network import NOBODY, Copper

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Law:
    """`a` takes the heat; `b`: NOBODY in a source, a node, or n + boundary. `own`: +1 copper, -1 its inverse, else 0. `other`,
    `slope`, `reference`: the temperature factor, NOBODY where there is none. `tilt`: reference [degC] of a slope law, or None.
    `one_way`: the heat is not taken out of b (a mass that follows, weighed elsewhere; fluid that flows on). `law`, `fluid`: as in
    `Group`."""

    a: int
    b: int = NOBODY
    own: int = 0
    other: int = NOBODY
    slope: float = 0.0
    reference: float = 0.0
    tilt: float | None = None
    one_way: bool = False
    law: int = LINEAR
    fluid: Knots = ()

    @classmethod
    def of(cls, group: Group, values: Parameters, index: int) -> Law:
        """The law of a network's group."""
        slope, reference = values.factors[index]
        return cls(
            group.a,
            group.b,
            group.own,
            group.other,
            float(slope),
            float(reference),
            one_way=group.one_way,
            law=group.law,
            fluid=group.fluid,
        )

    @property
    def affine(self) -> bool:
        """Whether psi is linear in the temperatures, so that its slopes are all of it."""
        factors = [self.b != NOBODY, self.own != 0, self.other != NOBODY, self.tilt is not None]
        return sum(factors) <= 1 and self.own >= 0 and self.law == LINEAR and not self.fluid


@dataclass(frozen=True)
class Table:
    """Laws as a compiled loop reads them. `places` (L, 7): a, b, own, other, 1 where one way, law, knots k of the fluid;
    `numbers` (L, 3 + 2 most knots): slope, reference, tilt (NaN: none), k temperatures, k factors; `copper` (2,): alpha [1/K],
    reference [degC]."""

    places: Integers
    numbers: Floats
    copper: Floats

    @classmethod
    def of(cls, laws: Sequence[Law], copper: Copper) -> Table:
        places = [(w.a, w.b, w.own, w.other, w.one_way, w.law, len(w.fluid)) for w in laws]
        numbers = np.zeros((len(laws), 3 + 2 * max((len(w.fluid) for w in laws), default=0)))
        for own, w in zip(numbers, laws, strict=True):
            own[:3] = w.slope, w.reference, np.nan if w.tilt is None else w.tilt
            own[3 : 3 + 2 * len(w.fluid)] = [*(degC for degC, _ in w.fluid), *(factor for _, factor in w.fluid)]
        alpha = np.array([copper.alpha_per_K, copper.reference_degC])
        return cls(np.array(places, dtype=np.int64).reshape(-1, 7), numbers, alpha)


def psi(table: Table, temperatures: Floats, boundaries: Floats) -> tuple[Floats, Floats]:
    """psi (L, N) of laws at temperatures (N, n) [degC] with boundaries (N, b) [degC], and its slope with T_b (L, N)."""
    found = np.empty((2, len(table.places), len(temperatures)))
    _psi(table.places, table.numbers, table.copper, every_place(temperatures, boundaries), 0, found)
    return found[0], found[1]


def every_place(temperatures: Floats, boundaries: Floats) -> Floats:
    """(n + b, N): a place's temperatures side by side."""
    found: Floats = np.concatenate([temperatures.T, boundaries.T])
    return found


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _psi(places: Integers, numbers: Floats, copper: Floats, at: Floats, first: int, found: Floats) -> None:
    one = np.empty((4, at.shape[1]))
    for w in range(len(places)):
        psi_of(places[w], numbers[w], copper, at, first, one)
        for k in range(at.shape[1]):
            found[0, w, k], found[1, w, k] = one[0, k], one[2, k]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def psi_of(place: Integers, number: Floats, copper: Floats, at: Floats, first: int, found: Floats) -> None:
    """psi of one law and its slopes with T_a, T_b and T_m: `found` (4, K), in K steps from `first` on, of `every_place`. Factor by
    factor, so that all steps go through one short loop."""
    a, b, own, other = place[0], place[1], place[2], place[3]
    slope, reference, tilt = number[0], number[1], number[2]
    alpha, cold = copper[0], copper[1]
    linked, steps = 1.0 if b != NOBODY else 0.0, found.shape[1]
    end = b if linked else a
    for k in range(steps):
        found[0, k] = 1.0 - linked + at[end, first + k] - at[a, first + k]
        found[1, k], found[2, k], found[3, k] = -linked, linked, 0.0
    if place[5] != LINEAR:
        for k in range(steps):
            found[0, k], found[1, k], found[2, k] = drop(place[5], at[a, first + k], at[b, first + k])
    if place[6] > 0:
        knots, factors = number[3 : 3 + place[6]], number[3 + place[6] : 3 + 2 * place[6]]
        for k in range(steps):
            factor, growth = between(at[b, first + k], knots, factors)
            found[1, k] *= factor
            found[2, k] = found[2, k] * factor + found[0, k] * growth
            found[0, k] *= factor
    if own != 0:
        for k in range(steps):
            factor, change = 1 + alpha * (at[a, first + k] - cold), alpha
            if own < 0:
                factor, change = 1 / factor, -alpha / factor**2
            found[1, k] = found[1, k] * factor + found[0, k] * change
            found[2, k] *= factor
            found[0, k] *= factor
    if other != NOBODY:
        for k in range(steps):
            factor = 1 + slope * (at[other, first + k] - reference)
            found[1, k] *= factor
            found[2, k] *= factor
            found[3, k] = found[0, k] * slope
            found[0, k] *= factor
    if not np.isnan(tilt):
        for k in range(steps):
            factor = (at[a, first + k] + at[end, first + k]) / 2 - tilt
            found[1, k] = found[1, k] * factor + found[0, k] * (1.0 - linked / 2)
            found[2, k] = found[2, k] * factor + found[0, k] * (linked / 2)
            found[3, k] *= factor
            found[0, k] *= factor
