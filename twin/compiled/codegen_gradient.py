"""The gradient kernel: from the last step of a run to the first, as source text (`twin.compiled.codegen_derivatives`).

The transpose of the derivatives by each parameter (A. Griewank, A. Walther, Evaluating Derivatives, 2nd ed. (2008),
section 3.2, doi:10.1137/1.9780898717761). Every name in the text is the derivative of the weighted sum by something:
`A` by the temperatures at a step's end, `N` by those at its start, `K` by coefficients, `H` by capacities; in a stage
`e` by its temperatures, `a` by its heats, `b` by its bases.
"""

from __future__ import annotations

from twin.compiled.codegen import Writer, indented
from twin.compiled.codegen_derivatives import HEAD, coefficients, linearised
from twin.compiled.integrators import Tableau
from twin.compiled.structure import CONSTANT, Structure
from twin.motor.network import NOBODY


def generate_gradient(structure: Structure, tableau: Tableau) -> str:
    """The source of `run(features, boundaries, step_s, coefficients, capacities, copper, factors, temperatures,
    weights, by_coefficient, by_capacity, by_start)`.

    It fills `by_coefficient` (K,), `by_capacity` (n,) and `by_start` (n,): the derivatives of the sum of `weights` (N
    + 1, n) times the `temperatures` (N + 1, n) that a run left.
    """
    w, last = Writer(structure), len(tableau.b) - 1
    heats = linearised(w, tableau)
    nodes, size = range(structure.n), coefficients(structure)
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
    own = "float64[:, ::1], float64[::1], float64[::1], float64[::1]"
    text = HEAD.format(own=own, names="weights, by_coefficient, by_capacity, by_start")
    text += indented(1, [*w.hoisted, *begin, "for k in range(features.shape[0] - 1, -1, -1):"])
    return text + indented(2, [*steps, *w.lines]) + indented(1, end)


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
