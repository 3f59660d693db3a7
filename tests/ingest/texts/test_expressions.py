"""Derived channels: a small arithmetic, checked, never evaluated as Python."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ingest.errors import ExpressionError
from ingest.texts.expressions import DEEPEST, LONGEST, parse

A, B = np.array([3.0, -4.0, np.nan]), np.array([4.0, 3.0, 1.0])
VALUES = {"a": A, "b": B, "Motor.Speed [rpm]": B}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("hypot(a, b) / sqrt(2)", np.hypot(A, B) / np.sqrt(2)),
        ("mean(a, b)", (A + B) / 2),
        ("mean(a)", A),
        ("min(a, b, 0)", np.array([0.0, -4.0, np.nan])),
        ("max(a, b)", np.array([4.0, 3.0, np.nan])),
        ("abs(a)", np.abs(A)),
        ("exp(a)", np.exp(A)),
        ("ln(b) + log(b) + log10(a)", np.array([2 * np.log(4.0) + np.log10(3.0), np.nan, np.nan])),
        ("pow(b, 2)", B**2),
        ("a - b - 1", A - B - 1),
        ("a / b / 2", A / B / 2),
        ("a + b * 2", A + 2 * B),
        ("(a + b) * 2", (A + B) * 2),
        ("-a**2", -(A**2)),
        ("2**-b", 2.0**-B),
        ("b**3**2", B**9),
        ("--b", B),
        ("1.5e1*b + .5 - 2.", 15 * B - 1.5),
        ("`Motor.Speed [rpm]` + b", 2 * B),
    ],
)
def test_expressions_have_the_usual_meaning(text: str, expected: np.ndarray[tuple[int], np.dtype[np.float64]]) -> None:
    np.testing.assert_allclose(parse(text).evaluate(VALUES), expected, rtol=1e-15)


def test_names_come_once_each_in_order_of_first_use() -> None:
    assert parse("hypot(b, a) + b * `a b`").names == ("b", "a", "a b")


@pytest.mark.parametrize(
    "text", ["a / 0", "sqrt(0 - abs(b) - 1)", "9**9**9**9**9 * b", "(0-abs(b)-1)**0.5", "b**1e300*b"]
)
def test_what_is_no_finite_number_is_a_gap(text: str) -> None:
    result = parse(text).evaluate({"a": A, "b": B + 1})
    assert result.shape == (3,) and result.dtype == np.float64 and np.isnan(result).all()


def test_integers_are_computed_in_float64_and_inputs_stay_as_they_are() -> None:
    counts = np.array([100, 120], dtype=np.int8)
    assert parse("a * a").evaluate({"a": counts}).tolist() == [10000.0, 14400.0]
    values = np.array([np.inf, 1.0])
    assert np.isnan(parse("a").evaluate({"a": values})[0]) and np.isinf(values[0])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "position 1: the expression ends where a number, a signal or a parenthesis is wanted"),
        ("a +", "position 4: the expression ends where"),
        ("a b", 'position 3: found "b" where an operator is wanted'),
        ("(a", 'position 3: the expression ends where ")" is wanted'),
        ("a)", 'position 2: found ")" where an operator is wanted'),
        ("hypt(a, b)", 'position 1: "hypt" is no function. Nearest: hypot. Allowed are numbers'),
        ("1 + hypot(a)", "position 5: hypot takes 2 argument(s), found 1"),
        ("sqrt()", 'position 6: found ")" where'),
        ("__import__('os')", 'position 1: "__import__" is no function'),
        ("a.b", 'position 2: ".b" is not allowed'),
        ("can1:TempA.T", 'position 5: ":" is not allowed'),
        ("a == b", 'position 3: "=" is not allowed'),
        ("a[0]", 'position 2: "[" is not allowed'),
        ("`a", 'position 1: "`" is not allowed'),
        ("2a", 'position 1: "2a" is not allowed'),
        ("a if b else a", 'position 3: found "if" where an operator is wanted'),
        ("1 + 1", "position 1: no signal is named"),
        ("(" * 100 + "a" + ")" * 100, f"position {DEEPEST + 1}: nested deeper than {DEEPEST}"),
        ("-" * 100 + "a", f"nested deeper than {DEEPEST}"),
        ("a**" * 100 + "a", f"nested deeper than {DEEPEST}"),
        ("a" * (LONGEST + 1), "the expression has 2,001 characters, over the limit of 2,000: shorten it."),
    ],
)
def test_everything_else_is_refused_at_its_position(text: str, says: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        parse(text)
    assert says in str(caught.value)


def test_a_refusal_says_what_is_allowed() -> None:
    with pytest.raises(ExpressionError) as caught:
        parse("a % b")
    assert str(caught.value) == (
        'expression "a % b", position 3: "%" is not allowed. Allowed are numbers, signals (others than plain names in '
        "`backquotes`), + - * / ** and hypot sqrt abs exp ln log log10 pow min max mean."
    )


def test_the_longest_sum_is_evaluated_without_deep_recursion() -> None:
    text = "+".join(["a"] * (LONGEST // 2))
    started = time.perf_counter()
    assert parse(text).evaluate({"a": np.ones(1000)})[0] == LONGEST // 2
    assert time.perf_counter() - started < 2.0


@given(st.text(alphabet="ab1.()*/+-,` hypotsqrmean", max_size=40))
def test_any_text_is_an_expression_or_refused(text: str) -> None:
    try:
        expression = parse(text)
    except ExpressionError:
        return
    assert expression.evaluate(dict.fromkeys(expression.names, A)).shape == (3,)


def python(text: str, values: dict[str, float]) -> float | None:
    try:
        result = eval(text, {}, values)
    except (ZeroDivisionError, OverflowError):
        return None
    return float(result) if not isinstance(result, complex) else None


OPERANDS = st.sampled_from(["a", "b", "2.0", "0.5", "-a", "(b - a)"])


@given(OPERANDS, st.lists(st.tuples(st.sampled_from(["+", "-", "*", "/", "**"]), OPERANDS), max_size=6))
def test_precedence_is_that_of_python(first: str, rest: list[tuple[str, str]]) -> None:
    text = f"a + {first} " + " ".join(f"{sign} {operand}" for sign, operand in rest)
    expected = python(text, {"a": 1.5, "b": 3.0})
    result = parse(text).evaluate({"a": np.array([1.5]), "b": np.array([3.0])})[0]
    if expected is not None and np.isfinite(expected):
        assert result == pytest.approx(expected, rel=1e-12)
