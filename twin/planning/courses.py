"""What a bench could run next: S1 and S2 points over the recorded speeds and loads, spin-downs, direct current at
standstill, steps of the coolant's flow and temperature; and a day made of them, with rests between."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from twin.diagnosis.next_tests import LEAST_FLOW_SHARE, Proposed, as_test, load_of
from twin.errors import PlanError
from twin.fitting.model import Floats, Test
from twin.motor.network import LOADS, Network
from twin.motor.outputs import BLOCK_S
from twin.motor.sensor_laws import AMBIENT

MINUTES = (15, 30, 45, 60)  # how long a test may be
SPEEDS = tuple(np.linspace(0.125, 1.0, 8).tolist())  # of the highest recorded
LEVELS = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the largest load at a speed
NEAR_SPEED = 0.05  # of the highest
PULSES_S = ((30.0, 150.0), (60.0, 240.0), (120.0, 120.0))  # load on and off
COOLANT_MIN, COOLANT_K = (0.0, 10.0, 15.0, 30.0, 35.0, 60.0), (0.0, 0.0, -20.0, -20.0, 0.0, 0.0)  # 4 K a minute
STEP_MIN = 10
REST_MIN = 20


@dataclass(frozen=True)
class BenchRange:
    """What the recorded tests show of a bench: of speed and load (dimensionless), flow and coolant."""

    network: Network
    tests: tuple[Test, ...]
    load: str
    speeds: Floats
    loads: Floats

    @classmethod
    def of(cls, network: Network, tests: Sequence[Test]) -> BenchRange:
        """Raises `PlanError` where the tests share no speed and load."""
        load = load_of(tests)
        if load is None or not all("speed" in test.inputs for test in tests):
            raise PlanError("the sessions have no speed and current (or torque) in common: no test can be proposed")
        speeds, loads = (np.concatenate([np.abs(t.inputs[name]) for t in tests]) for name in ("speed", load))
        return cls(network, tuple(tests), load, speeds, loads)

    @property
    def top(self) -> float:
        """The highest speed."""
        return float(self.speeds.max())

    def most(self, speed: float) -> float:
        """The largest load at a speed: what the motor gave there or faster it gives at lower speeds too."""
        return float(self.loads[self.speeds >= speed - NEAR_SPEED * self.top].max())

    @property
    def has_flow(self) -> bool:
        return any(name.startswith("flow") for name in self.tests[0].inputs)

    @property
    def has_coolant(self) -> bool:
        return any(boundary.name != AMBIENT for boundary in self.network.boundaries)

    def rpm(self, speed: float) -> str:
        return f"{speed * self.network.scale['speed']:,.0f} rpm"

    def amount(self, load: float) -> str:
        return f"{load * self.network.scale[self.load]:,.0f} {LOADS[self.load]}"

    def words(self, speed: float, load: float) -> str:
        """ "3,000 rpm and 156 A", "3,000 rpm without current"."""
        return f"{self.rpm(speed)} and {self.amount(load)}" if load else f"{self.rpm(speed)} without {self.load}"

    def test(self, proposed: Proposed) -> Test:
        """A proposed test in steps of one block, from rest between the boundaries."""
        test = as_test(self.network, self.tests, proposed)
        return replace(test, frame=replace(test.frame, step_s=BLOCK_S))


def blocks(minutes: float) -> int:
    """How many blocks a time has."""
    return round(60 * minutes / BLOCK_S)


def courses(bench: BenchRange) -> Iterator[Proposed]:
    """Every test at its longest; each begins at no speed and load, so that a bench has a block
    to get there."""
    ones = np.ones(blocks(MINUTES[-1]))
    seconds = BLOCK_S * np.arange(len(ones))
    first_half = seconds % (2 * 60 * STEP_MIN) < 60 * STEP_MIN
    for speed in (0.0, *(share * bench.top for share in SPEEDS)):
        most = bench.most(speed)
        for load in dict.fromkeys(level * most for level in LEVELS):
            if speed == load == 0.0 or (speed == 0.0 and bench.load != "current"):
                continue
            at = bench.words(speed, load)
            if speed == 0.0:
                yield _begun(Proposed(f"DC at standstill with {bench.amount(load)}", 0 * ones, load * ones, ones))
                continue
            yield _begun(Proposed(f"S1 at {at}", speed * ones, load * ones, ones))
            if load < LEVELS[2] * most:
                continue
            for on_s, off_s in PULSES_S:
                pulses = np.where(seconds % (on_s + off_s) < on_s, load, 0.0)
                words = f"S2 pulses of {on_s:.0f} s every {on_s + off_s:.0f} s at {at}"
                yield _begun(Proposed(words, speed * ones, pulses, ones))
        half = LEVELS[2] * most
        at = bench.words(speed, half)
        if speed and bench.has_flow:
            flow = np.where(first_half, 1.0, LEAST_FLOW_SHARE)
            yield _begun(Proposed(f"flow halved every other {STEP_MIN} min at {at}", speed * ones, half * ones, flow))
        if speed and bench.has_coolant:
            first, last = COOLANT_MIN[1], COOLANT_MIN[4]
            words = f"coolant {-min(COOLANT_K):.0f} K colder from minute {first:.0f} to {last:.0f} at {at}"
            colder = np.interp(seconds / 60, COOLANT_MIN, COOLANT_K)
            yield _begun(Proposed(words, speed * ones, half * ones, ones, colder))
    for speed in (bench.top / 2, bench.top):
        down = speed * np.clip((15 * 60 - seconds % (20 * 60)) / (5 * 60), 0.0, 1.0)
        words = f"spin-downs of 5 min from {bench.rpm(speed)} without {bench.load}, every 20 min"
        yield _begun(Proposed(words, down, 0 * ones, ones))


def _begun(proposed: Proposed) -> Proposed:
    """A course whose first block is at no speed and load."""
    speed, load = proposed.speed.copy(), proposed.load.copy()
    speed[0] = load[0] = 0.0
    return replace(proposed, speed=speed, load=load)


def cut(proposed: Proposed, length: int) -> Proposed:
    """The first so many blocks of a course, the length said."""
    words = f"{proposed.words}, {length * BLOCK_S / 60:.0f} min"
    coolant = proposed.coolant_K[:length] if isinstance(proposed.coolant_K, np.ndarray) else proposed.coolant_K
    return Proposed(words, proposed.speed[:length], proposed.load[:length], proposed.flow[:length], coolant)


def rest(minutes: float) -> Proposed:
    """Standstill without load, the coolant running."""
    nothing = np.zeros(blocks(minutes))
    return Proposed(f"rest, {minutes:.0f} min", nothing, nothing, nothing + 1.0)


def joined(parts: Sequence[Proposed]) -> Proposed:
    """The parts one after the other, as one course."""
    return reduce(_then, parts)


def _then(first: Proposed, second: Proposed) -> Proposed:
    both = [
        np.concatenate([getattr(one, name) * np.ones(len(one.speed)) for one in (first, second)])
        for name in ("speed", "load", "flow", "coolant_K")
    ]
    return Proposed(f"{first.words}; {second.words}", *both)
