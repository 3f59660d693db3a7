"""R from a whole curve, of two lumps that lose heat by other laws than the fit starts from."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from analytics.insulation.checks.whole_curve import LEAST_SAMPLES, STEFAN_BOLTZMANN, Curve, fit

Floats = NDArray[np.float64]
ROWS_S, LOAD_S = 120.0, 9000.0


def curve(resistance: float, emissivity_m2: float = 0.2, swing_K: float = 0.0, seed: int = 0) -> Curve:
    """Samples every 2 min, the switches between them, of 2,000 and 9,500 J/K under 450 W."""
    step, rows = 2.0, round(ROWS_S / 2.0)
    t = np.arange(0.0, 12_600.0, step)
    air = 21.0 + swing_K * np.sin(2.0 * np.pi * t / 20_000.0)
    power = np.where((t > 35.0) & (t <= LOAD_S + 71.0), 450.0, 0.0)
    winding = iron = air[0]
    course = np.empty_like(t)
    for k in range(t.size):
        course[k] = winding
        lost = [
            0.5 * abs(T - air[k]) ** 0.25 * (T - air[k])
            + emissivity_m2 * STEFAN_BOLTZMANN * ((T + 273.15) ** 4 - (air[k] + 273.15) ** 4)
            for T in (winding, iron)
        ]
        through = (winding - iron) / resistance
        winding += step / 2000.0 * (power[k] - through - 0.25 * lost[0])
        iron += step / 9500.0 * (through - lost[1])
    copper = course[::rows] + np.random.default_rng(seed).normal(0.0, 0.05, t[::rows].size)
    on = np.flatnonzero(power[::rows] > 0.0)
    return Curve(t[::rows], copper, power[::rows], air[::rows], int(on[0]), int(on[-1]) + 1)


def test_two_lumps_give_their_resistance() -> None:
    found = fit(curve(0.03))
    assert found is not None
    assert found.sd < 0.05 * 0.03
    assert abs(found.value - 0.03) < 2.5 * found.sd


def test_the_course_is_that_of_the_resistance_though_surfaces_darken_and_the_ambient_swings() -> None:
    first, later = fit(curve(0.03, 0.20, 1.0, 1)), fit(curve(0.036, 0.23, -2.0, 2))
    assert first is not None and later is not None
    assert later.value / first.value == pytest.approx(1.2, rel=0.07)


def test_a_curve_of_few_samples_says_nothing() -> None:
    whole = curve(0.03)
    few = slice(None, LEAST_SAMPLES - 1)
    assert fit(Curve(whole.t_s[few], whole.copper[few], whole.power[few], whole.air[few], 1, LEAST_SAMPLES - 1)) is None
