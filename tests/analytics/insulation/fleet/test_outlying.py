"""Outlying specimens and batches: found where they are, none where there is none, few specimens and exchanged sensors
included."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.stats import norm

from analytics.insulation.fleet import outlying
from analytics.insulation.fleet.outlying import FleetAssessment, SpecimenHealth, assess
from analytics.insulation.fleet.slopes import slopes, step_or_slope
from analytics.insulation.fleet.spread import spread

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SD = 0.03
RATE, RATE_SD = 3e-4, 8e-5  # of ln R per hour


@dataclass
class Fleet:
    """120 motors in six batches with 3 to 21 checks each, 12 h apart, whose errors have the tails of Student's with
    five degrees."""

    who: Ints
    dose: Floats
    y: Floats
    batch: list[str | None]

    def add(self, motors: list[int], rate: float) -> None:
        """Make some age faster."""
        rows = np.isin(self.who, motors)
        self.y[rows] += rate * self.dose[rows]

    def assess(self) -> FleetAssessment:
        rows = np.random.default_rng(0).permutation(len(self.who))
        names, batches = [f"M{k:03d}" for k in self.who[rows]], [self.batch[k] for k in self.who[rows]]
        return assess(names, batches, self.dose[rows], self.y[rows], SD)


def _fleet(seed: int, motors: int = 120, batches: int = 6, checks: tuple[int, int] = (3, 21)) -> Fleet:
    random = np.random.default_rng([seed, 11])
    counts = random.integers(checks[0], checks[1] + 1, motors)
    who = np.repeat(np.arange(motors), counts)
    dose = np.concatenate([np.arange(n) * 12.0 for n in counts])
    of = np.arange(motors) % batches
    rate = RATE + RATE_SD * random.standard_normal(motors) + 2e-5 * random.standard_normal(batches)[of]
    y = -3.85 + 0.06 * random.standard_normal(motors)[who] + rate[who] * dose
    y += SD * np.sqrt(0.6) * random.standard_t(5.0, len(who))
    return Fleet(who, dose, y, [f"B{k + 1}" for k in of])


def _outlying(found: FleetAssessment) -> list[SpecimenHealth]:
    """The worst first."""
    return sorted((s for s in found.specimens if s.outlying), key=lambda s: -(s.score or 0.0))


def _listed(found: FleetAssessment) -> tuple[list[str], list[str]]:
    return [s.specimen for s in _outlying(found)], [b.batch for b in found.batches if b.outlying]


# ---- fleets --------------------------------------------------------------------------------------------------------


def test_nothing_is_listed_where_nothing_is() -> None:
    listed = [_listed(_fleet(seed).assess()) for seed in range(12)]
    assert sum(bool(specimens) for specimens, _ in listed) <= 2
    assert sum(bool(batches) for _, batches in listed) <= 1


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_bad_batch_is_listed_and_its_members_are_not(seed: int) -> None:
    fleet = _fleet(seed)
    fleet.add([k for k in range(120) if fleet.batch[k] == "B4"], 6e-4)
    found = fleet.assess()
    assert _listed(found) == ([], ["B4"])
    bad = next(b for b in found.batches if b.batch == "B4")
    assert bad.slope_percent_per_100h == pytest.approx(9.0, abs=1.5)
    assert found.slope_percent_per_100h == pytest.approx(3.0, abs=0.6)


def test_a_few_bad_motors_are_listed_the_worst_first() -> None:
    fleet = _fleet(3, checks=(12, 21))
    fleet.add([17], 1.2e-3)
    fleet.add([50], 2.4e-3)
    found = fleet.assess()
    assert _listed(found) == (["M050", "M017"], [])
    worst, next_worst = _outlying(found)
    assert worst.slope_percent_per_100h == pytest.approx(27.0, abs=4.0)
    assert (worst.score or 0.0) > (next_worst.score or 0.0) > 5.0


def test_a_motor_that_stands_out_of_a_bad_batch_is_listed_beside_it() -> None:
    fleet = _fleet(4, checks=(12, 21))
    fleet.add([k for k in range(120) if fleet.batch[k] == "B1"], 6e-4)
    fleet.add([6], 2.4e-3)
    assert _listed(fleet.assess()) == (["M006"], ["B1"])


def test_motors_of_a_bad_batch_whose_rates_multiply_are_not_listed_beside_it() -> None:
    random = np.random.default_rng([9, 12])
    dose = np.arange(16) * 12.0
    rate = RATE * (1.0 + 0.25 * random.standard_normal(160)) * np.where(np.arange(160) % 8 == 3, 3.0, 1.0)
    y = rate[:, None] * dose + 0.01 * random.standard_normal((160, 16))
    names, batches = [f"M{k:03d}" for k in range(160)], [f"B{k % 8 + 1}" for k in range(160)]
    found = assess(np.repeat(names, 16).tolist(), np.repeat(batches, 16).tolist(), np.tile(dose, 160), y.ravel(), 0.01)
    assert _listed(found) == ([], ["B4"])


def _multiplied(
    seed: int, motors: int, batches: int, spread: float, of_batches: float, bad: int = 0
) -> FleetAssessment:
    """Twelve checks of each, 12 h apart, that repeat to 1 %; log-normal rates, the first `bad` motors ten times as
    fast."""
    random = np.random.default_rng([seed, 13])
    dose, batch = np.arange(12) * 12.0, np.arange(motors) % batches
    rate = RATE * np.exp(spread * random.standard_normal(motors) + of_batches * random.standard_normal(batches)[batch])
    rate[:bad] *= 10.0
    y = rate[:, None] * dose + 0.01 * random.standard_normal((motors, 12))
    names, batch_names = [f"M{k:03d}" for k in range(motors)], [f"B{k:02d}" for k in batch]
    rows = [name for name in names for _ in dose], [name for name in batch_names for _ in dose]
    return assess(*rows, np.tile(dose, motors), y.ravel(), 0.01)


def test_healthy_motors_with_log_normal_rates_are_not_listed() -> None:
    assert sum(bool(_listed(_multiplied(seed, 150, 3, 0.8, 0.0))[0]) for seed in range(4)) <= 1


def test_motors_that_are_far_off_even_so_are_listed_first() -> None:
    assert set(_listed(_multiplied(0, 150, 3, 0.3, 0.0, bad=2))[0][:2]) == {"M000", "M001"}


def test_batches_that_all_differ_a_little_are_not_listed() -> None:
    assert sum(bool(_listed(_multiplied(seed, 120, 12, 0.1, 0.1))[1]) for seed in range(4)) <= 1


def test_motors_that_go_bad_late_are_listed_and_not_taken_for_exchanged_sensors() -> None:
    listed = 0
    for seed in range(3):
        fleet = _fleet(seed, checks=(16, 21))
        late = [5, 25, 45, 65]
        rows = np.isin(fleet.who, late)
        fleet.y[rows] += 3e-3 * np.maximum(fleet.dose[rows] - 96.0, 0.0)
        listed += len({f"M{k:03d}" for k in late} & set(_listed(fleet.assess())[0]))
    assert listed >= 10


def test_an_exchanged_sensor_is_no_bad_motor() -> None:
    fleet = _fleet(5, checks=(12, 21))
    rows = np.flatnonzero(fleet.who == 20)
    fleet.y[rows[len(rows) // 2 :]] += 0.25
    found = fleet.assess()
    stepped = next(s for s in found.specimens if s.specimen == "M020")
    assert not stepped.outlying
    assert stepped.step_at_dose_h == pytest.approx(fleet.dose[rows[len(rows) // 2]])
    assert stepped.slope_percent_per_100h == pytest.approx(3.0, abs=6.0)


def test_a_course_that_all_share_makes_nobody_outlying_however_early_it_ends() -> None:
    """Everybody's insulation gets worse quickly at first; a third of the motors were seen at first only."""
    fleet = _fleet(6, checks=(15, 21))
    early = (fleet.who % 3 == 0) & (fleet.dose > 50.0)
    rows = np.flatnonzero(~early)
    fleet = Fleet(fleet.who[rows], fleet.dose[rows], fleet.y[rows], fleet.batch)
    fleet.y += 0.3 * -np.expm1(-fleet.dose / 60.0)
    assert _listed(fleet.assess()) == ([], [])


