"""The reference motor behaves as the paper says of its class: S1, S2 and WLTP (its sections 3.1 and 4.2)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from benchmarks.integrator import AMBIENT_DEGC, COOLANT_DEGC, frame, motor, wltp_like
from twin.compiled.kernel import Compiled, compile_network
from twin.motor.features import evaluate, monomials
from twin.run.simulate import Frame, simulate

CLASS_H_DEGC = 180.0


@pytest.fixture(scope="module")
def reference(plain: Any) -> Compiled:
    return compile_network(motor("reference_motor"), load=plain)


def _hot_spot(reference: Compiled, rpm: float, ampere: float, seconds: float, step_s: float) -> np.ndarray[Any, Any]:
    """Hottest winding (N + 1,) [degC] under a constant load, from a motor at coolant temperature."""
    steps = round(seconds / step_s)
    u = {"speed": np.full(steps, rpm / 16000), "current": np.full(steps, ampere / 450), "flow": np.ones(steps)}
    inputs = Frame(
        step_s,
        evaluate(monomials(reference.network), u, steps),
        np.tile([COOLANT_DEGC, AMBIENT_DEGC], (steps, 1)),
    )
    T = simulate(reference, inputs, np.full(len(reference.network.nodes), COOLANT_DEGC))
    copper = [i for i, node in enumerate(reference.network.nodes) if node.region == "copper"]
    hottest: np.ndarray[Any, Any] = T[:, copper].max(axis=1)
    return hottest


def test_s1_at_the_continuous_current_reaches_180_in_half_an_hour(reference: Compiled) -> None:
    hottest = _hot_spot(reference, 6500.0, 225.0, 3600.0, 2.0)
    assert hottest[900] == pytest.approx(CLASS_H_DEGC, abs=3)
    assert hottest[-1] - hottest[900] < 2, "thermal equilibrium"


def test_s2_at_the_current_limit_reaches_180_within_tens_of_seconds(reference: Compiled) -> None:
    reached = np.argmax(_hot_spot(reference, 3000.0, 450.0, 60.0, 0.5) > CLASS_H_DEGC) * 0.5
    assert 10 < reached < 60


def test_a_wltp_stays_moderate(reference: Compiled) -> None:
    inputs = frame(reference.network, wltp_like(), 2.0)
    T = simulate(reference, inputs, np.full(len(reference.network.nodes), COOLANT_DEGC))
    assert 80 < T.max() < 150
