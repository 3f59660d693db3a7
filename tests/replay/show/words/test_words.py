from __future__ import annotations

import pytest

from replay.show.words import words


@pytest.mark.parametrize(
    ("count", "says"), [(0, "0.1 kB"), (300, "0.3 kB"), (6_200_000, "6.2 MB"), (1_440_000_000, "1.4 GB")]
)
def test_bytes_are_said_in_the_unit_that_people_read(count: int, says: str) -> None:
    assert words.size(count) == says


@pytest.mark.parametrize(
    ("value", "says"), [(3000.0, "3,000"), (2.46, "2.5"), (-20.0, "−20"), (-2.5, "−2.5"), (-0.0, "0"), (-0.04, "0.0")]
)
def test_a_number_below_zero_has_the_sign_that_pictures_have_and_zero_has_none(value: float, says: str) -> None:
    assert words.number(value) == says


@pytest.mark.parametrize(
    ("value", "digits", "says"),
    [(1234.56, 1, "1,234.6"), (-1.44, 1, "−1.4"), (-0.04, 1, "0.0"), (-0.004, 2, "0.00"), (float("nan"), 1, "–")],
)
def test_a_number_of_a_table_has_its_digits_and_nothing_has_no_sign(value: float, digits: int, says: str) -> None:
    assert words.fixed(value, digits) == says


@pytest.mark.parametrize(
    ("before", "after", "says"), [(7.71, 1.14, "+6.6"), (0.19, 0.207, "−0.02"), (0.5, 0.5, "0.0"), (0.3, 0.5, "−0.2")]
)
def test_a_difference_has_the_digits_of_what_it_is_between(before: float, after: float, says: str) -> None:
    assert words.less(*words.figures([before, after])) == says


@pytest.mark.parametrize(
    ("value", "says"), [(0.03124, "0.0312"), (14.25, "14.2"), (310.2, "310"), (37_612.0, "37,612"), (-1.1, "−1.1")]
)
def test_a_number_of_three_digits_is_whole_above_them_and_has_no_power_of_ten(value: float, says: str) -> None:
    assert words.digits(value) == says
