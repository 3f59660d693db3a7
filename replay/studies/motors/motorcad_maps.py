"""Loss maps from the table over speed and torque that Lab of Motor-CAD leaves.

`MotorLAB_elecdata.mat` holds, of an efficiency map, one matrix each of `Speed` [rpm], `Shaft_Torque` [Nm] and losses
[W]. So public programs read it: ThermalInterface.m of github.com/mathworks/import-motorcad-thermal-simulink, and
examples/basics/lab_basics.py of github.com/ansys/pymotorcad.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.errors import MotorFileError
from replay.studies.motors.loss_maps import mapped

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
CURRENTS = {"Id_Peak", "Iq_Peak"}  # what the other map that Motor-CAD exports goes over
DAMAGE = Exception  # scipy's own, and what a damaged byte leads to beneath it

Values = NDArray[np.float64]


def maps_of(path: Path) -> dict[str, str]:
    """Name of each loss that is not 0 everywhere -> its map, as a motor file's `map` reads it.

    Between points it is linear; where the motor does not reach, the nearest point counts. Raises MotorFileError
    where the file is none, or holds no map.
    """
    held = _held(path)
    if held.keys() >= CURRENTS and "Shaft_Torque" not in held:
        raise MotorFileError(
            f"{path.name}: is a saturation and loss map, over currents and not over speed and torque: calculate an "
            "efficiency map in Lab, and give its MotorLAB_elecdata.mat."
        )
    speed, torque = (_points(held, name, path) for name in ("Speed", "Shaft_Torque"))
    losses = {name.lower(): _points(held, name, path) for name in LOSSES if name in held}
    shape = held["Speed"].shape
    maps = mapped(speed, torque, losses, max(shape)) if min(shape) > 1 else None
    if maps is None:
        raise MotorFileError(
            f"{path.name}: holds a curve and no map: calculate an efficiency map in Lab, and give its file."
        )
    return maps


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
