"""A run of any network with dense matrices, which calibration and diagnosis fit by; nothing is compiled for a motor.

It stays beside `twin.run.sparse_march` because of what may differ in a test (masses that are attached, heats of any
course in time, sensors that are late), which `twin.fitting.circuit` and `responses` give to it, and because other
arithmetic changes the last bits of every sealed diagnosis. Speed is no reason: the sparse march makes the same
columns of a 21-node diagnosis in half of its time, those of every node in a third, and of 293 nodes in a twentieth or
less (`python benchmarks/marches.py`).

Over a step of h the temperatures follow the implicit midpoint rule (A-stable, order 2: Hairer and Wanner, Solving
Ordinary Differential Equations II, IV.3), with the heats linearised about a given course:

    (2 C / h + L) z = (2 C / h) T + b,    T' = 2 z - T,

z the mean temperature of the step. The matrices do not depend on T: they are eliminated many steps side by side,
without a search for pivots (2 C / h outweighs what losses take from the diagonal), and only two triangles a step are
left to solve in turn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from twin.compiled.heat import LINEAR
from twin.compiled.laws import Integers, Table, every_place, psi_of
from twin.errors import DivergedError
from twin.motor.network import NOBODY

Floats = NDArray[np.float64]

SIDE_BY_SIDE = 32  # steps: their matrices fit the second level cache


@dataclass(frozen=True)
class System:
    """The linear system of every step, eliminated already. `storage` (n,) 2 C / h [W/K]; `heat` (N, n) b [W].

    `factors` (N, n, n) of 2 C / h + L = (1 + A) (D + B), A below the diagonal, D on it, B above it. They lie
    transposed, so that a loop over a column runs along memory; of three nodes

        1/D_00  -A_10   -A_20
        -B_01   1/D_11  -A_21
        -B_02   -B_12   1/D_22
    """

    factors: Floats
    storage: Floats
    heat: Floats

    @classmethod
    def of(
        cls, table: Table, carried: Floats, capacity: Floats, step_s: float, course: Floats, boundaries: Floats
    ) -> System:
        """Law i carries `carried[i]` (N,) times psi, linear about the course (N, n)."""
        length, n = course.shape
        storage = 2 * capacity / step_s
        factors, heat = np.empty((length, n, n)), np.empty((length, n))
        at = every_place(course, boundaries)
        _assemble(table.places, table.numbers, table.copper, carried, at, storage, factors, heat)
        return cls(factors, storage, heat)

    @property
    def matrix(self) -> Floats:
        """(N, n, n) 2 C / h + L [W/K], of its factors."""
        turned = self.factors.transpose(0, 2, 1)
        places = range(turned.shape[1])
        lower, upper = -np.tril(turned, -1), -np.triu(turned, 1)
        lower[:, places, places] = 1.0
        upper[:, places, places] = 1 / turned[:, places, places]
        found: Floats = lower @ upper
        return found


def run(system: System, initial: Floats) -> tuple[Floats, Floats]:
    """Temperatures at the edges (N + 1, n) and means of the steps (N, n) [degC], from `initial` (n,) on.

    Raises `DivergedError` where they leave the finite numbers or ten thousand degrees.
    """
    length, n = system.heat.shape
    edges, found = np.empty((length + 1, n)), np.empty((length, n))
    edges[0] = initial
    _run(system.factors, system.storage, system.heat, edges, found)
    if not (np.abs(edges[-1]) < 1e4).all():
        raise DivergedError("temperatures run away: a loss grows faster with temperature than its links carry away")
    return edges, found


@numba.njit(error_model="numpy", nogil=True, cache=True, fastmath={"contract"})
def _assemble(
    places: Integers,
    numbers: Floats,
    copper: Floats,
    carried: Floats,
    at: Floats,
    storage: Floats,
    factors: Floats,
    heat: Floats,
) -> None:
    """Of some steps at a time: L and b law by law, then the factors of the matrices. The last ones overlap."""
    length, n = heat.shape
    lanes = min(SIDE_BY_SIDE, length)
    found, constant = np.empty((4, lanes)), np.empty(lanes)
    matrix, into = np.empty((n, n, lanes)), np.empty((n, lanes))
    ends = np.empty(3, np.int64)
    for start in range(0, length, lanes):
        first = min(start, length - lanes)
        for i in range(n):
            for k in range(lanes):
                into[i, k] = 0.0
            for c in range(n):
                for k in range(lanes):
                    matrix[i, c, k] = storage[i] if i == c else 0.0
        for w in range(len(places)):
            a, b = places[w, 0], places[w, 1]
            both = 0 <= b < n and not places[w, 4]
            straight = places[w, 2] == LINEAR and places[w, 3] == NOBODY and np.isnan(numbers[w, 2])
            if straight and (both or b >= n):
                for k in range(lanes):  # nothing but a conductance, as most laws are
                    matrix[a, a, k] += carried[w, first + k]
                if both:
                    for k in range(lanes):
                        load = carried[w, first + k]
                        matrix[b, b, k] += load
                        matrix[a, b, k] -= load
                        matrix[b, a, k] -= load
                else:
                    for k in range(lanes):
                        into[a, k] += carried[w, first + k] * at[b, first + k]
                continue
            psi_of(places[w], numbers[w], copper, at, first, found)
            for k in range(lanes):
                constant[k] = found[0, k]
            ends[0], ends[1], ends[2] = a, b, places[w, 3]
            for i in range(3):
                node = ends[i]
                if 0 <= node < n:
                    for k in range(lanes):
                        constant[k] -= found[i + 1, k] * at[node, first + k]
                        found[i + 1, k] *= carried[w, first + k]
            for e in range(2 if both else 1):
                sign = 1.0 - 2 * e
                for i in range(3):
                    if 0 <= ends[i] < n:
                        for k in range(lanes):
                            matrix[ends[e], ends[i], k] -= sign * found[i + 1, k]
                for k in range(lanes):
                    into[ends[e], k] += sign * carried[w, first + k] * constant[k]
        _factorise(matrix)
        for i in range(n):
            for k in range(lanes):
                heat[first + k, i] = into[i, k]
            for r in range(n):
                for k in range(lanes):
                    factors[first + k, i, r] = matrix[r, i, k]


@numba.njit(error_model="numpy", nogil=True, cache=True, fastmath={"contract"})
def _factorise(matrix: Floats) -> None:
    """Every (n, n) of (n, n, K) into -A, 1 / D and -B, in place, row by row."""
    n, _, lanes = matrix.shape
    for r in range(n):
        for i in range(r):
            for k in range(lanes):
                matrix[r, i, k] *= -matrix[i, i, k]
            for c in range(i + 1, n):
                for k in range(lanes):
                    matrix[r, c, k] += matrix[r, i, k] * matrix[i, c, k]
        for k in range(lanes):
            matrix[r, r, k] = 1 / matrix[r, r, k]
    for i in range(n):
        for c in range(i + 1, n):
            for k in range(lanes):
                matrix[i, c, k] = -matrix[i, c, k]


@numba.njit(error_model="numpy", nogil=True, cache=True, fastmath={"contract"})
def _run(factors: Floats, storage: Floats, heat: Floats, edges: Floats, found: Floats) -> None:
    n = storage.size
    z = np.empty(n)
    for k in range(len(found)):
        for i in range(n):
            z[i] = heat[k, i] + storage[i] * edges[k, i]
        for i in range(n):
            for r in range(i + 1, n):
                z[r] += factors[k, i, r] * z[i]
        for i in range(n - 1, -1, -1):
            z[i] *= factors[k, i, i]
            for r in range(i):
                z[r] += factors[k, i, r] * z[i]
        for i in range(n):
            found[k, i] = z[i]
            edges[k + 1, i] = 2 * z[i] - edges[k, i]
