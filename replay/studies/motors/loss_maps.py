"""Maps of losses over speed and torque, as a motor file reads them, from points of any operation.

At each speed the torques of a design program may be others; a map of a motor file has the same at all.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

MOST = 60  # knots of a map on either axis

Values = NDArray[np.float64]


def mapped(speed: Values, torque: Values, losses: Mapping[str, Values], most: int = MOST) -> dict[str, str] | None:
    """Name of each loss [W] that is not 0 everywhere -> its map, from points (N,) of speed [rpm] and torque [Nm]; None
    where these lie on a line.

    Points that turn forwards alone; a torque below 0 brakes. Between points it is linear; where there is none, the
    nearest counts. The knots are the points' own, `most` even ones where there are more.
    """
    forwards = speed >= 0
    speed, torque = speed[forwards], torque[forwards]
    if np.linalg.matrix_rank(np.column_stack([np.ones_like(speed), *_scaled(speed, torque)]), tol=1e-6) < 3:
        return None
    knots = _knots(speed, most), _knots(torque, most)
    return {
        name: _text(*knots, _gridded(speed, torque, loss[forwards], *knots))
        for name, loss in losses.items()
        if loss[forwards].any()
    }


def _scaled(*axes: Values) -> tuple[Values, ...]:
    """Each of 1 at most."""
    return tuple(one / max(float(np.abs(one).max(initial=0)), 1e-9) for one in axes)


def _knots(values: Values, most: int) -> Values:
    """The values themselves where they are few, else even ones between the least and the largest, and 0 between."""
    own = np.unique(values)
    if len(own) <= most:
        return own
    even = np.linspace(own[0], own[-1], min(most, MOST))
    return np.unique(np.append(even, 0.0)) if own[0] < 0 < own[-1] else even


def _gridded(speed: Values, torque: Values, loss: Values, speeds: Values, torques: Values) -> Values:
    """A loss at the knots (S, T)."""
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    at = np.column_stack(_scaled(speed, torque))
    wanted = np.stack(np.meshgrid(*_scaled(speeds, torques), indexing="ij"), axis=-1)
    inside = LinearNDInterpolator(at, loss)(wanted)
    return np.asarray(np.where(np.isnan(inside), NearestNDInterpolator(at, loss)(wanted), inside))


def _text(speeds: Values, torques: Values, values: Values) -> str:
    rows = [["rpm/Nm", *(f"{torque:.6g}" for torque in torques)]]
    rows += [[f"{speed:.6g}", *(f"{value:.6g}" for value in row)] for speed, row in zip(speeds, values, strict=True)]
    return "".join(",".join(row) + "\n" for row in rows)
