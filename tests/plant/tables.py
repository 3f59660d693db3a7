"""Tables as data loggers write them: English, German and Italian numbers and stamps, a row of units, local time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from math import isnan
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Style:
    """How one logger writes."""

    time: str  # name of the column
    delimiter: str
    decimal: str
    stamp: str
    zone: str

    @property
    def toml(self) -> str:
        """The table `[time]` of a bench file that explains it."""
        return f'[time]\ncolumn = "{self.time}"\nformat = "{self.stamp}"\nzone = "{self.zone}"\n'


STYLES: Mapping[str, Style] = {
    "english": Style("Time", ",", ".", "%Y-%m-%d %H:%M:%S", "UTC"),
    "german": Style("Zeit", ";", ",", "%d.%m.%Y %H:%M:%S", "Europe/Berlin"),
    "italian": Style("Ora", ";", ",", "%d/%m/%Y %H:%M:%S", "Europe/Rome"),
}


@dataclass(frozen=True)
class Column:
    """One column: its name, unit, values (N,) and decimal digits."""

    name: str
    unit: str
    values: Floats
    digits: int


def write_table(path: Path, style: Style, start: datetime, t_s: Floats, columns: Sequence[Column]) -> None:
    """Write one row for each `t_s` (N,), whole seconds after `start` (aware); an empty cell where a value is NaN. In
    cp1252, as loggers do."""
    zone = ZoneInfo(style.zone)
    begin = start.astimezone(UTC)
    stamps = [(begin + timedelta(seconds=s)).astimezone(zone).strftime(style.stamp) for s in np.rint(t_s).tolist()]
    cells = [stamps]
    for column in columns:
        form = f"%.{column.digits}f"
        texts = ["" if isnan(value) else form % value for value in column.values.tolist()]
        cells.append([text.replace(".", ",") for text in texts] if style.decimal == "," else texts)
    header = [style.time, *(column.name for column in columns)]
    units = ["", *(column.unit for column in columns)]
    lines = map(style.delimiter.join, [header, units, *map(list, zip(*cells, strict=True))])
    path.write_text("\n".join([*lines, ""]), encoding="cp1252")