def test_rows_in_any_order_and_missing_rows_make_the_same_answer() -> None:
    fleet = _fleet(7, motors=40)
    names, batches = [f"M{k:03d}" for k in fleet.who], [fleet.batch[k] for k in fleet.who]
    first = assess([*names, "M000"], [*batches, "B1"], np.append(fleet.dose, 12.0), np.append(fleet.y, np.nan), SD)
    again = fleet.assess()
    assert [s.score for s in again.specimens] == pytest.approx([s.score for s in first.specimens], abs=1e-6)


# ---- few -----------------------------------------------------------------------------------------------------------


def _stators(rates: ArrayLike, batches: Sequence[str | None]) -> FleetAssessment:
    random = np.random.default_rng(8)
    rate = np.asarray(rates, np.float64)
    who, dose = np.repeat(np.arange(len(rate)), 17), np.tile(np.arange(17) * 12.0, len(rate))
    y = rate[who] * dose + 0.008 * random.standard_normal(len(who))
    return assess([f"S{k}" for k in who], [batches[int(k)] for k in who], dose, y, 0.008)


def test_a_bad_batch_of_three_stators_is_told_from_three_healthy_ones() -> None:
    found = _stators([3e-4, 4e-4, 3.5e-4, 2e-3, 2.2e-3, 1.9e-3], ["B1"] * 3 + ["B2"] * 3)
    assert _listed(found) == ([], ["B2"])


