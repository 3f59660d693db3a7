"""The gradient kernel, as source text: what a number made of a run's temperatures answers to each parameter.

A stage s of a step solves `C base_s + R - M z_s = 0` (`twin.compiled.integrators`), C of the capacities, R - M z_s
the heats of all laws linear about the start T. Differentiated by a parameter p with `E_s = z_s - base_s`,

    M dz_s = C dbase_s + q_s + H_s dT,    q_s = d(heat)/dp - dC/dp E_s,    H_s = d(heat)/dT at fixed z_s,

so that the matrix, factorised once a step, serves all parameters, and the derivative is that of the discrete scheme
itself. The gradient is the transpose, from the last step to the first (A. Griewank, A. Walther, Evaluating
Derivatives, 2nd ed. (2008), section 3.2, doi:10.1137/1.9780898717761). The temperatures of the run are given; all else
of a step is worked out again. Only stiffly accurate methods that do not look back.

In the text, the names of the way back are derivatives of the weighted sum: `A` by the temperatures at a step's end,
`N` by those at its start, `K` by coefficients, `H` by capacities; in a stage `e` by its temperatures, `a` by its
heats, `b` by its bases.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from twin.compiled import codegen
from twin.compiled.codegen import Writer, indented
from twin.compiled.differentiate import Derivative
from twin.compiled.integrators import Tableau
from twin.compiled.structure import CONSTANT, Group, Structure
from twin.motor.heat_laws import AFFINE
from twin.motor.network import NOBODY

# A product and a sum may be one operation here: derivatives steer searches and bands, and are in no digest.
HEAD = '''"""Gradients of runs of one thermal network. Generated: change the generator, not this file."""

import math

import numba
import numpy as np


@numba.njit(
    "void(float64[:, ::1], float64[:, ::1], float64, float64[::1], float64[::1], float64[::1], float64[:, ::1],"
    " float64[:, ::1], float64[:, ::1], float64[::1], float64[::1], float64[::1])",
    error_model="numpy",
    fastmath={"contract"},
    nogil=True,
    cache=CACHE,
)
def run(features, boundaries, step_s, coefficients, capacities, copper, factors, temperatures, weights, by_coefficient,
        by_capacity, by_start):
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


def generate_gradient(structure: Structure, tableau: Tableau) -> str:
    """The source of `run(features, boundaries, step_s, coefficients, capacities, copper, factors, temperatures,
    weights, by_coefficient, by_capacity, by_start)`.

    It fills `by_coefficient` (K,), `by_capacity` (n,) and `by_start` (n,): the derivatives of the sum of `weights` (N
    + 1, n) times the `temperatures` (N + 1, n) that a run left.
    """
    w, last = Writer(structure), len(tableau.b) - 1
    heats = _linearised(w, tableau)
    nodes, size = range(structure.n), sum(len(group.terms) for group in structure.groups)
    steps = w.lines
    w.lines = []
    w.lines += [f"A{i} = N{i} + weights[k + 1, {i}]" for i in nodes]
    for s in range(last, -1, -1):
        after = [_weighted(tableau, s, last, i) for i in nodes]
        w.lines += [f"e{s}_{i} = {text}" for i, text in enumerate(after)]
        _solve_transposed(w, s)
        away = "" if s == last else " - e{s}_{i}"
        w.lines += [f"b{s}_{i} = C{i} * a{s}_{i}" + away.format(s=s, i=i) for i in nodes]
    start = {i: "".join(f" + b{s}_{i}" for s in range(last + 1)).removeprefix(" + ") for i in nodes}
    for group, of_stages in enumerate(heats):
        flows = [f"a{s}_{h.a}" + ("" if h.b == NOBODY else f" - a{s}_{h.b}") for s, h in enumerate(of_stages)]
        w.lines.append(
            f"G{group} = " + " + ".join(f"({f}) * {h.by_sum}" for f, h in zip(flows, of_stages, strict=True))
        )
        for flow, heat in zip(flows, of_stages, strict=True):
            for node, name in heat.by_start:
                start[node] += f" + ({flow}) * {name}"
        for i, j in of_stages[0].terms:
            w.lines.append(f"K{i} = K{i} + G{group}" + ("" if j == CONSTANT else f" * f{j}"))
    w.lines += [f"N{i} = {text}" for i, text in start.items()]
    w.lines += [f"H{i} = H{i} - (" + " + ".join(f"a{s}_{i} * D{s}_{i}" for s in range(last + 1)) + ")" for i in nodes]
    begin = [f"N{i} = 0.0" for i in nodes] + [f"K{i} = 0.0" for i in range(size)] + [f"H{i} = 0.0" for i in nodes]
    end = [f"by_coefficient[{i}] = K{i}" for i in range(size)]
    end += [f"by_capacity[{i}] = H{i} / ({tableau.gamma!r} * step_s)" for i in nodes]
    end += [f"by_start[{i}] = N{i} + weights[0, {i}]" for i in nodes]
    text = HEAD + indented(1, [*w.hoisted, *begin, "for k in range(features.shape[0] - 1, -1, -1):"])
    return text + indented(2, [*steps, *w.lines]) + indented(1, end)


def _linearised(w: Writer, tableau: Tableau) -> list[list[Heat]]:
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


def _weighted(tableau: Tableau, stage: int, last: int, node: int) -> str:
    """The derivative by a stage's temperature: by way of the end of the step, or of the bases of later stages."""
    if stage == last:
        return f"A{node}"
    later = range(stage + 1, last + 1)
    return " + ".join(f"{tableau.a[t][stage] / tableau.gamma!r} * b{t}_{node}" for t in later)


def _solve_transposed(w: Writer, stage: int) -> None:
    """`a` from `e`: the transposed matrix, with U first."""
    order, later = w.structure.pattern.order, w.structure.pattern.later
    for i in order:
        above = "".join(f" - u{k}_{i} * y{stage}_{k}" for k in order if i in later[k])
        w.lines.append(f"y{stage}_{i} = (e{stage}_{i}{above}) * d{i}")
    for i in reversed(order):
        below = "".join(f" - l{j}_{i} * a{stage}_{j}" for j in later[i])
        w.lines.append(f"a{stage}_{i} = y{stage}_{i}{below}")
