"""Rows over the steps of a test: sums of products of them, and rows that happen later."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from twin.motor.network import NOBODY

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class Product(NamedTuple):
    """One product of two rows, added to a third: to row `to` comes `weight` times row `first` of one array times row
    `second` of another, times the vector's entry `parameter` where one is named.

    Product(to=3, weight=-0.5, first=7, parameter=12) adds -0.5 first[7] second[0] beta[12] to row 3."""

    to: int
    weight: float
    first: int
    second: int = 0
    parameter: int = NOBODY


@dataclass(frozen=True)
class Products:
    """Many products, field by field (E,), as a compiled loop reads them."""

    to: Integers
    weight: Floats
    first: Integers
    second: Integers
    parameter: Integers

    @classmethod
    def of(cls, entries: Sequence[Product]) -> Products:
        table = np.array(entries, dtype=np.float64).reshape(-1, 5)
        to, first, second, parameter = (np.ascontiguousarray(table[:, i], dtype=np.int64) for i in (0, 2, 3, 4))
        return cls(to, table[:, 1].copy(), first, second, parameter)

    def weights(self, beta: Floats) -> Floats:
        """Weights times parameters at a vector (E,)."""
        found: Floats = self.weight * np.append(beta, 1.0)[self.parameter]
        return found

    def add(self, out: Floats, first: Floats, second: Floats, beta: Floats) -> None:
        """Add every product of a row of `first` (F, N) and a row of `second` (S, N) to its row of `out` (R, N)."""
        if self.to.size:
            _add_products(self.to, self.weights(beta), self.first, first, self.second, second, out)


assert NOBODY == -1  # the last entry of what `Products.weights` takes


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _add_products(
    to: Integers, weight: Floats, of_first: Integers, first: Floats, of_second: Integers, second: Floats, out: Floats
) -> None:
    for e in range(len(to)):
        if weight[e] != 0.0:
            r, i, j, w = to[e], of_first[e], of_second[e], weight[e]
            for k in range(out.shape[1]):
                out[r, k] += w * first[i, k] * second[j, k]


def parts_of_delay(steps: float) -> list[tuple[int, float]]:
    """(whole steps, share): rows so many steps late as a mixture of rows that are whole steps late."""
    if steps == 0:
        return [(0, 1.0)]
    whole = int(np.ceil(steps))
    return [(whole, 1 - (whole - steps)), (whole - 1, whole - steps)]


def shifted(x: Floats, steps: int) -> Floats:
    """Rows (R, N) so many steps late; the first and the last value hold beyond the ends."""
    if steps == 0:
        return x
    found, size = np.empty_like(x), min(abs(steps), x.shape[1])
    if steps > 0:
        found[:, size:], found[:, :size] = x[:, : x.shape[1] - size], x[:, :1]
    else:
        found[:, : x.shape[1] - size], found[:, x.shape[1] - size :] = x[:, size:], x[:, -1:]
    return found


def delayed(x: Floats, steps: float) -> Floats:
    """Rows (R, N) late by any number of steps, a part of a step as a mixture of two."""
    if steps == 0:
        return x
    (late, share), (soon, rest) = parts_of_delay(steps)
    found = share * shifted(x, late)
    found += rest * shifted(x, soon)
    return found
