"""The laws of heat as functions that compiled programs call, made from their text (`twin.motor.heat_laws`).

    heat(law, amount, own, far, other, alpha, reference, slope, level, relative, growth)
    -> value, by_own, by_far, by_other

The value [W] of the law of number `law` (`NUMBER`) and its slopes [W/K] with the three temperatures. `relative` and
`growth` matter to a stream alone; where there is no temperature factor, `slope` is 0. The number of no law gives NaN:
so shows a program that numba compiled before the law was written. `heat_of_vectors` is the same for amounts and
temperatures that may be vectors (`twin.arithmetic.vectors`).

    heat_capacity(far, knots, rises, count) -> relative, growth

The heat capacity of a fluid at `far` over that at 20 degC, and its slope [1/K], by a table of `count` entries
(`twin.compiled.structure.Ramps`).

    heats(law, at, a, b, m, first, alpha, reference, slope, level, fluid, knots, found)

`heat` at an amount of 1 in K steps from `first` on: its value and slopes become the rows of `found` (4, K). `at`
(places, N) are the temperatures in all steps; its rows a, b and m are own, far and other. `fluid` holds so many
`knots`, then as many rises.
"""

from __future__ import annotations

import math
import re
from typing import Any

import numba
import numpy as np

from twin.compiled.codegen import indented
from twin.compiled.differentiate import Derivative
from twin.motor.heat_laws import FACTOR, LAWS, NUMBER, RAMP, TEMPERATURES, HeatLaw

_OF_VECTORS = {"math.sqrt": "np.sqrt", "min": "np.minimum", "max": "np.maximum"}
_CALLS = re.compile(r"(?<![\w.])(math\.sqrt|min|max)(?=\()")


def for_vectors(text: str) -> str:
    """A text with the functions that vectors have too."""
    return _CALLS.sub(lambda call: _OF_VECTORS[call[1]], text)


def _statements(law: HeatLaw) -> tuple[list[str], str]:
    """What is worked out of a law, and the four results that it is worked out for."""
    lines, known = (FACTOR, *law.lines), {"relative": "growth"} if law is LAWS["stream"] else None
    slopes = [Derivative(lines, by, known if by == "far" else None) for by in TEMPERATURES]
    found = (law.heat, *(slope.of(law.heat) or "0.0" for slope in slopes))
    return [*lines, *dict.fromkeys(line for slope in slopes for line in slope.lines)], ", ".join(found)


JIT = '@numba.njit(error_model="numpy", nogil=True, forceinline=True)\n'

HEAT_CAPACITY = f"""{JIT}def heat_capacity(far, knots, rises, count):
    relative, growth = rises[0], 0.0
    for i in range(1, count):
        low, high = knots[i - 1], knots[i]
        relative += rises[i] * ({RAMP})
        growth += rises[i] * {Derivative((), "far").of(RAMP)}
    return relative, growth


"""


def _heat() -> str:
    text = f"{JIT}def heat(law, amount, own, far, other, alpha, reference, slope, level, relative, growth):\n"
    for name, law in LAWS.items():
        lines, found = _statements(law)
        text += indented(1, [f"if law == {NUMBER[name]}:"]) + indented(2, [*lines, f"return {found}"])
    return text + "    return np.nan, np.nan, np.nan, np.nan\n\n\n"


def _heats() -> str:
    """A loop in each branch, not a branch in the loop: compilers then take many states at a time."""
    text = f"{JIT}def heats(law, at, a, b, m, first, alpha, reference, slope, level, fluid, knots, found):\n"
    text += "    amount, rises = 1.0, fluid[knots:]\n"
    for name, law in LAWS.items():
        lines, results = _statements(law)
        before = ["own, far, other = at[a, first + k], at[b, first + k], at[m, first + k]"]
        if name == "stream":
            before.append("relative, growth = heat_capacity(far, fluid, rises, knots)")
        after = f"found[0, k], found[1, k], found[2, k], found[3, k] = {results}"
        text += indented(1, [f"if law == {NUMBER[name]}:"]) + indented(2, ["for k in range(found.shape[1]):"])
        text += indented(3, [*before, *lines, after]) + indented(2, ["return"])
    return text + "    found[:] = np.nan\n"


def _compiled(text: str) -> dict[str, Any]:
    made: dict[str, Any] = {"math": math, "numba": numba, "np": np, "__name__": __name__}
    exec(compile(text, "<laws of heat>", "exec"), made)  # noqa: S102 -- our own text
    return made


LINEAR, SOURCE, STREAM = (NUMBER[name] for name in ("linear", "source", "stream"))  # known to programs
TEXT = f"LINEAR, SOURCE, STREAM = {LINEAR}, {SOURCE}, {STREAM}\n\n\n" + HEAT_CAPACITY + _heat()
TEXT_OF_VECTORS = for_vectors(TEXT)
_of_numbers, _of_vectors = _compiled(TEXT + _heats()), _compiled(TEXT_OF_VECTORS)
heat, heat_capacity, heats = _of_numbers["heat"], _of_numbers["heat_capacity"], _of_numbers["heats"]
heat_of_vectors, heat_capacity_of_vectors = _of_vectors["heat"], _of_vectors["heat_capacity"]
