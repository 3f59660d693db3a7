"""The text of one group's law (`twin.motor.heat_laws`) and of its slopes, in the names of the straight-line kernel.

Group 3, which takes heat into node 0, has there the amount `g3`, the temperature `T0`, slope `s3` and level `r3` of
its temperature factor, that factor `y3` and the factor of copper `x3`. What else its law works out keeps its name,
with the number: `drop_3`.
"""

from __future__ import annotations

import itertools
import re

from twin.compiled.differentiate import Derivative
from twin.compiled.structure import Group, Ramps
from twin.motor.heat_laws import FACTOR, LAWS, RAMP, TEMPERATURES
from twin.motor.network import NOBODY

_NAME = re.compile(r"(?<![\w.])[a-z]\w*(?![\w.(])")


class LawText:
    """`heat`: the expression of the law; `lines`: what stands before it; `far`: the name of the temperature at the
    link's other end, a node's (`T5`) or a boundary's (`B0`)."""

    def __init__(self, n: int, index: int, group: Group) -> None:
        law, factor = LAWS[group.law], (FACTOR,) if group.other != NOBODY else ()
        lines = (*factor, *_relative(group.fluid), *law.lines)
        self.far = f"B{group.b - n}" if group.b >= n else f"T{group.b}"
        self._names = {"own": f"T{group.a}", "far": self.far, "other": f"T{group.other}", "amount": f"g{index}"}
        self._names |= {"slope": f"s{index}", "level": f"r{index}", "factor": f"y{index}", "rise": f"x{index}"}
        self._names |= {"alpha": "alpha", "reference": "reference"}
        if group.plain:  # no line of its own: the heat has the difference in it
            self._names["drop"] = f"({self.far} - T{group.a})"
        self._index = index
        self._slopes = {by: Derivative(lines, by) for by in TEMPERATURES}
        self._heat = law.heat if factor else law.heat.replace(" * factor", "")
        self.lines = [self._named(line) for line in (factor if group.plain else lines)]
        self.heat = self._named(self._heat)

    def slope_lines(self, by: str) -> list[str]:
        """What the slopes with a temperature (own, far, other) are made of."""
        return [self._named(line) for line in self._slopes[by].lines]

    def slope(self, by: str, of: str | None = None) -> str | None:
        """The slope of the heat, or of another text of the law, with a temperature; None where it is zero."""
        slope = self._slopes[by].of(of or self._heat)
        return None if slope is None else self._named(slope)

    def _named(self, text: str) -> str:
        return _NAME.sub(lambda name: self._names.get(name[0], f"{name[0]}_{self._index}"), text)


def _relative(fluid: Ramps) -> tuple[str, ...]:
    """The heat capacity of a fluid over its temperature: a sum of ramps."""
    if not fluid:
        return ()
    parts = [repr(fluid[0][1])]
    for (low, _), (high, rise) in itertools.pairwise(fluid):
        ramp = RAMP.replace("low", repr(low)).replace("high", repr(high))
        parts.append(f"{rise!r} * ({ramp})")
    return (f"relative = {' + '.join(parts)}",)
