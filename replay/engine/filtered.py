"""The filter over a session: temperatures corrected by the measured channels, and the heat that they ask for at one node."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.engine.frame import InputFrame, Observation
from replay.engine.open_loop import initial_temperatures, modelled
from replay.engine.run import Filtered
from twin.ekf import HEAT_SHARE, Reading, Start, filter_heat_at_its_pace
from twin.network import Network
from twin.simulate import Frame, source_heat

Floats = NDArray[np.float64]

LEAST_NOISE_K = 0.01  # of one sample: no sensor is without, whatever its bench file says
LEAST_LOSS_W = 1.0  # of a motor at rest: the sizes of the unknown heat follow its mean loss


def filter_session(
    network: Network,
    frame: InputFrame,
    losses: Mapping[str, float],
    level: str,
    node: str | None = None,
    measured: Sequence[str] | None = None,
) -> Filtered | None:
    """Temperatures and the heat at `node` from the channels named in `measured`; None where there is no such node or channel.

    `losses`: node -> mean modelled loss [W]. Left out, `node` is the magnet with the largest loss, else the rotor node with
    the largest; `measured` is every channel of this level but those of magnets, which are kept to check the filter. Kept
    channels set no initial temperature either. Raises `FrameError`, `DivergedError` as `twin.ekf.filter_heat`.
    """
    node = node or _uncertain(network, losses)
    channels = _production_like(network, frame, level) if measured is None else measured
    seen = tuple(o for o in frame.observations if o.channel in channels)
    if node is None or not seen:
        return None
    loss_W = max(sum(losses.values()), LEAST_LOSS_W)
    inputs = Frame(step_s=frame.step_s, features=frame.features, boundaries=frame.boundaries)
    temperatures, sd = initial_temperatures(network, replace(frame, observations=seen), level)
    start = Start(temperatures, sd, HEAT_SHARE * loss_W)
    readings = [_reading(o, frame) for o in seen]
    estimate = filter_heat_at_its_pace(network, inputs, start, node, readings, loss_W)
    at_node = [i for i, source in enumerate(network.sources) if source.node == node]
    nominal: Floats = source_heat(network, inputs, estimate.temperatures)[:, at_node].sum(axis=1)
    return Filtered(
        node=node,
        measured=tuple(o.channel for o in seen),
        temperatures=estimate.temperatures,
        heat_W=nominal + estimate.heat_W,
        heat_sd_W=estimate.heat_sd_W,
        nominal_W=nominal,
        heat_walk_W=estimate.noise.heat_W,
        nis=estimate.nis,
    )


def mean_losses(network: Network, inputs: Frame, temperatures: Floats) -> dict[str, float]:
    """Node -> mean modelled loss [W] at temperatures (N + 1, n), of nodes that have a source."""
    heat = source_heat(network, inputs, temperatures).mean(axis=0)
    losses = dict.fromkeys((source.node for source in network.sources), 0.0)
    for source, watts in zip(network.sources, heat, strict=True):
        losses[source.node] += float(watts)
    return losses


def filtered_summary(filtered: Filtered, frame: InputFrame, nodes: tuple[str, ...]) -> dict[str, Any]:
    """The entry `filtered` of a run's summary. `mae_K`: of each channel that the filter did not see; `heat_bias_W`: mean of
    estimated minus modelled heat; `heat_walk_W_per_sqrt_s`: the random walk that made the readings most likely."""
    errors: dict[str, float] = {}
    for o in frame.observations:
        use = o.good & frame.live
        if o.channel not in filtered.measured and use.any():
            residual = o.measured - modelled(o, frame, filtered.temperatures, nodes)
            errors[o.channel] = float(np.abs(residual[use]).mean())
    return {
        "node": filtered.node,
        "measured": list(filtered.measured),
        "mae_K": errors,
        "heat_bias_W": float((filtered.heat_W - filtered.nominal_W).mean()),
        "heat_walk_W_per_sqrt_s": filtered.heat_walk_W,
        "nis": filtered.nis if np.isfinite(filtered.nis) else None,
    }


def _uncertain(network: Network, losses: Mapping[str, float]) -> str | None:
    """Of the paper's losses the magnets' is known least; a network without magnets has them in its rotor."""
    for region in ("magnet", "rotor"):
        here = [node.name for node in network.nodes if node.region == region]
        if here:
            return max(here, key=lambda name: losses.get(name, 0.0))
    return None


def _production_like(network: Network, frame: InputFrame, level: str) -> list[str]:
    magnets = {node.name for node in network.nodes if node.region == "magnet"}
    usable = (o for o in frame.observations if level in ("testing", o.level) and o.label not in magnets)
    return [o.channel for o in usable]


def _reading(o: Observation, frame: InputFrame) -> Reading:
    samples = np.maximum(o.samples, 1)
    return Reading(
        channel=o.channel,
        weights=o.weights,
        time_constant_s=o.time_constant_s,
        value=np.where(o.good & frame.live, o.measured, np.nan),
        place=o.place,
        variance=np.maximum(o.noise**2 + o.resolution**2 / 12, LEAST_NOISE_K**2) / samples,
    )
