"""Filter and smoother over a session: temperatures corrected by measured channels, and the heat that these ask for.

What the network has wrong at a node that a thermometer reads is a heat there. In other parts of the motor it is sought
beside what is asked for, each heat as large as the loss at its node makes it likely: with one unknown alone, a stator
that is 2 K off was 80 W of the rotor behind it, and a rotor without a sensor 100 K off. How fast the heat of a part
wanders, only a thermometer there can tell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar, assert_never

import numpy as np
from numpy.typing import NDArray

from replay.engine.frame.frame import InputFrame
from replay.engine.frame.observations import Meter, Observation
from replay.engine.results.heat_readings import heat_readings
from replay.engine.results.hot_spot_bands import smoothed_spots
from replay.engine.results.kernel_cache import load_kernel
from replay.engine.results.open_loop import initial_by_reading, initial_temperatures, modelled, referenced
from replay.engine.results.run import Filtered, Smoothed
from replay.engine.results.summary import EstimatedHeat, FilterSummary, FoundUnknown, HeatAtNode, SmoothedSpot
from twin.filters.ekf import Estimate, at_their_pace
from twin.filters.inputs import AnyReading, FilterStart, HeatReading, Inputs, Reading, inputs_of
from twin.filters.smoother import smoothed
from twin.filters.unknowns import Unknown, UnknownBias, UnknownFactor, UnknownHeat
from twin.motor.causes import parse
from twin.motor.network import Network
from twin.motor.sensor import Sensor
from twin.run.losses import heat_flows
from twin.run.simulate import Frame, simulate, source_heat

Floats = NDArray[np.float64]
U = TypeVar("U", bound=Unknown)

MOST_NODES = 100  # above, a pass over a session takes longer than all else of a replay, by the cube of the nodes
LEAST_NOISE_K = 0.01  # of one sample: no sensor is without, whatever its bench file says
LEAST_LOSS_W = 1.0  # of a motor at rest: the sizes of unknown heats follow its mean loss
LEAST_SHARE = 0.05  # of the loss of the whole network: no unknown heat is smaller, however little its node has
UNREAD_SHARE = 0.2  # of an unknown's size, in a part of the motor that nothing reads
HEAT_WALK_SHARE = 0.001  # of an unknown heat's random walk per root of a second, of its size: where the search begins
ERROR_WANDERS_S = 3600.0  # in which a thermometer's error, such as of its place in a lump, wanders by its own size
MOST_FACTOR_SD = 0.7  # of the logarithm of what multiplies a loss: a factor of two
NOTHING_ASKED: Mapping[str, Unknown] = {}


@dataclass(frozen=True, kw_only=True)
class Estimated(Filtered):
    """What a filter has just found: also what it was `given` and the `estimate` as it came, the standard deviation of
    the smoother's temperatures (N + 1, n) [K], its hot spots, and each cause that was asked for."""

    given: Inputs
    estimate: Estimate
    smoothed_sd_K: Floats
    spots: dict[str, SmoothedSpot] = field(default_factory=dict)
    asked: list[FoundUnknown] = field(default_factory=list)


