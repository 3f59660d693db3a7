"""Loss maps from the table over speed and torque that Lab of Motor-CAD leaves.

`MotorLAB_elecdata.mat` holds, of an efficiency map, one matrix each of `Speed` [rpm], `Shaft_Torque` [Nm] and losses
[W]. So public programs read it: ThermalInterface.m of github.com/mathworks/import-motorcad-thermal-simulink, and
examples/basics/lab_basics.py of github.com/ansys/pymotorcad. At each speed its torques are others; a map of a motor
file has the same at all.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.errors import MotorFileError

LOSSES = (
    "Stator_Copper_Loss",
    "Stator_Copper_Loss_AC",
    "Rotor_Cage_Loss",
    "Iron_Loss_Stator_Back_Iron",
    "Iron_Loss_Stator_Tooth",
    "Iron_Loss_Rotor_Back_Iron",
    "Iron_Loss_Rotor_Tooth",
    "Iron_Loss_Rotor_Pole",
    "Magnet_Loss",
    "Banding_Loss",
    "Sleeve_Loss",
    "Friction_Loss",
    "Windage_Loss",
    "Stray_Load_Loss",
)
DAMAGE = Exception  # scipy's own, and what a damaged byte leads to beneath it
MOST = 60  # knots of a map on either axis

Values = NDArray[np.float64]


def maps_of(path: Path) -> dict[str, str]:
    """Name of each loss that is not 0 everywhere -> its map, as a motor file's `map` reads it.

    Motoring points alone, as a map takes speed and torque as magnitudes. Between points it is linear; where the motor
    does not reach, the nearest point counts. Raises MotorFileError where the file is none, or holds no map.
    """
    held = _held(path)
    speed, torque = (_points(held, name, path) for name in ("Speed", "Shaft_Torque"))
    driven = (speed >= 0) & (torque >= 0)
    flat = np.linalg.matrix_rank(_scaled(speed[driven], torque[driven]), tol=1e-6) < 3
    if flat or min(held["Speed"].shape) < 2:
        raise MotorFileError(
            f"{path.name}: holds a curve and no map: calculate an efficiency map in Lab, and give its file."
        )
    knots = _knots(speed[driven], held["Speed"].shape), _knots(torque[driven], held["Speed"].shape)
    losses = {name: _points(held, name, path) for name in LOSSES if name in held}
    return {
        name.lower(): _text(*knots, _gridded(speed[driven], torque[driven], loss[driven], *knots))
        for name, loss in losses.items()
        if loss[driven].any()
    }


def _held(path: Path) -> Mapping[str, Any]:
    from scipy.io import loadmat

    try:
        return dict(loadmat(str(path)))
    except OSError as error:
        raise MotorFileError(
            f"{path}: cannot be read: {error.strerror or error}. Check path and permissions."
        ) from None
    except DAMAGE as error:
        says = " ".join(str(error).split())[:120]
        raise MotorFileError(f"{path.name}: is no MATLAB file of version 7 or before ({says}).") from None


def _points(held: Mapping[str, Any], name: str, path: Path) -> Values:
    """The values of a matrix of the map (N,)."""
    matrix = held.get(name)
    if matrix is None or not np.issubdtype(np.asarray(matrix).dtype, np.number):
        raise MotorFileError(f"{path.name}: holds no {name}: give MotorLAB_elecdata.mat of an efficiency map.")
    if np.shape(matrix) != np.shape(held["Speed"]) or not np.isfinite(matrix).all():
        raise MotorFileError(f"{path.name}: {name} is no whole matrix of the size of Speed: calculate the map again.")
    return np.asarray(matrix, np.float64).ravel()


def _scaled(speed: Values, torque: Values) -> Values:
    """Points (N, 3) of 1, speed and torque, the last two of about 1."""
    return np.stack([np.ones_like(speed), *(one / max(float(one.max(initial=0)), 1e-9) for one in (speed, torque))], 1)


def _knots(values: Values, shape: tuple[int, ...]) -> Values:
    """The values themselves where they are few, else as many between the least and the largest as the map has."""
    own = np.unique(values)
    return own if len(own) <= max(shape) else np.linspace(own[0], own[-1], min(max(shape), MOST))


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
