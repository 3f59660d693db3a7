from __future__ import annotations

import math

import pytest

from twin.compiled.differentiate import Derivative

LINES = [
    "x = 1.0 / (1.0 + a * (t - r))",
    "p = -g * a * x * x",
    "y = g * math.sqrt(x) - 3.0 * min(max(t - 2.0, 0.0), 5.0)",
]
LAST = "(y if t < 9.0 else p * t) / (x - t) - r + g * x * p"
VALUES = {"a": 0.4, "g": 2.3, "r": -1.7}


def _value(text: str, lines: list[str], given: dict[str, float]) -> float:
    names = {"math": math, "min": min, "max": max, **given}
    for line in lines:
        name, expression = line.split(" = ", 1)
        names[name] = eval(expression, names)
    return float(eval(text, names))


@pytest.mark.parametrize("t", [1.0, 3.7, 8.0, 11.0])
@pytest.mark.parametrize("by", ["t", "a", "g", "r"])
def test_every_rule_agrees_with_central_differences(by: str, t: float) -> None:
    given, found = {**VALUES, "t": t}, Derivative(LINES, by)
    text = found.of(LAST)
    assert text is not None

    def moved(change: float) -> float:
        return _value(LAST, LINES, {**given, by: given[by] + change})

    step = 1e-3
    expected = (8 * (moved(step) - moved(-step)) - moved(2 * step) + moved(-2 * step)) / (12 * step)
    assert _value(text, [*LINES, *found.lines], given) == pytest.approx(expected, rel=1e-8)


def test_what_does_not_depend_on_a_name_has_no_derivative() -> None:
    found = Derivative(["x = a * b", "y = x + c"], "d")
    assert found.lines == []
    assert found.of("x * y - 1.0") is None


def test_a_line_that_assigns_the_name_itself_is_not_looked_into() -> None:
    assert Derivative(["g = c * f", "h = g * y"], "g").lines == ["h_by_g = (y)"]
