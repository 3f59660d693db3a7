"""What each sensor is worth: withheld in turn and estimated from the others; and the margin from a vehicle's sensors
to the hot spot.

A filter as it would run in a vehicle (readings so far) estimates what the withheld channel shows. The hot spot itself
is taken from the smoother with every channel.

Bands are as wide as the errors of other sessions ask for (`bands`), and the hot spot is as uncertain as windings are
when their own channels are withheld.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import norm

from ingest.catalogue.channels import load
from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.files.configurations import network_of
from replay.engine.frame.frame import InputFrame
from replay.engine.frame.frame_of import session_frame
from replay.engine.frame.observations import Observation
from replay.engine.results.filtered import (
    at_their_paces,
    filter_start,
    heats_elsewhere,
    is_read,
    mean_losses,
    reading_errors,
    reading_of,
    uncertain_node,
    unknown_loss,
    unread,
)
from replay.engine.results.hot_spots import nodes_of
from replay.engine.results.kernel_cache import load_kernel
from replay.engine.results.open_loop import modelled
from replay.engine.specimen.aged import of_specimen
from replay.errors import ReplayDataError
from replay.studies.characterise.bands import SessionErrors, banded, widenings
from replay.studies.characterise.calibrate import common_model
from replay.studies.sessions.fitting import fitting
from twin.filters.ekf import filter_unknowns
from twin.filters.inputs import FilterStart
from twin.filters.smoother import smoothed
from twin.filters.unknowns import Unknown, UnknownFactor, UnknownHeat
from twin.motor.network import Network
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]
Tell = Callable[[str], None]

SETTLE_S = 300.0  # of a session: what the start was wrong by is no sensor's worth
TOLERATED_K = 2.0  # mean error up to which a sensor is done without


@dataclass(frozen=True)
class Withheld:
    """A channel estimated without its own readings, over all sessions. `mae_K` and `max_K` are of the filter from the
    `others`, `open_loop_K` is the mean error of the model alone; `band_K` half width of the 95 % band (mean),
    `covered` the share of the readings of its `sessions` within that band; `filter_band_K`, `filter_covered` the same
    of the filter's own band. `widened`: the band of each session is the one that the others ask for; where not, there
    are too few of them, and it is the filter's own."""

    channel: str
    node: str
    mae_K: float
    max_K: float
    open_loop_K: float
    band_K: float
    covered: float
    filter_band_K: float
    filter_covered: float
    sessions: int
    widened: bool


@dataclass(frozen=True)
class Left:
    """One step of doing without: the channel of those left that is missed least, and the largest mean error [K] of all
    that are done without then."""

    channel: str
    worst_mae_K: float


@dataclass(frozen=True)
class Margin:
    """From a vehicle's channels to the hottest winding: how much must be left to the limit so that the hot spot
    passes it in no more than `risk` of the time. `from_sensor_K` above the hottest reading, `from_filter_K` above
    what a filter makes of them."""

    channels: tuple[str, ...]
    risk: float
    from_sensor_K: float
    from_filter_K: float
    hottest: str


@dataclass(frozen=True)
class Worth:
    """What each sensor is worth: `withheld` by channel; `order` in which they are done without, least missed first;
    `margin`, None without a vehicle's channel."""

    network: Network
    model: str
    sessions: tuple[SessionRecorded, ...]
    node: str
    withheld: tuple[Withheld, ...]
    order: tuple[Left, ...]
    margin: Margin | None


@dataclass(frozen=True)
class _Recorded:
    """A session as the filters take it. `asked`: the loss at `node`, as large and as fast as its size says; `unknowns`:
    it and then heats in other parts of the motor where a thermometer is, at the paces that all readings ask for."""

    network: Network
    frame: InputFrame
    inputs: Frame
    node: str
    asked: UnknownHeat | UnknownFactor
    unknowns: Sequence[Unknown]
    open_loop: Floats

    @property
    def nodes(self) -> tuple[str, ...]:
        return tuple(node.name for node in self.network.nodes)

    def observation(self, channel: str) -> Observation | None:
        return next((o for o in self.frame.observations if o.sensor.name == channel), None)

    def unknown(self, seen: Sequence[Observation]) -> list[Unknown]:
        """What a filter of these readings seeks: the loss, heats where it reads, and what it reads too much."""
        sensors = [o.sensor for o in seen]
        loss, *heats = self.unknowns
        loss = loss if is_read(self.network, self.asked, sensors) else unread(self.asked)
        read = {one.followed for one in sensors}
        return [loss, *(heat for heat in heats if heat.name in read), *reading_errors(sensors)]

    def start(self, seen: Sequence[Observation]) -> FilterStart:
        frame = replace(self.frame, observations=tuple(seen))
        return filter_start(self.network, frame, "testing")


