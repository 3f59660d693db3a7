"""Effects of several stresses on ln R: told apart where the plan tells them apart, and said where it does not."""

from __future__ import annotations

import numpy as np
import pytest

from analytics.insulation.courses.stress import effects

RNG = np.random.default_rng(5)


def campaign(soak_h: list[float], specimens: int = 6) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Checks before the first cycle and after each: specimen, hours, cycles."""
    hours = np.concatenate([[0.0], np.cumsum(soak_h)])
    names = [f"S{k}" for k in range(specimens) for _ in hours]
    return names, np.tile(hours, specimens), np.tile(np.arange(len(hours), dtype=np.float64), specimens)


def test_cycles_of_different_length_tell_hours_from_cycles() -> None:
    names, hours, cycles = campaign([4.0, 48.0, 2.0, 36.0, 3.0, 60.0, 1.0, 24.0])
    starts = np.repeat(RNG.normal(-3.8, 0.1, 6), len(hours) // 6)
    y = starts + 0.001 * hours + 0.02 * cycles + RNG.normal(0.0, 0.005, len(hours))
    found = {one.name: one for one in effects(names, y, np.full(len(y), 0.005), {"hours": hours, "cycles": cycles})}
    assert found["hours"].effect == pytest.approx(0.001, abs=4 * (found["hours"].sd or 0.0))
    assert found["cycles"].effect == pytest.approx(0.02, abs=4 * (found["cycles"].sd or 0.0))
    assert found["cycles"].sd is not None
    assert found["cycles"].sd < 0.004
    assert found["hours"].not_told_from == found["cycles"].not_told_from == ()


def test_cycles_of_one_length_cannot_tell_them_apart() -> None:
    names, hours, cycles = campaign([12.0] * 8)
    y = 0.001 * hours + RNG.normal(0.0, 0.005, len(hours))
    sd = np.full(len(y), 0.005)
    first, second = effects(names, y, sd, {"hours": hours, "cycles": cycles})
    assert first.not_told_from == ("cycles",)
    assert second.not_told_from == ("hours",)
    (alone,) = effects(names, y, sd, {"hours": hours})
    assert first.effect == pytest.approx(alone.effect, rel=1e-9)
    assert first.sd == pytest.approx(alone.sd, rel=1e-9)
    assert second.effect == pytest.approx(12.0 * (first.effect or 0.0)), "each is given as if it were all"


def test_cycles_of_another_length_in_each_oven_do_not_tell_what_each_specimens_own_rate_may_be() -> None:
    names, hours, cycles = campaign([48.0] * 10, 12)
    oven = np.array([int(name[1:]) % 3 for name in names])
    hours = hours * np.array([1.0, 2.0, 3.5])[oven] * (1.0 + 1e-5 * RNG.standard_normal(len(hours)))
    y = np.array([2e-3, 1e-3, 0.5e-3])[oven] * hours + RNG.normal(0.0, 0.005, len(hours))
    first, second = effects(names, y, np.full(len(y), 0.005), {"hours": hours, "cycles": cycles})
    assert (first.not_told_from, second.not_told_from) == (("cycles",), ("hours",))


def test_discharge_is_told_from_hours_and_cycles_that_are_one_column() -> None:
    names, hours, cycles = campaign([12.0] * 8)
    late = np.isin(names, ["S0", "S2", "S4"])
    discharge = np.where(late, np.maximum(hours - 48.0, 0.0), np.minimum(hours, 48.0))
    y = 0.001 * hours + 0.004 * discharge + RNG.normal(0.0, 0.005, len(hours))
    columns = {"hours": hours, "cycles": cycles, "discharge": discharge}
    found = {one.name: one for one in effects(names, y, np.full(len(y), 0.005), columns)}
    assert {name: one.not_told_from for name, one in found.items()} == {
        "hours": ("cycles",),
        "cycles": ("hours",),
        "discharge": (),
    }
    assert found["discharge"].effect == pytest.approx(0.004, abs=4 * (found["discharge"].sd or 0.0))
    assert found["hours"].effect == pytest.approx(0.001, abs=4 * (found["hours"].sd or 0.0))
    assert (found["discharge"].sd or 1.0) < 0.0005


def test_a_course_that_levels_off_is_not_put_down_to_what_was_done_early() -> None:
    seen = 0
    for seed in range(100):
        random = np.random.default_rng(seed)
        names, hours, cycles = campaign([12.0] * 12)
        y = 0.3 * -np.expm1(-hours / 60.0) + random.normal(0.0, 0.01, len(hours))
        columns = {"hours": hours, "cycles": cycles, "discharge": np.minimum(hours, 72.0)}
        found = effects(names, y, np.full(len(y), 0.01), columns)[2]
        seen += not found.not_told_from and abs(found.effect or 0.0) > 2.576 * (found.sd or 0.0)
    assert seen <= 5
    assert found.not_told_from == ("hours",), "what all had in the same cycles"


def test_what_is_nearly_a_bent_course_of_heat_is_not_told_from_it() -> None:
    names, hours, _ = campaign([12.0] * 12)
    y = 0.001 * hours + RNG.normal(0.0, 0.01, len(hours))
    found = effects(names, y, np.full(len(y), 0.01), {"hours": hours, "discharge": hours**1.2})
    assert [one.not_told_from for one in found] == [("discharge",), ("hours",)]


def test_of_stresses_that_add_up_to_each_other_none_is_told_from_another() -> None:
    names, hours, cycles = campaign([4.0, 48.0, 2.0, 36.0, 3.0, 60.0])
    both = hours + 10.0 * cycles
    y = 0.001 * hours + RNG.normal(0.0, 0.005, len(hours))
    found = effects(names, y, np.full(len(y), 0.005), {"hours": hours, "cycles": cycles, "discharge": both})
    assert [len(one.not_told_from) for one in found] == [2, 2, 2]


def test_a_stress_that_nobody_had_has_no_effect() -> None:
    names, hours, _ = campaign([12.0] * 5)
    found = effects(
        names, 0.001 * hours, np.full(len(hours), 0.01), {"hours": hours, "discharge": np.zeros(len(hours))}
    )
    assert found[0].effect == pytest.approx(0.001)
    assert (found[1].effect, found[1].sd) == (None, None)


def test_one_stress_alone_is_ordinary_least_squares_within_specimens() -> None:
    names, hours, _ = campaign([12.0, 20.0, 5.0], specimens=2)
    y = RNG.normal(0.0, 1.0, len(hours))
    (found,) = effects(names, y, np.ones(len(y)), {"hours": hours})
    dummies = np.column_stack([hours, np.array(names) == "S0", np.array(names) == "S1"]).astype(np.float64)
    expected, *_ = np.linalg.lstsq(dummies, y, rcond=None)
    assert found.effect == pytest.approx(expected[0])
    assert found.sd == pytest.approx(np.sqrt(np.linalg.inv(dummies.T @ dummies)[0, 0]))


def test_the_stated_error_covers_the_truth() -> None:
    inside = 0
    for seed in range(200):
        random = np.random.default_rng(seed)
        names, hours, cycles = campaign([4.0, 48.0, 2.0, 36.0, 3.0, 60.0])
        y = 0.001 * hours + 0.01 * cycles + random.normal(0.0, 0.01, len(hours))
        found = effects(names, y, np.full(len(y), 0.01), {"hours": hours, "cycles": cycles})[1]
        assert found.effect is not None
        assert found.sd is not None
        inside += abs(found.effect - 0.01) < 2.0 * found.sd
    assert inside >= 180
