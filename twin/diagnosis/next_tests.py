"""A short menu of tests that a bench could run next, within what the recorded ones have shown the motor to do."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from twin.errors import CauseError
from twin.fitting.recorded import Floats, RecordedChannel, RecordedMeter, Test
from twin.motor import features
from twin.motor.causes import Cause
from twin.motor.network import LOADS, Network
from twin.motor.sensor_laws import AMBIENT
from twin.run.simulate import Frame

HOUR_S, MINUTE_S = 3600.0, 60.0
SLOW_SHARE, FAST_SHARE, MIDDLE_SHARE = 0.25, 0.9, 0.5  # of the highest speed
PULSE_S, PAUSE_S = 60.0, 240.0
LEAST_FLOW_SHARE = 0.5  # of the usual flow, in the flow step
AS_NEAR = 0.02  # in speed and load, both over their scales: as near as the nearest recorded step


@dataclass(frozen=True)
class Proposed:
    """A test in `words`, and its inputs (N,) by steps: `speed` and `load` dimensionless, `flow` over the usual one,
    `coolant_K` above the mean of what was recorded."""

    words: str
    speed: Floats
    load: Floats
    flow: Floats
    coolant_K: Floats | float = 0.0


def menu(network: Network, tests: Sequence[Test]) -> tuple[Proposed, ...]:
    """S1 and S2 at low and high speed, a spin-down, direct current at standstill, a flow step. Empty where the recorded
    tests know no speed or load."""
    load = load_of(tests)
    if load is None or not all("speed" in t.inputs for t in tests):
        return ()
    speeds = np.concatenate([t.inputs["speed"] for t in tests])
    loads = np.concatenate([t.inputs[load] for t in tests])
    top, usual, most = float(speeds.max()), float(np.sqrt(np.mean(loads**2))), float(loads.max())
    step_s = tests[0].frame.step_s
    hour: Floats = step_s * np.arange(round(HOUR_S / step_s), dtype=np.float64)
    third = hour[: len(hour) // 3]
    ones = np.ones_like(hour)

    def rpm(share: float) -> str:
        return f"{share * top * network.scale['speed']:,.0f} rpm"

    def amount(level: float) -> str:
        return f"{level * network.scale[load]:.0f} {LOADS[load]}"

    pulses = np.where(hour % (PULSE_S + PAUSE_S) < PULSE_S, most, 0.0)
    coasting = top * np.clip((15 * MINUTE_S - third) / (5 * MINUTE_S), 0.0, 1.0)
    found = []
    for share in (SLOW_SHARE, FAST_SHARE):
        s1 = f"S1 at {rpm(share)} and {amount(usual)}, 60 min"
        s2 = f"S2 pulses of {PULSE_S:.0f} s at {rpm(share)} and {amount(most)}, 60 min"
        speed = share * top * ones
        found += [Proposed(s1, speed, usual * ones, ones), Proposed(s2, speed, pulses, ones)]
    spin_down = f"spin-down from {rpm(1.0)} without {load}, 20 min"
    found.append(Proposed(spin_down, coasting, 0 * third, np.ones_like(third)))
    if load == "current":
        found.append(Proposed(f"DC at standstill with {amount(usual)}, 60 min", 0 * ones, usual * ones, ones))
    if any(name.startswith("flow") for name in tests[0].inputs):
        stepped = np.where(hour % (HOUR_S / 3) < HOUR_S / 6, 1.0, LEAST_FLOW_SHARE)
        words = f"flow halved every other 10 min at {rpm(MIDDLE_SHARE)} and {amount(usual)}, 60 min"
        found.append(Proposed(words, MIDDLE_SHARE * top * ones, usual * ones, stepped))
    return tuple(found)


def load_of(tests: Sequence[Test]) -> str | None:
    """The input that says how hard the motor works."""
    return next((name for name in LOADS if all(name in t.inputs for t in tests)), None)


def as_test(network: Network, tests: Sequence[Test], proposed: Proposed) -> Test:
    """A proposed test as a model runs it: from the coldest recorded start, between the mean boundaries, with every
    channel and meter of the tests. Inputs that it does not set are those of the recorded step nearest in speed and
    load; a meter is read where one of the nearest steps was."""
    near = _Near.of(tests, proposed)
    inputs = _inputs(tests, proposed, near)
    length = len(proposed.speed)
    coldest = min(tests, key=lambda t: float(t.initial.mean()))
    around = np.concatenate([t.frame.boundaries for t in tests]).mean(axis=0)
    own = features.monomials(network)
    cooled = np.array([boundary.name != AMBIENT for boundary in network.boundaries])
    boundaries = around + np.outer(proposed.coolant_K * np.ones(length), cooled)
    frame = Frame(tests[0].frame.step_s, features.evaluate(own, inputs, length), boundaries)
    products = {m.name: frame.features[:, j] for j, m in enumerate(own)}
    for name in tests[0].features:
        if name not in products and (found := _product(name, inputs, length)) is not None:
            products[name] = found
    channels = read_throughout({c.name: c for t in tests for c in t.channels}.values(), length)
    test = Test(proposed.words, "other", frame, inputs, products, coldest.initial, coldest.initial_sd, channels)
    return replace(test, meters=tuple(_meters(tests, near)))


def read_throughout(channels: Iterable[RecordedChannel], length: int) -> tuple[RecordedChannel, ...]:
    """The channels with a sample in the middle of each of `length` steps, their values 0: for what a model shows."""
    every, middle, zero = np.ones(length), np.full(length, 0.5), np.zeros(length)
    return tuple(RecordedChannel(c.sensor, zero, every, middle) for c in channels)


@dataclass(frozen=True)
class _Near:
    """The `recorded` speeds and loads (M, 2) of all tests, those `proposed` (N, 2), and of each of these the `nearest`
    recorded step (N,) and its `distance` (N,)."""

    recorded: Floats
    proposed: Floats
    nearest: NDArray[np.intp]
    distance: Floats

    @classmethod
    def of(cls, tests: Sequence[Test], proposed: Proposed) -> _Near:
        load = str(load_of(tests))
        recorded = np.concatenate([np.column_stack([t.inputs["speed"], t.inputs[load]]) for t in tests])
        wanted = np.column_stack([proposed.speed, proposed.load])
        distance, nearest = cKDTree(recorded).query(wanted)
        return cls(recorded, wanted, nearest, distance)

    def among(self, read: NDArray[np.bool_]) -> tuple[NDArray[np.intp], Floats]:
        """The nearest of the recorded steps that were `read` (M,), some, and 1 (N,) where one of them is as near as the
        nearest of all, else 0."""
        distance, nearest = cKDTree(self.recorded[read]).query(self.proposed)
        return np.flatnonzero(read)[nearest], (distance <= self.distance + AS_NEAR).astype(np.float64)


def _inputs(tests: Sequence[Test], proposed: Proposed, near: _Near) -> dict[str, Floats]:
    shared = [name for name in tests[0].inputs if all(name in t.inputs for t in tests)]
    seen = {name: np.concatenate([t.inputs[name] for t in tests]) for name in shared}
    found = {name: values[near.nearest] for name, values in seen.items()}
    for name in shared:
        if name.startswith("flow"):
            found[name] = float(np.median(seen[name])) * proposed.flow
    return {**found, "speed": proposed.speed, str(load_of(tests)): proposed.load}


def _meters(tests: Sequence[Test], near: _Near) -> Iterator[RecordedMeter]:
    """The meters of the tests; what one reads besides is that of the nearest step, of a shaft at the torque there."""
    for first in {meter.name: meter for test in reversed(tests) for meter in test.meters}.values():
        own = [next((m for m in t.meters if m.name == first.name), _unread(first, t)) for t in tests]
        read = np.concatenate([m.samples for m in own]) > 0
        if not read.any():
            continue
        given = np.concatenate([m.given * np.ones_like(m.samples) for m in own])
        heat = np.concatenate([m.measured - m.given for m in own])[read]
        nearest, at = near.among(read)
        turned, turns = near.recorded[nearest, 0], near.proposed[:, 0]
        besides = given[nearest] * np.divide(turns, turned, out=np.ones_like(turns), where=turned != 0.0)
        measured = besides + np.abs(heat).mean()  # sizes the meter's rows as they were
        yield replace(first, measured=measured, samples=at, place=np.full_like(at, 0.5), given=besides)


def _unread(meter: RecordedMeter, test: Test) -> RecordedMeter:
    nothing = np.zeros(len(test.frame.features))
    return replace(meter, measured=nothing, samples=nothing, place=nothing, given=0.0)


def _product(name: str, inputs: dict[str, Floats], length: int) -> Floats | None:
    """The product of features that a law names; None where an input of it is not set, or it is none."""
    try:
        powers = Cause("loss", "any", name).exponents
    except CauseError:
        return None
    if not powers.keys() <= inputs.keys():
        return None
    return features.evaluate((features.Monomial(tuple(powers.items())),), inputs, length)[:, 0]
