"""Where a replay starts, and what each reading has to do with that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from made.motor import every_law
from replay.engine.frame.frame import InputFrame
from replay.engine.frame.observations import Observation
from replay.engine.results.open_loop import initial_by_reading, initial_temperatures
from twin.motor.features import monomials
from twin.motor.sensor import Sensor

NETWORK, STEPS = every_law(), 30


def observation(name: str, first_degC: float, level: str = "testing", **weights: float) -> Observation:
    steps = np.zeros(STEPS, dtype=np.int64)
    good = np.ones(STEPS, dtype=np.bool_)
    sensor = Sensor(name, weights, level=level, noise=0.1, bias_sd=0.3)
    return Observation(sensor, np.full(STEPS, first_degC), np.full(STEPS, 0.5), steps + 1, good, steps, steps, steps)


def frame(*observations: Observation) -> InputFrame:
    own = monomials(NETWORK)
    return InputFrame(
        t_ns=np.arange(STEPS + 1, dtype=np.int64) * 10**9,
        step_s=1.0,
        monomials=own,
        features=np.full((STEPS, len(own)), 0.5),
        boundaries=np.tile([60.0, 22.0], (STEPS, 1)),
        boundary_names=("coolant", "ambient"),
        inputs={},
        live=np.ones(STEPS, dtype=np.bool_),
        observations=observations,
        raw_files=(),
        note=None,
    )


def test_a_start_is_as_much_a_readings_as_it_says() -> None:
    """Two channels at one node, one that follows a mixture, one that starts nothing."""
    seen = (
        observation("W_1", 70.0, winding=1.0),
        observation("W_2", 74.0, winding=1.0),
        observation("R_1", 55.0, magnet=0.7, case=0.3),
        observation("C_1", 40.0, case=0.5, yoke=0.5),
    )
    start, _ = initial_temperatures(NETWORK, frame(*seen), "testing")
    by_reading = initial_by_reading(NETWORK, frame(*seen), "testing")
    assert by_reading.keys() == {"W_1", "W_2", "R_1"}
    for i, one in enumerate(seen):
        more = [*seen[:i], replace(one, measured=one.measured + 2.0), *seen[i + 1 :]]
        moved, _ = initial_temperatures(NETWORK, frame(*more), "testing")
        expected = by_reading.get(one.sensor.name, np.zeros(len(start)))
        np.testing.assert_allclose((moved - start) / 2.0, expected, atol=1e-9)


def test_a_reading_that_other_benches_lack_starts_nothing_there() -> None:
    seen = (observation("W_1", 70.0, level="production", winding=1.0), observation("Y_1", 60.0, yoke=1.0))
    assert initial_by_reading(NETWORK, frame(*seen), "production").keys() == {"W_1"}
