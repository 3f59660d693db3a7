"""Effects of several stresses on ln R: told apart where the plan tells them apart, and said where it does not."""

from __future__ import annotations

import numpy as np
import pytest

from analytics.insulation.stress import effects

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
    first, second = effects(names, y, np.full(len(y), 0.005), {"hours": hours, "cycles": cycles})
    assert first.not_told_from == ("cycles",)
    assert second.not_told_from == ("hours",)


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
