"""Ends of curves whose ends are known, and a resistance whose body still warms."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from analytics.insulation.checks.steady import LAST_S, resistance_at_rest, settle

Floats = NDArray[np.float64]
TAU_S, RISE_K, AMBIENT = 2000.0, 100.0, 20.0
ONE = np.ones(1)


def times(hours: float, step_s: float = 10.0) -> Floats:
    return np.arange(0.0, hours * 3600.0 + 1.0, step_s)


def rising(t_s: Floats, seed: int, noise: float = 0.1) -> Floats:
    """(N, 1): to 120 degC with 2,000 s, and a bend of 10 K with 700 s."""
    y = AMBIENT + RISE_K - 90.0 * np.exp(-t_s / TAU_S) - 10.0 * np.exp(-t_s / 700.0)
    return np.asarray(y + np.random.default_rng(seed).normal(0.0, noise, t_s.size))[:, None]


def test_a_curve_that_has_reached_its_end_is_steady_and_its_mean_of_10_min_the_answer() -> None:
    t = times(4.0)
    y = rising(t, 1)
    found = settle(t, y, None, ONE)
    assert found is not None
    assert found.steady.all() and not found.lost.any()
    assert found.last[0] == pytest.approx(y[t > t[-1] - LAST_S].mean())
    assert found.last[0] == pytest.approx(AMBIENT + RISE_K, abs=0.2)


def test_a_curve_that_was_stopped_is_extrapolated_and_its_sd_covers_the_truth() -> None:
    scores = []
    for seed in range(20):
        t = times(1.25)
        found = settle(t, rising(t, seed), None, ONE)
        assert found is not None
        assert not found.steady[0] and not found.lost[0]
        assert found.last[0] < AMBIENT + RISE_K - 8.0
        scores.append((found.final[0] - AMBIENT - RISE_K) / found.sd[0])
    assert np.max(np.abs(scores)) < 2.0


def test_a_curve_that_was_stopped_after_half_its_time_constant_is_not_told() -> None:
    t = times(0.45)
    found = settle(t, rising(t, 3), None, ONE)
    assert found is not None
    assert found.lost.all()


def test_series_of_one_body_share_its_rate() -> None:
    t = times(1.25)
    weak = 30.0 - 2.0 * np.exp(-t / TAU_S) + np.random.default_rng(4).normal(0.0, 0.3, t.size)
    together = settle(t, np.column_stack([rising(t, 4)[:, 0], weak]), None, np.ones(2))
    alone = settle(t, weak[:, None], None, ONE)
    assert together is not None and alone is not None
    assert together.tau_s == pytest.approx(TAU_S, rel=0.15)
    assert abs(together.final[1] - 30.0) < 3.0 * together.sd[1]
    assert together.sd[1] < alone.sd[0]


def test_an_ambient_that_swings_does_not_move_the_end() -> None:
    t = times(3.0)
    air = AMBIENT + 2.0 * np.sin(2.0 * np.pi * t / 7200.0)
    felt = np.empty_like(air)
    felt[0] = air[0]
    for k in range(1, t.size):
        felt[k] = felt[k - 1] + (t[k] - t[k - 1]) / TAU_S * (air[k] - felt[k - 1])
    y = rising(t, 5) - AMBIENT + felt[:, None]
    goes_to = air[t > t[-1] - LAST_S].mean() + RISE_K
    known, unknown = settle(t, y, air, ONE), settle(t, y, None, ONE)
    assert known is not None and unknown is not None
    assert known.final[0] == pytest.approx(goes_to, abs=0.4)
    assert abs(known.final[0] - goes_to) < abs(unknown.final[0] - goes_to)


def test_what_has_risen_is_not_said_to_end_below_where_it_is() -> None:
    t = times(2.5)
    for phase in np.linspace(0.0, 6.0, 9):
        swings = 2.0 * np.sin(2.0 * np.pi * t / 14_400.0 + phase)
        found = settle(t, rising(t, 8) + swings[:, None], None, ONE)
        assert found is not None
        assert found.final[0] > found.last[0] - 2.0
        assert found.sd[0] < 4.0


def test_less_than_20_min_says_nothing() -> None:
    t = times(0.3)
    assert settle(t, rising(t, 6), None, ONE) is None
    assert resistance_at_rest(t, t, t, 1.0 + t) is None


def warming(t_s: Floats, resistance: float, head_loss: float = 2.4, film: float = 3.0) -> tuple[Floats, Floats]:
    """(drop, iron) of a winding of 2,500 J/K on an iron of 8,000 J/K under 500 W, both losing heat, from rest at 20
    degC."""
    winding = iron = AMBIENT
    drops, irons = [], []
    inner = np.diff(t_s, prepend=t_s[0] - 10.0)
    for step in inner:
        for _ in range(10):
            through = (winding - iron) / resistance
            winding += step / 10.0 * (500.0 - through - head_loss * (winding - AMBIENT)) / 2500.0
            iron += step / 10.0 * (through - film * (iron - AMBIENT)) / 8000.0
        drops.append(winding - iron)
        irons.append(iron)
    return np.array(drops), np.array(irons)


def at_rest(resistance: float, head_loss: float = 2.4, film: float = 3.0) -> float:
    """(T_w - T_i) / P of `warming` after for ever."""
    return resistance / (1.0 + head_loss * (resistance + 1.0 / film))


@pytest.mark.parametrize("hours", [0.75, 1.25, 3.0])
def test_a_resistance_is_the_one_at_rest_though_the_body_still_warms(hours: float) -> None:
    t = times(hours)
    drop, iron = warming(t, 0.03)
    random = np.random.default_rng(7)
    found = resistance_at_rest(
        t, drop + random.normal(0.0, 0.03, t.size), iron + random.normal(0.0, 0.05, t.size), np.full(t.size, 500.0)
    )
    assert found is not None
    truth = at_rest(0.03)
    assert found.value == pytest.approx(truth, rel=0.01)
    assert abs(found.value - truth) < 3.0 * found.sd
    if hours < 1.0:
        late = t > t[-1] - LAST_S
        assert abs(drop[late].mean() / 500.0 / truth - 1.0) > 0.1, "else the plain mean would do"


def test_a_resistance_of_bodies_that_do_not_change_is_the_plain_mean() -> None:
    t = times(0.5)
    found = resistance_at_rest(t, np.full(t.size, 40.0), np.full(t.size, 60.0), np.full(t.size, 1000.0))
    assert found is not None
    assert found.value == pytest.approx(0.04, rel=1e-9)
