"""What a step of a run answers to a change of each parameter, as source text: what the gradient kernel is made from.

A stage s of a step solves `C base_s + R - M z_s = 0` (`twin.compiled.integrators`), C of the capacities, R - M z_s
the heats of all laws linear about the start T. Differentiated by a parameter p with `E_s = z_s - base_s`,

    M dz_s = C dbase_s + q_s + H_s dT,    q_s = d(heat)/dp - dC/dp E_s,    H_s = d(heat)/dT at fixed z_s,

so that the matrix, factorised once a step, serves all parameters, and the derivative is that of the discrete scheme
itself. A gradient is the transpose, from the last step to the first (A. Griewank, A. Walther, Evaluating Derivatives,
2nd ed. (2008), section 3.2, doi:10.1137/1.9780898717761). The temperatures of the run are given; all else of a step
is worked out again.

Only stiffly accurate methods that do not look back.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from twin.compiled import codegen
from twin.compiled.codegen import Writer
from twin.compiled.differentiate import Derivative
from twin.compiled.integrators import Tableau
from twin.compiled.structure import Group, Structure
from twin.motor.heat_laws import AFFINE
from twin.motor.network import NOBODY

# A product and a sum may be one operation here: derivatives steer searches and bands, and are in no digest.
HEAD = '''"""Derivatives of runs of one thermal network. Generated: change the generator, not this file."""

import math

import numba
import numpy as np


@numba.njit(
    "void(float64[:, ::1], float64[:, ::1], float64, float64[::1], float64[::1], float64[::1], float64[:, ::1],"
    " float64[:, ::1], {own})",
    error_model="numpy",
    fastmath={{"contract"}},
    nogil=True,
    cache=CACHE,
)
def run(features, boundaries, step_s, coefficients, capacities, copper, factors, temperatures, {names}):
'''


@dataclass(frozen=True)
class Heat:
    """The heat that a group brings into node `a`, and takes out of node `b` (NOBODY: out of none), in one stage.
    `by_sum`: the name of its derivative by the sum of its `terms`; `by_start`: a node and the name of the derivative
    by its temperature at the start."""

    a: int
    b: int
    terms: tuple[tuple[int, int], ...]
    by_sum: str
    by_start: tuple[tuple[int, str], ...]


def coefficients(structure: Structure) -> int:
    """How many there are."""
    return sum(len(group.terms) for group in structure.groups)


def linearised(w: Writer, tableau: Tableau) -> list[list[Heat]]:
    """A step made again from its temperatures, and the heats of all groups in its stages, differentiated."""
    last, nodes = len(tableau.b) - 1, range(w.structure.n)
    codegen.read_inputs(w, tableau)
    w.lines += [f"T{i} = temperatures[k, {i}]" for i in nodes]
    for index, group in enumerate(w.structure.groups):
        codegen.add_group(w, index, group)
    codegen.factorise(w)
    codegen.add_right_sides(w)
    for s in range(last + 1):
        known = codegen.bases(w, tableau, s)
        if s < last:
            codegen.solve(w, s, known)
        else:
            w.lines += [f"z{s}_{i} = temperatures[k + 1, {i}]" for i in nodes]
        w.lines += [f"D{s}_{i} = z{s}_{i} - ({base})" for i, base in enumerate(known)]
    return [list(_heats(w, index, group, last)) for index, group in enumerate(w.structure.groups)]


def _heats(w: Writer, index: int, group: Group, last: int) -> Iterator[Heat]:
    alone = Writer(w.structure)
    codegen.add_group(alone, index, group)
    straight = group.law in AFFINE and group.other == NOBODY
    ends = () if straight else sorted({i for i in (group.a, group.b, group.other) if 0 <= i < w.structure.n})
    by_sum, by_start = Derivative(alone.lines, f"g{index}"), {i: Derivative(alone.lines, f"T{i}") for i in ends}
    w.lines += [line for one in (by_sum, *by_start.values()) for line in one.lines]
    gives = 0 <= group.b < w.structure.n and not group.one_way
    for s in range(last + 1):
        heat = " ".join(alone.right[group.a]).removeprefix("+ ") or "0.0"
        heat += "".join(f" - ({alone.assembled(*at)}) * z{s}_{at[1]}" for at in alone.matrix if at[0] == group.a)
        w.lines.append(f"Y{index}_{s} = {by_sum.of(heat) or '0.0'}")
        bent = {i: one.of(heat) for i, one in by_start.items()}
        w.lines += [f"J{index}_{s}_{i} = {text}" for i, text in bent.items() if text is not None]
        names = tuple((i, f"J{index}_{s}_{i}") for i, text in bent.items() if text is not None)
        yield Heat(group.a, group.b if gives else NOBODY, group.terms, f"Y{index}_{s}", names)
