"""A recorded test as a model reads it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from twin import actions
from twin.outputs import Output
from twin.simulate import Frame

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Channel:
    """An observed channel of one test. `measured` (N,) [degC]: means over the steps, any value where `output.samples` is 0;
    `white_sd`, `resolution` [K] of one sample; `bias_sd` [K] constant within the test."""

    name: str
    bus: str
    output: Output
    measured: Floats
    white_sd: float
    resolution: float
    bias_sd: float


@dataclass(frozen=True)
class Test:
    """One recorded test in steps of `frame.step_s`, whole blocks only. `inputs`: feature -> (N,) dimensionless, step means;
    `features`: name of a product -> (N,) step means of it; `initial`, `initial_sd` (n,); `course`: what `Course` multiplies with;
    `start_ns` of the first step."""

    __test__ = False

    name: str
    kind: str
    frame: Frame
    inputs: Mapping[str, Floats]
    features: Mapping[str, Floats]
    initial: Floats
    initial_sd: Floats
    channels: tuple[Channel, ...]
    course: Mapping[str, float] = field(default_factory=dict)
    start_ns: int = 0

    def is_common(self, action: actions.Action) -> bool:
        """Whether the stamps of every channel are late alike: then the drive is delayed instead, which is exact for columns."""
        if not isinstance(action, actions.Late) or action.drifts:
            return False
        return {channel.name for channel in self.channels} <= set(action.channels)
