"""A motor cut open: each node as a ring about the shaft, by its region and its name, the half towards the reader away.

From the inside: shaft, bearings, rotor, magnets, the rotor's surface, air, teeth, copper, yoke, cooling jacket,
housing. What is called end, plate or terminal, bearings and fluids with a side stand before the stack (`_a`) or behind
it (`_b`); `_a` and `_b` elsewhere are its halves, and `_1`, `_2`, ... its slices. A motor file may say otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replay.show.plots.network_places import slice_of
from twin.motor.network import Network

Floats = NDArray[np.float64]

BY_NAME: Mapping[str, int] = {  # word in a name -> rank from the inside
    "shaft": 0,
    "surface": 4,
    "sleeve": 4,
    "gap": 5,
    "teeth": 6,
    "tooth": 6,
    "jacket": 9,
}
BY_REGION: Mapping[str, int] = {
    "bearing": 1,
    "rotor": 2,
    "magnet": 3,
    "fluid": 5,
    "copper": 7,
    "iron": 8,
    "housing": 10,
    "other": 11,
}
OUTSIDE_STACK = ("end", "endwinding", "plate", "terminal")  # words of a name
LENGTH, END = 1.0, 0.32  # of half the stack, and of what stands at an end
SPACE = 0.02  # between parts
CORNERS = 25  # along the arc of a half ring


@dataclass(frozen=True)
class HalfRing:
    """A half ring of a node: `r` from the inner to the outer radius, `x` along the shaft."""

    node: str
    r: tuple[float, float]
    x: tuple[float, float]


def parts(network: Network) -> list[HalfRing]:
    """A part for each node, where the motor file puts it; of the others no two in the same place."""
    ranks: dict[int, dict[str, list[str]]] = {}
    placed = [HalfRing(node.name, node.radius, node.along) for node in network.nodes if node.along and node.radius]
    for node in (node for node in network.nodes if node.along is None):
        found = ranks.setdefault(_rank(node.name, node.region), {})
        found.setdefault(_row(node.name, node.region), []).append(node.name)
    regions = {node.name: node.region for node in network.nodes}
    for k, rank in enumerate(sorted(ranks)):
        rows = ranks[rank]
        for where in ("end", "stack"):
            own = [names for row, names in rows.items() if row.startswith("end") == (where == "end")]
            for j, names in enumerate(own):
                r = (k + j / len(own), k + (j + 1) / len(own))
                radii = (r[0] / len(ranks), r[1] / len(ranks) - SPACE / 2)
                placed += [HalfRing(n, radii, x) for n, x in _along(names, regions).items()]
    return placed


def _words(name: str) -> list[str]:
    return name.split("_")


def _rank(name: str, region: str) -> int:
    return next((BY_NAME[word] for word in _words(name) if word in BY_NAME), BY_REGION.get(region, 11))


def _is_end(name: str, region: str) -> bool:
    sided = _side(name) != "" and region in ("bearing", "fluid")
    return sided or any(word in OUTSIDE_STACK for word in _words(name))


def _side(name: str) -> str:
    return next((word for word in reversed(_words(name)) if word in ("a", "b")), "")


def _row(name: str, region: str) -> str:
    """What stands in one row along the shaft: halves and slices of the same thing, one at each end."""
    bare = "_".join(word for word in _words(slice_of(name)[0]) if word not in ("a", "b"))
    return ("end " if _is_end(name, region) else "stack ") + bare


def _along(names: Sequence[str], regions: Mapping[str, str]) -> dict[str, tuple[float, float]]:
    """Node -> from where to where along the shaft, of the nodes of a row."""
    if _is_end(names[0], regions[names[0]]):
        front, behind = (-LENGTH - END, -LENGTH - SPACE), (LENGTH + SPACE, LENGTH + END)
        return {name: front if _side(name) == "a" else behind for name in names}
    if names[0].split("_")[0] == "shaft" and len(names) == 1:
        return {names[0]: (-LENGTH - 1.6 * END, LENGTH + 1.6 * END)}
    edges = np.linspace(-LENGTH, LENGTH, len(names) + 1).tolist()
    middle = (len(names) + 1) / 2  # the middle slice has its node's bare name
    in_order = sorted(names, key=lambda name: (_side(name), slice_of(name)[1] or middle))
    return {name: (a + SPACE / 2, b - SPACE / 2) for name, a, b in zip(in_order, edges[:-1], edges[1:], strict=True)}


def mesh(part: HalfRing) -> tuple[Floats, NDArray[np.uint32], Floats]:
    """Corners (m, 3), triangles (k, 3) and normals (m, 3) of a part: the half behind the plane of the shaft."""
    turn = np.linspace(0.0, np.pi, CORNERS)
    ring = np.column_stack([np.cos(turn), np.sin(turn)])  # (y behind the plane is sin, z is cos)
    (inner, outer), (left, right) = part.r, part.x
    faces = [
        _strip(_arc(ring, outer, left), _arc(ring, outer, right), _out(ring)),
        _strip(_arc(ring, inner, right), _arc(ring, inner, left), -_out(ring)),
        _strip(_arc(ring, inner, left), _arc(ring, outer, left), np.tile([-1.0, 0.0, 0.0], (CORNERS, 1))),
        _strip(_arc(ring, outer, right), _arc(ring, inner, right), np.tile([1.0, 0.0, 0.0], (CORNERS, 1))),
    ]
    for z in (1.0, -1.0):  # the two faces of the cut
        near = np.array([[left, 0.0, z * inner], [right, 0.0, z * inner]])
        far = np.array([[left, 0.0, z * outer], [right, 0.0, z * outer]])
        faces.append(_strip(near, far, np.tile([0.0, -1.0, 0.0], (2, 1))))
    begins = np.cumsum([0, *(len(corners) for corners, _, _ in faces)])
    triangles = [own + begin for (_, own, _), begin in zip(faces, begins, strict=False)]
    corners, normals = (np.concatenate([face[k] for face in faces]) for k in (0, 2))
    return corners, np.concatenate(triangles).astype(np.uint32), normals


def _arc(ring: Floats, r: float, x: float) -> Floats:
    return np.column_stack([np.full(len(ring), x), r * ring[:, 1], r * ring[:, 0]])


def _out(ring: Floats) -> Floats:
    return np.column_stack([np.zeros(len(ring)), ring[:, 1], ring[:, 0]])


def _strip(one: Floats, other: Floats, normals: Floats) -> tuple[Floats, NDArray[np.int64], Floats]:
    """A band between two rows of corners (n, 3), with the normals (n, 3) of both."""
    n, i = len(one), np.arange(len(one) - 1)
    triangles = np.concatenate([np.column_stack([i, i + 1, n + i]), np.column_stack([i + 1, n + i + 1, n + i])])
    return np.concatenate([one, other]), triangles, np.concatenate([normals, normals])
