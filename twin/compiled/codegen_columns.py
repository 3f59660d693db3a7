"""The columns kernel: the derivatives of all temperatures by many parameters side by side, as source text.

One step of the columns is that of the temperatures with other right-hand sides (`twin.compiled.codegen_derivatives`), in an inner loop over the
columns that the compiler makes into vector instructions.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from twin.compiled import codegen
from twin.compiled.codegen import Writer, indented
from twin.compiled.codegen_derivatives import HEAD, Heat, coefficients, linearised
from twin.compiled.integrators import Tableau
from twin.compiled.structure import CONSTANT, Structure
from twin.motor.network import NOBODY

LINE = 16  # numbers of single precision in a line of a cache


def width(columns: int) -> int:
    """Numbers in a row of so many columns: whole lines of a cache, and an odd count of them, so that rows begin in all places of the
    nearest cache in turn."""
    lines = -(-columns // LINE)
    return LINE * (lines + 1 - lines % 2)


def generate_columns(structure: Structure, tableau: Tableau, wanted: Sequence[int]) -> str:
    """The source of `run(features, boundaries, step_s, coefficients, capacities, copper, factors, temperatures, block, state,
    means)`, in single precision: seven digits for half the time.

    `wanted`: parameters, of coefficients, then capacities, then initial temperatures; W the `width` of so many. `state` (2 + s, n, W), s the
    stages: in the first the derivatives of the temperatures at the start, left as they are at the end, all else 0. `means` (B, n, W): means over
    each block of `block` steps, where a step counts as the mean of its ends.
    """
    w, n, wide = Writer(structure), structure.n, width(len(wanted))
    heats = linearised(w, tableau)
    w.lines += _own(w, heats, len(tableau.b), wanted)
    beside, singles = _beside(w, heats, tableau, wide)
    sums = wide * n
    w.hoisted += ["flat = state.reshape(-1)", f"rate = 1.0 / ({tableau.gamma!r} * step_s)", "share = 0.5 / block"]
    flush = ["if (k + 1) % block == 0:", f"    for i in range({n}):", f"        for c in range({wide}):"]
    flush += [f"            means[k // block, i, c] = flat[{sums} + i * {wide} + c] * share"]
    flush += [f"            flat[{sums} + i * {wide} + c] = 0.0"]
    text = HEAD.format(own="int64, float32[:, :, ::1], float32[:, :, ::1]", names="block, state, means")
    text += indented(1, [*w.hoisted, "for k in range(features.shape[0]):"])
    text += indented(2, [*w.lines, *singles, f"for c in range({wide}):"])
    return text + indented(3, beside) + indented(2, flush)


def _own(w: Writer, heats: list[list[Heat]], stages: int, wanted: Sequence[int]) -> Iterator[str]:
    """What a parameter itself brings into its nodes in each stage: few entries a column, the rest stays 0."""
    n, wide, size = w.structure.n, width(len(wanted)), coefficients(w.structure)
    column = {place: c for c, place in enumerate(wanted)}
    for s in range(stages):
        first = (2 + s) * n * wide
        for heat in (of_stages[s] for of_stages in heats):
            for i, j in heat.terms:
                if i in column:
                    text = heat.by_sum if j == CONSTANT else f"{heat.by_sum} * f{j}"
                    yield f"flat[{first + heat.a * wide + column[i]}] = {text}"
                    if heat.b != NOBODY:
                        yield f"flat[{first + heat.b * wide + column[i]}] = -{text}"
        for i in range(n):
            if size + i in column:
                yield f"flat[{first + i * wide + column[size + i]}] = -D{s}_{i} * rate"


def _beside(w: Writer, heats: list[list[Heat]], tableau: Tableau, wide: int) -> tuple[list[str], list[str]]:
    """The step of one column, and the numbers of single precision that all columns of the step share."""
    n, last = w.structure.n, len(tableau.b) - 1
    lines, scalars = [f"T{i}_c = flat[{i * wide} + c]" for i in range(n)], dict[str, str]()
    for s in range(last + 1):
        right = {f"R{i}": f"flat[{((2 + s) * n + i) * wide} + c]" for i in range(n)}
        for heat in (of_stages[s] for of_stages in heats):
            for node, name in heat.by_start:
                scalars[name] = f"{name}_1"
                right[f"R{heat.a}"] += f" + {name}_1 * T{node}_c"
                if heat.b != NOBODY:
                    right[f"R{heat.b}"] += f" - {name}_1 * T{node}_c"
        known, of_stage = codegen.bases(w, tableau, s), Writer(w.structure)
        codegen.solve(of_stage, s, known)
        of_stage.lines += [f"D{s}_{i} = z{s}_{i} - ({base})" for i, base in enumerate(known) if s < last]
        lines += [_of_column(line, right, scalars) for line in of_stage.lines]
    for i in range(n):
        lines.append(f"flat[{(n + i) * wide} + c] = flat[{(n + i) * wide} + c] + (T{i}_c + z{last}_{i}_c)")
        lines.append(f"flat[{i * wide} + c] = z{last}_{i}_c")
    return lines, [f"{single} = np.float32({text})" for text, single in scalars.items()]


def _of_column(line: str, right: Mapping[str, str], scalars: dict[str, str]) -> str:
    """A line of a run as that of its derivative: what depends on temperatures is a column's, `R` is `right`, and all else a number
    of single precision, which is entered among the `scalars`."""

    def renamed(found: re.Match[str]) -> str:
        name = found[0]
        if re.fullmatch(r"T\d+|[Dvz]\d+_\d+", name):
            return f"{name}_c"
        if name in right:
            return right[name]
        return scalars.setdefault(name, f"{name}_1" if name.isidentifier() else f"share_{len(scalars)}")

    return re.sub(r"[A-Za-z]\w*|\d+\.\d+(?:e-?\d+)?", renamed, line)
