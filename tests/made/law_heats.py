"""Every law of a network as amount times psi (`twin.compiled.laws`), all at one state: what the paper's form is made
from."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from twin.compiled.laid_out import laid_out
from twin.compiled.laws import psi_of
from twin.compiled.structure import CONSTANT
from twin.motor.network import Network

Floats = NDArray[np.float64]
Index = NDArray[np.int64]


class LawHeats(NamedTuple):
    """The laws of a network, one for each group of its structure. `places`, `numbers`, `copper` as
    `twin.compiled.laws.Table`; `shares` (m + 1, L): what each monomial, and in the last row 1, adds to the amount of
    each law [W or W/K]."""

    places: Index
    numbers: Floats
    copper: Floats
    shares: Floats

    def amounts(self, features_of_steps: Floats) -> Floats:
        """Amount of each law (N, L) in steps with features (N, m)."""
        found: Floats = features_of_steps @ self.shares[:-1] + self.shares[-1]
        return found


def law_heats(network: Network) -> LawHeats:
    """The laws of a checked network with its own coefficients."""
    motor = laid_out(network)
    own = shares(network, motor.values.coefficients)
    return LawHeats(motor.table.places, motor.table.numbers, motor.table.copper, own)


def shares(network: Network, coefficients: Floats) -> Floats:
    """`LawHeats.shares` (m + 1, L) of given coefficients in the order of `features.terms`."""
    shape = laid_out(network).shape
    found = np.zeros((shape.monomials + 1, len(shape.groups)))
    for g, group in enumerate(shape.groups):
        for i, j in group.terms:
            found[-1 if j == CONSTANT else j, g] += coefficients[i]
    return found


@numba.njit(error_model="numpy", nogil=True, cache=True)
def psi_at(places: Index, numbers: Floats, copper: Floats, at: Floats, found: Floats) -> None:
    """Fill `found` (L, 4): psi of every law and its slopes with T_a, T_b and T_m, at nodes and boundaries `at` (n +
    b, 1) [degC]."""
    one = np.empty((4, 1))
    for w in range(len(places)):
        psi_of(places[w], numbers[w], copper, at, one)
        found[w] = one[:, 0]
