"""Where a run begins: measured nodes as measured, the others by the network's own steady interpolation."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra

from twin.motor import features
from twin.motor.network import Network

MEASURED_SD_K = 0.3  # least prior sd of a measured node: a lump is not the place of its sensor
NEAR_SD_K, FAR_SD_K = 2.0, 4.0  # of a node one link away from what is known, and of one three or more away


def steady_interpolation(
    network: Network,
    features_row: NDArray[np.float64],
    boundaries_row: NDArray[np.float64],
    measured: Mapping[str, tuple[float, float]],
    weights: Mapping[str, Mapping[str, float]] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Initial temperatures (n,) [degC] and their prior standard deviations (n,) [K].

    A node of `measured`, node -> (temperature, sd), starts there, with that sd but at least 0.3 K. Where `weights`,
    node -> shares, say that it was measured in a mixture of which its own share is over a half, the mixture starts
    there. Every other node takes the steady temperature between measured nodes and boundaries, without losses, with
    the conductances of `features_row` (m,) (temperature factors at their reference); its sd is 1 K and 1 K for each
    link to the nearest known temperature, within 2 to 4 K. A part that no conductance joins to anything known (a
    rotor at rest may be one) starts at the mean of what is known.
    """
    n = len(network.nodes)
    index = _index(network)
    known = {index[node]: value for node, (value, _) in measured.items()}
    known |= {n + j: float(value) for j, value in enumerate(boundaries_row)}
    mixed = {index[node]: {index[k]: share for k, share in own.items()} for node, own in (weights or {}).items()}
    temperatures = _interpolate(conductances(network, features_row), known, mixed)
    links = np.zeros((len(index), len(index)))
    for a, b in (*((link.a, link.b) for link in network.links), *features.stream_places(network)):
        links[index[a], index[b]] = links[index[b], index[a]] = 1.0
    distance = _links_away(links, known)
    sd = np.clip(1.0 + distance[:n], NEAR_SD_K, FAR_SD_K)
    for node, (_, own_sd) in measured.items():
        sd[index[node]] = max(MEASURED_SD_K, own_sd)
    return temperatures[:n], sd


def conductances(network: Network, features_row: NDArray[np.float64]) -> NDArray[np.float64]:
    """Conductances (n + b, n + b) [W/K] between nodes, then boundaries, at features (m,): row i holds what node i
    takes for each kelvin of another. Temperature factors are at their reference, radiation about 20 degC, free
    convection at 10 K, fluids at 20 degC. Symmetric but for circuits."""
    index = _index(network)
    column = {monomial: j for j, monomial in enumerate(features.monomials(network))}
    result = np.zeros((len(index), len(index)))
    for link in network.links:
        a, b = index[link.a], index[link.b]
        for term in link.terms:
            j = column.get(features.monomial(term))
            result[a, b] += term.coefficient * (1.0 if j is None else features_row[j])
        result[b, a] = result[a, b]
    for (before, node), term in zip(features.stream_places(network), features.streams(network), strict=True):
        result[index[node], index[before]] += term.coefficient * features_row[column[features.monomial(term)]]
    return result


def _index(network: Network) -> dict[str, int]:
    return {name: i for i, name in enumerate(network.names)}


def _interpolate(
    conductance: NDArray[np.float64], known: Mapping[int, float], mixed: Mapping[int, Mapping[int, float]]
) -> NDArray[np.float64]:
    """Steady temperatures (n + b,) between those that are `known`; of these, places in `mixed` are known as the
    temperature of a mixture."""
    size = len(conductance)
    result = np.full(size, np.mean(list(known.values())))
    fixed = np.array(sorted(known.keys() - mixed.keys()), dtype=np.intp)
    result[fixed] = [known[i] for i in fixed.tolist()]
    led = np.isfinite(_links_away(conductance, known))
    free = [i for i in range(size) if i in mixed or (i not in known and led[i])]
    balance = np.diag(conductance.sum(axis=1)) - conductance
    right = np.zeros(size)
    for i, own in mixed.items():
        balance[i], right[i] = [own.get(j, 0.0) for j in range(size)], known[i]
    rest = np.array([i for i in range(size) if i not in free], dtype=np.intp)
    at = np.array(free, dtype=np.intp)
    right[at] -= (balance[np.ix_(at, rest)] * result[rest]).sum(axis=1)
    result[at] = _solved(balance[np.ix_(at, at)], right[at])
    return result


def _solved(matrix: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """The solution by elimination with the largest pivot of each column, an element at a time: LAPACK's bits change
    with the processor."""
    whole = np.column_stack([matrix, right])
    for k in range(len(right)):
        pivot = k + int(np.abs(whole[k:, k]).argmax())
        whole[[k, pivot]] = whole[[pivot, k]]
        whole[k] /= whole[k, k]
        share = np.where(np.arange(len(right)) == k, 0.0, whole[:, k])
        whole -= share[:, None] * whole[k]
    return whole[:, -1]


def _links_away(links: NDArray[np.float64], known: Mapping[int, float]) -> NDArray[np.float64]:
    """How many links lead from each place to the nearest known one; infinite where none does. `links` (n + b, n + b)
    are not 0 where one leads from the row's place to the column's."""
    away: NDArray[np.float64] = dijkstra(links.T != 0, unweighted=True, indices=list(known), min_only=True)
    return away


def time_constants(network: Network, features_row: NDArray[np.float64]) -> dict[str, float]:
    """Node -> C / sum of its conductances [s] at features (m,): how fast it follows its neighbours; infinite where it
    has none."""
    total = conductances(network, features_row).sum(axis=1)
    return {node.name: node.capacity / total[i] if total[i] > 0 else np.inf for i, node in enumerate(network.nodes)}
