"""What a sensor may get wrong, each law once: its name and unit, how large it may be, its words,
and what it adds to a reading.

A new law is one class here and its name in `SENSOR_LAWS`. From there its candidates are made, its ids are known and
worded, and its column is computed. A bench file takes it off by `ingest.bench.laws`, which cannot import this module: a
test holds the two against each other for every law.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

AMBIENT = "ambient"  # the boundary that pulls at a sensor through its leads


@dataclass(frozen=True)
class Seen:
    """What a reading may go with, at the edges of the steps of a test (N + 1,): the temperature that the sensor
    `followed`, its lag included [degC], the time since the start [s], and the `inputs` that the test has: the
    magnitude of the speed [rpm] and of the current [A]."""

    followed: Floats
    time_s: Floats
    inputs: Mapping[str, Floats] = field(default_factory=dict)


@dataclass(frozen=True)
class SensorLaw:
    """A channel reads otherwise than the temperature that it follows, by an amount p in `unit`. `sd`: the prior size of
    p where it is a cause, of a law that follows an input at the motor's scale of that; `sign`: +1 where p cannot be
    below 0; `says`: its words, `{place}` the place of the sensor."""

    channel: str

    law: ClassVar[str]
    unit: ClassVar[str]
    sd: ClassVar[float]
    sign: ClassVar[int] = 0
    says: ClassVar[str]


class Lag(SensorLaw):
    """A channel follows p more slowly than stated: a first-order lag only delays."""

    law, unit, sd, sign = "lag", "s", 20.0, 1
    says = "the sensor at {place} follows more slowly than stated"


class Misreading(SensorLaw):
    """A channel reads p (`of_truth` x what it follows + `of_ambient` x ambient) and `adds` too much,
    all linear in p. `of_input`: the input that it goes with, "" for none; p is for each `per` of it [its stored unit].
    """

    of_input: ClassVar[str] = ""
    per: ClassVar[float] = 1.0
    of_truth: ClassVar[float] = 0.0
    of_ambient: ClassVar[float] = 0.0

    def adds(self, p: float, seen: Seen) -> Floats | float:
        """What p adds that goes with neither temperature (N + 1,), or the one number that it is at all times [K]."""
        return p * seen.inputs[self.of_input] / self.per if self.of_input else 0.0


class Bias(Misreading):
    """A channel reads p too much."""

    law, unit, sd = "bias", "K", 3.0
    says = "the sensor at {place} reads off by a constant"

    def adds(self, p: float, seen: Seen) -> float:
        return p


class Gain(Misreading):
    """A channel reads (1 + p) times the truth in degC."""

    law, unit, sd = "gain", "1", 0.05
    says = "the sensor at {place} reads off in proportion"
    of_truth = 1.0


class Drift(Misreading):
    """A channel reads p times the hours since the start too much."""

    law, unit, sd = "drift", "K/h", 2.0
    says = "the sensor at {place} drifts with time"

    def adds(self, p: float, seen: Seen) -> Floats:
        return p * seen.time_s / 3600


class Stem(Misreading):
    """A channel reads p (ambient - truth) too much: heat along the leads only pulls towards ambient."""

    law, unit, sd, sign = "stem", "1", 0.05, 1
    says = "the sensor at {place} is pulled towards ambient by heat along its leads"
    of_truth, of_ambient = -1.0, 1.0


class OfSpeed(Misreading):
    """A channel reads p too much at 1,000 rpm, and in proportion: how a turning part is read (a radiation thermometer
    that sees the gap between passing poles, telemetry that loses signal, slip rings that rub) changes as it turns. On
    the machine of `examples/hust_motor` the rotor's reading rises by 2 to 3 K at each stop, so at the motor's top speed
    it is as large as any sensor's offset."""

    law, unit, sd = "speed", "K/1000 rpm", 3.0
    says = "the sensor at {place} reads off in proportion to speed"
    of_input, per = "speed", 1000.0


class OfCurrent(Misreading):
    """A channel reads p too much at 100 A, and in proportion: what the inverter couples into leads grows with the
    phase current, and an amplifier that rectifies it is off by kelvins at full current."""

    law, unit, sd = "current", "K/100 A", 3.0
    says = "the sensor at {place} reads off in proportion to current"
    of_input, per = "current", 100.0


SENSOR_LAWS: tuple[type[Misreading | Lag], ...] = (Bias, Gain, Lag, Drift, Stem, OfSpeed, OfCurrent)


@dataclass(frozen=True)
class Exchange:
    """Two channels carry each other's names: there or not, so found before anything is fitted."""

    channel: str
    other: str
