"""Filter and smoother over a session: temperatures corrected by the measured channels, and the heat that they ask for at one node."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.engine.frame import InputFrame, Meter, Observation
from replay.engine.open_loop import initial_temperatures, modelled, referenced
from replay.engine.run import Filtered, Smoothed
from twin.ekf import at_their_pace
from twin.filter_inputs import Reading, Start
from twin.network import Network
from twin.simulate import Frame, source_heat
from twin.smoother import smoothed
from twin.unknowns import Unknown, UnknownBias, UnknownHeat

Floats = NDArray[np.float64]

MOST_NODES = 100  # above, a pass over a session takes longer than all else of a replay, by the cube of the nodes
LEAST_NOISE_K = 0.01  # of one sample: no sensor is without, whatever its bench file says
LEAST_LOSS_W = 1.0  # of a motor at rest: the sizes of the unknown heat follow its mean loss
HEAT_SHARE = 0.05  # sd of the unknown heat at the start, of the mean loss of the whole network
HEAT_WALK_SHARE = 0.001  # of its random walk per square root of a second, of the same loss: where the search begins


def filter_session(
    network: Network,
    frame: InputFrame,
    losses: Mapping[str, float],
    level: str,
    node: str | None = None,
    measured: Sequence[str] | None = None,
) -> Filtered | None:
    """Temperatures and the heat at `node` from the channels named in `measured`; None where there is no such node or channel, or the
    network is too large.

    `losses`: node -> mean modelled loss [W]. Left out, `node` is the magnet with the largest loss, else the rotor node with
    the largest; `measured` is every channel of this level but those of magnets, which are kept to check the filter. Kept
    channels set no initial temperature either. A resistance is read as the temperature that it stands for, with an error of
    its own to be found. Raises `FrameError`, `DivergedError` as `twin.ekf.filter_unknowns`.
    """
    node = node or uncertain_node(network, losses)
    channels = _production_like(network, frame, level) if measured is None else measured
    seen = tuple(o for o in frame.observations if o.channel in channels)
    meters = [m for m in frame.meters if m.seen.channel in channels and m.what.law is not None]
    if node is None or not (seen or meters) or len(network.nodes) > MOST_NODES:
        return None
    inputs = Frame(step_s=frame.step_s, features=frame.features, boundaries=frame.boundaries)
    temperatures, sd = initial_temperatures(network, replace(frame, observations=seen), level)
    start, heat = Start(temperatures, sd), unknown_heat(node, losses)
    begins = {n.name: (float(t), float(s)) for n, t, s in zip(network.nodes, temperatures, sd, strict=True)}
    converted = [_as_thermometer(m, begins) for m in meters]
    readings = [reading_of(o, frame) for o in (*seen, *(o for o, _ in converted))]
    errors: list[Unknown] = [UnknownBias(o.channel, sd_K) for o, sd_K in converted]
    unknowns = at_their_pace(network, inputs, start, [heat, *errors], readings)
    smooth = smoothed(network, inputs, start, unknowns, readings)
    estimate = smooth.filtered
    at_node = [i for i, source in enumerate(network.sources) if source.node == node]

    def modelled_W(temperatures: Floats) -> Floats:
        heat: Floats = source_heat(network, inputs, temperatures)[:, at_node].sum(axis=1)
        return heat

    nominal = modelled_W(estimate.temperatures)
    return Filtered(
        node=node,
        measured=tuple(r.channel for r in readings),
        temperatures=estimate.temperatures,
        heat_W=nominal + estimate.found[1:, 0],
        heat_sd_W=estimate.found_sd[1:, 0],
        nominal_W=nominal,
        heat_walk_W=next(u.walk_W for u in unknowns if isinstance(u, UnknownHeat)),
        nis=estimate.nis,
        smoothed=Smoothed(
            smooth.temperatures, modelled_W(smooth.temperatures) + smooth.found[:-1, 0], smooth.found_sd[:-1, 0]
        ),
    )


def mean_losses(network: Network, inputs: Frame, temperatures: Floats) -> dict[str, float]:
    """Node -> mean modelled loss [W] at temperatures (N + 1, n), of nodes that have a source."""
    heat = source_heat(network, inputs, temperatures).mean(axis=0)
    losses = dict.fromkeys((source.node for source in network.sources), 0.0)
    for source, watts in zip(network.sources, heat, strict=True):
        losses[source.node] += float(watts)
    return losses


def filtered_summary(filtered: Filtered, frame: InputFrame, nodes: tuple[str, ...]) -> dict[str, Any]:
    """The entry `filtered` of a run's summary. `mae_K`, `smoothed_mae_K`: of each channel that the filter did not see; `heat_bias_W`:
    mean of estimated minus modelled heat; `heat_walk_W_per_sqrt_s`: the random walk that made the readings most likely."""

    def errors(temperatures: Floats) -> dict[str, float]:
        found: dict[str, float] = {}
        for o in frame.observations:
            use = o.good & frame.live
            if o.channel not in filtered.measured and use.any():
                residual = o.measured - modelled(o, frame, temperatures, nodes)
                found[o.channel] = float(np.abs(residual[use]).mean())
        return found

    return {
        "node": filtered.node,
        "measured": list(filtered.measured),
        "mae_K": errors(filtered.temperatures),
        "smoothed_mae_K": None if filtered.smoothed is None else errors(filtered.smoothed.temperatures),
        "heat_bias_W": float((filtered.heat_W - filtered.nominal_W).mean()),
        "heat_walk_W_per_sqrt_s": filtered.heat_walk_W,
        "nis": filtered.nis if np.isfinite(filtered.nis) else None,
    }


def unknown_heat(node: str, losses: Mapping[str, float]) -> UnknownHeat:
    """The unknown heat at a node, as large as follows from the mean modelled `losses` [W] of all nodes."""
    loss_W = max(sum(losses.values()), LEAST_LOSS_W)
    return UnknownHeat(node, HEAT_SHARE * loss_W, HEAT_WALK_SHARE * loss_W)


def uncertain_node(network: Network, losses: Mapping[str, float]) -> str | None:
    """Of the paper's losses the magnets' is known least; a network without magnets has them in its rotor."""
    for region in ("magnet", "rotor"):
        here = [node.name for node in network.nodes if node.region == region]
        if here:
            return max(here, key=lambda name: losses.get(name, 0.0))
    return None


def _production_like(network: Network, frame: InputFrame, level: str) -> list[str]:
    magnets = {node.name for node in network.nodes if node.region == "magnet"}
    all_of_them = (*frame.observations, *(meter.seen for meter in frame.meters))
    return [o.channel for o in all_of_them if level in ("testing", o.level) and o.label not in magnets]


def _as_thermometer(meter: Meter, begins: Mapping[str, tuple[float, float]]) -> tuple[Observation, float]:
    """A resistance or flux linkage as the temperature that it stands for, and the sd of its constant error [K]. `begins`: node ->
    temperature and sd at the start, which are those of a reference that the bench file leaves out."""
    law, o = referenced(meter, {node: degC for node, (degC, _) in begins.items()}).law, meter.seen
    assert law is not None  # meters without one are left out
    degC, per_K = law.temperature(o.measured), abs(law.per_K)
    if meter.what.referenced:
        rise = 1 / abs(law.slope_per_K) + abs(float(np.nanmean(degC)) - law.reference_degC)
        sd_K = float(np.hypot(o.bias_sd / per_K, meter.what.gain_sd * rise))
    else:
        sd_K = sum(share * begins[node][1] for node, share in law.weights.items())
    as_degC = replace(o, weights=law.weights, measured=degC, noise=o.noise / per_K, resolution=o.resolution / per_K)
    return as_degC, max(sd_K, LEAST_NOISE_K)


def reading_of(o: Observation, frame: InputFrame) -> Reading:
    """A recorded channel as a filter reads it: means of its good samples where no input was bridged."""
    samples = np.maximum(o.samples, 1)
    return Reading(
        channel=o.channel,
        weights=o.weights,
        time_constant_s=o.time_constant_s,
        value=np.where(o.good & frame.live, o.measured, np.nan),
        place=o.place,
        variance=np.maximum(o.noise**2 + o.resolution**2 / 12, LEAST_NOISE_K**2) / samples,
    )
