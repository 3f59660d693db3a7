"""A network as indices: what both kernels are made from. It holds the topology and no value that calibration changes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin import features
from twin.network import Network, Term
from twin.sparse import Pattern, factorise

CONSTANT = -1  # a term without features
NOBODY = -1  # no other end, no factor's node


@dataclass(frozen=True)
class Group:
    """Terms that share a place and its factors, so their sum is multiplied once.

    `a`: the node that takes the heat. `b`: the link's other end, a node or `n + boundary`, NOBODY in a source.
    `terms`: (coefficient, monomial or CONSTANT). `own`: +1 copper, -1 resistance, 0 none, of the node's own temperature.
    `other`: node of the temperature factor, or NOBODY; its values are row `index` of `Parameters.factors`.
    """

    a: int
    b: int
    terms: tuple[tuple[int, int], ...]
    own: int
    other: int


@dataclass(frozen=True)
class Structure:
    """`monomials`: columns of the features; `symmetric`: the step matrix is so, half of the elimination can be saved."""

    n: int
    monomials: int
    groups: tuple[Group, ...]
    pattern: Pattern
    symmetric: bool


@dataclass(frozen=True)
class Parameters:
    """The values of a network. `coefficients` (K,) [W or W/K] in the order of `features.terms`; `capacities` (n,) [J/K];
    `copper` (2,) alpha [1/K], reference [degC]; `factors` (groups, 2) slope [1/K], reference [degC], 0 where there is none.
    """

    coefficients: NDArray[np.float64]
    capacities: NDArray[np.float64]
    copper: NDArray[np.float64]
    factors: NDArray[np.float64]


_Key = tuple[int, int, int, int, float, float]  # a, b, own, other, slope, reference


def _grouped(network: Network) -> dict[_Key, list[tuple[int, int]]]:
    """The terms of each group: place and factors -> (coefficient, monomial) pairs."""
    place = {name: i for i, name in enumerate(network.names)}
    column = {monomial: j for j, monomial in enumerate(features.monomials(network))}
    ends = [sorted((place[link.a], place[link.b])) for link in network.links]
    places = [(a, b, link.terms) for (a, b), link in zip(ends, network.links, strict=True)]
    places += [(place[source.node], NOBODY, source.terms) for source in network.sources]
    groups: dict[_Key, list[tuple[int, int]]] = {}
    coefficient = 0
    for a, b, terms in places:
        for term in terms:
            pair = (coefficient, column.get(features.monomial(term), CONSTANT))
            groups.setdefault((a, b, *_factors(term, place)), []).append(pair)
            coefficient += 1
    return groups


def _factors(term: Term, place: dict[str, int]) -> tuple[int, int, float, float]:
    own = 1 if term.copper else term.resistance
    factor = term.temperature
    if factor is None:
        return own, NOBODY, 0.0, 0.0
    return own, place[factor.node], factor.slope_per_K, factor.reference_degC


def structure(network: Network) -> Structure:
    """The indices of a checked network."""
    n = len(network.nodes)
    groups = tuple(Group(a, b, tuple(terms), own, other) for (a, b, own, other, *_), terms in _grouped(network).items())
    edges = [(g.a, g.b) for g in groups if 0 <= g.b < n]
    crossed = [(end, g.other) for g in groups if g.other != NOBODY for end in (g.a, g.b) if 0 <= end < n]
    symmetric = all(g.other == NOBODY or (g.b == NOBODY and g.other == g.a) for g in groups)
    return Structure(n, len(features.monomials(network)), groups, factorise(n, edges + crossed), symmetric)


def parameters(network: Network) -> Parameters:
    """The values of a checked network, in the order of its structure."""
    factors = [(slope, reference) for _, _, _, _, slope, reference in _grouped(network)]
    return Parameters(
        coefficients=np.array([term.coefficient for term in features.terms(network)]),
        capacities=np.array([node.capacity for node in network.nodes]),
        copper=np.array([network.copper.alpha_per_K, network.copper.reference_degC]),
        factors=np.array(factors, dtype=np.float64).reshape(-1, 2),
    )