def test_a_bad_batch_of_two_among_six_bent_courses_is_told() -> None:
    """All of them flat first; the bend is no error of their slopes."""
    random = np.random.default_rng(15)
    rate = np.array([8e-4, 9e-4, 7.5e-4, 8.5e-4, 1.7e-3, 1.55e-3])
    dose = np.arange(17) * 12.0
    y = rate[:, None] * 2.0 * np.maximum(dose - 96.0, 0.0) + 0.008 * random.standard_normal((6, 17))
    names, batches = np.repeat([f"S{k}" for k in range(6)], 17), np.repeat(["B1"] * 4 + ["B2"] * 2, 17)
    found = assess(names.tolist(), batches.tolist(), np.tile(dose, 6), y.ravel(), 0.008)
    assert _listed(found) == ([], ["B2"])


@pytest.mark.parametrize(
    "batches", [["B1"] * 2 + ["B2"] * 2 + ["B3"] * 2, ["B1"] * 3 + ["B2"] * 3, ["B1"] * 6, [None] * 6]
)
def test_the_one_stator_of_six_that_ages_is_listed_however_they_are_batched(batches: Sequence[str | None]) -> None:
    """The mate of its batch and the spread of the six would hide it, were it counted in them."""
    found = _stators([0.0, 2e-5, -2e-5, 3e-5, -3e-5, 6e-4], batches)
    assert _listed(found) == (["S5"], [])


def test_the_further_off_a_stator_is_the_smaller_is_its_p_value() -> None:
    batches = ["B1", "B1", "B2", "B2", "B3", "B3"]
    found = [
        _stators([8e-4, 9e-4, 7.5e-4, 8.5e-4, 8e-4, rate], batches).specimens[-1] for rate in (1.6e-3, 2.4e-3, 4e-3)
    ]
    p_values = np.array([one.p_value for one in found], np.float64)
    assert (np.diff(np.log(p_values)) < -0.5).all()


