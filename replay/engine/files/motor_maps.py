"""A motor file with maps in files of their own, made whole, as a store keeps it: tables where files were named."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator
from pathlib import Path

from ingest.errors import TomlError
from ingest.texts.toml_file import TomlTable, read
from ingest.texts.toml_spans import spans
from replay.engine.files.motor_file import SCHEMA, read_motor
from replay.errors import MotorFileError
from twin.motor.network import Network

_BOM = "\ufeff"
_AMPERES = re.compile(r"(?<![A-Za-z])A\s*$")


def read_motor_file(path: Path) -> Network:
    """The network of a motor file and of the maps beside it. Raises MotorFileError."""
    return read_motor(whole(path), path.name)


def whole(path: Path) -> bytes:
    """The bytes of a motor file, each `map = "file.csv"` replaced by its table on the same line. Raises MotorFileError
    where the file or a map cannot be read."""
    try:
        data = path.read_bytes()
        root = read(data, path.name, SCHEMA)
        named = [(at, term) for at, term in _terms(root) if isinstance(term.values.get("map"), str)]
        if not named:
            return data
        text = data.decode().removeprefix(_BOM)
        places, parts, end = spans(text), [], 0
        for span, term in sorted(((places[at], term) for at, term in named), key=lambda one: one[0].start):
            parts += [text[end : span.start], _inline(path, term)]
            end = span.end
        return "".join([*parts, text[end:]]).encode()
    except TomlError as error:
        raise MotorFileError(str(error)) from None
    except OSError as error:
        why = error.strerror or error
        raise MotorFileError(f"{path}: cannot be read: {why}. Check path and permissions.") from None


def _terms(root: TomlTable) -> Iterator[tuple[tuple[str | int, ...], TomlTable]]:
    """Every term with the place of its map."""
    for table in (root, *root.tables("configuration")):
        for entry in (*table.tables("link"), *table.tables("source")):
            for term in entry.tables("terms"):
                yield (*term.path, "map"), term


def _inline(motor: Path, term: TomlTable) -> str:
    file = motor.parent / term.values["map"]
    if not file.is_file():
        raise term.error(f'map "{term.values["map"]}" is not there ({file}): correct the path.', "map")
    speed, load, values, over = _table(file)
    rows = ", ".join(_list(row) for row in values)
    return f"{{speed_rpm = {_list(speed)}, {over} = {_list(load)}, values = [{rows}]}}"


def _list(values: list[float]) -> str:
    return f"[{', '.join(map(repr, values))}]"


def _table(file: Path) -> tuple[list[float], list[float], list[list[float]], str]:
    """Speeds of the first column, loads of the first row, a row of values for each speed, and what the loads are:
    `current_A` where the corner ends in "A", such as "rpm/A"."""
    try:
        text = file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise MotorFileError(f"{file.name}: is not UTF-8 text. Save the map as CSV in UTF-8.") from None
    first = text.partition("\n")[0]
    delimiter = next((mark for mark in (";", "\t") if mark in first), ",")
    reader = csv.reader(text.splitlines(), delimiter=delimiter)
    rows = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    if len(rows) < 2 or len(rows[0][1]) < 2:
        raise MotorFileError(
            f"{file.name}: holds no table: the first row has a free cell and the torques [Nm], or the cell rpm/A and "
            "the currents [A], each further row a speed [rpm] and its values."
        )
    (number, head), *body = rows
    load = [_number(file, number, cell) for cell in head[1:]]
    over = "current_A" if _AMPERES.search(head[0]) else "torque_Nm"
    for number, row in body:
        if len(row) != len(head):
            cells = f"has {len(row)} cells, the first row {len(head)}"
            raise MotorFileError(f"{file.name}:{number}: {cells}: fill the table.")
    numbers = [[_number(file, number, cell) for cell in row] for number, row in body]
    return [row[0] for row in numbers], load, [row[1:] for row in numbers], over


def _number(file: Path, line: int, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise MotorFileError(f'{file.name}:{line}: "{cell.strip()[:40]}" is not a number: decimals take a point.')
    return value
