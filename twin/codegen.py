"""The straight-line kernel: a whole open-loop run of one topology as source text, every quantity a local variable.

The text depends on the topology alone; coefficients, capacities and factors are arguments, so a refit compiles nothing.
"""

from __future__ import annotations

from collections import defaultdict

from twin.integrators import Tableau
from twin.structure import CONSTANT, NOBODY, Group, Structure

HEAD = '''"""One thermal network as straight-line code. Generated: change the generator, not this file."""

import numba


@numba.njit(
    "void(float64[:, ::1], float64[:, ::1], float64, float64[::1], float64[::1], float64[::1], float64[:, ::1],"
    " float64[:, ::1])",
    error_model="numpy",
    nogil=True,
    cache=CACHE,
)
def run(features, boundaries, step_s, coefficients, capacities, copper, factors, out):
'''


class _Writer:
    """Lines of the body, and what is added to each entry of the step matrix and of its right-hand side."""

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self.hoisted: list[str] = []
        self.lines: list[str] = []
        self.matrix: defaultdict[tuple[int, int], list[str]] = defaultdict(list)
        self.right: defaultdict[int, list[str]] = defaultdict(list)

    def entry(self, row: int, column: int) -> str:
        if self.structure.symmetric and row > column:
            row, column = column, row
        return f"m{row}_{column}"

    def add(self, row: int, column: int, signed: str) -> None:
        """Add a signed expression to the matrix; in a symmetric one only the upper half is kept."""
        if row <= column or not self.structure.symmetric:
            self.matrix[row, column].append(signed)


def generate(structure: Structure, tableau: Tableau) -> str:
    """The source of `run(features, boundaries, step_s, coefficients, capacities, copper, factors, out)`.

    It fills `out[1:]` from `out[0]`; arrays as in `Frame` and `Parameters`. `CACHE` is left to whoever loads the text.
    """
    w = _Writer(structure)
    _read_state(w, tableau)
    for index, group in enumerate(structure.groups):
        _group(w, index, group)
    _assemble(w)
    _eliminate(w)
    _stages(w, tableau)
    n = structure.n
    w.hoisted += [f"T{i} = out[0, {i}]" for i in range(n)]
    w.lines += [f"out[k + 1, {i}] = T{i}" for i in range(n)]
    body = "".join(f"    {line}\n" for line in [*w.hoisted, "for k in range(features.shape[0]):"])
    return HEAD + body + "".join(f"        {line}\n" for line in w.lines)


def _read_state(w: _Writer, tableau: Tableau) -> None:
    w.hoisted += [f"C{i} = capacities[{i}] / ({tableau.gamma!r} * step_s)" for i in range(w.structure.n)]
    if any(group.own for group in w.structure.groups):
        w.hoisted += ["alpha = copper[0]", "reference = copper[1]"]
    boundaries = sorted({g.b - w.structure.n for g in w.structure.groups if g.b >= w.structure.n})
    w.lines += [f"f{j} = features[k, {j}]" for j in range(w.structure.monomials)]
    w.lines += [f"B{j} = boundaries[k, {j}]" for j in boundaries]


def _group(w: _Writer, index: int, group: Group) -> None:
    g = f"g{index}"
    w.hoisted += [f"c{i} = coefficients[{i}]" for i, _ in group.terms]
    w.lines.append(f"{g} = " + " + ".join(f"c{i}" if j == CONSTANT else f"c{i} * f{j}" for i, j in group.terms))
    if group.other != NOBODY:
        w.hoisted += [f"s{index} = factors[{index}, 0]", f"r{index} = factors[{index}, 1]"]
        w.lines.append(f"y{index} = 1.0 + s{index} * (T{group.other} - r{index})")
    if group.b == NOBODY:
        _source(w, index, group)
    else:
        _link(w, index, group)


def _source(w: _Writer, index: int, group: Group) -> None:
    """Heat g x y into node a, linear about the start: x the copper factor or its inverse, y the temperature factor."""
    g, a = f"g{index}", group.a
    if group.own:
        w.lines.append(f"x{index} = 1.0 + alpha * (T{a} - reference)")
        slope = f"{g} * alpha"
        if group.own < 0:
            w.lines.append(f"x{index} = 1.0 / x{index}")
            slope = f"-{g} * alpha * x{index} * x{index}"
        slope += f" * y{index}" if group.other != NOBODY else ""
        w.lines.append(f"p{index} = {slope}")
        w.add(a, a, f"- p{index}")
        w.right[a].append(f"- p{index} * T{a}")
        g = f"{g} * x{index}"
    if group.other != NOBODY:
        w.lines.append(f"q{index} = {g} * s{index}")
        w.add(a, group.other, f"- q{index}")
        w.right[a].append(f"- q{index} * T{group.other}")
        g = f"{g} * y{index}"
    w.right[a].append(f"+ {g}")


