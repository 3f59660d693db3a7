"""Where the nodes of a network stand in a picture: near what they are coupled to, apart from everything else.

Stress majorisation: positions X minimise `sum_ij d_ij^-2 (|X_i - X_j| - d_ij)^2` for graph distances d_ij, by repeated
solution of one linear system (E. R. Gansner, Y. Koren, S. North, Graph Drawing 2004, doi:10.1007/978-3-540-31843-9_25).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import shortest_path

Floats = NDArray[np.float64]

ROUNDS = 300
SETTLED = 1e-5  # relative change of the stress in a round
PUSHES = 600


def stress_layout(lengths: Floats, start: Floats) -> Floats:
    """Positions (n, 2) from a `start` (n, 2), which decides orientation; `lengths` (n, n) of links, symmetric, 0 where
    there is none: such parts are kept as far apart as the longest distance. The same input gives the same bits."""
    distance = shortest_path(lengths, directed=False)
    finite = distance[np.isfinite(distance)]
    distance[~np.isfinite(distance)] = finite.max() + 1.0
    weight = np.divide(1.0, distance**2, out=np.zeros_like(distance), where=distance > 0)
    laplacian = np.diag(weight.sum(axis=1)) - weight
    inverse = np.linalg.pinv(laplacian)
    place: Floats = start - start.mean(axis=0)
    before = np.inf
    for _ in range(ROUNDS):
        apart = _apart(place)
        stress = float((weight * (apart - distance) ** 2).sum())
        if before - stress < SETTLED * stress:
            break
        before = stress
        pull = np.divide(weight * distance, apart, out=np.zeros_like(apart), where=apart > 1e-12)
        place = inverse @ ((np.diag(pull.sum(axis=1)) - pull) @ place)
    return place


def _apart(place: Floats) -> Floats:
    return np.asarray(np.sqrt(((place[:, None, :] - place[None, :, :]) ** 2).sum(axis=2)))


def without_overlap(place: Floats, size: Floats) -> Floats:
    """Centres (n, 2) of boxes of `size` (n, 2), moved until no two overlap, each pair along the axis of least way."""
    place = place.copy()
    room = (size[:, None, :] + size[None, :, :]) / 2
    order = np.arange(len(place))
    for _ in range(PUSHES):
        gap = place[:, None, :] - place[None, :, :]
        inside = room - np.abs(gap)
        first, second = np.nonzero((inside > 1e-9).all(axis=2) & (order[:, None] < order))
        if first.size == 0:
            break
        for i, j in zip(first.tolist(), second.tolist(), strict=True):
            between = place[i] - place[j]
            over = room[i, j] - np.abs(between)
            if (over > 1e-9).all():
                axis = int(np.argmin(over))
                step = 0.51 * over[axis] * (1.0 if between[axis] >= 0 else -1.0)
                place[i, axis] += step
                place[j, axis] -= step
    return place
