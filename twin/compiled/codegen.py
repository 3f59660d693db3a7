"""The straight-line kernel: a whole open-loop run of one network as source text, every quantity a local variable.

The text depends on which node is linked to which, by what law, and on the tables of fluids; coefficients, capacities
and temperature factors are arguments, so that a motor with new numbers needs no compiling.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

from twin.compiled.differentiate import negated
from twin.compiled.integrators import Tableau
from twin.compiled.law_text import LawText
from twin.compiled.structure import CONSTANT, Group, Structure
from twin.motor.heat_laws import LAWS
from twin.motor.network import NOBODY

HEAD = '''"""One thermal network as straight-line code. Generated: change the generator, not this file."""

import math

import numba


@numba.njit(
    "void(float64[:, ::1], float64[:, ::1], float64, float64[::1], float64[::1], float64[::1], float64[:, ::1],"
    " float64[:, ::1])",
    error_model="numpy",
    nogil=True,
    no_cfunc_wrapper=True,
    cache=CACHE,
)
def run(features, boundaries, step_s, coefficients, capacities, copper, factors, out):
'''


class Writer:
    """The body of a kernel as it is written: lines before the loop over the steps (`hoisted`) and within it
    (`lines`), and the signed expressions that make up each entry of the step's matrix and right-hand side (`matrix`,
    `right`)."""

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self.hoisted: list[str] = []
        self.lines: list[str] = []
        self.matrix: defaultdict[tuple[int, int], list[str]] = defaultdict(list)
        self.right: defaultdict[int, list[str]] = defaultdict(list)

    @property
    def boundaries(self) -> list[int]:
        """The boundaries that links end at."""
        n = self.structure.n
        return sorted({g.b - n for g in self.structure.groups if g.b >= n})

    def add(self, row: int, column: int, signed: str) -> None:
        """Add a signed expression to an entry of the matrix."""
        self.matrix[row, column].append(signed)

    def assembled(self, row: int, column: int) -> str:
        return " ".join(self.matrix[row, column]).removeprefix("+ ") or "0.0"

    def text(self) -> str:
        """The body of `run`: what is hoisted, then the loop over the steps."""
        return indented(1, [*self.hoisted, "for k in range(features.shape[0]):"]) + indented(2, self.lines)


def indented(depth: int, lines: Iterable[str]) -> str:
    """The lines as text, so many blocks deep."""
    return "".join(f"{'    ' * depth}{line}\n" for line in lines)


def generate(structure: Structure, tableau: Tableau) -> str:
    """The source of `run(features, boundaries, step_s, coefficients, capacities, copper, factors, out)`.

    It fills `out[1:]` from `out[0]`; arrays as in `Frame` and `Parameters`. `CACHE` is left to whoever loads the text.
    """
    w = Writer(structure)
    read_inputs(w, tableau)
    for index, group in enumerate(structure.groups):
        add_group(w, index, group)
    factorise(w)
    _stages(w, tableau)
    w.hoisted += [f"T{i} = out[0, {i}]" for i in range(structure.n)]
    if tableau.back:
        w.hoisted += ["gamma = 1.0", "back = 0.0", *(f"P{i} = T{i}" for i in range(structure.n))]
    end_step(w, tableau)
    w.lines += [f"out[k + 1, {i}] = T{i}" for i in range(structure.n)]
    return HEAD + w.text()


def read_inputs(w: Writer, tableau: Tableau) -> None:
    gamma, before = ("gamma", w.lines) if tableau.back else (repr(tableau.gamma), w.hoisted)
    before += [f"C{i} = capacities[{i}] / ({gamma} * step_s)" for i in range(w.structure.n)]
    if any("alpha" in line for group in w.structure.groups for line in LAWS[group.law].lines):
        w.hoisted += ["alpha = copper[0]", "reference = copper[1]"]
    w.lines += [f"f{j} = features[k, {j}]" for j in range(w.structure.monomials)]
    w.lines += [f"B{j} = boundaries[k, {j}]" for j in w.boundaries]


def add_group(w: Writer, index: int, group: Group) -> None:
    """The heat of a group, linear about the start of the step: its slopes go into the matrix, what is left to the
    right-hand side."""
    w.hoisted += [f"c{i} = coefficients[{i}]" for i, _ in group.terms]
    w.lines.append(f"g{index} = " + " + ".join(f"c{i}" if j == CONSTANT else f"c{i} * f{j}" for i, j in group.terms))
    if group.other != NOBODY:
        w.hoisted += [f"s{index} = factors[{index}, 0]", f"r{index} = factors[{index}, 1]"]
    law = LawText(w.structure.n, index, group)
    (_source if group.b == NOBODY else _link)(w, index, group, law)


def _source(w: Writer, index: int, group: Group, law: LawText) -> None:
    """Heat into node a: `p` its slope with the node's own temperature, `q` with that of the temperature factor."""
    w.lines += law.lines
    for name, by, node in ((f"p{index}", "own", group.a), (f"q{index}", "other", group.other)):
        slope = law.slope(by)
        if slope is not None:
            w.lines.append(f"{name} = {slope}")
            w.add(group.a, node, f"- {name}")
            w.right[group.a].append(f"- {name} * T{node}")
    w.right[group.a].append(f"+ {law.heat}")


