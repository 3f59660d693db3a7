"""Where a motor without and with what was named differ: two models that explain the same readings.

Calibration bends coefficients until they stand in for a cause, as far as the sensors see. What they had to do for that
shows where no sensor sits and where no test was run. All differences are with what was named minus without, both run as
in a replay: nothing is fitted on the test.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from twin.diagnosis.next_tests import HOUR_S, Proposed, as_test, load_of
from twin.errors import DivergedError
from twin.fitting.actions import Parameter
from twin.fitting.fit import Fit
from twin.fitting.model import Floats, Model, Test
from twin.fitting.noise import floor_variance
from twin.motor.network import LOADS

SPEEDS, LOADED = (0.25, 0.5, 0.75, 1.0), (0.0, 0.7, 1.4)  # of the highest speed, of the load's root mean square
STEP_S = 10.0  # of an hour at one point: only its end counts
NEAR_SPEED = 0.05  # of the highest speed: no point is above the largest load that was recorded so near
HOTTER_K = 20.0  # than it ever was in the tests no node becomes that nothing limits
TELLS = 3.0  # times what a sensor may be off: so far apart two models are told apart


@dataclass(frozen=True)
class Relief:
    """A healthy difference and how far it moves `before` and `after` something was named, in the sd that it was given
    at first."""

    parameter: Parameter
    before: float
    after: float


@dataclass(frozen=True)
class NodeApart:
    """How far apart a node is over some tests [K], in the mean and at most, that in `test` at `t_s`."""

    node: str
    mean_K: float
    max_K: float
    test: int
    t_s: float


@dataclass(frozen=True)
class ReadingApart:
    """How far apart a sensor reads [K] after an hour at a point, over what it may be off: `times`."""

    name: str
    node: str
    differ_K: float
    times: float


@dataclass(frozen=True)
class PointApart:
    """An hour at constant `speed` and `load`, dimensionless: how far apart each node is at its end [K], and how far
    apart the sensors read."""

    words: str
    speed: float
    load: float
    nodes: Mapping[str, float]
    readings: Sequence[ReadingApart]


@dataclass(frozen=True)
class Foreseen:
    """A sensor in a test that was not run: what each model has it read (B,) [degC] at `t_s` (B,) [s] from the start,
    and what it may be off [K]."""

    name: str
    node: str
    floor_K: float
    t_s: Floats
    reads: Mapping[str, Floats]


def relieved(before: Fit, after: Fit, stated: Sequence[Parameter]) -> list[Relief]:
    """What all tests have in common of the healthy differences, those first that moved back most. `stated`: with the sd
    that each was given at first."""
    sd = {p.action: p.sd for p in stated if p.test is None}
    moved = [
        {p.action: (p, float(b)) for p, b in zip(fit.model.parameters, fit.beta, strict=True) if p.test is None}
        for fit in (before, after)
    ]
    both = [action for action in moved[0] if action in moved[1] and action in sd]
    found = [Relief(moved[0][a][0], moved[0][a][1] / sd[a], moved[1][a][1] / sd[a]) for a in both]
    return sorted(found, key=lambda one: abs(one.after) - abs(one.before))


def unseen(tests: Sequence[Test], nodes: Sequence[str]) -> list[str]:
    """The nodes that no sensor of the tests follows."""
    seen = {channel.sensor.node for test in tests for channel in test.channels}
    return [node for node in nodes if node not in seen]


def inside(before: Fit, after: Fit, tests: Sequence[Test]) -> list[NodeApart]:
    """The nodes without a sensor over the tests, the furthest apart in the mean first. Raises `DivergedError`."""
    names = [node.name for node in before.model.network.nodes]
    models = [_replayed(fit, tests) for fit in (before, after)]
    courses = [[model.course(s, beta)[1] for s in range(len(tests))] for model, beta in models]
    apart = [np.abs(b - a) for a, b in zip(*courses, strict=True)]
    found = []
    for name in unseen([*before.model.tests, *tests], names):
        own = [one[:, names.index(name)] for one in apart]
        worst = max(range(len(own)), key=lambda s: float(own[s].max()))
        at = (int(own[worst].argmax()) + 0.5) * tests[worst].frame.step_s
        found.append(NodeApart(name, float(np.concatenate(own).mean()), float(own[worst].max()), worst, at))
    return sorted(found, key=lambda one: -one.mean_K)


def points(before: Fit, after: Fit) -> list[PointApart]:
    """Points of an hour over the speeds and loads that the tests show, as far as neither model makes a node much hotter
    there than it ever was; [] where the tests know no speed or load."""
    hottest = np.max([before.model.course(s, before.beta)[1].max(axis=0) for s in range(len(before.model.tests))], 0)
    return [
        point
        for proposed in _menu(before.model)
        if (point := _point(before, after, proposed, hottest + HOTTER_K)) is not None
    ]


def usual_floor(fit: Fit) -> float:
    """What a sensor may be off [K]: the median of those that there are."""
    return float(np.median([_floor(fit, c.name, c.sensor.bias_sd) for t in fit.model.tests for c in t.channels]))


def foreseen(fits: Mapping[str, Fit], proposed: Proposed) -> list[Foreseen]:
    """Every sensor in a test, by each of the models that does not run away in it; [] where all do."""
    first = next(iter(fits.values()))
    test = as_test(first.model.network, first.model.tests, proposed)
    read: dict[str, dict[str, Floats]] = {}
    t_s: dict[str, Floats] = {}
    for name, fit in fits.items():
        model, beta = _replayed(fit, [test])
        try:
            series = model.residuals(beta)
        except DivergedError:
            continue
        for one in series:
            read.setdefault(one.channel, {})[name] = -one.y  # the readings of the test are 0
            t_s[one.channel] = one.t_s
    return [
        Foreseen(c.name, c.sensor.label, _floor(first, c.name, c.sensor.bias_sd), t_s[c.name], read[c.name])
        for c in test.channels
        if c.name in read
    ]


def _menu(model: Model) -> Iterator[Proposed]:
    tests, scale = model.tests, model.network.scale
    load = load_of(tests)
    if load is None or not all("speed" in t.inputs for t in tests):
        return
    speeds, loads = (np.concatenate([t.inputs[name] for t in tests]) for name in ("speed", load))
    top, usual = float(speeds.max()), float(np.sqrt(np.mean(loads**2)))
    ones = np.ones(round(HOUR_S / STEP_S))
    for speed in (share * top for share in SPEEDS):
        most = float(loads[np.abs(speeds - speed) <= NEAR_SPEED * top].max(initial=0.0))
        for level in (share * usual for share in LOADED):
            if level <= most:
                words = f"S1 at {speed * scale['speed']:,.0f} rpm and {level * scale[load]:.0f} {LOADS[load]}, 60 min"
                yield Proposed(words, speed * ones, level * ones, ones)


def _point(before: Fit, after: Fit, proposed: Proposed, hottest: Floats) -> PointApart | None:
    """None where a model runs away, or makes a node hotter than it should become."""
    test = as_test(before.model.network, before.model.tests, proposed)
    test = replace(test, frame=replace(test.frame, step_s=STEP_S))
    names = [node.name for node in before.model.network.nodes]
    ends, readings = [], []
    for fit in (before, after):
        model, beta = _replayed(fit, [test])
        try:
            ends.append(model.course(0, beta)[1][-1])
        except DivergedError:
            return None
        readings.append({series.channel: -float(series.y[-1]) for series in model.residuals(beta)})
    if (np.maximum(*ends) > hottest).any():
        return None
    found = []
    for channel in test.channels:
        differ = readings[1][channel.name] - readings[0][channel.name]
        floor = _floor(before, channel.name, channel.sensor.bias_sd)
        found.append(ReadingApart(channel.name, channel.sensor.label, differ, abs(differ) / floor))
    nodes = dict(zip(names, (ends[1] - ends[0]).tolist(), strict=True))
    return PointApart(proposed.words, float(proposed.speed[0]), float(proposed.load[0]), nodes, found)


def _replayed(fit: Fit, tests: Sequence[Test]) -> tuple[Model, Floats]:
    """The motor and sensors of a fit on other tests, and the vector."""
    shared = [p.test is None for p in fit.model.parameters]
    parameters = [p for p, own in zip(fit.model.parameters, shared, strict=True) if own]
    return Model(fit.model.network, tests, parameters, fit.model.noise), fit.beta[np.array(shared)]


def _floor(fit: Fit, channel: str, bias_sd: float) -> float:
    """What no reading of a channel could be better than in a test [K]: noise of a block, and the offset."""
    variance = [floor_variance(s, fit.model.noise_of(channel)) for s in fit.series if s.channel == channel]
    return float(np.hypot(np.sqrt(np.mean(variance)), bias_sd))
