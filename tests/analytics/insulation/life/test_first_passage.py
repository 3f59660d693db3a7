"""The life of a specimen from its checks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analytics.insulation.life.first_passage import first_passage

LN2 = math.log(2.0)


def test_a_clear_path_gives_the_interval_between_two_checks() -> None:
    found = first_passage([0, 100, 200, 300, 400], [-1.0, -0.9, -0.6, -0.1, 0.4], 0.01)
    assert (found.lower_h, found.upper_h) == (200.0, 300.0)


def test_a_path_that_stays_below_is_not_over() -> None:
    found = first_passage([0, 100, 200], [0.0, 0.1, 0.3], 0.02)
    assert (found.lower_h, found.upper_h) == (200.0, math.inf)


def test_a_check_too_near_to_tell_widens_the_interval_on_both_sides() -> None:
    near = first_passage([0, 100, 200, 300], [0.0, 0.3, LN2 + 0.01, 1.0], 0.03)
    assert (near.lower_h, near.upper_h) == (100.0, 300.0)
    also = first_passage([0, 100, 200, 300], [0.0, 0.3, LN2 - 0.01, 1.0], 0.03)
    assert (also.lower_h, also.upper_h) == (100.0, 300.0)


def test_a_last_check_too_near_to_tell_ends_nothing() -> None:
    found = first_passage([0, 100, 200], [0.0, 0.3, LN2 + 0.01], 0.03)
    assert (found.lower_h, found.upper_h) == (100.0, math.inf)


def test_a_dip_first_does_not_count_and_a_return_does_not_undo() -> None:
    found = first_passage([0, 50, 100, 150, 200], [0.0, -0.4, 0.1, 0.9, 0.2], 0.02)
    assert (found.lower_h, found.upper_h) == (100.0, 150.0)


def test_a_specimen_over_at_its_first_later_check_began_its_life_at_the_start() -> None:
    found = first_passage([10, 100], [0.0, 2.0], 0.02)
    assert (found.lower_h, found.upper_h) == (10.0, 100.0)


def test_rows_out_of_order_repeats_and_missing_ones_change_nothing_but_the_error() -> None:
    found = first_passage([300, 0, 200, 200, 100, 250], [1.0, 0.0, 0.68, 0.62, 0.3, math.nan], 0.03)
    assert (found.lower_h, found.upper_h) == (100.0, 300.0)
    often = first_passage([300, 0, 200, 100], [1.0, 0.0, 0.60, 0.3], [0.03, 0.005, 0.005, 0.03])
    assert (often.lower_h, often.upper_h) == (200.0, 300.0)


def test_too_few_checks_say_so() -> None:
    for dose, value in (([0.0], [0.0]), ([0.0, 0.0], [0.0, 0.1]), ([0.0, 10.0], [0.0, math.nan])):
        found = first_passage(dose, value, 0.02)
        assert found.lower_h is None
        assert "fewer than two doses" in found.why


@pytest.mark.parametrize("error", [0.01, 0.03])
def test_the_true_passage_is_inside_nearly_always(error: float) -> None:
    """Slopes that pass ln 2 at 500 h of dose, checked every 60 h."""
    random = np.random.default_rng(1)
    dose = np.arange(0.0, 901.0, 60.0)
    inside = 0
    for _ in range(400):
        found = first_passage(dose, LN2 * dose / 500.0 + error * random.standard_normal(dose.size), error)
        assert found.lower_h is not None
        assert found.upper_h is not None
        inside += found.lower_h < 500.0 <= found.upper_h
    assert inside >= 360
