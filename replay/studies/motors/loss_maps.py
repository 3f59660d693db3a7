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

    Motoring points alone, as a map takes speed and torque as magnitudes. Between points it is linear; where there is
    none, the nearest counts. The knots are the points' own, `most` even ones where there are more.
    """
    driven = (speed >= 0) & (torque >= 0)
    if np.linalg.matrix_rank(_scaled(speed[driven], torque[driven]), tol=1e-6) < 3:
        return None
    knots = _knots(speed[driven], most), _knots(torque[driven], most)
    return {
        name: _text(*knots, _gridded(speed[driven], torque[driven], loss[driven], *knots))
        for name, loss in losses.items()
        if loss[driven].any()
    }


def _scaled(speed: Values, torque: Values) -> Values:
    """Points (N, 3) of 1, speed and torque, the last two of about 1."""
    return np.stack([np.ones_like(speed), *(one / max(float(one.max(initial=0)), 1e-9) for one in (speed, torque))], 1)


def _knots(values: Values, most: int) -> Values:
    """The values themselves where they are few, else even ones between the least and the largest."""
    own = np.unique(values)
    return own if len(own) <= most else np.linspace(own[0], own[-1], min(most, MOST))


def _gridded(speed: Values, torque: Values, loss: Values, speeds: Values, torques: Values) -> Values:
    """A loss at the knots (S, T)."""
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    at = _scaled(speed, torque)[:, 1:]
    wanted = np.stack(np.meshgrid(speeds / speed.max(), torques / torque.max(), indexing="ij"), axis=-1)
    inside = LinearNDInterpolator(at, loss)(wanted)
    return np.asarray(np.where(np.isnan(inside), NearestNDInterpolator(at, loss)(wanted), inside))


def _text(speeds: Values, torques: Values, values: Values) -> str:
    rows = [["rpm/Nm", *(f"{torque:.6g}" for torque in torques)]]
    rows += [[f"{speed:.6g}", *(f"{value:.6g}" for value in row)] for speed, row in zip(speeds, values, strict=True)]
    return "".join(",".join(row) + "\n" for row in rows)