def filter_session(
    network: Network,
    frame: InputFrame,
    losses: Mapping[str, float],
    level: str,
    asked: Mapping[str, Unknown] = NOTHING_ASKED,
    measured: Sequence[str] | None = None,
) -> Estimated | None:
    """What filter and smoother make of a session: temperatures, and the loss at one node. None where the motor has no
    such node or more than `MOST_NODES`, or there is no channel to read.

    `losses`: node -> mean modelled loss [W]. `asked`: id of a cause -> the unknown to be found for it, losses first
    (`replay.engine.results.asked_unknowns`). The node is that of the first loss in `asked`; without one it is the
    magnet with the largest loss, else the rotor node with the largest. Several magnets have one unknown together: a
    factor on the losses of all of them. All else in `asked` is found beside.

    `measured`: names of the channels to read; left out, all of this level but those of magnets, which are kept to check
    the filter and set no initial temperature either. A resistance is read as the temperature that it stands for, with
    an error of its own to be found; powers and heats are read beside thermometers, and their error is also that of the
    model's other losses (`replay.engine.results.heat_readings`). Raises `FrameError`, `DivergedError` as
    `twin.filters.ekf.filter_unknowns`.
    """
    own = list(asked.values())
    said = place_of_loss(own[0]) if own else None
    node = said or uncertain_node(network, losses)
    channels = _production_like(network, frame, level) if measured is None else measured
    seen = tuple(o for o in frame.observations if o.sensor.name in channels)
    chosen = [m for m in frame.meters if m.seen.sensor.name in channels]
    meters = [m for m in chosen if m.what.law is not None]
    if node is None or not (seen or meters) or len(network.nodes) > MOST_NODES:
        return None
    inputs = Frame(step_s=frame.step_s, features=frame.features, boundaries=frame.boundaries)
    begun = replace(frame, observations=seen)
    temperatures, sd = initial_temperatures(network, begun, level)
    start = filter_start(network, begun, level)
    own = own if said else [unknown_loss(network, node, losses), *own]
    sensors = [o.sensor for o in seen]
    of_form = [] if len(chosen) > len(meters) else heats_elsewhere(network, losses, sensors, own)
    begins = {n.name: (float(t), float(s)) for n, t, s in zip(network.nodes, temperatures, sd, strict=True)}
    converted = [_as_thermometer(m, begins) for m in meters]
    readings = [reading_of(o, frame) for o in (*seen, *(o for o, _ in converted))]
    errors = [*reading_errors(sensors, own), *(UnknownBias(o.sensor.name, sd_K) for o, sd_K in converted)]
    unknowns = at_their_paces(network, inputs, start, own, [*of_form, *errors], readings)
    paced = unknowns[0]
    assert not isinstance(paced, UnknownBias)  # a loss is first
    heats = _heats(chosen, network, frame, inputs, temperatures, node)
    every: list[AnyReading] = [*readings, *(reading for reading, _ in heats)]
    sought = [*unknowns, *(error for _, error in heats)]
    smooth = smoothed(network, inputs, start, sought, every)
    estimate = smooth.filtered
    at_node = [i for i, source in enumerate(network.sources) if source.node == node]

    def loss(temperatures: Floats, found: Floats, found_sd: Floats) -> tuple[Floats, Floats, Floats]:
        """The loss at the node (N,) [W]: as modelled, as estimated, and the standard deviation of the estimate."""
        nominal: Floats = source_heat(network, inputs, temperatures)[:, at_node].sum(axis=1)
        if isinstance(paced, UnknownHeat):
            return nominal, nominal + found, found_sd
        return nominal, nominal * np.exp(found), nominal * np.exp(found) * found_sd

    thermometers = slice(len(readings))
    innovations, variances = estimate.innovations[:, thermometers], estimate.variances[:, thermometers]
    nominal, heat_W, heat_sd_W = loss(estimate.temperatures, estimate.found[1:, 0], estimate.found_sd[1:, 0])
    _, smooth_W, smooth_sd_W = loss(smooth.temperatures, smooth.found[:-1, 0], smooth.found_sd[:-1, 0])
    found = zip(asked.items(), range(len(own) - len(asked), len(own)), strict=True)
    return Estimated(
        given=inputs_of(network, inputs, start, sought, every),
        estimate=estimate,
        smoothed_sd_K=smooth.temperatures_sd,
        node=node,
        measured=tuple(r.channel for r in every),
        temperatures=estimate.temperatures,
        heat_W=heat_W,
        heat_sd_W=heat_sd_W,
        nominal_W=nominal,
        heat_walk_W=paced.walk_W if isinstance(paced, UnknownHeat) else paced.walk * float(nominal.mean()),
        nis=replace(estimate, innovations=innovations, variances=variances).nis,
        smoothed=Smoothed(smooth.temperatures, smooth_W, smooth_sd_W),
        spots=smoothed_spots(network, frame, smooth.temperatures, smooth.temperatures_sd, channels),
        asked=[_found(cause, one, smooth.found[:-1, i], smooth.found_sd[:-1, i]) for (cause, one), i in found],
    )


