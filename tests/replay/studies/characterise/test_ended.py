"""How S1 sessions and the pulses of S2 sessions ended, of frames written by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.facts.events import SessionRecorded
from replay.engine.frame.frame import InputFrame
from replay.engine.frame.observations import Observation
from replay.show.verbs.envelope import ending, together
from replay.studies.characterise.envelope import Ended, ended, pulses
from twin.motor.network import Boundary, Link, Network, Node, Term
from twin.motor.sensor import Sensor

Floats = NDArray[np.float64]

STEP_s = 0.5
NETWORK = Network(
    name="one",
    nodes=(Node("winding", 100.0, "copper", limit_degC=180.0),),
    boundaries=(Boundary("coolant"),),
    links=(Link("winding", "coolant", (Term(1.0),)),),
    sources=(),
    scale={},
)


def _session(name: str, kind: str) -> SessionRecorded:
    return SessionRecorded(
        session=name,
        name=name,
        kind=kind,
        kind_why="",
        specimen=None,
        batch=None,
        bench=None,
        configuration=None,
        attributes={},
        absolute=False,
        start_ns=0,
        end_ns=1,
        files=[],
    )


def _frame(inputs: Mapping[str, Floats], degC: Floats, time_constant_s: float = 0.0) -> InputFrame:
    steps = len(degC)
    whole, yes = np.zeros(steps, dtype=np.int64), np.ones(steps, dtype=np.bool_)
    shown = Observation(
        sensor=Sensor("TC", {"winding": 1.0}, noise=0.1, resolution=0.1, bias_sd=0.5, time_constant_s=time_constant_s),
        measured=degC,
        place=np.full(steps, 0.5),
        samples=whole + 1,
        good=yes,
        first_record=whole,
        last_record=whole,
        raw=whole,
    )
    return InputFrame(
        t_ns=np.arange(steps + 1, dtype=np.int64) * round(STEP_s * 1e9),
        step_s=STEP_s,
        monomials=(),
        features=np.zeros((steps, 0)),
        boundaries=np.zeros((steps, 1)),
        boundary_names=("coolant",),
        inputs=inputs,
        live=yes,
        observations=(shown,),
        raw_files=(),
        note=None,
    )


def _held(speed: float, torque: float, current: float | None, hottest: float) -> InputFrame:
    """Ten minutes at one point."""
    flat = np.ones(1200)
    inputs = {"speed_rpm": speed * flat, "torque_Nm": torque * flat}
    return _frame(inputs | ({} if current is None else {"current_A": current * flat}), np.linspace(60.0, hottest, 1200))


def _reasons(frames: Sequence[InputFrame], kind: str = "s1") -> list[str]:
    sessions = [_session(f"{i}_{kind}", kind) for i in range(len(frames))]
    return [one.reason for one in ended(NETWORK, sessions, frames, "torque_Nm")]


def test_in_field_weakening_the_current_is_what_is_at_its_limit() -> None:
    """100 Nm for 400 A at low speed, 40 Nm for the same 400 A at high speed, and 60 Nm for 200 A."""
    slow, weakened, easy = (
        _held(4000.0, 100.0, 400.0, 120.0),
        _held(14_000.0, 40.0, 396.0, 120.0),
        _held(4000.0, 60.0, 200.0, 110.0),
    )
    assert _reasons([slow, weakened, easy]) == ["current limit", "current limit", "time"]


def test_a_limited_temperature_comes_before_the_current() -> None:
    assert _reasons([_held(4000.0, 100.0, 400.0, 178.0)]) == ["temperature"]


def test_current_may_be_recorded_by_its_components() -> None:
    frames = []
    for d, q in ((0.0, 400.0), (-320.0, 240.0), (0.0, 200.0)):
        known = _held(4000.0, 0.2 * q, None, 120.0)
        parts = {"current_d_A": np.full(1200, d), "current_q_A": np.full(1200, q)}
        frames.append(_frame({**known.inputs, **parts}, known.observations[0].measured))
    assert _reasons(frames) == ["current limit", "current limit", "time"]


def test_without_current_in_every_session_the_load_is_compared() -> None:
    frames = [_held(4000.0, 100.0, None, 120.0), _held(14_000.0, 40.0, 400.0, 120.0)]
    assert _reasons(frames) == ["load limit", "time"]


def _pulsed(time_constant_s: float = 0.0) -> InputFrame:
    """Three pulses of 20 s, a minute apart: 400 A that stay cool, 300 A that end at 176 degC as a sensor shows it
    that lags by 2 s behind a rise of 2 K/s, and 200 A."""
    steps = 40
    rest = np.zeros(120)
    current = np.concatenate([np.r_[rest, np.full(steps, amps)] for amps in (400.0, 300.0, 200.0)] + [rest])
    ramp = np.arange(1, steps + 1) * 2.0 * STEP_s
    courses = (80.0 + ramp, 136.0 + ramp, 100.0 + ramp)
    degC = np.concatenate([np.r_[np.full(120, course[0]), course] for course in courses] + [np.full(120, 90.0)])
    inputs = {"speed_rpm": np.full(current.size, 7000.0), "torque_Nm": 0.4 * current, "current_A": current}
    return _frame(inputs, degC, time_constant_s)


def _of_pulses(frame: InputFrame) -> tuple[Ended, ...]:
    return ended(NETWORK, [_session("2_s2", "s2")], [frame], "torque_Nm")


def test_every_pulse_of_an_s2_session_has_its_own_reason() -> None:
    found = _of_pulses(_pulsed(2.0))
    assert [one.pulse for one in found] == [1, 2, 3]
    assert [one.reason for one in found] == ["current limit", "temperature", "time"]
    assert [one.seconds for one in found] == [20.0, 20.0, 20.0]
    assert [one.current_A for one in found] == [400.0, 300.0, 200.0]
    assert [one.load for one in found] == [160.0, 120.0, 80.0]


def test_the_known_lag_of_a_thermometer_is_taken_off() -> None:
    """2 K/s for 2 s: 4 K behind."""
    _, lagging, _ = _of_pulses(_pulsed(2.0))
    _, shown, _ = _of_pulses(_pulsed())
    assert shown.hottest_degC == pytest.approx(176.0)
    assert shown.reason == "time"
    assert lagging.hottest_degC == pytest.approx(180.0)


def test_a_flicker_is_no_pulse_and_a_point_is_one_whole() -> None:
    push = np.zeros(100)
    push[10:14], push[40:60] = 100.0, 100.0
    assert pulses(push, STEP_s) == [(40, 60)]
    (one,) = ended(NETWORK, [_session("1_s1", "s1")], [_pulsed()], "torque_Nm")
    assert one.pulse is None


def test_pulses_alike_are_told_together_with_the_hottest() -> None:
    frame = _pulsed()
    twice = _frame(
        {name: np.tile(values, 2) for name, values in frame.inputs.items()},
        np.r_[frame.observations[0].measured, frame.observations[0].measured + 2.0],
    )
    groups = together(_of_pulses(twice))
    assert [[one.pulse for one in some] for some in groups] == [[1, 4], [2], [3, 6], [5]]
    assert ending(groups[0], "torque_Nm") == (
        "2_s2 (s2) pulses 1 and 4 of 20 s at the largest current of all sessions: winding 122 °C, "
        "160 Nm and 400 A at 7,000 rpm"
    )