def _link(w: Writer, index: int, group: Group, law: LawText) -> None:
    """Heat `h` times the drop into node a and, unless it goes one way, out of node b. `h` is the amount times the
    temperature factor, `q` the slope with the temperature of that factor, `da` what the drop falls by per kelvin of
    a, `db` what it grows by per kelvin of b. Where the drop is the difference itself, `h` stands in the matrix and
    nothing is left."""
    a, b, m, far = group.a, group.b, group.other, law.far
    boundary = b >= w.structure.n
    gives = not (boundary or group.one_way)
    crossed, bent = m != NOBODY, not group.plain
    g = f"h{index}" if crossed else f"g{index}"
    w.lines += law.lines
    if bent:
        _add_drop(w, index, law)
    if crossed:
        w.lines += [f"q{index} = {law.slope('other')}", f"h{index} = g{index} * y{index}"]
        w.add(a, m, f"- q{index}")
        w.right[a].append(f"- q{index} * T{m}")
        if gives:
            w.add(b, m, f"+ q{index}")
            w.right[b].append(f"+ q{index} * T{m}")
    to_a, to_b = (f"{g} * da{index}", f"{g} * db{index}") if bent else (g, g)
    w.add(a, a, f"+ {to_a}")
    if boundary:
        w.right[a].append(f"+ {g} * (drop_{index} + da{index} * T{a})" if bent else f"+ {g} * {far}")
        return
    w.add(a, b, f"- {to_b}")
    if bent:
        w.lines.append(f"dr{index} = {g} * (drop_{index} + da{index} * T{a} - db{index} * {far})")
        w.right[a].append(f"+ dr{index}")
    if gives:
        w.add(b, b, f"+ {to_b}")
        w.add(b, a, f"- {to_a}")
        if bent:
            w.right[b].append(f"- dr{index}")


def _add_drop(w: Writer, index: int, law: LawText) -> None:
    by_own, by_far = law.slope("own", of="drop"), law.slope("far", of="drop")
    assert by_own is not None and by_far is not None, "what drives a link goes by both its temperatures"
    # The same where only the difference matters.
    w.lines += dict.fromkeys([*law.slope_lines("own"), *law.slope_lines("far")])
    w.lines += [f"da{index} = {negated(by_own)}", f"db{index} = {by_far}"]


def factorise(w: Writer) -> None:
    """L and U of the step matrix along the diagonal, row by row in the order of elimination; `d` is 1 / pivot.

    Every variable is assigned once: numba compiles that in a fraction of the time that updates in place take.
    """
    order, later = w.structure.pattern.order, w.structure.pattern.later
    for i in range(w.structure.n):
        w.matrix[i, i].insert(0, f"C{i}")

    def reduced(row: int, column: int) -> str:
        earlier = [k for k in order[: order.index(min(row, column, key=order.index))] if {row, column} <= {*later[k]}]
        return w.assembled(row, column) + "".join(f" - l{row}_{k} * u{k}_{column}" for k in earlier)

    for p in order:
        w.lines += [f"u{p}_{j} = {reduced(p, j)}" for j in (p, *later[p])]
        w.lines.append(f"d{p} = 1.0 / u{p}_{p}")
        for i in later[p]:
            column = f"u{p}_{i}" if w.structure.symmetric else f"({reduced(i, p)})"
            w.lines.append(f"l{i}_{p} = {column} * d{p}")


def _stages(w: Writer, tableau: Tableau) -> None:
    """`z` is a stage's temperature, `D` its distance from the stage's base."""
    last = len(tableau.b) - 1
    add_right_sides(w)
    for s in range(last + 1):
        known = bases(w, tableau, s)
        solve(w, s, known)
        if s < last or not tableau.stiffly_accurate:
            w.lines += [f"D{s}_{i} = z{s}_{i} - ({base})" for i, base in enumerate(known)]


def add_right_sides(w: Writer) -> None:
    """`R`: what flows into a node at the temperatures of the start, less what the matrix says of them."""
    w.lines += [f"R{i} = " + (" ".join(w.right[i]) or "0.0").removeprefix("+ ") for i in range(w.structure.n)]


def bases(w: Writer, tableau: Tableau, stage: int) -> list[str]:
    """What each node's temperature of a stage starts from."""
    row = enumerate(tableau.a[stage])
    added = "".join(f" + {value / tableau.gamma!r} * D{j}_{{i}}" for j, value in row if value)
    back = " + back * (T{i} - P{i})" if tableau.back else ""
    return [f"T{i}" + (back + added).format(i=i) for i in range(w.structure.n)]


def solve(w: Writer, stage: int, known: Sequence[str]) -> None:
    """One stage: forward along the order with L into `v`, backward with U into `z`."""
    order, later = w.structure.pattern.order, w.structure.pattern.later
    for i in order:
        above = "".join(f" - l{i}_{k} * v{stage}_{k}" for k in order if i in later[k])
        w.lines.append(f"v{stage}_{i} = C{i} * ({known[i]}) + R{i}{above}")
    for i in reversed(order):
        below = "".join(f" - u{i}_{j} * z{stage}_{j}" for j in later[i])
        w.lines.append(f"z{stage}_{i} = (v{stage}_{i}{below}) * d{i}")


def end_step(w: Writer, tableau: Tableau) -> None:
    """The state at the step's end."""
    last = len(tableau.b) - 1
    if tableau.back:
        w.lines += [f"gamma = {tableau.gamma!r}", f"back = {tableau.back!r}"]
        w.lines += [f"P{i} = T{i}" for i in range(w.structure.n)]
    for i in range(w.structure.n):
        sums = "".join(f" + {b / tableau.gamma!r} * D{s}_{i}" for s, b in enumerate(tableau.b))
        w.lines.append(f"T{i} = z{last}_{i}" if tableau.stiffly_accurate else f"T{i} = T{i}{sums}")
