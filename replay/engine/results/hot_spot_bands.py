"""How sure the hot spots of a run are: by what the model's calibration left unknown, else by `sd` of the motor file."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.files.motor_file import read_motor
from replay.engine.frame.frame import InputFrame
from replay.engine.results.artefacts import read_parquet
from replay.engine.results.hot_spots import hot_spots
from replay.engine.results.open_loop import modelled
from replay.engine.results.summary import HotSpot, ModelledSpot, SmoothedSpot
from replay.engine.specimen.aged import Aged
from twin.calibration.calibrate import freedom
from twin.calibration.uncertainty import coarse, sd_K
from twin.calibration.united import United
from twin.errors import DivergedError
from twin.fitting.model import Test
from twin.motor.ageing_law import AgeingTerm
from twin.motor.configured import configured
from twin.motor.features import placed_terms
from twin.motor.network import Network
from twin.run.simulate import Frame

Floats = NDArray[np.float64]

MOST_NODES = 100  # above, the derivatives take longer than all else of a replay, by the cube of the nodes
Z95 = 1.96
TOO_LARGE = f"more than {MOST_NODES}"  # how the reason of a large network ends


def with_bands(
    store: Store,
    facts: Facts,
    session: SessionRecorded,
    model: str,
    network: Network,
    frame: InputFrame,
    start: tuple[Floats, Floats],
    ageing: Sequence[Aged],
    spots: Mapping[str, HotSpot],
) -> dict[str, ModelledSpot]:
    """The `spots` with bands, by what is not known of coefficients, capacities, the `start` (temperatures and sd, (n,))
    and what `ageing` has left; none for a `network` (of the session, as its specimen has it) of more than `MOST_NODES`.
    """
    if not spots or len(network.nodes) > MOST_NODES:
        return _without(spots, f"the network has {len(network.nodes)} nodes, {TOO_LARGE}")
    whole, latest = Frame(frame.step_s, frame.features, frame.boundaries), max(one.at_s for one in spots.values())
    test = Test(
        name=session.name,
        kind=session.kind,
        frame=coarse(whole, latest),
        inputs={},
        features={},
        initial=start[0],
        initial_sd=start[1],
        channels=(),
    )
    motor = read_motor(store.archive.read(model), facts.models[model].file)
    covariance, band_from = known_covariance(store, facts, model, motor, session.configuration)
    covariance = covariance + _aged(configured(motor, session.configuration), ageing)
    at = [(one.node, one.at_s) for one in spots.values()]
    try:
        found = sd_K(network, test, at, covariance)
    except DivergedError:  # the run itself is whole
        return _without(spots, "the model runs away in the longer steps that a band is worked out in")
    return {
        spot: ModelledSpot(**vars(one), sd_K=sd, ci95_degC=_band(one, sd), band_from=band_from)
        for (spot, one), sd in zip(spots.items(), found, strict=True)
    }


def _without(spots: Mapping[str, HotSpot], why: str) -> dict[str, ModelledSpot]:
    return {spot: ModelledSpot(**vars(one), why_no_band=why) for spot, one in spots.items()}


def _band(spot: HotSpot, sd_K: float) -> list[float]:
    return [spot.max_degC - Z95 * sd_K, spot.max_degC + Z95 * sd_K]


def smoothed_spots(
    network: Network, frame: InputFrame, temperatures: Floats, sd: Floats, read: Collection[str]
) -> dict[str, SmoothedSpot]:
    """The hot spots by a smoother's `temperatures` with their own `sd` (N + 1, n), from the channels in `read`. The
    `sd_K` of a spot is the root of the sum of squares of the smoother's own, how far it is off the channels that follow
    the node, and what those that it did not read may read too much (`bias_sd`). None without such a channel: a
    smoother's own holds errors of readings and random walks alone, and was 4 to 8 times too small at magnets."""
    nodes = tuple(node.name for node in network.nodes)
    found: dict[str, SmoothedSpot] = {}
    for spot, one in hot_spots(network, temperatures, frame.step_s).items():
        there = [o for o in frame.observations if o.sensor.label == one.node and (o.good & frame.live).any()]
        whole = None
        if there:
            off = [(o.measured - modelled(o, frame, temperatures, nodes))[o.good & frame.live] for o in there]
            own = sd[round(one.at_s / frame.step_s), nodes.index(one.node)]
            bias_sd = [0.0 if o.sensor.name in read else o.sensor.bias_sd for o in there]
            wrong = np.mean([b**2 + np.mean(k**2) for b, k in zip(bias_sd, off, strict=True)])
            whole = float(np.sqrt(own**2 + wrong))
        found[spot] = SmoothedSpot(
            **vars(one),
            sd_K=whole,
            ci95_degC=None if whole is None else _band(one, whole),
            checked_by=[o.sensor.name for o in there],
        )
    return found


def known_covariance(store: Store, facts: Facts, model: str, motor: Network, rig: str | None) -> tuple[Floats, str]:
    """Covariance (P, P) of ln coefficients and ln capacities of a rig's own network, and where it is from. It is that
    of the priors in the motor file; parameters that a calibration learnt have the covariance that this left."""
    covariance = np.diag([p.sd**2 for p in freedom(configured(motor, rig), ())])
    event = facts.calibrations.get(model)
    if event is None or event.covariance is None:
        return covariance, "motor file"
    table = read_parquet(store.archive.read(event.covariance))
    names, learnt = United(motor, [rig]).names_of(rig), {name: i for i, name in enumerate(table["name"].to_pylist())}
    own = np.array([i for i, name in enumerate(names) if name in learnt], dtype=np.intp)
    theirs = np.array([learnt[names[i]] for i in own], dtype=np.intp)
    whole = np.array(table["covariance"].to_pylist(), dtype=np.float64)
    covariance[np.ix_(own, own)] = whole[np.ix_(theirs, theirs)]
    return covariance, "calibration"


def _aged(network: Network, ageing: Sequence[Aged]) -> Floats:
    """Covariance (P, P) that the ageing of a specimen adds: terms that are equally old are off together."""
    places = list(placed_terms(network))
    found = np.zeros((len(places) + len(network.nodes),) * 2)
    for one in ageing:
        old = np.array([isinstance(term, AgeingTerm) and place in one.places for place, term in places])
        found[: len(places), : len(places)] += one.sd**2 * np.outer(old, old)
    return found


def covariance_table(names: Sequence[str], covariance: Floats) -> pa.Table:
    """One row a parameter: its name and its row of the covariance of logarithms."""
    return pa.table({"name": list(names), "covariance": covariance.tolist()})
