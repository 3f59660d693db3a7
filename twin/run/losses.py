"""Where the heat of a run comes from and where it goes: means over each step, closed to rounding.

Over a step of h a run by `twin.compiled.integrators.SDIRK2` brings every node `C (T1 - T0) / h = (1 - gamma) q(Y) +
gamma q(T1)`, with the heats q at the inner stage Y and at the end, linear about the start T0. The end is known, so

    Y = T0 + gamma / (1 - gamma) (T1 - T0 - gamma h q(T1) / C)

and the same weights give the step's mean of every single heat: what sources make is then what boundaries take and
nodes store.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from twin.compiled.integrators import SDIRK2
from twin.compiled.laid_out import laid_out
from twin.compiled.laws import Integers, Law, Table, every_place, psi, psi_of
from twin.compiled.structure import Group
from twin.motor.network import NOBODY, Network, Term
from twin.run.simulate import Frame, heat_of_terms, of_monomial

Floats = NDArray[np.float64]

KINDS = ("copper_dc", "copper_ac", "iron", "magnet", "mechanical", "other")
_OF_REGION = {"iron": "iron", "rotor": "iron", "magnet": "magnet", "bearing": "mechanical", "fluid": "mechanical"}
CHUNK_STEPS = 4096  # the heats of every law are in memory at once for so many


def kind_of(region: str, term: Term) -> str:
    """The kind of a loss, one of `KINDS`, by the region of its node.

    Copper that goes with current alone and is not divided by its resistance is DC, all else there AC; lamination of the
    rotor is iron; bearings and air (windage) are mechanical.
    """
    if region == "copper":
        used = {feature for feature, exponent in term.exponents.items() if exponent}
        direct = bool(used) and all(feature.startswith("current") for feature in used)
        return "copper_dc" if direct and not term.resistance else "copper_ac"
    return _OF_REGION.get(region, "other")


@dataclass(frozen=True)
class HeatFlows:
    """Means over N steps [W]. `terms` (S, N): heat that each term of the sources makes, in the order of the network's
    sources and their terms; `boundaries` (b, N): heat that each boundary takes."""

    terms: Floats
    boundaries: Floats

    @property
    def made(self) -> Floats:
        """(N,) heat of all sources [W]."""
        total: Floats = self.terms.sum(axis=0)
        return total


def heat_flows(network: Network, frame: Frame, temperatures: Floats) -> HeatFlows:
    """The heats of a run of `twin.run.simulate.simulate` with its default integrator; `temperatures` (N + 1, n)
    [degC] as it gave them."""
    parts = [
        _heat_flows(
            network,
            Frame(frame.step_s, frame.features[at : at + CHUNK_STEPS], frame.boundaries[at : at + CHUNK_STEPS]),
            temperatures[at : at + CHUNK_STEPS + 1],
        )
        for at in range(0, len(frame.features), CHUNK_STEPS)
    ]
    return HeatFlows(
        np.concatenate([part.terms for part in parts], axis=1),
        np.concatenate([part.boundaries for part in parts], axis=1),
    )


def _heat_flows(network: Network, frame: Frame, temperatures: Floats) -> HeatFlows:
    shape, values, _, laws, table = laid_out(network)
    n, carried = shape.n, np.array([_carried(group, values.coefficients, frame) for group in shape.groups])
    start, end = (every_place(at, frame.boundaries) for at in (temperatures[:-1], temperatures[1:]))
    at_end = _linear(table, start, end)
    gamma, storage = SDIRK2.gamma, values.capacities[:, None] / frame.step_s
    moved = end[:n] - start[:n]
    inner = end.copy()
    inner[:n] = start[:n] + gamma / (1 - gamma) * (moved - gamma * (_incidence(laws, n) @ (carried * at_end)) / storage)
    psi = (1 - gamma) * _linear(table, start, inner) + gamma * at_end
    heat, takes = carried * psi, takers(network)
    taken = [-heat[[takes(law) == b for law in laws]].sum(axis=0) for b in range(len(network.boundaries))]
    return HeatFlows(heat_of_terms(network, frame, psi), np.array(taken).reshape(-1, len(frame.features)))


def takers(network: Network, states: int | None = None) -> Callable[[Law], int | None]:
    """A function that names the boundary (an index) that takes the heat of a law, None where none does: the one where
    a link ends, or the inlet of a circuit whose fluid flows into a node. `states`: how many places stand before the
    boundaries; left out, the nodes."""
    n, index = len(network.nodes), {name: i for i, name in enumerate(network.names)}
    places = [
        (index[node], index[before], index[circuit.inlet] - n)
        for circuit in network.circuits
        for before, node in zip((circuit.inlet, *circuit.nodes), circuit.nodes, strict=False)
    ]
    streams = {(node, before): inlet for node, before, inlet in places if before < n}
    first = n if states is None else states

    def takes(law: Law) -> int | None:
        return law.b - first if law.b >= first else streams.get((law.a, law.b)) if law.one_way else None

    return takes


def flows_between(network: Network, frame: Frame, temperatures: Floats) -> dict[tuple[str, str], Floats]:
    """Heat (N,) [W] from the first to the second, in the order of `Network.names`, of every two places that a link or a
    stream joins, with the features and boundaries of `frame` at `temperatures` (N, n) [degC]. What a stream brings is
    counted at its node."""
    shape, values, _, laws, table = laid_out(network)
    per_amount, _ = psi(table, temperatures, frame.boundaries)
    found: dict[tuple[str, str], Floats] = {}
    for group, law, own in zip(shape.groups, laws, per_amount, strict=True):
        if law.b != NOBODY:
            into_a = _carried(group, values.coefficients, frame) * own
            first, second = sorted((law.a, law.b))
            pair = network.names[first], network.names[second]
            found[pair] = found.get(pair, 0.0) + (into_a if law.a == second else -into_a)
    return found


def _carried(group: Group, coefficients: Floats, frame: Frame) -> Floats:
    """The amount (N,) of a group of terms in each step [W, in a link W/K]."""
    total = np.zeros(len(frame.features))
    for i, j in group.terms:
        total += coefficients[i] * of_monomial(j, frame)
    return total


def _incidence(laws: Sequence[Law], n: int) -> Floats:
    """(n, L): +1 where a law's heat enters a node, -1 where it is taken from."""
    found = np.zeros((n, len(laws)))
    for w, law in enumerate(laws):
        found[law.a, w] += 1.0
        if 0 <= law.b < n and not law.one_way:
            found[law.b, w] -= 1.0
    return found


