"""Loggers whose clock is late by far more than a fit may move it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from made import motor as made
from twin.diagnosis.late_clocks import late_clocks
from twin.differences.everyday import everyday
from twin.fitting.model import Model, Test
from twin.motor.network import Source

INITIAL = np.array([60.0, 50.0, 55.0, 45.0])
BUSES = {"W_1": "TL-20 A", "Y_1": "TL-20 A"}


def _test(drive: made.Drive, steps: int) -> Test:
    """A motor with a fifth more losses than its file says, the records of one bus late by so many steps of 2 s."""
    network = made.every_law()
    more = (
        Source(s.node, tuple(replace(t, coefficient=1.2 * t.coefficient) for t in s.terms)) for s in network.sources
    )
    true = replace(network, sources=tuple(more))
    test = made.recorded(network, drive, INITIAL, true=true, seed=0, buses=BUSES, name="4_s2")
    late = [c.sensor.bus == "TL-20 A" for c in test.channels]
    moved = (
        replace(c, measured=_late(c.measured, steps) if is_late else c.measured)
        for c, is_late in zip(test.channels, late, strict=True)
    )
    return replace(test, channels=tuple(moved))


def _late(values: made.Floats, steps: int) -> made.Floats:
    return values[np.clip(np.arange(values.size) - steps, 0, values.size - 1)]


def _found(*tests: Test) -> list[str]:
    network = made.every_law()
    return late_clocks(Model(network, tests, everyday(network, tests)))


@pytest.mark.parametrize(("steps", "which"), [(19, "late"), (-30, "early")])
def test_a_logger_that_is_off_by_half_a_minute_and_more_is_told_with_its_correction(steps: int, which: str) -> None:
    (line,) = _found(_test(made.pulses(1200.0), 0), _test(made.pulses(1200.0), steps))
    assert line.startswith('session 4_s2: the thermometers of "TL-20 A" follow the motor about ')
    assert f" s too {which} by the stamps of the inputs. " in line
    said = line.partition('cause = "clock.TL_20_A.offset", amount = ')[2].partition(";")[0]
    assert float(said) == pytest.approx(2 * steps, abs=4)


@pytest.mark.parametrize("steps", [0, 3, -3])
def test_a_few_seconds_are_left_to_the_fit(steps: int) -> None:
    assert _found(_test(made.pulses(1200.0), steps)) == []


def test_where_the_load_hardly_changes_nothing_is_told() -> None:
    steady = {name: np.full_like(values, 0.5) for name, values in made.smooth(1200.0).items()}
    assert _found(_test(steady, 30)) == []


def test_pulses_that_repeat_tell_no_lag() -> None:
    """Every 40 s the same: 40 s late is not late at all, and 20 s early as well as late."""
    drive = made.pulses(1200.0)
    on = (np.arange(drive["current"].size) // round(20 / made.FINE_S) % 2).astype(np.float64)
    assert _found(_test({**drive, "current": 0.2 + 0.7 * on, "speed": np.full_like(on, 0.5)}, 10)) == []
