"""The columns kernel: a run and, beside it, the derivative of every temperature by every parameter, as source text.

Differentiating the step `M(T) z_s = C/(gamma h) base_s + R(T)` of `twin.integrators` by a parameter p gives the same matrix on
the left, so one factorisation serves the temperatures and all columns `S = dT/dp`:

    M dz_s = C/(gamma h) dbase_s + q_s + H_s S

`q_s`: the heat that p itself adds in stage s, a few entries a column; `H_s`: how the linearisation of the step moves with
its start, entries only where a law is not linear in temperature. So the columns are the exact derivative of the discrete
scheme. `q_s` is folded into the columns as they stand before each stage, so that no dense right-hand side exists.

Columns lie in tiles of `TILE` side by side: a tile fits the nearest cache and its inner loops have a constant length,
which is what lets the compiler use vector instructions.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

from twin.codegen import Writer, end_step, step
from twin.integrators import Tableau
from twin.structure import CONSTANT, NOBODY, Group, Structure

TILE = 16

_JIT = '@numba.njit(error_model="numpy", nogil=True, cache=CACHE)'
# Columns may contract a product and a sum into one operation (half the work): they steer a search and are in no digest.
_JIT_COLUMNS = '@numba.njit(error_model="numpy", nogil=True, fastmath={"contract"}, cache=CACHE)'

HEAD = f'''"""One thermal network and its sensitivities as straight-line code. Generated: change the generator, not this file."""

import numba


{_JIT_COLUMNS}
def observe(weight, block, columns, start, node, share, lag, lagged, means):
    for o in range(weight.shape[0]):
        if weight[o] == 0.0:
            continue
        for t in range(columns.shape[0]):
            mean = means[o, block, t]
            if lag[o, 0] > 0.0:
                for c in range({TILE}):
                    mean[c] += weight[o] * lagged[1, o, t, c]
                continue
            for e in range(start[o], start[o + 1]):
                factor = weight[o] * share[e]
                row = columns[t, node[e] * {TILE} : node[e] * {TILE} + {TILE}]
                for c in range({TILE}):
                    mean[c] += factor * row[c]


{_JIT_COLUMNS}
def follow(columns, start, node, share, lag, lagged):
    for o in range(lag.shape[0]):
        if lag[o, 0] <= 0.0:
            continue
        for t in range(columns.shape[0]):
            before, reading = lagged[0, o, t], lagged[1, o, t]
            for c in range({TILE}):
                reading[c] = lag[o, 0] * reading[c] + lag[o, 1] * before[c]
                before[c] = 0.0
            for e in range(start[o], start[o + 1]):
                row = columns[t, node[e] * {TILE} : node[e] * {TILE} + {TILE}]
                for c in range({TILE}):
                    before[c] += share[e] * row[c]
            for c in range({TILE}):
                reading[c] += lag[o, 2] * before[c]


{_JIT_COLUMNS}
def fold(amount, state, place, into, into_K, out_of, out_of_K, columns):
    for e in range(into.shape[0]):
        change = amount[e] * state[place[e]]
        columns[into[e]] += change * into_K[e]
        columns[out_of[e]] -= change * out_of_K[e]
'''

RUN = f"""

{_JIT}
def run(
    features, boundaries, step_s, coefficients, capacities, copper, factors, out,
    forcing, feature, scale, place, into, into_K, out_of, out_of_K,
    state, amount, values, columns, stages, held, visits, block, old, new, start, node, share, lag, lagged, means,
):
    flat = columns.reshape(-1)