def mean_losses(network: Network, inputs: Frame, temperatures: Floats) -> dict[str, float]:
    """Node -> its mean modelled loss [W] at temperatures (N + 1, n); nodes without a source are left out."""
    heat = source_heat(network, inputs, temperatures).mean(axis=0)
    losses = dict.fromkeys((source.node for source in network.sources), 0.0)
    for source, watts in zip(network.sources, heat, strict=True):
        losses[source.node] += float(watts)
    return losses


def filter_summary(filtered: Estimated, frame: InputFrame, nodes: tuple[str, ...]) -> FilterSummary:
    """An estimate in numbers, beside what was measured. `nodes`: those of its temperatures, in order."""
    smooth = filtered.smoothed

    def errors(temperatures: Floats, seen: bool) -> dict[str, float]:
        found = {}
        for o in (o for o in frame.observations if (o.sensor.name in filtered.measured) == seen):
            if (use := o.good & frame.live).any():
                residual = o.measured - modelled(o, frame, temperatures, nodes)
                found[o.sensor.name] = float(np.abs(residual[use]).mean())
        return found

    return FilterSummary(
        node=filtered.node,
        measured=list(filtered.measured),
        mae_K=errors(filtered.temperatures, seen=False),
        smoothed_mae_K=None if smooth is None else errors(smooth.temperatures, seen=False),
        read_mae_K=errors(filtered.temperatures, seen=True),
        smoothed_read_mae_K=None if smooth is None else errors(smooth.temperatures, seen=True),
        heat_bias_W=float((filtered.heat_W - filtered.nominal_W).mean()),
        heat_walk_W_per_sqrt_s=filtered.heat_walk_W,
        heat=HeatAtNode(
            modelled_mean_W=float(filtered.nominal_W.mean()),
            filter=_heat(filtered.heat_W, filtered.heat_sd_W, frame.step_s, 1),
            smoother=None if smooth is None else _heat(smooth.heat_W, smooth.heat_sd_W, frame.step_s, 0),
        ),
        hot_spots=filtered.spots,
        nis=filtered.nis if np.isfinite(filtered.nis) else None,
        unknowns=filtered.asked,
    )


def _heat(heat_W: Floats, sd_W: Floats, step_s: float, late: int) -> EstimatedHeat:
    """A course of heat (N,) in a few numbers. `late`: 1 where the heat of a step is known at its end only, else 0."""
    k = int(np.argmax(heat_W))
    return EstimatedHeat(
        mean_W=float(heat_W.mean()),
        sd_W=float(np.sqrt((sd_W**2).mean())),
        max_W=float(heat_W[k]),
        max_sd_W=float(sd_W[k]),
        max_at_s=(k + late) * step_s,
    )


def _found(cause: str, unknown: Unknown, found: Floats, sd: Floats) -> FoundUnknown:
    """A cause that was asked for, in a few numbers, from what the smoother found of it (N,)."""
    unit = {UnknownHeat: "W", UnknownFactor: "1", UnknownBias: "K"}[type(unknown)]
    if isinstance(unknown, UnknownFactor):
        found, sd = np.exp(found), np.exp(found) * sd
    return FoundUnknown(
        id=cause,
        unit=unit,
        mean=float(found.mean()),
        sd=float(np.sqrt((sd**2).mean())),
        min=float(found.min()),
        max=float(found.max()),
    )


def place_of_loss(unknown: Unknown) -> str | None:
    """The node whose loss an unknown is about; None of a conductance or a sensor."""
    if isinstance(unknown, UnknownHeat):
        return unknown.node
    if isinstance(unknown, UnknownFactor) and parse(unknown.of).kind == "loss":
        return parse(unknown.of).place
    return None


def unknown_heat(node: str, losses: Mapping[str, float]) -> UnknownHeat:
    """The unknown heat at a node, at the start as large as its mean modelled loss, or as a share of that of all nodes.
    `losses` [W]: of all nodes."""
    size_W = max(losses.get(node, 0.0), LEAST_SHARE * sum(losses.values()), LEAST_LOSS_W)
    return UnknownHeat(node, size_W, HEAT_WALK_SHARE * size_W)


