"""The heat paths of a motor by name: which terms are whose, and which paths its file does not have."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, count, islice

from twin.motor.causes import link_place, mirrored
from twin.motor.network import Network

Place = tuple[str, ...]  # (node,), or the two ends of a link as its cause id writes them


def terms_of(network: Network) -> tuple[dict[tuple[str, str], tuple[int, ...]], dict[str, tuple[int, ...]]]:
    """Places in `twin.motor.features.terms` of every link, by its ends as the file writes them, and of every source."""
    places = count()
    links = {(link.a, link.b): tuple(islice(places, len(link.terms))) for link in network.links}
    return links, {source.node: tuple(islice(places, len(source.terms))) for source in network.sources}


def terms_at(network: Network, place: Place) -> tuple[int, ...]:
    """The terms of one source or link, whichever way round it is written; none where the file has none there."""
    links, sources = terms_of(network)
    if len(place) == 1:
        return sources.get(place[0], ())
    return links.get((place[0], place[1])) or links.get((place[1], place[0]), ())


def missing(network: Network) -> list[tuple[str, str]]:
    """Pairs of nodes that share a neighbour but no link, and nodes with boundaries they have no link to."""
    neighbours: dict[str, set[str]] = {name: set() for name in network.names}
    for link in network.links:
        neighbours[link.a].add(link.b)
        neighbours[link.b].add(link.a)
    nodes, boundaries = [n.name for n in network.nodes], [b.name for b in network.boundaries]
    near = [(a, b) for a, b in combinations(nodes, 2) if (neighbours[a] & neighbours[b]).difference(boundaries)]
    pairs = [*near, *((node, boundary) for node in nodes for boundary in boundaries)]
    return [(a, b) for a, b in pairs if b not in neighbours[a]]


def links_with_groups(network: Network, places: Sequence[Place]) -> list[tuple[str, tuple[Place, ...]]]:
    """Each link under its own name, then pairs of links that mirror each other under their common stem."""
    found: dict[str, tuple[Place, ...]] = {link_place(network, *place): (place,) for place in places}
    by_ends = {frozenset(place): place for place in places}
    for place in places:
        for name, twin in _mirror(network, place):
            other = by_ends.get(frozenset(twin))
            if other is not None and other != place and name not in found:
                found[name] = (place, other)
    return list(found.items())


def _mirror(network: Network, place: Place) -> Iterator[tuple[str, Place]]:
    """(stem, the mirrored link): every end with `_a`, `_b`, `_1` or `_2` exchanged for its twin."""
    a_options, b_options = ([(s, t) for s, t in mirrored(end).items() if s not in network.names] for end in place)
    for stem_a, twin_a in a_options or [(place[0], place[0])]:
        for stem_b, twin_b in b_options or [(place[1], place[1])]:
            if stem_a != stem_b:
                yield f"{stem_a}-{stem_b}", (twin_a, twin_b)