@pytest.mark.parametrize("batches", [["B1"] * 4 + ["B2"] * 2, ["B1"] * 2 + ["B3"] * 2 + ["B2"] * 2])
def test_a_batch_of_two_that_ages_faster_than_four_others_by_seven_tenths_is_listed(
    batches: Sequence[str | None],
) -> None:
    found = _stators([8e-4, 9e-4, 7.5e-4, 8.5e-4, 1.45e-3, 1.35e-3], batches)
    assert _listed(found) == ([], ["B2"])


def test_few_healthy_stators_are_not_listed_more_often_than_is_said() -> None:
    """Rates that differ by a fifth, in three batches of two: 1 of 20 is what is said, 5 of 40 has a chance of 1 in 20
    then."""
    random = np.random.default_rng(33)
    batches = ["B1", "B1", "B2", "B2", "B3", "B3"]
    found = [_listed(_stators(8e-4 * (1.0 + 0.2 * random.standard_normal(6)), batches)) for _ in range(40)]
    assert sum(listed != ([], []) for listed in found) <= 4


def test_stators_that_all_differ_make_no_batch_bad() -> None:
    found = _stators([1e-4, 1.5e-3, 6e-4, 4e-4, 1.9e-3, 9e-4], ["B1"] * 3 + ["B2"] * 3)
    assert _listed(found) == ([], [])


def test_a_single_batch_is_not_compared() -> None:
    found = _stators([3e-4, 4e-4, 3e-4], ["B1", "B1", "B1"])
    assert found.batches[0].score is None
    assert "the only one" in found.batches[0].why
    assert [s.score is not None for s in found.specimens] == [True] * 3


def test_without_batches_specimens_are_compared_all_the_same() -> None:
    found = _stators([3e-4, 4e-4, 3.5e-4, 3e-4, 2.5e-4, 4e-3], [None] * 6)
    assert _listed(found) == (["S5"], [])
    assert found.batches == ()


@pytest.mark.parametrize("rows", [0, 1, 2])
def test_what_cannot_be_compared_says_why(rows: int) -> None:
    names = [f"S{k}" for k in range(rows) for _ in range(3)]
    found = assess(names, ["B1"] * len(names), [0.0, 12.0, 24.0] * rows, np.zeros(len(names)), 0.01)
    assert all("fewer than 3" in s.why for s in found.specimens)
    assert all("fewer than 3" in b.why for b in found.batches)
    assert found.slope_percent_per_100h is None


@pytest.mark.parametrize("dose_h", [5.0, 461.1])  # the mean of 461.1 alone is rounded
def test_a_specimen_with_one_dose_is_named_as_such(dose_h: float) -> None:
    names = ["a"] * 3 + ["b"] * 3 + ["c"] * 3 + ["d"]
    found = assess(names, [None] * 10, [0.0, 12.0, 24.0] * 3 + [dose_h], np.zeros(10), 0.007)
    lone = found.specimens[-1]
    assert (lone.specimen, lone.slope_percent_per_100h, lone.score) == ("d", None, None)
    assert "two different doses" in lone.why


# ---- the parts -----------------------------------------------------------------------------------------------------


def test_the_list_of_benjamini_and_hochberg_is_reproduced() -> None:
    """The example of section 3.2 of J. R. Stat. Soc. B 57 (1995) 289: four of fifteen at 0.05."""
    p = [
        0.0001,
        0.0004,
        0.0019,
        0.0095,
        0.0201,
        0.0278,
        0.0298,
        0.0344,
        0.0459,
        0.3240,
        0.4262,
        0.5719,
        0.6528,
        0.7590,
        1.0,
    ]
    found = outlying._listed(np.zeros(len(p)), np.array(p), 0.05)
    assert [one.outlying for one in found] == [True] * 4 + [False] * 11


