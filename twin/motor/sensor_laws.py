"""What a sensor may get wrong, each law once: its name and unit, how large it may be, its words,
and what it adds to a reading.

A new law is one class here and its name in `SENSOR_LAWS`. From there its candidates are made, its ids are known and
worded, and its column is computed. A bench file takes it off by `ingest.bench.laws`, which cannot import this module: a
test holds the two against each other for every law.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

AMBIENT = "ambient"  # the boundary that pulls at a sensor through its leads


@dataclass(frozen=True)
class Seen:
    """What a reading may go with, at the edges of the steps of a test (N + 1,): the temperature that the sensor
    `followed`, its lag included [degC], and the time since the start [s]."""

    followed: Floats
    time_s: Floats


@dataclass(frozen=True)
class SensorLaw:
    """A channel reads otherwise than the temperature that it follows, by an amount p in `unit`. `sd`: the prior size of
    p where it is a cause; `sign`: +1 where p cannot be below 0; `says`: its words, `{place}` the place of the
    sensor."""

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
    all linear in p."""

    of_truth: ClassVar[float] = 0.0
    of_ambient: ClassVar[float] = 0.0

    def adds(self, p: float, seen: Seen) -> Floats | float:
        """What p adds that goes with neither temperature (N + 1,), or the one number that it is at all times [K]."""
        return 0.0


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


SENSOR_LAWS: tuple[type[Misreading | Lag], ...] = (Bias, Gain, Lag, Drift, Stem)


@dataclass(frozen=True)
class Exchange:
    """Two channels carry each other's names: there or not, so found before anything is fitted."""

    channel: str
    other: str