"""


@dataclass(frozen=True)
class Places:
    """Where the parts of a stage's `state` begin: 1; `node` temperatures [degC]; `group`: heat per unit of its sum;
    `bias`: what a kelvin of its boundary adds through a group [W]; `charge`: heat that a capacity takes up [W]; inverse
    `resistance` of copper nodes; `boundary` temperatures [degC]."""

    node: int
    group: int
    bias: int
    charge: int
    resistance: int
    boundary: int


def places(structure: Structure) -> Places:
    """The layout of `state`."""
    n, groups = structure.n, len(structure.groups)
    return Places(1, 1 + n, 1 + n + groups, 1 + n + 2 * groups, 1 + 2 * n + 2 * groups, 1 + 3 * n + 2 * groups)


def copper_nodes(structure: Structure) -> tuple[int, ...]:
    """Nodes with a loss in copper: those whose inverse resistance is in `state`."""
    return tuple(sorted({group.a for group in structure.groups if group.own}))


def generate(structure: Structure, tableau: Tableau) -> str:
    """The source of `run`, for a stiffly accurate method. Arguments after those of the simulation's kernel:

    A parameter's own heat is the sum of its items: item e puts `scale[e] * forcing[k, feature[e]] * state[stage, place[e]]`
    [W] into one entry of the columns and takes it out of another: `into`, `out_of` (E,) flat positions, `into_K`,
    `out_of_K` (E,) gamma h / C of their nodes [K/W], 0 where there is none. `columns` (tiles, n TILE): dT/dp at the start,
    left as at the end. `visits` (N, 2), `block` (N,), `old`, `new` (N, m): whether anything is observed, each step's
    block, and what its start and end weigh in the block's mean. `start` (m + 1,), `node`, `share`: the nodes of each output; `lag` (m, 3): factors of the reading, the truth
    before and the truth now, 0 without lag. `means` (m, B, tiles, TILE): added to. Scratch: `state` (s, places), `amount` (E,),
    `values` (factors of a step), `stages` (s - 1, tiles, n TILE), `held` (tiles, n TILE), `lagged`
    (2, m, tiles, TILE), which holds truth and reading at the start.
    """
    w = step(structure, tableau)
    last = len(tableau.b) - 1
    w.lines += [f"D{last}_{i} = z{last}_{i} - ({_base(tableau, last, i)})" for i in range(structure.n)]
    for index, group in enumerate(structure.groups):
        _unit_heat(w, index, group, last)
    _state(w, tableau)
    bent = _curvature(w, last)
    held = sorted({j for rows in bent.values() for row in rows.values() for j in row})
    names = [f"C{i}" for i in range(structure.n)] + [f"d{i}" for i in range(structure.n)]
    names += [
        name for p in structure.pattern.order for i in structure.pattern.later[p] for name in (f"l{i}_{p}", f"u{p}_{i}")
    ]
    names += [h for s in bent.values() for row in s.values() for h in row.values()]
    w.lines += [f"values[{v}] = {name}" for v, name in enumerate(names)]
    w.hoisted.append("slow = lag.sum() > 0.0")
    observe = "    observe({}[k], block[k], columns, start, node, share, lag, lagged, means)"
    w.lines += ["if visits[k, 0]:", observe.format("old")]
    w.lines += _hold(held)
    w.lines += ["for e in range(place.shape[0]):", "    amount[e] = scale[e] * forcing[k, feature[e]]"]
    for s in range(last + 1):
        w.lines.append(f"fold(amount, state{s}, place, into, into_K, out_of, out_of_K, flat)")
        w.lines.append(f"solve{s}(values, columns, stages, held)")
    w.lines += ["if slow:", "    follow(columns, start, node, share, lag, lagged)"]
    w.lines += ["if visits[k, 1]:", observe.format("new")]
    end_step(w, tableau)
    solves = "".join(_solve_columns(structure, tableau, s, names, bent.get(s, {}), held) for s in range(last + 1))
    return HEAD + solves + RUN + w.text()


def _base(tableau: Tableau, stage: int, node: int) -> str:
    row = tableau.a[stage]
    return f"T{node}" + "".join(f" + {a / tableau.gamma!r} * D{j}_{node}" for j, a in enumerate(row) if a)


def _combined(tableau: Tableau, stage: int) -> list[float]:
    """A stage's base as a combination of the step's start and the stages before it."""
    bases: list[list[float]] = []
    for s in range(stage + 1):
        base = [1.0] + [0.0] * stage
        for j, a in enumerate(tableau.a[s]):
            base = [b - a / tableau.gamma * before for b, before in zip(base, bases[j], strict=True)]
            base[1 + j] += a / tableau.gamma
        bases.append(base)
    return bases[stage]


def _unit_heat(w: Writer, index: int, group: Group, last: int) -> None:
    """`w`: the heat into a in each stage per unit of the group's sum; `o`: per kelvin of its boundary."""
    a, b, m, n = group.a, group.b, group.other, w.structure.n
    for s in range(last + 1):
        moved = f" * (z{s}_{m} - T{m})"
        if b == NOBODY:
            heat, slope = "1.0", ""
            if group.own:
                heat = f"x{index}"
                slope = "alpha" if group.own > 0 else f"-alpha * x{index} * x{index}"
            own = f" + {slope} * (z{s}_{a} - T{a})" if slope else ""
            if m == NOBODY:
                w.lines.append(f"w{index}_{s} = {heat}{own}")
            else:
                w.lines.append(f"w{index}_{s} = ({heat}{own}) * y{index} + {heat} * s{index}{moved}")
            continue
        far, then = (f"B{b - n}", f"B{b - n}") if b >= n else (f"z{s}_{b}", f"T{b}")
        if m == NOBODY:
            w.lines.append(f"w{index}_{s} = {far} - z{s}_{a}")
        else:
            w.lines.append(f"w{index}_{s} = y{index} * ({far} - z{s}_{a}) + s{index} * ({then} - T{a}){moved}")
        if b >= n:
            turn = f" + {_sum(group)} * s{index}{moved}" if m != NOBODY else ""
            w.lines.append(f"o{index}_{s} = g{index}{turn}")


