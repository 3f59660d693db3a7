"""A recorded test as a model reads it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from twin.fitting import actions
from twin.motor.observables import Thermometric
from twin.motor.outputs import Output
from twin.run.simulate import Frame

Floats = NDArray[np.float64]

METER_SHARE = 0.08  # of the mean heat: a form of the losses that is 2 % off there leaves a thermometer 0.25 K off
LEAST_HEAT_W = 1.0


@dataclass(frozen=True)
class RecordedChannel:
    """An observed channel of one test. `measured` (N,) [degC]: means over the steps, any value where `output.samples`
    is 0; `white_sd`, `resolution` [K] of one sample; `bias_sd` [K] constant within the test."""

    name: str
    bus: str
    output: Output
    measured: Floats
    white_sd: float
    resolution: float
    bias_sd: float


@dataclass(frozen=True)
class RecordedMeter:
    """An observed channel of one test that is no thermometer, in its own `unit`: what goes with the temperature of
    nodes (`law`), or else a heat [W], of all sources (`boundary` None) or what a boundary (an index) takes out of the
    motor. `given` (N,): what the meter of a heat reads besides, known from inputs, as the mechanical power is in the
    electrical. The stamps are those of the inputs, the weights of `output` mean nothing; `gain_sd`: of the share by
    which it reads too much; all else as in `RecordedChannel`.

    A model's rows of a meter are so many `row`, so that 1 is as much as 1 K of a thermometer
    and one rule serves the noise of both."""

    name: str
    bus: str
    unit: str
    output: Output
    measured: Floats
    white_sd: float
    resolution: float
    bias_sd: float
    gain_sd: float
    boundary: int | None = None
    given: Floats | float = 0.0
    law: Thermometric | None = None

    @cached_property
    def row(self) -> float:
        """What 1 in a row stands for: what 1 K changes, or `METER_SHARE` of the mean heat that is read."""
        if self.law is not None:
            return abs(self.law.per_K)
        heat = np.abs(self.measured - self.given)[self.output.samples > 0]
        return METER_SHARE * max(float(heat.mean()) if heat.size else 0.0, LEAST_HEAT_W)


@dataclass(frozen=True)
class Test:
    """One recorded test in steps of `frame.step_s`, whole blocks only. `inputs`: feature -> (N,) dimensionless, step
    means; `features`: name of a product -> (N,) step means of it; `initial`, `initial_sd` (n,); `course`: what `Course`
    multiplies with; `start_ns` of the first step."""

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

    @property
    def sensors(self) -> tuple[RecordedChannel | RecordedMeter, ...]:
        """Channels, then meters: the order of a model's rows."""
        return (*self.channels, *self.meters)

    def is_common(self, action: actions.Action) -> bool:
        """Whether the stamps of every channel are late alike: then the drive is delayed instead, which is exact for
        columns. Not where there are meters, whose stamps are those of the drive."""
        if not isinstance(action, actions.Late) or action.drifts or self.meters:
            return False
        return {channel.name for channel in self.channels} <= set(action.channels)
