"""The published HUST network as our motor file gives the published errors on the published recordings.

Reference: DOI 10.1109/TPEL.2024.3409388 and the authors' public notebook; recordings and motor file in
examples/hust_motor.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from made.places import EXAMPLES
from replay.engine.files.motor_file import read_motor
from twin.compiled.kernel import Compiled, compile_network
from twin.motor.features import evaluate, monomials
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]

HUST = EXAMPLES / "hust_motor"
PEAK_A = 370.0
PUBLISHED_MAE_K = {  # winding, stator, rotor
    1: (0.6, 0.5, 0.6),
    3: (3.6, 3.3, 4.4),
    9: (5.3, 5.5, 2.7),
    10: (6.9, 6.9, 2.3),
    12: (1.6, 1.5, 2.8),
}


@cache
def _motor() -> Compiled:
    return compile_network(read_motor((HUST / "motor.toml").read_bytes(), "motor.toml"))


@cache
def _recording(number: int) -> dict[str, Floats]:
    rows = np.genfromtxt(HUST / f"id_{number}.csv.gz", delimiter=",", names=True)
    return {name: rows[name] for name in rows.dtype.names or ()}


def _measured(r: dict[str, Floats]) -> Floats:
    """(N, 3) winding, stator, rotor, as the authors average their thermocouples."""
    winding = (r["activewind_1"] + r["activewind_2"]) / 2
    stator = (r["slotbottom"] + r["outer_yoke"]) / 2
    return np.stack([winding, stator, r["rotor"]], axis=1)


def _inputs(r: dict[str, Floats]) -> tuple[Floats, Floats]:
    """Current / 261.63 A rms and |speed| / 4000 rpm."""
    return np.hypot(r["IdFbk"], r["IqFbk"]) / PEAK_A, np.abs(r["speed"]) / 4000.0


def _replayed(r: dict[str, Floats]) -> Floats:
    """Temperatures at the recording's rows: held inputs over each second, from the first row."""
    motor = _motor()
    current, speed = _inputs(r)
    u = {"current": current[:-1], "speed": speed[:-1]}
    phi = evaluate(monomials(motor.network), u, len(current) - 1)
    around = np.stack([r["water_outlet"], r["ambient"]], axis=1)[:-1]
    return simulate(motor, Frame(1.0, phi, around), _measured(r)[0])


@pytest.mark.parametrize("number", PUBLISHED_MAE_K)
def test_the_published_errors_are_reproduced(number: int) -> None:
    r = _recording(number)
    mae = np.abs(_replayed(r) - _measured(r)).mean(axis=0)
    print(f"id {number}: " + ", ".join(f"{m:.3f} ({p})" for m, p in zip(mae, PUBLISHED_MAE_K[number], strict=True)))
    np.testing.assert_allclose(mae, PUBLISHED_MAE_K[number], rtol=0, atol=0.06)  # printed to 0.1 K


def _published_step(T: Floats, i: float, f: float, coolant: float, ambient: float) -> Floats:
    """Rates of change [K/s] by the published formulas, products as printed."""
    copper = 1.5 * 4.67e-3 * (PEAK_A * i) ** 2 * (1 + 0.0039 * (T[0] - 20)) * (1 + 0.02174 * f + 0.3874 * f * f)
    rest = 247.8 * f + 1151.47 * i * f
    share = min(max(0.8910 + 0.0231 * i - 0.0397 * f - 0.009 * i * f, 0.0), 1.0)
    to_stator, to_rotor = (T[0] - T[1]) / 0.01375, 1.7098 * (T[1] - T[2])
    return np.array(
        [
            (copper - to_stator) / 3716.15,
            (share * rest + to_stator - to_rotor - (T[1] - coolant) / 0.01879) / 5616.32,
            ((1 - share) * rest + to_rotor - 0.19953 * (T[2] - ambient)) / 5329.69,
        ]
    )


def test_the_terms_agree_with_the_published_formulas_within_a_thousandth_of_a_kelvin() -> None:
    r = {name: values[:1200] for name, values in _recording(9).items()}
    current, speed = _inputs(r)
    T = _measured(r)[0]
    published = [T]
    for i, f, coolant, ambient in zip(current, speed, r["water_outlet"], r["ambient"], strict=True):
        for _ in range(10):  # classical Runge-Kutta, 0.1 s
            k1 = _published_step(T, i, f, coolant, ambient)
            k2 = _published_step(T + 0.05 * k1, i, f, coolant, ambient)
            k3 = _published_step(T + 0.05 * k2, i, f, coolant, ambient)
            k4 = _published_step(T + 0.1 * k3, i, f, coolant, ambient)
            T = T + 0.1 * (k1 + 2 * k2 + 2 * k3 + k4) / 6
        published.append(T)
    difference = np.abs(_replayed(r) - np.array(published[:-1])).max()
    print(f"largest difference {difference:.5f} K")
    assert difference < 0.001