def _sum(group: Group) -> str:
    return "(" + " + ".join(f"c{i}" if j == CONSTANT else f"c{i} * f{j}" for i, j in group.terms) + ")"


def _state(w: Writer, tableau: Tableau) -> None:
    """What the parameters' heats are made of. A stage's row is what folding it adds: its own part less the one before."""
    structure, at, last = w.structure, places(w.structure), len(tableau.b) - 1
    w.hoisted += [f"state{s} = state[{s}]" for s in range(last + 1)]
    for i in copper_nodes(structure):
        w.lines.append(f"x_{i} = 1.0 / (1.0 + alpha * (T{i} - reference))")
        w.lines += [f"x_{i}_{s} = x_{i} - alpha * x_{i} * x_{i} * (z{s}_{i} - T{i})" for s in range(last + 1)]
    names = [(0, "1.0")]
    for i in range(structure.n):
        names += [(at.node + i, f"z{{s}}_{i}"), (at.charge + i, f"-C{i} * D{{s}}_{i}")]
    for index, group in enumerate(structure.groups):
        names.append((at.group + index, f"w{index}_{{s}}"))
        if group.b >= structure.n:
            names.append((at.bias + index, f"o{index}_{{s}}"))
    names += [(at.resistance + i, f"x_{i}_{{s}}") for i in copper_nodes(structure)]
    parts = [1.0 / _combined(tableau, s)[0] for s in range(last + 1)]
    for s in range(last + 1):
        for place, text in names:
            before = f" - {parts[s - 1]!r} * ({text.format(s=s - 1)})" if s else ""
            w.lines.append(f"state{s}[{place}] = {parts[s]!r} * ({text.format(s=s)}){before}")
        change = parts[s] - parts[s - 1] if s else parts[s]
        w.lines += [
            "for j in range(boundaries.shape[1]):",
            f"    state{s}[{at.boundary} + j] = {change!r} * boundaries[k, j]",
        ]


def _curvature(w: Writer, last: int) -> dict[int, dict[int, dict[int, str]]]:
    """The entries of `H`: stage -> row -> column -> variable. Its heat goes into a and, in a link, out of b."""
    found: dict[int, dict[int, dict[int, str]]] = {}
    for s in range(last + 1):
        entries: defaultdict[tuple[int, int], list[str]] = defaultdict(list)
        for index, group in enumerate(w.structure.groups):
            for column, expression in _bent(w.structure, index, group, s):
                entries[group.a, column].append(f"+ {expression}")
                if 0 <= group.b < w.structure.n:
                    entries[group.b, column].append(f"- {expression}")
        for (i, j), terms in entries.items():
            w.lines.append(f"h{s}_{i}_{j} = " + " ".join(terms).removeprefix("+ "))
            found.setdefault(s, {}).setdefault(i, {})[j] = f"h{s}_{i}_{j}"
    return found


