"""The derivatives of one number made of a run's temperatures by every coefficient, capacity and initial temperature,
in two runs' time.

Exact for the discrete scheme, backwards from the last step to the first (`twin.compiled.codegen_gradient`): the
hottest magnet of a run and how sure it is, the load that a node bears, a squared error. Of many numbers,
`twin.run.block_columns` is faster.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.compiled.kernel import Compiled
from twin.errors import FrameError
from twin.run.simulate import Frame

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Gradient:
    """The derivatives of one number by `coefficients` (K,) in the order of `features.terms`, then `streams`, by
    `capacities` (n,) and by `initial` temperatures (n,): of a number in K they are K per W or W/K, K per J/K and
    K/K."""

    coefficients: Floats
    capacities: Floats
    initial: Floats


def gradient(compiled: Compiled, frame: Frame, temperatures: Floats, weights: Floats) -> Gradient:
    """The derivatives of the sum of `weights` (N + 1, n) times `temperatures` (N + 1, n), which `simulate` gave for
    the `frame`.

    What follows the last weight that is not zero costs nothing. Raises `FrameError` for a network of the index form
    or another method than the default.
    """
    network, p = compiled.network, compiled.parameters
    if compiled.gradient is None:
        raise FrameError(
            f'network "{network.name}" of {len(network.nodes)} nodes has no kernel for gradients: '
            "take the default integrator, and merge "
            "nodes where there are more than about 50 (whyhot motor reduce)"
        )
    n, there = len(network.nodes), np.flatnonzero(np.einsum("ij,ij->i", weights, weights))
    steps = int(there[-1]) if there.size else 0
    phi, around = (np.ascontiguousarray(own[:steps], dtype=np.float64) for own in (frame.features, frame.boundaries))
    found = Gradient(np.empty(len(p.coefficients)), np.empty(n), np.empty(n))
    compiled.gradient()(
        phi,
        around,
        float(frame.step_s),
        p.coefficients,
        p.capacities,
        p.copper,
        p.factors,
        np.ascontiguousarray(temperatures, dtype=np.float64),
        np.ascontiguousarray(weights, dtype=np.float64),
        found.coefficients,
        found.capacities,
        found.initial,
    )
    return found