def _link(w: _Writer, index: int, group: Group) -> None:
    """Heat g y (T_b - T_a) into node a and out of node b, linear about the start in the factor's temperature."""
    g, a, b, m = f"g{index}", group.a, group.b, group.other
    boundary = b >= w.structure.n
    far = f"B{b - w.structure.n}" if boundary else f"T{b}"
    if m != NOBODY:
        w.lines.append(f"q{index} = {g} * s{index} * ({far} - T{a})")
        w.lines.append(f"{g} = {g} * y{index}")
        w.add(a, m, f"- q{index}")
        w.right[a].append(f"- q{index} * T{m}")
    w.add(a, a, f"+ {g}")
    if boundary:
        w.right[a].append(f"+ {g} * {far}")
        return
    w.add(b, b, f"+ {g}")
    w.add(a, b, f"- {g}")
    w.add(b, a, f"- {g}")
    if m != NOBODY:
        w.add(b, m, f"+ q{index}")
        w.right[b].append(f"+ q{index} * T{m}")


def _assemble(w: _Writer) -> None:
    for i in range(w.structure.n):
        w.matrix[i, i].insert(0, f"C{i}")
        w.lines.append(f"R{i} = " + " ".join(w.right[i] or ["0.0"]).removeprefix("+ "))
        for j in w.structure.pattern.later[i]:
            w.add(i, j, "")  # fill, and the empty one of a pair in an unsymmetric matrix, begin as 0
            w.add(j, i, "")
    for (row, column), signed in w.matrix.items():
        w.lines.append(f"m{row}_{column} = " + (" ".join(filter(None, signed)).removeprefix("+ ") or "0.0"))


def _eliminate(w: _Writer) -> None:
    """LU along the diagonal; `d` is the reciprocal pivot, `l` the multipliers; `m` right of the pivot are the rows of U."""
    for p in w.structure.pattern.order:
        later = w.structure.pattern.later[p]
        w.lines.append(f"d{p} = 1.0 / {w.entry(p, p)}")
        w.lines += [f"l{i}_{p} = {w.entry(i, p)} * d{p}" for i in later]
        for k, i in enumerate(later):
            columns = later[k:] if w.structure.symmetric else later
            w.lines += [f"{w.entry(i, j)} -= l{i}_{p} * {w.entry(p, j)}" for j in columns]


def _stages(w: _Writer, tableau: Tableau) -> None:
    nodes = range(w.structure.n)
    stages = len(tableau.b)
    for s in range(stages):
        weights = [value / tableau.gamma for value in tableau.a[s]]
        for i in nodes:
            base = f"T{i}" + "".join(f" + {e!r} * D{j}_{i}" for j, e in enumerate(weights) if e)
            w.lines.append(f"b{i} = {base}")
            w.lines.append(f"z{i} = C{i} * b{i} + R{i}")
        _substitute(w)
        if s < stages - 1 or not tableau.stiffly_accurate:
            w.lines += [f"D{s}_{i} = z{i} - b{i}" for i in nodes]
    for i in nodes:
        sums = "".join(f" + {b / tableau.gamma!r} * D{s}_{i}" for s, b in enumerate(tableau.b))
        w.lines.append(f"T{i} = z{i}" if tableau.stiffly_accurate else f"T{i} = T{i}{sums}")


def _substitute(w: _Writer) -> None:
    """Solve for z in place: forward along the order with the multipliers, backward with the rows of U."""
    pattern = w.structure.pattern
    for p in pattern.order:
        w.lines += [f"z{i} -= l{i}_{p} * z{p}" for i in pattern.later[p]]
    for p in reversed(pattern.order):
        sums = "".join(f" - {w.entry(p, j)} * z{j}" for j in pattern.later[p])
        w.lines.append(f"z{p} = (z{p}{sums}) * d{p}" if sums else f"z{p} = z{p} * d{p}")
