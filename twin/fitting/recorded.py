"""A recorded test as a model reads it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from twin.fitting import actions
from twin.motor.observables import Measurand
from twin.motor.outputs import Blocks, blocks
from twin.motor.sensor import Sensor
from twin.run.simulate import Frame

Floats = NDArray[np.float64]

METER_SHARE = 0.08  # of the mean heat: a form of the losses that is 2 % off there leaves a thermometer 0.25 K off
LEAST_HEAT_W = 1.0


@dataclass(frozen=True)
class RecordedChannel:
    """An observed channel of one test: its `sensor`, and over N steps `measured` (N,) [degC] means of the samples, any
    value where there are none, `samples` (N,) usable ones in each, `place` (N,) in [0, 1] their mean time within it."""

    sensor: Sensor
    measured: Floats
    samples: Floats
    place: Floats

    @property
    def name(self) -> str:
        """The name of the channel."""
        return self.sensor.name

    def blocks(self, step_s: float) -> Blocks:
        """Its steps cut into blocks of 10 s."""
        return blocks(self.samples, self.place, step_s)


@dataclass(frozen=True)
class RecordedMeter(RecordedChannel):
    """An observed channel that is no thermometer: all numbers are in the unit of `what` it measures. Its stamps are
    those of the inputs; the sensor of a power or heat follows no node, its weights mean nothing. `given` (N,): what
    such a meter reads besides, known from inputs, as the mechanical power is in the electrical.

    A model's rows of a meter are so many `row`, so that 1 is as much as 1 K of a thermometer
    and one rule serves the noise of both."""

    what: Measurand
    given: Floats | float = 0.0

    @cached_property
    def row(self) -> float:
        """What 1 in a row stands for: what 1 K changes, or `METER_SHARE` of the mean heat that is read."""
        if self.what.law is not None:
            return abs(self.what.law.per_K)
        heat = np.abs(self.measured - self.given)[self.samples > 0]
        return METER_SHARE * max(float(heat.mean()) if heat.size else 0.0, LEAST_HEAT_W)


@dataclass(frozen=True)
class Test:
    """One recorded test in steps of `frame.step_s`, whole blocks only. `inputs`: feature -> (N,) dimensionless, step
    means; `features`: name of a product -> (N,) step means of it; `initial`, `initial_sd` (n,); `course`: what `Course`
    multiplies with; `start_ns` of the first step; `begins`: channel -> what 1 K of its reading adds to `initial` (n,)
    [K/K], where the start was measured with it; `supposed`: nodes that no sensor follows, each as if it had been read
    once (`twin.fitting.supposed`); `load` (N,): the torque, negative while it brakes, or the current where no torque is
    recorded, or nothing (0,) where neither is, dimensionless."""

    __test__ = False

    name: str
    kind: str
    frame: Frame
    inputs: Mapping[str, Floats]
    features: Mapping[str, Floats]
    initial: Floats
    initial_sd: Floats
    channels: tuple[RecordedChannel, ...]
    course: Mapping[str, float] = field(default_factory=dict)
    start_ns: int = 0
    meters: tuple[RecordedMeter, ...] = ()
    begins: Mapping[str, Floats] = field(default_factory=dict)
    supposed: tuple[RecordedChannel, ...] = ()
    load: Floats = field(default_factory=lambda: np.empty(0))

    @property
    def load_is_torque(self) -> bool:
        """Whether `load` is the torque."""
        return "torque" in self.inputs

    @property
    def coldest_degC(self) -> float:
        """The mean of its coldest boundary, which rises are counted from."""
        return float(self.frame.boundaries.mean(axis=0).min())

    @property
    def thermometers(self) -> tuple[RecordedChannel, ...]:
        """The channels, then the supposed ones."""
        return (*self.channels, *self.supposed)

    @property
    def sensors(self) -> tuple[RecordedChannel, ...]:
        """Thermometers, then meters: the order of a model's rows."""
        return (*self.thermometers, *self.meters)

    def is_common(self, action: actions.Action) -> bool:
        """Whether the stamps of every channel are late alike: then the drive is delayed instead, which is exact for
        columns. Not where there are meters, whose stamps are those of the drive."""
        if not isinstance(action, actions.Late) or action.drifts or self.meters:
            return False
        return {channel.name for channel in self.channels} <= set(action.channels)
