"""What observed channels show in the steps of a frame: sensor or meter, and means of its samples with their lineage."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from twin.motor.observables import Measurand
from twin.motor.sensor import Sensor

if TYPE_CHECKING:
    from ingest.catalogue.channels import ChannelData

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Times = NDArray[np.int64]


@dataclass(frozen=True)
class Observation:
    """A sensor over the N steps. `measured` [degC]: mean of the samples in a step, NaN where there is none; `place` in
    [0, 1): their mean time within the step; `samples`: good ones in the step, `good` where there is any;
    `first_record`, `last_record`: of the samples, -1 where there is none; `raw`: index of their file."""

    sensor: Sensor
    measured: Floats
    place: Floats
    samples: NDArray[np.int64]
    good: Bools
    first_record: Times
    last_record: Times
    raw: Times


@dataclass(frozen=True)
class Meter:
    """An observed channel that is no thermometer: what it measures, and its samples in the unit of its quantity."""

    what: Measurand
    seen: Observation


def sensor_of(channel: ChannelData) -> Sensor:
    """The sensor of a channel, as the bench file describes it; one without a place stands for itself."""
    spec = channel.spec
    return Sensor(
        name=spec.name,
        weights=dict(spec.weights) or {spec.node or spec.name: 1.0},
        bus=channel.buses[0],
        level=spec.level,
        noise=spec.noise,
        resolution=spec.resolution or 0.0,
        bias_sd=spec.bias_sd,
        time_constant_s=spec.time_constant_s,
    )


def observe(channel: ChannelData, good: Bools, edges: Times, raw_files: tuple[str, ...]) -> Observation:
    """An observed channel in steps [edge, next edge), from its `good` samples; where a step has none, from others."""
    n = edges.size - 1
    step_ns = int(edges[1] - edges[0])
    inside = (channel.t_ns >= edges[0]) & (channel.t_ns < edges[-1])
    step = (channel.t_ns[inside] - edges[0]) // step_ns
    count_good = np.bincount(step[good[inside]], minlength=n)
    keep = good[inside] | (count_good[step] == 0)
    step, t, value = step[keep], channel.t_ns[inside][keep], channel.value[inside][keep]
    count = np.bincount(step, minlength=n)
    there = count > 0
    with np.errstate(invalid="ignore"):
        measured = np.bincount(step, value, minlength=n) / count
        place = np.bincount(step, (t - edges[step]) / step_ns, minlength=n) / count
    first, last, raw = (np.full(n, -1, dtype=np.int64) for _ in range(3))
    position = np.array([raw_files.index(file) for file in channel.raws], dtype=np.int64)
    starts = np.searchsorted(step, np.flatnonzero(there))
    ends = np.append(starts[1:], step.size) - 1
    records, files = channel.record[inside][keep], channel.raw[inside][keep]
    first[there], last[there], raw[there] = records[starts], records[ends], position[files[starts]]
    return Observation(
        sensor=sensor_of(channel),
        measured=measured,
        place=np.nan_to_num(place),
        samples=count_good.astype(np.int64),
        good=count_good > 0,
        first_record=first,
        last_record=last,
        raw=raw,
    )
