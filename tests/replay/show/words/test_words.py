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