def _linear(table: Table, about: Floats, at: Floats) -> Floats:
    """psi (L, N) of laws at temperatures `at` (P, N) of every place, as it is when made linear about temperatures
    `about` (P, N)."""
    found = np.empty((len(table.places), about.shape[1]))
    _linear_psi(table.places, table.numbers, table.copper, about, at - about, found)
    return found


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _linear_psi(places: Integers, numbers: Floats, copper: Floats, about: Floats, by: Floats, found: Floats) -> None:
    one = np.empty((4, about.shape[1]))
    for w in range(len(places)):
        psi_of(places[w], numbers[w], copper, about, one)
        for k in range(about.shape[1]):
            found[w, k] = one[0, k]
        for i in range(3):
            end = places[w, (0, 1, 3)[i]]
            if end >= 0:
                for k in range(about.shape[1]):
                    found[w, k] += one[i + 1, k] * by[end, k]


def by_kind(network: Network, flows: HeatFlows) -> dict[str, Floats]:
    """Kind of loss -> (N,) [W], of the kinds that the network has, in the order of `KINDS`."""
    region = {node.name: node.region for node in network.nodes}
    kinds = [kind_of(region[source.node], term) for source in network.sources for term in source.terms]
    return {kind: flows.terms[[own == kind for own in kinds]].sum(axis=0) for kind in KINDS if kind in kinds}


@dataclass(frozen=True, kw_only=True)
class HeatPart:
    """A part of the heat of a run: its mean, and its energy over the run."""

    mean_W: float
    energy_J: float


@dataclass(frozen=True, kw_only=True)
class StoredHeat:
    """What the nodes of a region hold at the end of a run beyond what they held at its start."""

    energy_J: float


@dataclass(frozen=True, kw_only=True)
class HeatBalance:
    """All losses of a run, then the same by kind (of `KINDS`), region and node; what each boundary took and each region
    stored; `left_J`: what the balance does not close by, rounding."""

    mean_W: float
    energy_J: float
    kinds: dict[str, HeatPart]
    regions: dict[str, HeatPart]
    nodes: dict[str, HeatPart]
    boundaries: dict[str, HeatPart]
    stored: dict[str, StoredHeat]
    left_J: float

    @property
    def stored_J(self) -> float:
        """What all regions stored."""
        return sum(one.energy_J for one in self.stored.values())


def account(network: Network, frame: Frame, temperatures: Floats, flows: HeatFlows) -> HeatBalance:
    """The energies and means of a run, from its heats."""
    region = {node.name: node.region for node in network.nodes}
    places = [source.node for source in network.sources for _ in source.terms]
    energies = (flows.terms.sum(axis=1) * frame.step_s).tolist()
    regions: dict[str, float] = {}
    nodes: dict[str, float] = {}
    stored: dict[str, float] = {}
    for node, energy in zip(places, energies, strict=True):
        regions[region[node]] = regions.get(region[node], 0.0) + energy
        nodes[node] = nodes.get(node, 0.0) + energy
    for node_, gained in zip(network.nodes, (temperatures[-1] - temperatures[0]).tolist(), strict=True):
        stored[node_.region] = stored.get(node_.region, 0.0) + node_.capacity * gained
    taken = dict(
        zip((b.name for b in network.boundaries), (flows.boundaries.sum(axis=1) * frame.step_s).tolist(), strict=True)
    )
    made, duration_s = sum(energies), len(frame.features) * frame.step_s

    def parts(energies: Mapping[str, float]) -> dict[str, HeatPart]:
        return {name: HeatPart(mean_W=J / duration_s, energy_J=J) for name, J in energies.items()}

    return HeatBalance(
        mean_W=made / duration_s,
        energy_J=made,
        kinds=parts({kind: float(heat.sum()) * frame.step_s for kind, heat in by_kind(network, flows).items()}),
        regions=parts(regions),
        nodes=parts(nodes),
        boundaries=parts(taken),
        stored={name: StoredHeat(energy_J=energy) for name, energy in stored.items()},
        left_J=made - sum(taken.values()) - sum(stored.values()),
    )
