"""What drives a motor at an operating point: inputs over speed and load, as recorded steps have shown them.

Recorded steps are averaged in small cells first, so that an hour at one point counts as much as a passing second. At
a point every input is a plane through the cells nearest to it, weighed by their distance (local linear regression: W.
S. Cleveland, J. Am. Stat. Assoc. 74 (1979) 829, doi:10.1080/01621459.1979.10481038). It is good up to the largest
load that was recorded near a speed; beyond, nothing is known.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Floats = NDArray[np.float64]

CELLS = 50  # along speed and along load
AROUND = 16  # cells that a plane is laid through
NEAR = 0.06  # of the largest speed and load: how far a recorded cell speaks


class OperatingMap:
    """All recorded steps: `speed` and `load` (N,), at least 0, and `inputs`, name -> (N,), in any units; NaN where
    unknown."""

    def __init__(self, speed: Floats, load: Floats, inputs: Mapping[str, Floats]) -> None:
        there = np.isfinite(np.stack([speed, load, *inputs.values()])).all(axis=0)
        speed, load = speed[there], load[there]
        self.top_speed, self.top_load = float(speed.max()), float(load.max())
        places = np.column_stack([speed / self.top_speed, load / self.top_load])
        _, cell = np.unique((places * CELLS).astype(np.int64) @ [2 * CELLS, 1], return_inverse=True)
        count = np.bincount(cell)

        def means(values: Floats) -> Floats:
            found: Floats = np.bincount(cell, values) / count
            return found

        self._at = np.column_stack([means(column) for column in places.T])
        self._inputs = {name: means(values[there]) for name, values in inputs.items()}
        self._tree = cKDTree(self._at)

    def inputs(self, speed: float, load: float) -> dict[str, float]:
        """The inputs at a point, within what the steps nearest to it had."""
        point = np.array([speed / self.top_speed, load / self.top_load])
        distance, near = self._tree.query(point, k=min(AROUND, len(self._at)))
        distance, near = np.atleast_1d(distance), np.atleast_1d(near)
        reach = max(float(distance.max()), NEAR)
        weight = (1 - np.minimum(distance / reach, 1.0) ** 3) ** 3 + 1e-6
        design = np.column_stack([np.ones(len(near)), self._at[near] - point]) * np.sqrt(weight)[:, None]
        values = np.column_stack([own[near] for own in self._inputs.values()])
        plane = np.linalg.lstsq(design, values * np.sqrt(weight)[:, None], rcond=1e-6)[0][0]
        low, high = values.min(axis=0), values.max(axis=0)
        return dict(zip(self._inputs, map(float, np.clip(plane, low, high)), strict=True))

    def most_load(self, speed: float) -> float:
        """The largest load that was recorded near a speed; 0 where none was."""
        near = np.abs(self._at[:, 0] - speed / self.top_speed) <= NEAR
        return float(self._at[near, 1].max(initial=0.0)) * self.top_load
