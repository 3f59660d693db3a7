"""Powers, logarithms and right-angled sums of derived channels: against sixty digits, and bit by bit."""

from __future__ import annotations

import hashlib
from decimal import Decimal, localcontext

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.texts.expressions import parse
from ingest.texts.powers import exp, hypot, ln, log10, power

Floats = NDArray[np.float64]
RANDOM = np.random.default_rng(7)


def worst(found: Floats, true: list[Decimal]) -> float:
    with localcontext() as context:
        context.prec = 60
        return max(float(abs(Decimal(own) / one - 1)) for own, one in zip(found.tolist(), true, strict=True))


def test_a_right_angled_sum_is_within_one_place_of_sixty_digits() -> None:
    x, y = (RANDOM.normal(0.0, 300.0, 4000) * 10.0 ** RANDOM.integers(-3, 3, 4000) for _ in "xy")
    with localcontext() as context:
        context.prec = 60
        true = [(Decimal(a) ** 2 + Decimal(b) ** 2).sqrt() for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    assert worst(hypot(x, y), true) < 2.3e-16


def test_no_square_of_a_right_angled_sum_leaves_the_numbers() -> None:
    x = np.array([3.0, -3e200, 3e-320, 0.0, -7.1, np.inf])
    y = np.array([4.0, 4e200, 4e-320, 0.0, 0.0, 1.0])
    assert hypot(x, y) == pytest.approx([5.0, 5e200, 5e-320, 0.0, 7.1, np.inf], rel=2.3e-16)
    assert hypot(-0.1, 0.0) == 0.1


@pytest.mark.parametrize("exponent", [0.1, 0.8, 1.3, -2.7, 2.0, -1.0, 33.3, -60.2, 200.7])
def test_a_power_is_as_near_as_it_says(exponent: float) -> None:
    base = np.exp(RANDOM.uniform(-3.0, 3.0, 400))
    with localcontext() as context:
        context.prec = 60
        true = [Decimal(value) ** Decimal(exponent) for value in base.tolist()]
    with np.errstate(over="ignore"):  # of squares that no digit asks for
        found = power(base, exponent)
    assert worst(found, true) < 1.2e-16 * abs(exponent) + 2e-14


def test_squares_roots_and_inverses_are_those_of_the_processor() -> None:
    base = RANDOM.uniform(0.0, 900.0, 1000)
    for exponent, same in ((2.0, base * base), (0.5, np.sqrt(base)), (-1.0, 1 / base), (1.0, base)):
        np.testing.assert_array_equal(power(base, exponent), same)


def test_powers_at_the_borders_are_those_of_arithmetic() -> None:
    base = np.array([-2.0, -2.0, -8.0, 0.0, 0.0, 0.0, 1.0, -1.0, 1.5, 0.5, np.nan, 2.0, 4.0])
    exponent = np.array([65.0, -3.0, 1 / 3, 0.0, -1.0, 0.3, 1e300, 1e300, np.inf, 1e300, 0.0, np.nan, 1e-300])
    with np.errstate(all="ignore"):
        found = power(base, exponent)
    nan, inf = np.nan, np.inf
    np.testing.assert_array_equal(
        found, [-(2.0**65), -0.125, nan, 1.0, inf, 0.0, 1.0, 1.0, inf, 0.0, nan, nan, 1.0], strict=True
    )


def test_exponentials_and_logarithms_are_as_near_as_they_say() -> None:
    x = np.concatenate([RANDOM.uniform(-700.0, 700.0, 400), RANDOM.uniform(-1.0, 1.0, 400)])
    y = np.concatenate([np.exp(x), 1 + RANDOM.uniform(-1e-6, 1e-6, 400)])
    with localcontext() as context:
        context.prec = 60
        powers, numbers = [Decimal(value).exp() for value in x.tolist()], [Decimal(value) for value in y.tolist()]
        natural, decimal = [one.ln() for one in numbers], [one.log10() for one in numbers]
    assert worst(exp(x), powers) < 4e-16
    assert worst(ln(y), natural) < 4e-16
    assert worst(log10(y), decimal) < 6e-16


def test_exponentials_and_logarithms_at_the_borders() -> None:
    nan, inf = np.nan, np.inf
    with np.errstate(all="ignore"):
        np.testing.assert_array_equal(exp(np.array([nan, inf, 1e9, -1e9, 0.0])), [nan, inf, inf, 0.0, 1.0])
        np.testing.assert_array_equal(ln(np.array([nan, inf, 0.0, -1.0, 1.0])), [nan, nan, nan, nan, 0.0])
    assert ln(5e-324) == pytest.approx(-744.4400719213812, rel=4e-16)


@pytest.mark.parametrize(
    ("text", "digest"),
    [
        (
            "hypot(d, q) / sqrt(2) + abs(q)**1.3 - q**(d / 300)",
            "458ca1f6da03834e142eab9305c8c9f798e4dbd566f23dd81a812ca887a15545",
        ),
        ("exp(d / 99) + ln(q) * log10(q)", "a0253ccd60232f06300bba061283e579e485b43632d88205a0aced9298932449"),
    ],
)
def test_derived_channels_have_the_same_bits_on_every_machine(text: str, digest: str) -> None:
    d, q = np.arange(1, 2001) * 0.37 - 300.0, np.arange(2000, 0, -1) * 0.41
    values = parse(text).evaluate({"d": d, "q": q})
    assert np.isfinite(values).all()
    assert hashlib.sha256(values.astype("<f8").tobytes()).hexdigest() == digest
