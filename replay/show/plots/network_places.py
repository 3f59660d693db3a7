"""Where the nodes of a motor stand in its picture [inches]: the outside on top, the rotor below, end a at the left."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from replay.show.words.layout import stress_layout, without_overlap
from twin.motor.features import stream_places
from twin.motor.network import Network

Floats = NDArray[np.float64]

LAYER: Mapping[str, float] = {  # region -> height where the layout starts
    "housing": 3.0,
    "iron": 2.0,
    "copper": 1.0,
    "fluid": 0.5,
    "other": 0.5,
    "magnet": -1.0,
    "rotor": -1.0,
    "bearing": -1.5,
}
OUTSIDE = 4.0  # of boundaries
PAGE = (9.6, 6.2)
MANY = 12  # nodes and boundaries that fill the page
GAP = (0.22, 0.16)  # between two boxes
DECADES = 3.0  # a link that conducts so much less than the best is twice as long
HUB = 2.0  # links that make a node of a large network a length of 1 further from its neighbours


def places_of_boxes(network: Network, conductances: Floats, boxes: Floats) -> Floats:
    """Centres (n + b, 2) of the `boxes` (n + b, 2) of nodes and boundaries: those with large `conductances` (links,)
    [W/K] between them near each other, none over another."""
    return without_overlap(_on_page(_lengths(network, conductances), _start(network)), boxes + np.array(GAP))


def places_of_dots(network: Network) -> Floats:
    """Places (n + b, 2) of the nodes and boundaries of a large network: slices in rows, aside what is linked to all."""
    return _on_page(_hubs_far(network), _start(network))


def slice_of(name: str) -> tuple[str, int]:
    """`teeth_7` -> teeth, 7; `teeth` -> teeth, 0."""
    found = re.fullmatch(r"(.*)_(\d+)", name)
    return (found[1], int(found[2])) if found else (name, 0)


def _on_page(lengths: Floats, start: Floats) -> Floats:
    place = stress_layout(lengths, start)
    span = np.ptp(place, axis=0)
    scale = np.array(PAGE) / np.where(span > 0, span, 1.0)
    on_page: Floats = place * scale * min(1.0, (len(place) / MANY) ** 0.5)
    return on_page


def _coupled(network: Network) -> list[tuple[int, int]]:
    """Indices of the two ends of each link, then of each step of a stream."""
    index = {name: i for i, name in enumerate(network.names)}
    ends = [*((link.a, link.b) for link in network.links), *stream_places(network)]
    return [(index[a], index[b]) for a, b in ends]


def _matrix(network: Network, lengths: Iterable[float]) -> Floats:
    """Lengths for the layout (n + b, n + b), of what is coupled, 0 elsewhere."""
    found = np.zeros((len(network.names),) * 2)
    for (a, b), length in zip(_coupled(network), lengths, strict=True):
        found[a, b] = found[b, a] = length
    return found


def _lengths(network: Network, conductances: Floats) -> Floats:
    best = max(conductances.max(initial=0.0), 1e-9)
    worse = np.clip(np.log10(best / np.maximum(conductances, 1e-12)) / DECADES, 0.0, 1.0)
    return _matrix(network, [*(1.0 + worse), *(1.0 for _ in stream_places(network))])


def _hubs_far(network: Network) -> Floats:
    """1 between slices, more from a node that touches many, as a housing or a coolant does, so that it brings no two of
    them near each other."""
    ends = np.array(_coupled(network))
    touches = np.bincount(ends.ravel(), minlength=len(network.names))
    return _matrix(network, np.maximum(1.0, touches[ends].max(axis=1) / HUB))


def _start(network: Network) -> Floats:
    """Where the layout begins: regions from top to bottom, ends and slices from left to right, none on another."""
    regions = {node.name: node.region for node in network.nodes}
    most: dict[str, int] = {}
    for part, number in map(slice_of, network.names):
        most[part] = max(most.get(part, 1), number)
    start = []
    for i, name in enumerate(network.names):
        part, number = slice_of(name)
        end = next((word for word in reversed(part.split("_")) if word in ("a", "b")), "")
        side = {"a": -1.5, "b": 1.5}.get(end, 0.0)
        along = 3.0 * (number / most[part] - 0.5) if number else 0.0
        height = LAYER[regions[name]] if name in regions else OUTSIDE
        start.append((side + along + 0.05 * np.sin(7.0 * i), height + 0.05 * np.cos(5.0 * i)))
    return np.array(start)