def test_slopes_and_their_errors_are_those_of_least_squares_for_small_residuals() -> None:
    random = np.random.default_rng(9)
    who = np.repeat(np.arange(3), [5, 9, 2])
    dose, sd = random.uniform(0.0, 100.0, 16), random.uniform(0.01, 0.03, 16)
    y = 1.0 + 2e-3 * dose + 0.5 * sd * random.standard_normal(16)
    found = slopes(who, dose, y, sd)
    for k in range(3):
        of = who == k
        design = np.column_stack([np.ones(of.sum()), dose[of]]) / sd[of, None]
        covariance = np.linalg.inv(design.T @ design)
        assert found.slope[k] == pytest.approx((covariance @ design.T @ (y[of] / sd[of]))[1], rel=1e-6)
        assert found.sd[k] == pytest.approx(found.factor[k] * np.sqrt(covariance[1, 1]), rel=1e-9)


def test_the_scale_of_the_errors_is_learnt_from_their_scatter() -> None:
    random = np.random.default_rng(10)
    who, dose = np.repeat(np.arange(60), 10), np.tile(np.arange(10) * 12.0, 60)
    y = 0.02 * random.standard_normal(600)
    assert slopes(who, dose, y, np.full(600, 0.01)).scale == pytest.approx(2.0, rel=0.1)
    y[::50] += 1.0
    assert slopes(who, dose, y, np.full(600, 0.01)).scale == pytest.approx(2.0, rel=0.25)


def test_a_step_and_a_slope_are_weighed() -> None:
    dose, sd = np.arange(20, dtype=np.float64) * 12.0, np.full(20, 0.02)
    noise = 0.02 * np.random.default_rng(1).standard_normal(20)
    usual = 3e-4 * dose
    stepped = step_or_slope(dose, usual + noise + 0.15 * (dose >= 120.0), sd, 3e-4, 1e-4, 1e-3)
    assert stepped is not None
    assert stepped.at_dose_h == 120.0
    assert stepped.slope == pytest.approx(3e-4, abs=3.0 * stepped.sd)
    assert step_or_slope(dose, usual + noise + 1e-3 * dose, sd, 3e-4, 1e-4, 1e-3) is None


def test_the_spread_is_what_it_was_made_with_and_does_not_follow_the_few_that_stand_out() -> None:
    random = np.random.default_rng(2)
    group = np.repeat(np.arange(4), 100)
    error = random.uniform(0.5, 2.0, 400)
    value = (
        np.array([0.0, 5.0, -3.0, 1.0])[group] + 1.0 * random.standard_normal(400) + error * random.standard_normal(400)
    )
    found = spread(value, error**2, group, 5, 0.3, 0.01, 3.0)
    assert np.sqrt(found.tau_square) == pytest.approx(1.0, rel=0.2)
    assert found.centre[:4] == pytest.approx([0.0, 5.0, -3.0, 1.0], abs=0.6)
    assert np.isnan(found.centre[4])
    assert np.isinf(found.variance[4])
    value[::20] += 50.0
    wild = spread(value, error**2, group, 5, 0.3, 0.01, 3.0)
    assert wild.centre[:4] == pytest.approx(found.centre[:4], abs=0.5)
    assert wild.tau_square < 3.0 * found.tau_square


def test_two_values_have_the_usual_spread() -> None:
    found = spread(np.array([10.0, 10.0]), np.array([1e-6, 1e-6]), np.array([0, 1]), 2, 0.3, 0.01, 3.0)
    assert np.sqrt(found.tau_square) == pytest.approx(3.0, rel=1e-3)


def test_scores_of_a_large_healthy_fleet_are_standard_normal() -> None:
    fleet = _fleet(12, motors=400)
    scores = np.array([s.score for s in fleet.assess().specimens], np.float64)
    assert np.quantile(scores, [0.25, 0.5, 0.75]) == pytest.approx(norm.ppf([0.25, 0.5, 0.75]), abs=0.2)
