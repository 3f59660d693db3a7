"""The resistance behind the minutes after a switch, of two lumps in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from analytics.insulation.checks.first_minutes import LENGTH_S, SwitchSamples, fit, stretch

Floats = NDArray[np.float64]
C_W, C_I, WATTS = 2500.0, 8000.0, 500.0


def factor() -> float:
    return (C_I / (C_W + C_I)) ** 2


def step_response(x: Floats, resistance: float) -> Floats:
    """Rise [K] of the winding `x` after a step of 500 W, no heat lost."""
    total = C_W + C_I
    tau = resistance * C_W * C_I / total
    after = np.maximum(x, 0.0)
    return np.asarray(WATTS * (after / total + resistance * factor() * (1.0 - np.exp(-after / tau))))


def heating(
    resistance: float, switched_s: float, seed: int = 0, noise: float = 0.0, lead_s: float = 300.0
) -> SwitchSamples:
    t = np.arange(-lead_s, LENGTH_S + 60.0, 10.0)
    y = 20.0 + step_response(t - switched_s, resistance)
    y += np.random.default_rng(seed).normal(0.0, noise, t.size) if noise else 0.0
    power = np.where(t > switched_s, WATTS, 0.0)
    found = stretch(t, y, power, int(np.argmax(power > 0.0)))
    assert found is not None
    return found


def cooling(resistance: float, switched_s: float, seed: int = 0, noise: float = 0.0) -> SwitchSamples:
    t = np.arange(-300.0, LENGTH_S + 60.0, 10.0)
    y = 120.0 - step_response(t - switched_s, resistance)
    y += np.random.default_rng(seed).normal(0.0, noise, t.size) if noise else 0.0
    power = np.where(t > switched_s, 0.0, WATTS)
    found = stretch(t, y, power, int(np.argmax(power == 0.0)))
    assert found is not None
    return found


@pytest.mark.parametrize("switched_s", [0.5, 4.0, 9.5])
def test_two_lumps_give_their_resistance_times_the_square_of_the_irons_share(switched_s: float) -> None:
    found = fit([heating(0.03, switched_s), cooling(0.03, switched_s)])
    assert found.value == pytest.approx(0.03 * factor(), rel=0.02)


@pytest.mark.parametrize("worse", [0.9, 1.1, 1.38])
def test_the_course_over_checks_is_that_of_the_resistance(worse: float) -> None:
    first, later = (
        fit([heating(0.03 * ratio, 3.0, 1, 0.03), cooling(0.03 * ratio, 6.0, 2, 0.03)]) for ratio in (1.0, worse)
    )
    assert later.value / first.value == pytest.approx(worse, rel=0.02)


def test_the_sd_covers_the_scatter_over_noise_and_moments_of_the_switch() -> None:
    random = np.random.default_rng(11)
    found = [
        fit([heating(0.03, random.uniform(0.2, 9.8), k, 0.05), cooling(0.03, random.uniform(0.2, 9.8), 99 - k, 0.05)])
        for k in range(12)
    ]
    score = [(one.value - 0.03 * factor()) / one.sd for one in found]
    assert 0.1 < float(np.sqrt(np.mean(np.square(score)))) < 1.5


def test_a_log_that_begins_under_load_is_less_certain_and_a_switch_off_makes_up_for_it() -> None:
    t = np.arange(0.0, LENGTH_S + 60.0, 10.0)
    begun = stretch(t, 20.0 + step_response(t, 0.03), np.full(t.size, WATTS), 0)
    assert begun is not None
    alone, together = fit([begun]), fit([begun, cooling(0.03, 5.0)])
    assert alone.sd > 1.5 * fit([heating(0.03, 5.0)]).sd
    assert abs(alone.value - 0.03 * factor()) < 3.0 * alone.sd
    assert together.value == pytest.approx(0.03 * factor(), rel=0.03)


def test_a_slow_film_and_an_ambient_that_drifts_do_not_enter() -> None:
    still = heating(0.03, 5.0)
    x = np.maximum(still.t_s - 5.0, 0.0)
    drifting = SwitchSamples(
        still.t_s,
        still.copper - 8.0 * (x / LENGTH_S) ** 2 + 1.5 * x / LENGTH_S,
        still.power,
        still.from_s,
        still.to_s,
        still.before_W,
    )
    assert fit([drifting]).value == pytest.approx(fit([still]).value, rel=0.005)


def test_a_power_that_rises_with_the_copper_is_followed() -> None:
    t = np.arange(-300.0, LENGTH_S + 60.0, 10.0)
    tau = 0.03 * C_W * C_I / (C_W + C_I)
    fine = np.arange(0.0, LENGTH_S + 60.0, 0.5)
    power = WATTS * (1.0 + 0.3 * fine / LENGTH_S)
    fast = np.zeros_like(fine)
    for k in range(1, fine.size):
        fast[k] = fast[k - 1] + 0.5 / tau * ((power[k] + power[k - 1]) / 2.0 - fast[k - 1])
    stored = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 4.0)]) / (C_W + C_I)
    y = 20.0 + np.interp(t, fine, stored + 0.03 * factor() * fast, left=0.0)
    part = stretch(t, y, np.where(t > 0.0, np.interp(t, fine, power), 0.0), int(np.argmax(t > 0.0)))
    assert part is not None
    assert fit([part]).value == pytest.approx(0.03 * factor(), rel=0.03)


def test_too_short_or_too_coarse_a_record_is_no_stretch() -> None:
    t = np.arange(0.0, 600.0, 10.0)
    assert stretch(t, step_response(t, 0.03), np.full(t.size, WATTS), 0) is None
    coarse = np.arange(0.0, 7200.0, 120.0)
    assert stretch(coarse, step_response(coarse, 0.03), np.full(coarse.size, WATTS), 0) is None


def test_a_fit_to_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="no stretch of heating or cooling"):
        fit([])
