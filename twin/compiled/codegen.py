"""The straight-line kernel: a whole open-loop run of one topology as source text, every quantity a local variable.

The text depends on the topology and the tables of fluids alone; coefficients, capacities and factors are arguments, so a refit
compiles nothing.
"""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Iterable, Sequence

from twin.compiled.integrators import Tableau
from twin.compiled.structure import CONSTANT, Group, Structure
from twin.motor.drops import FREE_CONVECTION, RADIATION
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
    """Lines of the body, and what is added to each entry of the step matrix and of its right-hand side."""

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
    add_step(w, tableau)
    w.hoisted += [f"T{i} = out[0, {i}]" for i in range(structure.n)]
    if tableau.back:
        w.hoisted += ["gamma = 1.0", "back = 0.0", *(f"P{i} = T{i}" for i in range(structure.n))]
    end_step(w, tableau)
    w.lines += [f"out[k + 1, {i}] = T{i}" for i in range(structure.n)]
    return HEAD + w.text()


def add_step(w: Writer, tableau: Tableau) -> None:
    """One step, from the state and the inputs to the temperatures of its stages."""
    for index, group in enumerate(w.structure.groups):
        add_group(w, index, group)
    factorise(w)
    _stages(w, tableau)


def read_inputs(w: Writer, tableau: Tableau) -> None:
    gamma, before = ("gamma", w.lines) if tableau.back else (repr(tableau.gamma), w.hoisted)
    before += [f"C{i} = capacities[{i}] / ({gamma} * step_s)" for i in range(w.structure.n)]
    if any(group.own for group in w.structure.groups):
        w.hoisted += ["alpha = copper[0]", "reference = copper[1]"]
    w.lines += [f"f{j} = features[k, {j}]" for j in range(w.structure.monomials)]
    w.lines += [f"B{j} = boundaries[k, {j}]" for j in w.boundaries]


def add_group(w: Writer, index: int, group: Group) -> None:
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


def _source(w: Writer, index: int, group: Group) -> None:
    """Heat g x y into node a, linear about the start: x the copper factor or its inverse, y the temperature factor."""
    g, a = f"g{index}", group.a
    if group.own:
        warm, slope = f"1.0 + alpha * (T{a} - reference)", f"{g} * alpha"
        if group.own < 0:
            warm, slope = f"1.0 / ({warm})", f"-{g} * alpha * x{index} * x{index}"
        w.lines.append(f"x{index} = {warm}")
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


def _link(w: Writer, index: int, group: Group) -> None:
    """Heat g y (T_b - T_a) into node a and, unless it goes one way, out of node b, linear about the start in the factor's
    temperature."""
    g, a, b, m = f"g{index}", group.a, group.b, group.other
    boundary = b >= w.structure.n
    far = f"B{b - w.structure.n}" if boundary else f"T{b}"
    gives = not (boundary or group.one_way)
    if not group.plain:
        _drop(w, index, group, far)
    if m != NOBODY:
        drop = f"({far} - T{a})" if group.plain else f"dv{index}"
        w.lines.append(f"q{index} = {g} * s{index} * {drop}")
        w.lines.append(f"h{index} = {g} * y{index}")
        g = f"h{index}"
        w.add(a, m, f"- q{index}")
        w.right[a].append(f"- q{index} * T{m}")
        if gives:
            w.add(b, m, f"+ q{index}")
            w.right[b].append(f"+ q{index} * T{m}")
    to_a, to_b = (g, g) if group.plain else (f"{g} * da{index}", f"{g} * db{index}")
    w.add(a, a, f"+ {to_a}")
    if boundary:
        w.right[a].append(f"+ {g} * {far}" if group.plain else f"+ {g} * (dv{index} + da{index} * T{a})")
        return
    w.add(a, b, f"- {to_b}")
    if not group.plain:
        w.lines.append(f"dr{index} = {g} * (dv{index} + da{index} * T{a} - db{index} * {far})")
        w.right[a].append(f"+ dr{index}")
    if gives:
        w.add(b, b, f"+ {to_b}")
        w.add(b, a, f"- {to_a}")
        if not group.plain:
            w.right[b].append(f"- dr{index}")


def _drop(w: Writer, index: int, group: Group, far: str) -> None:
    """What drives the heat, as `twin.motor.drops`: `dv` at the start, `da` what it falls by per kelvin of a, `db` what it grows by
    per kelvin of b."""
    own, i = f"T{group.a}", index
    if group.law == RADIATION:
        unit = repr(4 * 293.15**3)
        w.lines += [
            f"dc{i} = {own} + 273.15",
            f"dw{i} = {far} + 273.15",
            f"dv{i} = (dw{i} * dw{i} + dc{i} * dc{i}) * (dw{i} + dc{i}) * ({far} - {own}) / {unit}",
            f"da{i} = 4.0 * dc{i} * dc{i} * dc{i} / {unit}",
            f"db{i} = 4.0 * dw{i} * dw{i} * dw{i} / {unit}",
        ]
    elif group.law == FREE_CONVECTION:
        w.lines += [
            f"dw{i} = {far} - {own}",
            f"dc{i} = dw{i} * dw{i} + 0.01",
            f"dh{i} = math.sqrt(math.sqrt(math.sqrt(dc{i}))) / {math.sqrt(math.sqrt(math.sqrt(100.01)))!r}",
            f"dv{i} = dh{i} * dw{i}",
            f"da{i} = dh{i} * (1.0 + 0.25 * dw{i} * dw{i} / dc{i})",
            f"db{i} = da{i}",
        ]
    else:
        _fluid(w, index, group, far)


def _fluid(w: Writer, i: int, group: Group, far: str) -> None:
    """The heat capacity of the fluid that comes, relative: a table as a sum of ramps."""
    ramps, slopes = [repr(group.fluid[0][1])], ["0.0"]
    for (low, before), (high, after) in itertools.pairwise(group.fluid):
        slope = repr((after - before) / (high - low))
        ramps.append(f"{slope} * min(max({far} - {low!r}, 0.0), {high - low!r})")
        slopes.append(f"({slope} if {low!r} < {far} <= {high!r} else 0.0)")
    w.lines += [
        f"da{i} = {' + '.join(ramps)}",
        f"dw{i} = {far} - T{group.a}",
        f"dv{i} = da{i} * dw{i}",
        f"db{i} = da{i} + ({' + '.join(slopes)}) * dw{i}",
    ]


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
