"""Loss maps from a table with a row for each operating point: what any design program's map is as a table.

Motor-CAD and MotorXP export maps as CSV, and no public description says their columns; so the columns are told by names
and units, as those of logs are: speed, torque, and losses in W or kW. Written as any table that is read as a log.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ingest.errors import UnitError, UnreadableLogError
from ingest.formats import Rows, TimeSpec, open_log
from ingest.texts.guessing import guess, unit_in_name
from ingest.texts.quantities import Conversion, converter
from replay.errors import MotorFileError
from replay.studies.motors.loss_maps import mapped

LOSS = re.compile("loss|verlust|perdit|perte|pérdida|perdida", re.IGNORECASE)

Values = NDArray[np.float64]


def maps_of(path: Path) -> dict[str, str]:
    """Name of each loss -> its map, as a motor file's `map` reads it. Raises MotorFileError where the table is none of
    operating points."""
    columns, units = _read(path)
    speed, torque = (_of(quantity, columns, units, path) for quantity in ("speed", "torque"))
    lost = {name: values for name, values in columns.items() if LOSS.search(name)}
    losses = {_file_name(name): _conversion(name, "heat", units, path)(values) for name, values in lost.items()}
    if not losses:
        raise MotorFileError(f"{path.name}: no column of it is called a loss, as Iron_Loss [W] is: name them so.")
    whole = np.all([np.isfinite(one) for one in (speed, torque, *losses.values())], axis=0)
    maps = mapped(speed[whole], torque[whole], {name: loss[whole] for name, loss in losses.items()})
    if maps is None:
        raise MotorFileError(f"{path.name}: its points lie on a line: a map needs several speeds and torques.")
    return maps


def _read(path: Path) -> tuple[Mapping[str, Values], Mapping[str, str]]:
    """The columns of numbers (N,) of a table, and their units."""
    try:
        log = open_log(path, TimeSpec(untimed=True))
        batches = [batch for batch in log.batches() if isinstance(batch, Rows)]
    except UnreadableLogError as error:
        raise MotorFileError(str(error)) from None
    names = [name for name, values in batches[0].columns.items() if values.dtype != object] if batches else []
    columns = {name: np.concatenate([batch.columns[name] for batch in batches]) for name in names}
    return columns, {name: unit for name in names if (unit := log.units.get(name) or unit_in_name(name))}


def _of(quantity: str, columns: Mapping[str, Values], units: Mapping[str, str], path: Path) -> Values:
    """The one column of a quantity, in its stored unit."""
    found = [name for name in columns if not LOSS.search(name) and guess(name, units.get(name)) == quantity]
    if len(found) != 1:
        seem = f"{' and '.join(found)} seem to be" if found else "no column of it seems to be"
        raise MotorFileError(f"{path.name}: {seem} the {quantity}: call one column of it {quantity} and no other.")
    return _conversion(found[0], quantity, units, path)(columns[found[0]])


def _conversion(name: str, quantity: str, units: Mapping[str, str], path: Path) -> Conversion:
    """From the unit of a column to the stored one."""
    if name not in units:
        raise MotorFileError(f'{path.name}: "{name}" says no unit: write it behind the name, as in Speed [rpm].')
    try:
        return converter(units[name], quantity)
    except UnitError as error:
        raise MotorFileError(f'{path.name}, column "{name}": {error}') from None


def _file_name(column: str) -> str:
    """ "iron_loss" of `Iron Loss [W]`."""
    return re.sub(r"\W+", "_", re.sub(r"[\[(].*", "", column)).strip("_").lower() or "loss"
