"""Nodes of a network become one: the sum of their capacities and losses, and of their conductances to each other
neighbour.

The links within the new node vanish. In matrices that is `V' C V`, `V' L V`, `V' P` with one column of `V` for each
node of the new network, so no heat is lost.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from twin.motor.configured import configured
from twin.motor.network import Configuration, Link, Network, Node, Source, Term


def merged(network: Network, groups: Mapping[str, Sequence[str]]) -> Network:
    """The network in which each of `groups`, name -> nodes, is one node, in the place of its first; all else stays as
    it is.

    Terms of the same features and factors add up; a prior's sd is that of the sum of what is added, each known by
    itself, so that slices of a part (`twin.motor.slicing`) make the part again. Region: that of most capacity; limit:
    the lowest. Configurations are left out (`merged_configurations`).
    """
    new = {member: name for name, members in groups.items() for member in members}

    def called(name: str) -> str:
        return new.get(name, name)

    links: dict[tuple[str, str], list[tuple[Term, ...]]] = {}
    for link in network.links:
        a, b = called(link.a), called(link.b)
        if a != b:
            links.setdefault((b, a) if (b, a) in links else (a, b), []).append(_renamed(link.terms, new))
    sources: dict[str, list[tuple[Term, ...]]] = {}
    for source in network.sources:
        sources.setdefault(called(source.node), []).append(_renamed(source.terms, new))
    nodes: dict[str, list[Node]] = {}
    for node in network.nodes:
        nodes.setdefault(called(node.name), []).append(node)
    summed = {name: _summed(terms) for name, terms in sources.items()}
    return replace(
        network,
        nodes=tuple(_lump(name, members) for name, members in nodes.items()),
        links=tuple(Link(a, b, _summed(terms)) for (a, b), terms in links.items()),
        sources=tuple(Source(name, terms) for name, terms in summed.items() if terms),
        circuits=tuple(
            replace(circuit, nodes=tuple(dict.fromkeys(map(called, circuit.nodes)))) for circuit in network.circuits
        ),
        configurations=(),
    )


def merged_configurations(network: Network, groups: Mapping[str, Sequence[str]]) -> tuple[Configuration, ...]:
    """The configurations of a whole motor `network`, for the motor merged by `groups`: each says how its own network,
    merged alike, differs from that.

    One that removes some members of a group only, or that leaves nothing of a coupling or loss that the whole motor
    has, has no such version and is left out.
    """
    whole = merged(configured(network, None), groups)
    found = (_merged_configuration(network, whole, one, groups) for one in network.configurations)
    return tuple(one for one in found if one is not None)


def _merged_configuration(
    network: Network, whole: Network, one: Configuration, groups: Mapping[str, Sequence[str]]
) -> Configuration | None:
    removed = set(one.remove)
    if any(removed & set(members) and not removed >= set(members) for members in groups.values()):
        return None
    gone = [name for name, members in groups.items() if removed & set(members)]
    kept = {name: members for name, members in groups.items() if name not in gone}
    rig = merged(configured(network, one.name), kept)
    grouped = {member for members in groups.values() for member in members}
    remove = (*gone, *(name for name in one.remove if name not in grouped))
    links = [{frozenset((link.a, link.b)): link for link in some.links} for some in (whole, rig)]
    sources = [{source.node: source for source in some.sources} for some in (whole, rig)]
    lost = [ends for ends in links[0].keys() - links[1].keys() if not ends & set(remove)]
    if lost or sources[0].keys() - sources[1].keys() - set(remove):
        return None
    return Configuration(
        one.name,
        remove,
        tuple(link for ends, link in links[1].items() if ends not in links[0] or links[0][ends].terms != link.terms),
        tuple(source for node, source in sources[1].items() if sources[0].get(node) != source),
    )


def _renamed(terms: Sequence[Term], new: Mapping[str, str]) -> tuple[Term, ...]:
    return tuple(
        replace(term, temperature=replace(term.temperature, node=new[term.temperature.node]))
        if term.temperature is not None and term.temperature.node in new
        else term
        for term in terms
    )


def _summed(places: Sequence[tuple[Term, ...]]) -> tuple[Term, ...]:
    """The terms of several places, those of one law added up; what cancels is left out."""
    if len(places) == 1:
        return places[0]
    kinds: list[tuple[Term, list[Term]]] = []
    for term in (term for terms in places for term in terms):
        kind = replace(term, coefficient=1.0, sd=1.0)
        same = next((same for found, same in kinds if found == kind), None)
        if same is None:
            kinds.append((kind, [term]))
        else:
            same.append(term)
    result = []
    for _, same in kinds:
        weight = sum(abs(term.coefficient) for term in same)
        total = sum(term.coefficient for term in same)
        if abs(total) > 1e-12 * weight:
            sd = math.hypot(*(term.coefficient * term.sd for term in same)) / abs(total)
            result.append(replace(same[0], coefficient=total, sd=sd))
    return tuple(result)


def _lump(name: str, members: Sequence[Node]) -> Node:
    total = sum(node.capacity for node in members)
    regions: dict[str, float] = {}
    for node in members:
        regions[node.region] = regions.get(node.region, 0.0) + node.capacity
    limits = [node.limit_degC for node in members if node.limit_degC is not None]
    return replace(
        members[0],
        name=name,
        capacity=total,
        region=max(regions, key=lambda region: regions[region]),
        sd=math.hypot(*(node.capacity * node.sd for node in members)) / total,
        limit_degC=min(limits, default=None),
        along=None,
        radius=None,
    )