def heats_elsewhere(
    network: Network, losses: Mapping[str, float], sensors: Sequence[Sensor], asked: Sequence[Unknown]
) -> list[UnknownHeat]:
    """An unknown heat at each node that one of these thermometers follows, in parts of the motor where nothing is
    `asked` for: the whole rotor is one part, else all nodes of a region are."""
    part, taken = _parts(network), {part for one in asked for part in _about(network, one, sensors)}
    read = dict.fromkeys(one.followed for one in sensors if one.followed is not None)
    return [unknown_heat(node, losses) for node in read if part[node] not in taken]


def reading_errors(sensors: Sequence[Sensor], asked: Sequence[Unknown] = ()) -> list[UnknownBias]:
    """What each of these thermometers reads too much: within its `bias_sd` at the start, and wandering by as much in
    `ERROR_WANDERS_S`; but for those whose error is `asked` for."""
    taken = {one.channel for one in asked if isinstance(one, UnknownBias)}
    wrong = [one for one in sensors if one.bias_sd > 0 and one.name not in taken]
    return [UnknownBias(one.name, one.bias_sd, one.bias_sd / np.sqrt(ERROR_WANDERS_S)) for one in wrong]


def filter_start(network: Network, frame: InputFrame, level: str) -> FilterStart:
    """Where a filter of the frame's thermometers begins: at `initial_temperatures`, which their errors are in."""
    right = [replace(o, sensor=replace(o.sensor, bias_sd=0.0)) for o in frame.observations]
    temperatures, sd = initial_temperatures(network, replace(frame, observations=tuple(right)), level)
    return FilterStart(temperatures, sd, by_reading=initial_by_reading(network, frame, level))


def at_their_paces(
    network: Network,
    frame: Frame,
    start: FilterStart,
    asked: Sequence[Unknown],
    beside: Sequence[Unknown],
    readings: Sequence[Reading],
) -> list[Unknown]:
    """What is asked for and then what is sought beside it, each at the pace that the readings ask for; in a part of the
    motor that none of them reads, `unread`. Raises as `twin.filters.ekf.at_their_pace`."""
    sensors = [one.sensor for one in readings]
    read = [one for one in asked if is_read(network, one, sensors)]
    sized = [one if one in read else unread(one) for one in asked]
    paced = at_their_pace(network, frame, start, beside, readings, sized)
    others = [one for one in sized if one not in read]
    found = dict(zip(read, at_their_pace(network, frame, start, read, readings, [*others, *paced]), strict=True))
    return [*(found.get(one, one) for one in sized), *paced]


def unread(unknown: U) -> U:
    """An unknown in a part of the motor that nothing reads: smaller and slower, for whatever other readings seem to say
    of it is mostly what the network has wrong where they are. An error of a sensor stays."""
    match unknown:
        case UnknownHeat():
            return replace(unknown, sd_W=UNREAD_SHARE * unknown.sd_W, walk_W=UNREAD_SHARE * unknown.walk_W)
        case UnknownFactor():
            return replace(unknown, sd=UNREAD_SHARE * unknown.sd, walk=UNREAD_SHARE * unknown.walk)
        case UnknownBias():
            return unknown
        case _:
            assert_never(unknown)


def is_read(network: Network, unknown: Unknown, sensors: Sequence[Sensor]) -> bool:
    """Whether one of these thermometers follows a node in a part of the motor that an unknown is about."""
    part, about = _parts(network), _about(network, unknown, sensors)
    return any(part[one.followed] in about for one in sensors if one.followed is not None)


def _parts(network: Network) -> dict[str, str]:
    """Node -> the part of the motor that it is of."""
    return {node.name: "rotor" if node.region == "magnet" else node.region for node in network.nodes}


def _about(network: Network, unknown: Unknown, sensors: Sequence[Sensor]) -> set[str]:
    """The parts of the motor that an unknown is about; of a boundary none."""
    part, followed = _parts(network), {one.name: one.followed for one in sensors}
    return {part[place] for place in _places(unknown, followed) if place in part}


