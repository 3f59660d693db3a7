"""Patchwork: terms that only together stand in for a law that no candidate has.

The candidate whose form is nearest fits such a cause, a second one beside it fits what the first leaves, and each seems
to be needed. Where a candidate has the right form, nothing near its place asks for as much again.
"""

from __future__ import annotations

from collections.abc import Sequence

from twin.differences.candidates import Candidate
from twin.motor.causes import OF_THE_MOTOR
from twin.motor.network import Network

NEEDS = 0.5  # ln BF of all other terms near the first, as a share of the first one's: from here on it is patchwork


def is_patchwork(terms: Sequence[tuple[Candidate, float]], network: Network) -> bool:
    """Whether the terms near the strongest one are needed half as much as it is, by the ln BF of leaving each out."""
    if len(terms) < 2:
        return False
    first, *others = sorted(terms, key=lambda term: -term[1])
    own = nodes_of(first[0], network)
    near = own.union(*({link.a, link.b} for link in network.links if {link.a, link.b} & own))
    return sum(value for candidate, value in others if near & nodes_of(candidate, network)) >= NEEDS * first[1]


def nodes_of(candidate: Candidate, network: Network) -> frozenset[str]:
    """The nodes where a candidate acts, without boundaries; none for an error of the bench, which heats nothing."""
    if candidate.cause.kind not in OF_THE_MOTOR:
        return frozenset()
    return frozenset({name for place in candidate.places for name in place} & {node.name for node in network.nodes})