def _bent(structure: Structure, index: int, group: Group, s: int) -> list[tuple[int, str]]:
    """Second derivatives of a group's heat by the temperatures at the start, times what moved since: (column, expression)."""
    a, b, m, n = group.a, group.b, group.other, structure.n
    own, other = f"(z{s}_{a} - T{a})", f"(z{s}_{m} - T{m})"
    total = _sum(group)
    if b == NOBODY:
        bent = []
        factor = f" * y{index}" if m != NOBODY else ""
        if group.own < 0:
            bent.append((a, f"2.0 * {total} * alpha * alpha * x{index} * x{index} * x{index}{factor} * {own}"))
        if group.own and m != NOBODY:
            slope = "alpha" if group.own > 0 else f"(-alpha * x{index} * x{index})"
            cross = f"{total} * {slope} * s{index}"
            bent += [(a, f"{cross} * {other}"), (m, f"{cross} * {own}")]
        return bent
    if m == NOBODY:
        return []
    turn = f"{total} * s{index}"
    far, then = (f"B{b - n}", f"B{b - n}") if b >= n else (f"z{s}_{b}", f"T{b}")
    bent = [(m, f"{turn} * ({far} - z{s}_{a} - {then} + T{a})"), (a, f"(-{turn} * {other})")]
    return bent if b >= n else [*bent, (b, f"{turn} * {other}")]


def _hold(held: list[int]) -> list[str]:
    """Keep the rows that the curvature multiplies, as they are before anything is folded into them."""
    if not held:
        return []
    copies = [f"        held[t, {r * TILE} + c] = columns[t, {j * TILE} + c]" for r, j in enumerate(held)]
    return ["for t in range(columns.shape[0]):", f"    for c in range({TILE}):", *copies]


def _solve_columns(
    structure: Structure, tableau: Tableau, s: int, names: list[str], bent: dict[int, dict[int, str]], held: list[int]
) -> str:
    """`solve<s>`: one stage of all columns with the factors of the step; the last stage becomes the columns."""
    n, last = structure.n, len(tableau.b) - 1
    order, later = structure.pattern.order, structure.pattern.later
    start, *stages = _combined(tableau, s)
    used = {h for row in bent.values() for h in row.values()}
    hoisted = [f"{name} = values[{v}]" for v, name in enumerate(names) if name[0] != "h" or name in used]
    hoisted += [f"C{i}_{j} = {part!r} * C{i}" for i in range(n) for j, part in enumerate([start, *stages][: s + 1])]
    body = []
    for i in order:
        base = f"C{i}_0 * source[{i * TILE} + c]" + "".join(
            f" + C{i}_{j + 1} * stage{j}[{i * TILE} + c]" for j in range(s)
        )
        base += "".join(f" + {h} * kept[{held.index(j) * TILE} + c]" for j, h in bent.get(i, {}).items())
        known = "".join(f" - l{i}_{k} * v{k}" for k in order if i in later[k])
        body.append(f"v{i} = {base}{known}")
    for i in reversed(order):
        known = "".join(f" - u{i}_{j} * z{j}" for j in later[i])
        body += [f"z{i} = (v{i}{known}) * d{i}", f"target[{i * TILE} + c] = z{i}"]
    lines = [*hoisted, "for t in range(columns.shape[0]):", "    source, kept = columns[t], held[t]"]
    lines += [f"    stage{j} = stages[{j}, t]" for j in range(s)]
    lines.append("    target = source" if s == last else f"    target = stages[{s}, t]")
    lines += [f"    for c in range({TILE}):", *(f"        {line}" for line in body)]
    head = f"\n\n{_JIT_COLUMNS}\ndef solve{s}(values, columns, stages, held):\n"
    return head + "".join(f"    {line}\n" for line in lines)
