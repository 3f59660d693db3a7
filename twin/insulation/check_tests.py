"""A DC check's test as a fit over many checks takes it: long steps, one mean channel for each place, chosen minutes."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin.differences.everyday import products_of
from twin.fitting.recorded import Floats, RecordedChannel, Test
from twin.motor.features import terms
from twin.motor.network import Network
from twin.motor.outputs import BLOCK_S
from twin.motor.paths import terms_of
from twin.run.simulate import Frame

Bools = NDArray[np.bool_]

ON_QUANTILE, ON_SHARE = 0.995, 0.5  # the load is on above this share of this quantile of the heat
BEFORE_S = 120.0  # of a switch, that belong to its minutes
MOST_LEAD_K = 10.0  # of the copper over what is around it, where a record begins at rest
START_K, START_SHARE = 0.1, 0.2  # sd of a node's start about the others; more by this share of their excess at rest


def coarse(test: Test) -> Test:
    """The test in steps of one block (10 s), without meters; an end that fills no step is left out.

    Inputs, boundaries and features are means over a step; a channel is the mean of its samples there, at their mean
    place in the step.
    """
    many = max(1, round(BLOCK_S / test.frame.step_s))
    steps = len(test.frame.features) // many

    def means(values: Floats) -> Floats:
        return np.asarray(values[: steps * many].reshape(steps, many, *values.shape[1:]).mean(axis=1))

    def thinned(channel: RecordedChannel) -> RecordedChannel:
        samples = channel.samples[: steps * many].reshape(steps, many)
        total = np.maximum(samples.sum(axis=1), 1.0)
        values = np.where(samples > 0.0, channel.measured[: steps * many].reshape(steps, many), 0.0)
        place = (np.arange(many) + channel.place[: steps * many].reshape(steps, many)) / many
        measured, place = (np.asarray((samples * one).sum(axis=1) / total) for one in (values, place))
        return RecordedChannel(channel.sensor, measured, samples.sum(axis=1), place)

    return replace(
        test,
        frame=Frame(
            test.frame.step_s * many,
            np.ascontiguousarray(means(test.frame.features)),
            np.ascontiguousarray(means(test.frame.boundaries)),
        ),
        inputs={name: means(values) for name, values in test.inputs.items()},
        features={name: means(values) for name, values in test.features.items()},
        channels=tuple(thinned(channel) for channel in test.channels),
        meters=(),
    )


def by_place(test: Test, left_out: Collection[str]) -> Test:
    """The test with one channel in place of all that follow the same nodes with the same lag: their mean in the steps
    where each of them has samples; no channel where there is no such step. Channels named in `left_out` are dropped.
    Sensors of one lump are at different places of it, and their mean is nearer to what the lump stands for."""
    groups: dict[tuple[object, ...], list[RecordedChannel]] = {}
    for channel in test.channels:
        if channel.name not in left_out:
            place = (*sorted(channel.sensor.weights.items()), channel.sensor.time_constant_s)
            groups.setdefault(place, []).append(channel)
    means = map(_mean, groups.values())
    return replace(test, channels=tuple(channel for channel in means if channel.samples.any()))


def _mean(channels: Sequence[RecordedChannel]) -> RecordedChannel:
    first, many = channels[0].sensor, len(channels)
    rms = (float(np.sqrt(np.mean([getattr(c.sensor, name) ** 2 for c in channels]))) for name in NOISES)
    noise, resolution, bias_sd = (value / float(np.sqrt(many)) for value in rms)
    return RecordedChannel(
        replace(first, name=" + ".join(first.weights), noise=noise, resolution=resolution, bias_sd=bias_sd),
        measured=np.asarray(np.mean([c.measured for c in channels], axis=0), np.float64),
        samples=np.min([c.samples for c in channels], axis=0),
        place=np.asarray(np.mean([c.place for c in channels], axis=0), np.float64),
    )


NOISES = ("noise", "resolution", "bias_sd")


def begun_alike(network: Network, test: Test) -> Test:
    """The test of a body that was left to itself before: all its nodes start at the mean of what the sensors read
    first, the surer the nearer that is to the temperature around it, and what sensors differ by is mostly their error.
    A body that is more than `MOST_LEAD_K` off was not left to itself: each node starts where its own sensors say."""
    own = _first_readings(test)
    if not own:
        return test
    level, lead = float(np.mean(list(own.values()))), abs(_lead_K(test))
    if lead < MOST_LEAD_K:
        start = np.full(len(network.nodes), level)
    else:
        start = np.array([own.get(node.name, level) for node in network.nodes])
    return replace(test, initial=start, initial_sd=np.full(start.size, START_K + START_SHARE * lead))


def _first_readings(test: Test) -> dict[str, float]:
    """Node -> what the sensors that follow it alone read first [degC]."""
    found: dict[str, list[float]] = {}
    for channel in test.channels:
        there = np.flatnonzero(channel.samples > 0.0)
        if there.size and len(channel.sensor.weights) == 1:
            found.setdefault(channel.sensor.node, []).append(float(channel.measured[there[0]]))
    return {node: float(np.mean(values)) for node, values in found.items()}


def _lead_K(test: Test) -> float:
    """How far the body is above what is around it as the record begins [K]."""
    first = _first_readings(test)
    return float(np.mean(list(first.values())) - test.frame.boundaries[0].mean()) if first else 0.0


def of_iron(network: Network, channel: RecordedChannel) -> bool:
    """Whether a channel follows iron more than anything else."""
    region = {node.name: node.region for node in network.nodes}
    return region[channel.sensor.node] == "iron"


def without_iron(network: Network, test: Test) -> Test:
    """The test without the channels that follow iron."""
    return replace(test, channels=tuple(one for one in test.channels if not of_iron(network, one)))


def iron_moved(network: Network, test: Test, by_K: float) -> Test:
    """The test with the readings of channels that follow iron moved by so many K."""
    moved = (replace(c, measured=c.measured + by_K) if of_iron(network, c) else c for c in test.channels)
    return replace(test, channels=tuple(moved))


def load(network: Network, test: Test) -> tuple[int, int] | None:
    """First and last step of the last unbroken load, by the heat of the network's sources; None where there is none."""
    products, listed = products_of(network, test.frame.features), list(terms(network))
    heat = np.zeros(len(test.frame.features))
    for places in terms_of(network)[1].values():
        for i in places:
            heat += listed[i].coefficient * products[i]
    on = heat > ON_SHARE * np.quantile(heat, ON_QUANTILE)
    if not on.any() or not heat.max() > 0.0:
        return None
    last = int(np.flatnonzero(on)[-1])
    return int(np.max(np.flatnonzero(~on[:last]), initial=-1)) + 1, last


