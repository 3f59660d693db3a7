from __future__ import annotations

import math

import pytest

from twin.compiled.differentiate import Derivative

LINES = [
    "x = 1.0 / (1.0 + a * (t - r))",
    "p = -g * a * x * x",
    "y = g * math.sqrt(x) - 3.0 * (min(max(t, 2.0), 7.0) - 2.0) + math.sqrt(math.sqrt(math.sqrt(t * t + a)))",
]
LAST = "(y * (t < 9.0) + p * t * (9.0 <= t)) / (x - t) - r + -g * x * p / 3.0"
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
    found = Derivative(["g = c * f", "h = g * y * y"], "g")
    assert (found.lines, found.of("h - g * c")) == ([], "(y * y - c)")


def test_names_that_are_seen_through_one_line_alone_share_its_derivatives() -> None:
    lines = ["gap = far - own", "square = gap * gap"]
    by_far, by_own = (Derivative(lines, by) for by in ("far", "own"))
    assert by_far.lines == by_own.lines == ["square_by_gap = (gap + gap)"]
    assert (by_far.of("square"), by_own.of("square")) == ("square_by_gap", "-square_by_gap")
    assert by_own.of("square + 2.0 * own") == "-(square_by_gap - 2.0)"


def test_a_product_keeps_its_factors_in_their_order() -> None:
    """The straight-line kernel has had this order since its first digest."""
    found = Derivative(["x = 1.0 / (1.0 + a * (t - r))", "y = 1.0 + s * (u - l)"], "t")
    assert (found.lines, found.of("g * x * y")) == ([], "-g * a * x * x * y")


@pytest.mark.parametrize("text", ["t ** 3", "math.exp(t)", "t if t < 1.0 else 2.0", "q[t]"])
def test_what_there_is_no_rule_for_is_said(text: str) -> None:
    with pytest.raises(ValueError, match="there is no rule for the derivative of"):
        Derivative([], "t").of(text)
