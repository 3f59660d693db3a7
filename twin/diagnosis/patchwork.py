"""Terms that only together stand in for a law that the list does not hold.

A cause that no candidate has the form of is fitted by the nearest one, and what that leaves by a second one beside it:
each then seems to be needed. A named form leaves nothing near its place that asks for as much again.
"""

from __future__ import annotations

from collections.abc import Sequence

from twin.differences.candidates import Candidate
from twin.motor.causes import OF_THE_MOTOR
from twin.motor.network import Network

NEEDS = 0.5  # of the first term's ln BF, that of all others near it together: a form that is right needs less beside it


def is_patchwork(terms: Sequence[tuple[Candidate, float]], network: Network) -> bool:
    """Whether the terms near the strongest one, each with the ln BF of leaving it out,
    are needed half as much as it is."""
    if len(terms) < 2:
        return False
    first, *others = sorted(terms, key=lambda term: -term[1])
    near = neighbourhood(nodes_of(first[0], network), network)
    return sum(value for candidate, value in others if near & nodes_of(candidate, network)) >= NEEDS * first[1]


def nodes_of(candidate: Candidate, network: Network) -> frozenset[str]:
    """The nodes where a candidate acts, boundaries left out; of an error of the bench none,
    it changes no temperature."""
    if candidate.cause.kind not in OF_THE_MOTOR:
        return frozenset()
    return frozenset({name for place in candidate.places for name in place} & {node.name for node in network.nodes})


def neighbourhood(nodes: frozenset[str], network: Network) -> frozenset[str]:
    """The nodes and those that a link joins to one of them."""
    joined = {end for link in network.links if {link.a, link.b} & nodes for end in (link.a, link.b)}
    return frozenset((nodes | joined) & {node.name for node in network.nodes})