def every_s(test: Test) -> float:
    """Time between two steps with samples of the channel that has fewest [s]."""
    found = [np.flatnonzero(channel.samples > 0.0) for channel in test.channels]
    return test.frame.step_s * max(float(np.median(np.diff(there))) if there.size > 1 else 1.0 for there in found)


def minutes_of_switches(network: Network, test: Test, minutes: float) -> Test | None:
    """The test with only the samples from 2 min before to `minutes` after its load is switched on and off; None where
    neither switch has so many minutes recorded after it. A record that begins warm and under load holds no switching
    on."""
    found = load(network, test)
    if found is None:
        return None
    step_s = test.frame.step_s
    t_s = (np.arange(len(test.frame.features)) + 0.5) * step_s
    shown = np.zeros(t_s.size, dtype=np.bool_)
    switches = [found[0], found[1] + 1] if found[0] > 0 or abs(_lead_K(test)) < MOST_LEAD_K else [found[1] + 1]
    for at_s in (switch * step_s for switch in switches):
        until_s = at_s + 60.0 * minutes
        if until_s <= t_s[-1] + step_s:
            shown |= (t_s >= at_s - BEFORE_S) & (t_s <= until_s)
    cut = only(test, shown)
    return cut if cut.channels else None


def only(test: Test, shown: Bools) -> Test:
    """The test with the samples of the steps `shown` (N,) alone; channels that have none there are left out."""

    def cut(channel: RecordedChannel) -> RecordedChannel:
        return replace(channel, samples=np.where(shown, channel.samples, 0.0))

    return replace(test, channels=tuple(one for one in map(cut, test.channels) if one.samples.any()))
