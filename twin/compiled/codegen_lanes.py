"""The kernel of runs side by side: the text of `twin.compiled.codegen`, compiled for vectors in place of numbers
(`twin.arithmetic.vectors`).

Every run has the bits that it has alone.
"""

from __future__ import annotations

from twin.arithmetic.vectors import LANES, MARK
from twin.compiled import codegen
from twin.compiled.heat import for_vectors
from twin.compiled.integrators import Tableau
from twin.compiled.structure import Structure

HEAD = f'''"""{LANES} runs of one thermal network side by side. Generated: change the generator, not this file."""

import numba
import numpy as np

from twin.arithmetic.vectors import vectors


@numba.njit(
    "void(float64[:, :, ::1], float64[:, :, ::1], float64, float64[::1], float64[::1], float64[::1], float64[:, ::1],"
    " float64[:, :, ::1])",
    error_model="numpy",
    nogil=True,
    no_cfunc_wrapper=True,
    cache=CACHE,
)
def run(features, boundaries, step_s, coefficients, capacities, copper, factors, out):
    lanes = out.shape[2:]
    features, boundaries, out = vectors(features, lanes), vectors(boundaries, lanes), vectors(out, lanes)
'''


def generate_side_by_side(structure: Structure, tableau: Tableau) -> str:
    """The source of `run` as `twin.compiled.codegen.generate` says it, for a method that does not look back;
    `features`, `boundaries` and `out` have a last axis of `LANES`."""
    body = codegen.generate(structure, tableau).removeprefix(codegen.HEAD)
    return MARK + HEAD + for_vectors(body)
