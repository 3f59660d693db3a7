"""What a bench gets wrong is named among all candidates of a motor: a reading that goes with speed or current, a logger
that smooths, a coolant that was off in one of three sessions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import accumulate

import numpy as np
import pytest
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from made.motor import CHANNELS, SINGLE, STEP_S, every_law, pulses, recorded
from twin.diagnosis.naming import search
from twin.differences.candidates import InputChannel, added_monomials, generate
from twin.differences.everyday import everyday
from twin.fitting.model import Model, Test
from twin.motor.sensor import Sensor

Floats = NDArray[np.float64]

INITIAL = np.array([45.0, 42.0, 41.0, 35.0])
BUSES = {"W_1": "can1", "Y_1": "can2", "R_1": "can2"}
NAMES = ("cold", "warm", "hot")
CANDIDATES = generate(
    every_law(),
    [Sensor(name, weights, BUSES[name]) for name, (weights, _) in CHANNELS.items()],
    [InputChannel(name, "can1") for name in (*SINGLE, "coolant", "ambient")],
    NAMES,
)


@pytest.fixture(scope="module", autouse=True)
def _one_thread() -> Iterator[None]:
    """The matrices are small: more threads only wait for each other."""
    with threadpool_limits(1, user_api="blas"):
        yield


def _tests() -> list[Test]:
    more = added_monomials(CANDIDATES)
    return [
        recorded(every_law(), pulses(900.0, seed=i), INITIAL, more=more, seed=i, buses=BUSES, name=name)
        for i, name in enumerate(NAMES)
    ]


def _reading(test: Test, moved: Mapping[str, Callable[[Floats], Floats]]) -> Test:
    """The test with other readings (N,) of some channels."""
    own = (replace(c, measured=moved[c.name](c.measured)) if c.name in moved else c for c in test.channels)
    return replace(test, channels=tuple(own))


def _with_speed(test: Test, number: int) -> Test:
    """Up to 4 K too little at 10,000 rpm."""
    return _reading(test, {"R_1": lambda x: x - 4.0 * test.inputs["speed"]})


def _with_current(test: Test, number: int) -> Test:
    """Up to 4 K too much at 200 A."""
    return _reading(test, {"Y_1": lambda x: x + 4.0 * test.inputs["current"]})


def _smoothed(test: Test, number: int) -> Test:
    """By 12 s more of each sensor's own lag tau: (1 + tau s) / (1 + (tau + 12) s)."""

    return _reading(test, {name: partial(_slower, tau_s=CHANNELS[name][1]) for name in ("Y_1", "R_1")})


def _slower(x: Floats, tau_s: float) -> Floats:
    kept, prompt = np.exp(-STEP_S / (tau_s + 12.0)), tau_s / (tau_s + 12.0)
    behind = np.array(list(accumulate(x.tolist(), lambda held, now: kept * held + (1 - kept) * now)))
    return np.asarray(prompt * x + (1 - prompt) * behind)


def _coolant_off(test: Test, number: int) -> Test:
    """Recorded 4 K too warm in the second session."""
    off = np.array([4.0 * (number == 1), 0.0])
    return replace(test, frame=replace(test.frame, boundaries=test.frame.boundaries + off))


@pytest.mark.parametrize(
    ("name", "wrong", "low", "high"),
    [
        ("sensor.magnet.speed", _with_speed, -0.5, -0.3),
        ("sensor.yoke.current", _with_current, 1.6, 2.4),
        ("clock.can2.lag", _smoothed, 10.0, 14.0),
        ("boundary.coolant.bias_in_warm", _coolant_off, 3.0, 5.0),
    ],
)
def test_what_the_bench_gets_wrong_is_named_first_and_alone_and_its_size_told(
    name: str, wrong: Callable[[Test, int], Test], low: float, high: float
) -> None:
    tests = [wrong(test, number) for number, test in enumerate(_tests())]
    found = search(Model(every_law(), tests, everyday(every_law(), tests)), CANDIDATES)
    assert [str(one.candidate.cause) for one in found.accepted] == [name]
    assert low < found.accepted[0].amplitude < high


def test_a_bench_that_gets_nothing_wrong_is_silent() -> None:
    tests = _tests()
    assert search(Model(every_law(), tests, everyday(every_law(), tests)), CANDIDATES).accepted == ()
