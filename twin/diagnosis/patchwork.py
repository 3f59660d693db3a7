"""Patchwork: terms that only together stand in for a law that no candidate has.

The candidate whose form is nearest fits such a cause, a second one beside it fits what the first leaves, and each seems
to be needed. Where a candidate has the right form, nothing near its place asks for as much again. Two causes side by
side look otherwise: each is asked for alone, and no less once the other is there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from twin.diagnosis.evidence import TOLD_APART
from twin.differences.candidates import Candidate
from twin.motor.causes import OF_THE_MOTOR
from twin.motor.network import Network

NEEDS = 0.5  # ln BF of all other terms near the first, as a share of the first one's: from here on it is patchwork


@dataclass(frozen=True)
class Survivor:
    """A term that survived: ln BF of leaving it out (`needed`), and of letting it in first (`alone`)."""

    candidate: Candidate
    needed: float
    alone: float

    @property
    def by_itself(self) -> bool:
        """Whether it is asked for alone, and no less beside the others."""
        return self.alone > TOLD_APART and self.needed > self.alone - TOLD_APART


def is_patchwork(terms: Sequence[Survivor], network: Network) -> bool:
    """Whether the terms near the strongest one that do not stand by themselves are needed half as much as it is."""
    if len(terms) < 2:
        return False
    first, *others = sorted(terms, key=lambda term: -term.needed)
    near = around(nodes_of(first.candidate, network), network)
    leaning = [one for one in others if near & nodes_of(one.candidate, network) and not one.by_itself]
    return sum(one.needed for one in leaning) >= NEEDS * first.needed


def around(nodes: frozenset[str], network: Network) -> frozenset[str]:
    """Nodes and those that a link joins them to."""
    return nodes.union(*({link.a, link.b} for link in network.links if {link.a, link.b} & nodes))


def nodes_of(candidate: Candidate, network: Network) -> frozenset[str]:
    """The nodes where a candidate acts, without boundaries; none for an error of the bench, which heats nothing."""
    if candidate.cause.kind not in OF_THE_MOTOR:
        return frozenset()
    return frozenset({name for place in candidate.places for name in place} & {node.name for node in network.nodes})