def sensors_worth(
    store: Store,
    facts: Facts,
    sessions: Sequence[SessionRecorded],
    model: str | None,
    vehicle: Sequence[str],
    risk: float,
    tell: Tell,
) -> Worth:
    """What each sensor of the sessions is worth. `vehicle`: channels that a vehicle has; those of level production
    where none are named; `risk` as in `Margin`.

    Raises ReplayDataError where under two channels observe nodes, or a named channel is not there.
    """
    model = model or common_model(facts, sessions)
    recorded = []
    with fitting("weighing sensors"):
        for session in sessions:
            tell(f"reading {session.name}")
            recorded.append(_recorded(store, facts, session, model))
        every = [o.sensor for one in recorded for o in one.frame.observations]
        channels = sorted({sensor.name for sensor in every})
        if len(channels) < 2:
            raise ReplayDataError(
                "fewer than two channels observe nodes of the motor: there is nothing to estimate one from."
            )
        own = tuple(vehicle) or tuple(sorted({sensor.name for sensor in every if sensor.level == "production"}))
        if unknown := [name for name in own if name not in channels]:
            raise ReplayDataError(
                f'no channel "{unknown[0]}" observes a node in these sessions: name one of {", ".join(channels)}.'
            )
        withheld, errors = [], dict[str, list[SessionErrors]]()
        for channel in channels:
            tell(f"without {channel}")
            one, errors[channel] = _withheld(recorded, channel, [c for c in channels if c != channel])
            withheld.append(one)
        tell("doing without one after the other")
        order = _order(recorded, channels, {one.channel: one.mae_K for one in withheld})
        tell("the margin to the hot spot")
        margin = _margin(recorded, own, risk, _winding_K(recorded, errors)) if own else None
    return Worth(recorded[0].network, model, tuple(sessions), recorded[0].node, tuple(withheld), tuple(order), margin)


def _recorded(store: Store, facts: Facts, session: SessionRecorded, model: str) -> _Recorded:
    specimen = of_specimen(store, facts, session, network_of(store, facts, session, model))
    network = specimen.network
    frame = session_frame(session, load(store, facts, session), network, specimen.hours)
    inputs = Frame(frame.step_s, frame.features, frame.boundaries)
    start = filter_start(network, frame, "testing")
    open_loop = simulate(load_kernel(network), inputs, start.temperatures)
    losses = mean_losses(network, inputs, open_loop)
    node = uncertain_node(network, losses) or max(losses, key=lambda name: losses[name])
    readings = [reading_of(o, frame) for o in frame.observations]
    asked = unknown_loss(network, node, losses)
    sensors = [o.sensor for o in frame.observations]
    heats, errors = heats_elsewhere(network, losses, sensors, [asked]), reading_errors(sensors)
    unknowns = at_their_paces(network, inputs, start, [asked], [*heats, *errors], readings)
    return _Recorded(network, frame, inputs, node, asked, unknowns[: 1 + len(heats)], open_loop)


def _filtered(one: _Recorded, seen: Sequence[str]) -> tuple[Floats, Floats]:
    """Temperatures and their sd (N + 1, n) from some channels' readings so far."""
    observations = [o for o in one.frame.observations if o.sensor.name in seen]
    readings = [reading_of(o, one.frame) for o in observations]
    found = filter_unknowns(one.network, one.inputs, one.start(observations), one.unknown(observations), readings)
    return found.temperatures, found.temperatures_sd


