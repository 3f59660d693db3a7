"""A network as indices: what both kernels are made from. It holds what is linked to what, and no value that a
calibration changes."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.compiled.sparse import Pattern, factorise
from twin.motor import features
from twin.motor.heat_laws import source_law
from twin.motor.network import NOBODY, Fluid, Network, Term

CONSTANT = -1  # a term without features

# A table over temperature: the first knot [degC] and the value there, then every other knot and the rise [1/K] up to
# it. (20.0, 1.0), (60.0, 0.002) is 1 up to 20 degC and 1.08 from 60 degC on, a line in between.
Ramps = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Group:
    """Terms that share a place and its factors, so their sum is multiplied once.

    `a`: the node that takes the heat. `b`: the link's other end, a node or `n + boundary`, NOBODY in a source.
    `terms`: (coefficient, monomial or CONSTANT). `law`: of `twin.motor.heat_laws.LAWS`. `other`: of the temperature
    factor, a node (in a fit also `n + boundary`) or NOBODY; its values are row `index` of `Parameters.factors`.
    `one_way`: the heat is not taken out of b, which flows on. `fluid`: its heat capacity over that at 20 degC where it
    goes with the temperature T_b, else empty.
    """

    a: int
    b: int
    terms: tuple[tuple[int, int], ...]
    law: str
    other: int = NOBODY
    one_way: bool = False
    fluid: Ramps = ()

    def taken_from(self, n: int) -> int:
        """The node that loses the heat, of n; NOBODY where none does."""
        return self.b if 0 <= self.b < n and not self.one_way else NOBODY

    @property
    def plain(self) -> bool:
        """Whether the heat of a link follows the difference of its two temperatures itself."""
        return self.law == "linear"


@dataclass(frozen=True)
class Structure:
    """A network of `n` nodes. `monomials`: how many columns the features have; `pattern`: the order of elimination;
    `symmetric`: whether the step's matrix is, so that half of its elimination can be saved."""

    n: int
    monomials: int
    groups: tuple[Group, ...]
    pattern: Pattern
    symmetric: bool

    @classmethod
    def of(cls, n: int, monomials: int, groups: tuple[Group, ...]) -> Structure:
        """Eliminated in an order that fills in little."""
        edges = [(g.a, g.b) for g in groups if 0 <= g.b < n]
        crossed = [(end, g.other) for g in groups if 0 <= g.other < n for end in (g.a, g.b) if 0 <= end < n]
        return cls(n, monomials, groups, factorise(n, edges + crossed), all(_mirrored(g, n) for g in groups))


@dataclass(frozen=True)
class Parameters:
    """The values of a network. `coefficients` (K,) [W or W/K] in the order of `features.terms`, then of
    `features.streams`; `capacities` (n,) [J/K]; `copper` (2,) alpha [1/K], reference [degC]; `factors` (groups, 2)
    slope [1/K], reference [degC], 0 where there is none.
    """

    coefficients: NDArray[np.float64]
    capacities: NDArray[np.float64]
    copper: NDArray[np.float64]
    factors: NDArray[np.float64]


_Key = tuple[Group, float, float]  # a group still without terms, slope, reference


def _places(network: Network) -> Iterator[tuple[_Key, Term]]:
    """The place of every coefficient, in their order."""
    index = {name: i for i, name in enumerate(network.names)}
    for link in network.links:
        a, b = sorted((index[link.a], index[link.b]))
        for term in link.terms:
            yield _key(a, b, term, index), term
    for source in network.sources:
        for term in source.terms:
            yield _key(index[source.node], NOBODY, term, index), term
    fluids = [_ramps(circuit.fluid) for circuit in network.circuits for _ in circuit.nodes]
    streams = zip(features.stream_places(network), features.streams(network), fluids, strict=True)
    for (before, node), term, fluid in streams:
        group = Group(index[node], index[before], (), "stream" if fluid else "linear", one_way=True, fluid=fluid)
        yield (group, 0.0, 0.0), term


def _key(a: int, b: int, term: Term, index: dict[str, int]) -> _Key:
    law = source_law(1 if term.copper else term.resistance) if b == NOBODY else term.law or "linear"
    factor = term.temperature
    if factor is None:
        return Group(a, b, (), law), 0.0, 0.0
    return Group(a, b, (), law, index[factor.node]), factor.slope_per_K, factor.reference_degC


def _ramps(fluid: Fluid) -> Ramps:
    """The fluid's heat capacity over that at `features.STREAM_DEGC`, over the knots of both its tables; empty if
    constant."""
    knots = sorted({*fluid.density.degC, *fluid.heat_capacity.degC})
    unit = fluid.at(features.STREAM_DEGC)
    table = [(float(degC), fluid.at(degC) / unit) for degC in knots]
    if len({value for _, value in table}) == 1:
        return ()
    rises = [(after - before) / (high - low) for (low, before), (high, after) in itertools.pairwise(table)]
    return (table[0], *((degC, rise) for (degC, _), rise in zip(table[1:], rises, strict=True)))


def structure(network: Network) -> Structure:
    """The indices of a checked network."""
    return described(network)[0]


def described(network: Network) -> tuple[Structure, Parameters]:
    """The indices of a checked network, and its values in their order."""
    column = {monomial: j for j, monomial in enumerate(features.monomials(network))}
    terms: dict[_Key, list[tuple[int, int]]] = {}
    for coefficient, (key, term) in enumerate(_places(network)):
        terms.setdefault(key, []).append((coefficient, column.get(features.monomial(term), CONSTANT)))
    groups = tuple(replace(group, terms=tuple(own)) for (group, _, _), own in terms.items())
    every = (*features.terms(network), *features.streams(network))
    values = Parameters(
        coefficients=np.array([term.coefficient for term in every]),
        capacities=np.array([node.capacity for node in network.nodes]),
        copper=np.array([network.copper.alpha_per_K, network.copper.reference_degC]),
        factors=np.array([factor for _, *factor in terms], dtype=np.float64).reshape(-1, 2),
    )
    return Structure.of(len(network.nodes), len(column), groups), values


def _mirrored(group: Group, n: int) -> bool:
    """Whether what a group adds to the step matrix is symmetric."""
    if group.other != NOBODY and not (group.b == NOBODY and group.other == group.a):
        return False
    return not 0 <= group.b < n or (group.plain and not group.one_way)
