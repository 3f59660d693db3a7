"""What every coefficient, capacity and initial temperature does to every node's temperature in an open-loop run, in one pass.

The derivatives of the discrete scheme itself (`twin.compiled.codegen_derivatives`), forwards, all columns side by side, of seven digits. A candidate is
a term whose coefficient is put to 0 in `Compiled.parameters`: its column is what it would bring. The derivatives of one number by
everything are a task for `twin.run.gradients`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from twin.compiled.codegen_columns import width
from twin.compiled.integrators import DEFAULT
from twin.compiled.kernel import Compiled
from twin.errors import FrameError
from twin.run.simulate import Frame

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

CHUNK = 64  # blocks whose columns are held at a time


def columns(
    compiled: Compiled, frame: Frame, temperatures: Floats, block: int, wanted: Sequence[int] | None = None
) -> Singles:
    """(B, n, P): derivatives of the mean temperature of each node over each block of `block` steps by every coefficient (in the order
    of `features.terms`, then `streams`) [K per W or W/K], capacity [K per J/K] and initial temperature [K/K], or those that are `wanted`
    of these places.

    `temperatures` (N + 1, n) as `simulate` gives them for the `frame`; a step counts as the mean of its two ends, steps behind the last
    whole block do not count. Raises `FrameError` for a network of the index form or another method than the default.
    """
    none = np.empty((0, len(compiled.network.nodes), len(_places(compiled, wanted))), np.float32)
    return np.concatenate([none, *_of_blocks(compiled, frame, temperatures, block, _places(compiled, wanted))])


def grams(
    compiled: Compiled, frame: Frame, temperatures: Floats, block: int, wanted: Sequence[int] | None = None
) -> Floats:
    """(n, P, P): of each node, the sum of `s s'` over all blocks, s its row of `columns`. However long the run, no more than `CHUNK`
    blocks of columns are held. Raises as `columns`."""
    places = _places(compiled, wanted)
    total = np.zeros((len(compiled.network.nodes), len(places), len(places)))
    for part in _of_blocks(compiled, frame, temperatures, block, places):
        rows = part.transpose(1, 0, 2)
        total += rows.transpose(0, 2, 1) @ rows
    return total


def _places(compiled: Compiled, wanted: Sequence[int] | None) -> tuple[int, ...]:
    every = range(len(compiled.parameters.coefficients) + 2 * len(compiled.network.nodes))
    return tuple(every if wanted is None else wanted)


def _of_blocks(
    compiled: Compiled, frame: Frame, temperatures: Floats, block: int, places: tuple[int, ...]
) -> Iterator[Singles]:
    network, p = compiled.network, compiled.parameters
    if compiled.columns is None:
        raise FrameError(
            f'network "{network.name}" of {len(network.nodes)} nodes has no kernel for columns: take the default integrator, and merge '
            "nodes where there are more than about 50 (whyhot motor reduce)"
        )
    run, n, wide = compiled.columns(places), len(network.nodes), width(len(places))
    state = np.zeros((2 + len(DEFAULT.b), n, wide), np.float32)
    first_start = len(p.coefficients) + n
    for column, place in enumerate(places):
        if place >= first_start:
            state[0, place - first_start, column] = 1.0
    phi, around = (np.ascontiguousarray(own, dtype=np.float64) for own in (frame.features, frame.boundaries))
    blocks = len(phi) // block
    for first in range(0, blocks, CHUNK):
        means = np.empty((min(CHUNK, blocks - first), n, wide), np.float32)
        a, b = first * block, (first + len(means)) * block
        values = (p.coefficients, p.capacities, p.copper, p.factors)
        run(phi[a:b], around[a:b], float(frame.step_s), *values, temperatures[a : b + 1], block, state, means)
        yield means[:, :, : len(places)]