def _errors(one: _Recorded, channel: str, temperatures: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Measured less estimated (N,) [K] of a channel, and where it counts."""
    o = one.observation(channel)
    if o is None:
        steps = len(one.inputs.features)
        return np.zeros(steps), np.zeros(steps, dtype=np.bool_)
    after = np.arange(len(o.measured)) * one.frame.step_s >= SETTLE_S
    return o.measured - modelled(o, one.frame, temperatures, one.nodes), o.good & one.frame.live & after


def _withheld(
    recorded: Sequence[_Recorded], channel: str, others: Sequence[str]
) -> tuple[Withheld, list[SessionErrors]]:
    """What a channel is like from the others, and its errors, one entry for each session."""
    sessions, alone, label = [], [], ""
    for one in recorded:
        o = one.observation(channel)
        if o is None:
            continue
        label = o.sensor.label
        temperatures, sd = _filtered(one, others)
        error, use = _errors(one, channel, temperatures)
        if not use.any():
            continue
        weights = np.array([o.sensor.weights.get(node, 0.0) for node in one.nodes])
        own = sd[1:] @ weights  # as if all nodes of a mixture were off together
        sessions.append(SessionErrors(error[use], np.sqrt(own[use] ** 2 + o.sensor.noise**2 + o.sensor.bias_sd**2)))
        alone.append(_errors(one, channel, one.open_loop)[0][use])
    if not sessions:
        raise ReplayDataError(f'channel "{channel}" has no usable sample after the first {SETTLE_S / 60:.0f} min.')
    error, factors = np.concatenate([one.K for one in sessions]), widenings(sessions)
    plain = [1.0] * len(sessions)
    band_K, covered = banded(sessions, factors or plain)
    filter_band_K, filter_covered = banded(sessions, plain)
    found = Withheld(
        channel=channel,
        node=label,
        mae_K=float(np.abs(error).mean()),
        max_K=float(np.abs(error).max()),
        open_loop_K=float(np.abs(np.concatenate(alone)).mean()),
        band_K=band_K,
        covered=covered,
        filter_band_K=filter_band_K,
        filter_covered=filter_covered,
        sessions=len(sessions),
        widened=bool(factors),
    )
    return found, sessions


def _order(recorded: Sequence[_Recorded], channels: Sequence[str], first: dict[str, float]) -> list[Left]:
    """Greedily, at each step the channel without which the worst estimate of all that are done without stays
    smallest."""
    left, gone, found = list(channels), list[str](), list[Left]()
    while len(left) > 1:
        tried = {c: first[c] if not gone else _worst(recorded, [x for x in left if x != c], [*gone, c]) for c in left}
        best = min(tried, key=lambda c: tried[c])
        left.remove(best)
        gone.append(best)
        found.append(Left(best, tried[best]))
    return found


def _worst(recorded: Sequence[_Recorded], seen: Sequence[str], gone: Sequence[str]) -> float:
    """The largest mean error of the channels that are gone, over all sessions [K]."""
    parts: dict[str, list[Floats]] = {channel: [] for channel in gone}
    for one in recorded:
        temperatures, _ = _filtered(one, seen)
        for channel in gone:
            error, use = _errors(one, channel, temperatures)
            parts[channel].append(np.abs(error[use]))
    return max(float(np.concatenate(errors).mean()) for errors in parts.values())


def _winding_K(recorded: Sequence[_Recorded], errors: Mapping[str, Sequence[SessionErrors]]) -> float:
    """Root mean square [K] of what windings are off by when their own channels are withheld; of all channels where
    none is at a winding."""
    windings = {one.network.nodes[i].name for one in recorded for i in nodes_of("winding", one.network)}
    labels = {o.sensor.name: o.sensor.label for one in recorded for o in one.frame.observations}
    of = [channel for channel in errors if labels[channel] in windings] or list(errors)
    return float(np.sqrt(np.mean([np.mean(one.K**2) for channel in of for one in errors[channel]])))


def _margin(recorded: Sequence[_Recorded], vehicle: Sequence[str], risk: float, off_K: float) -> Margin:
    """The margin from a vehicle's channels. The hot spot is the hottest winding node of the smoother with every
    channel, normal about it with the smoother's standard deviation and `off_K` besides."""
    above_sensor, above_filter, spread, hottest = [], [], [], dict[str, int]()
    for one in recorded:
        winding = nodes_of("winding", one.network)
        seen = [o for o in one.frame.observations if o.sensor.name in vehicle]
        if not winding or not seen:
            continue
        readings = [reading_of(o, one.frame) for o in one.frame.observations]
        every = smoothed(one.network, one.inputs, one.start(one.frame.observations), one.unknowns, readings)
        at = np.argmax(every.temperatures[1:, winding], axis=1)
        rows = np.arange(len(at))
        hot, sd = every.temperatures[1:, winding][rows, at], every.temperatures_sd[1:, winding][rows, at]
        shown = np.nanmax(np.where([o.good for o in seen], [o.measured for o in seen], np.nan), axis=0, initial=-np.inf)
        estimated = _filtered(one, vehicle)[0][1:, winding].max(axis=1)
        use = np.isfinite(shown) & one.frame.live & (rows * one.frame.step_s >= SETTLE_S)
        above_sensor.append(hot[use] - shown[use])
        above_filter.append(hot[use] - estimated[use])
        spread.append(np.hypot(sd[use], off_K))
        for place, count in zip(*np.unique(at[use], return_counts=True), strict=True):
            name = one.nodes[winding[int(place)]]
            hottest[name] = hottest.get(name, 0) + int(count)
    if not hottest:
        raise ReplayDataError(
            "no session has a winding node and a channel of the vehicle: there is no hot spot to keep away from."
        )
    sd = np.concatenate(spread)
    return Margin(
        channels=tuple(vehicle),
        risk=risk,
        from_sensor_K=exceeded_by(np.concatenate(above_sensor), sd, risk),
        from_filter_K=exceeded_by(np.concatenate(above_filter), sd, risk),
        hottest=max(hottest, key=lambda name: hottest[name]),
    )


def exceeded_by(mean: Floats, sd: Floats, risk: float) -> float:
    """The m that normals of `mean` and `sd` (N,) [K] exceed with the probability `risk`, all equally likely."""

    def beyond(m: float) -> float:
        return float(norm.sf(m, mean, sd).mean()) - risk

    reach = 12 * float(sd.max())
    return float(brentq(beyond, float(mean.min()) - reach, float(mean.max()) + reach))
