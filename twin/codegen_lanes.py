"""The kernel of runs side by side: the statements of `twin.codegen` with an inner loop around them, as source text.

What the compiler makes of that is vector instructions, and every run has the bits that it has alone.
"""

from __future__ import annotations

from twin.codegen import Writer, add_step, end_step, indented, read_inputs
from twin.integrators import Tableau
from twin.structure import Structure

LANES = 16  # runs side by side: fewer are not made into vector instructions, more do not fit the nearest cache

SIDE_BY_SIDE = f'''"""{LANES} runs of one thermal network side by side. Generated: change the generator, not this file."""

import math

import numba


@numba.njit(
    "void(float64[:, :, ::1], float64, float64[::1], float64[::1], float64[::1], float64[:, ::1], float64[:, ::1],"
    " float64[:, :, ::1])",
    error_model="numpy",
    nogil=True,
    cache=CACHE,
)
def run(inputs, step_s, coefficients, capacities, copper, factors, state, out):
'''

STEPS_SIDE_BY_SIDE = f"""    here = state.reshape(-1)
    for k in range(inputs.shape[0]):
        row = inputs[k].reshape(-1)
        for c in range({LANES}):
"""


def generate_side_by_side(structure: Structure, tableau: Tableau) -> str:
    """The source of the same run for `LANES` sessions, for a method that does not look back:
    `run(inputs, step_s, coefficients, capacities, copper, factors, state, out)`.

    `inputs` (N, m + b, LANES): features, then boundaries, of all sessions side by side; `state` (n, LANES) is left as it is
    after the last step, `out` (N, n, LANES) holds it after each.
    """
    w, n, m = Writer(structure), structure.n, structure.monomials
    read_inputs(w, tableau)
    inputs = {f"features[k, {j}]": j for j in range(m)} | {f"boundaries[k, {j}]": m + j for j in w.boundaries}
    w.lines = [f"{name} = row[{inputs[text] * LANES} + c]" for name, text in (line.split(" = ") for line in w.lines)]
    w.lines += [f"T{i} = here[{i * LANES} + c]" for i in range(n)]
    add_step(w, tableau)
    end_step(w, tableau)
    w.lines += [f"here[{i * LANES} + c] = T{i}" for i in range(n)]
    steps = STEPS_SIDE_BY_SIDE + indented(3, w.lines) + indented(2, ["out[k] = state"])
    return SIDE_BY_SIDE + indented(1, w.hoisted) + steps
