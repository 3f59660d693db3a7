"""The hottest winding and magnet of a run, limits, and what derating made of them: parts of a run's summary.

A node is the mean of its lump, and where lumps of different sizes lie is not in a motor file: there a hot spot is no
more than its node. Equal slices in a row are cells of one bar, and the bar's profile is hotter between their middles
than any of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ingest.bench.derating import DeratingRule
from ingest.catalogue.channels import ChannelData
from replay.engine.frame.inputs import InputSamples, held
from replay.engine.results.summary import DeratingCourse, HotSpot, LimitPassed, SpotProfile
from twin.motor.network import Network
from twin.run.derating import Derating, derated

Floats = NDArray[np.float64]
Times = NDArray[np.int64]

REGIONS = {"winding": ("copper",), "magnet": ("magnet", "rotor")}  # hot spot -> where it is sought, the first there is


def hot_spots(network: Network, temperatures: Floats, step_s: float) -> dict[str, HotSpot]:
    """The hottest "winding" and "magnet" (the rotor, where magnets are no nodes), as far as a motor has such nodes.
    `temperatures` (N + 1, n)."""
    return {spot: _hottest(network, temperatures, step_s, at) for spot in REGIONS if (at := nodes_of(spot, network))}


def nodes_of(spot: str, network: Network) -> list[int]:
    """The nodes among which a hot spot is sought."""
    by_region = ([i for i, node in enumerate(network.nodes) if node.region == region] for region in REGIONS[spot])
    return next((found for found in by_region if found), [])


def _hottest(network: Network, temperatures: Floats, step_s: float, at: Sequence[int]) -> HotSpot:
    edge, own = (int(i) for i in np.unravel_index(int(np.argmax(temperatures[:, at])), (len(temperatures), len(at))))
    node, degC = network.nodes[at[own]], float(temperatures[edge, at[own]])
    limit, beside = node.limit_degC, _beside(network, at[own])
    return HotSpot(
        node=node.name,
        max_degC=degC,
        at_s=edge * step_s,
        limit_degC=limit,
        margin_K=None if limit is None else limit - degC,
        profile=_profile(network, temperatures[edge], at[own], beside) if len(beside) == 2 else None,
    )


def _beside(network: Network, of: int) -> list[int]:
    """Indices of the slices beside a slice: nodes of the same region and size, linked to it by the same conductance."""
    nodes, places = network.nodes, {node.name: i for i, node in enumerate(network.nodes)}
    own = nodes[of]
    ends = ((link.b if link.a == own.name else link.a, link) for link in network.links if own.name in (link.a, link.b))
    linked = [(places[other], link.terms) for other, link in ends if other in places]
    same = [n.region == own.region and math.isclose(n.capacity, own.capacity) for n in nodes]
    alike = [(i, terms) for i, terms in linked if same[i]]
    return [i for i, terms in alike if [other for _, other in alike].count(terms) == 2]


def _profile(network: Network, degC: Floats, at: int, beside: Sequence[int]) -> SpotProfile:
    """Where a bar is hottest that is heated alike all over. Its profile is the parabola whose means over three slices
    are their temperatures; `at` is the hottest of them, `beside` the other two."""
    warmer, colder = sorted(beside, key=lambda i: -degC[i])
    tilt, bend = float(degC[warmer] - degC[colder]), float(2 * degC[at] - degC[warmer] - degC[colder])
    return SpotProfile(
        max_degC=float(degC[at]) + bend / 24 + (tilt * tilt / (8 * bend) if bend > 0 else 0.0),
        towards=network.nodes[warmer].name,
        slices=tilt / (2 * bend) if bend > 0 else 0.0,
    )


def limits(network: Network, temperatures: Floats, step_s: float) -> dict[str, LimitPassed]:
    """Every node that has a limit: how long the means of its steps were above it, and how hot it became. `temperatures`
    (N + 1, n)."""
    means = (temperatures[:-1] + temperatures[1:]) / 2
    return {
        node.name: LimitPassed(
            limit_degC=node.limit_degC,
            above_s=step_s * float((means[:, i] > node.limit_degC).sum()),
            max_degC=float(temperatures[:, i].max()),
        )
        for i, node in enumerate(network.nodes)
        if node.limit_degC is not None
    }


def watched(
    rules: Sequence[DeratingRule], channels: Sequence[ChannelData], t_ns: Times
) -> dict[str, tuple[str, Floats]]:
    """Channel of a rule -> the node that it follows most, and what a controller knew from it at the times `t_ns` (N,):
    its last sample as it was sent, stuck or not; NaN before the first."""
    names = {rule.channel for rule in rules}
    found = {}
    for one in channels:
        if one.spec.name in names and one.t_ns.size:
            weights = one.spec.weights or {one.spec.node or "": 1.0}
            shown = held(InputSamples(one.t_ns, one.recorded), t_ns)
            place = max(weights, key=lambda node: weights[node])
            found[one.spec.name] = (place, np.where(t_ns >= one.t_ns[0], shown, np.nan))
    return found


def deratings(
    rules: Sequence[DeratingRule],
    shown: Mapping[str, tuple[str, Floats]],
    network: Network,
    temperatures: Floats,
    step_s: float,
) -> list[DeratingCourse]:
    """Every rule beside the run. `shown`: channel -> the place that it follows and what it showed in each step (N,),
    NaN without a sample. A rule protects the hottest magnet where its sensor is on the rotor, else the hottest winding;
    one whose sensor this session lacks is left out."""
    means = (temperatures[:-1] + temperatures[1:]) / 2
    regions = {node.name: node.region for node in network.nodes}
    found = []
    for rule in (rule for rule in rules if rule.channel in shown):
        node, own = shown[rule.channel]
        spot = "magnet" if regions.get(node) in REGIONS["magnet"] else "winding"
        protected = nodes_of(spot, network)
        if not protected:
            continue
        result = derated(Derating(rule.begin_degC, rule.end_degC), own, means[:, protected].max(axis=1), step_s)
        if result is not None:
            allowed = (network.nodes[i].limit_degC for i in protected)
            lowest = min((limit for limit in allowed if limit is not None), default=None)
            free = result.hottest_free_degC
            margin = None if lowest is None or free is None else lowest - free
            found.append(DeratingCourse(**vars(rule), protects=spot, **vars(result), margin_K=margin))
    return found