def _places(unknown: Unknown, followed: Mapping[str, str | None]) -> list[str]:
    """The nodes that an unknown is about. `followed`: channel -> the node that it follows."""
    match unknown:
        case UnknownHeat():
            return [unknown.node]
        case UnknownFactor():
            return [end for cause in (unknown.of, *unknown.also) for end in parse(cause).ends]
        case UnknownBias():
            node = followed.get(unknown.channel)
            return [] if node is None else [node]
        case _:
            assert_never(unknown)


def unknown_loss(network: Network, node: str, losses: Mapping[str, float]) -> UnknownHeat | UnknownFactor:
    """The unknown at a node whose loss is sought: a heat, or for one of several magnets, as in slices of a stack, a
    factor on the losses of all: a heat in one slice would leave the others as they are, which no sensor may see."""
    heat = unknown_heat(node, losses)
    magnets = [n.name for n in network.nodes if n.region == "magnet" and losses.get(n.name, 0.0) > 0]
    if node not in magnets or len(magnets) == 1:
        return heat
    sd = min(heat.sd_W / sum(losses[name] for name in magnets), MOST_FACTOR_SD)
    of, *also = (f"loss.{name}.scale" for name in magnets)
    return UnknownFactor(of, sd, sd * heat.walk_W / heat.sd_W, tuple(also))


def uncertain_node(network: Network, losses: Mapping[str, float]) -> str | None:
    """The node whose loss is known least: the magnet with the largest loss, without magnets the rotor node."""
    for region in ("magnet", "rotor"):
        here = [node.name for node in network.nodes if node.region == region]
        if here:
            return max(here, key=lambda name: losses.get(name, 0.0))
    return None


def _production_like(network: Network, frame: InputFrame, level: str) -> list[str]:
    magnets = {node.name for node in network.nodes if node.region == "magnet"}
    sensors = [o.sensor for o in (*frame.observations, *(meter.seen for meter in frame.meters))]
    return [one.name for one in sensors if level in ("testing", one.level) and one.label not in magnets]


def _heats(
    meters: Sequence[Meter], network: Network, frame: InputFrame, inputs: Frame, temperatures: Floats, node: str
) -> list[tuple[HeatReading, UnknownBias]]:
    """What meters of power and heat let a filter read, linearised about the open loop from these temperatures (n,)."""
    if all(meter.what.law is not None for meter in meters):
        return []
    open_loop = simulate(load_kernel(network), inputs, temperatures)
    return heat_readings(meters, network, frame, heat_flows(network, inputs, open_loop), node)


def _as_thermometer(meter: Meter, begins: Mapping[str, tuple[float, float]]) -> tuple[Observation, float]:
    """A meter of resistance or flux linkage as a thermometer: its observation in degC, and the sd of its constant error
    [K]. `begins`: node -> temperature and sd at the start, where the bench file leaves the reference out."""
    law, o = referenced(meter, {node: degC for node, (degC, _) in begins.items()}).law, meter.seen
    assert law is not None  # meters without one are left out
    degC, per_K = law.temperature(o.measured), abs(law.per_K)
    if meter.what.referenced:
        rise = 1 / abs(law.slope_per_K) + abs(float(np.nanmean(degC)) - law.reference_degC)
        sd_K = float(np.hypot(o.sensor.bias_sd / per_K, meter.what.gain_sd * rise))
    else:
        sd_K = sum(share * begins[node][1] for node, share in o.sensor.weights.items())
    noise, resolution = o.sensor.noise / per_K, o.sensor.resolution / per_K
    sensor = replace(o.sensor, noise=noise, resolution=resolution)
    return replace(o, sensor=sensor, measured=degC), max(sd_K, LEAST_NOISE_K)


def reading_of(o: Observation, frame: InputFrame) -> Reading:
    """A recorded channel as a filter reads it: means of its good samples where no input was bridged."""
    samples = np.maximum(o.samples, 1)
    return Reading(
        sensor=o.sensor,
        value=np.where(o.good & frame.live, o.measured, np.nan),
        place=o.place,
        variance=np.maximum(o.sensor.noise**2 + o.sensor.resolution**2 / 12, LEAST_NOISE_K**2) / samples,
    )
