"""Lines of a table as columns: all together where that works, else those that cannot be read one by one."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
from numpy.typing import NDArray

from ingest.formats import SHOWN, _csv_units
from ingest.formats._csv_dialect import BLANKS, Dialect, cells
from ingest.formats._csv_numbers import BEYOND, MISSING, Numerals

SINGLY = 64  # rows that are read one by one where they cannot be read together


@dataclass(frozen=True)
class Lines:
    """Lines that were read: their places (N,), and the columns in the order of the header, (N,) each."""

    line: NDArray[np.int64]
    columns: tuple[NDArray[Any], ...]


@dataclass(frozen=True)
class LineReader:
    """Reads the lines of a table; `numeric`: which of its columns hold numbers. `bounds` takes the columns with cells
    that say but a bound: the first such cell, and how many there are."""

    dialect: Dialect
    numeric: tuple[bool, ...]
    no_row: str = ""  # what a line is that has other fields than the header, where that is known
    bounds: dict[str, tuple[str, int]] = field(default_factory=dict)

    def read(self, lines: list[str], places: list[int], bad: dict[int, tuple[str, str]]) -> Lines:
        """The lines at `places`; `bad` takes those that cannot be read: place -> (column, why)."""
        none = Lines(np.empty(0, np.int64), tuple(np.empty(0, float if kind else object) for kind in self.numeric))
        parts = [*self._parts(lines, places, bad)] or [none]
        columns = (np.concatenate(column) for column in zip(*(part.columns for part in parts), strict=True))
        present = tuple(one if one.dtype == object else Numerals.present(one) for one in columns)
        return Lines(np.concatenate([part.line for part in parts]), present)

    def _parts(self, lines: list[str], places: list[int], bad: dict[int, tuple[str, str]]) -> Iterator[Lines]:
        """The lines at `places`, together where that works, else in halves, in the end one by one."""
        if not places:
            return
        columns = self._together([lines[place] for place in places])
        if columns is not None:
            yield Lines(np.array(places), columns)
        elif len(places) <= SINGLY:
            yield from self._singly(lines, places, bad)
        else:
            half = len(places) // 2
            yield from self._parts(lines, places[:half], bad)
            yield from self._parts(lines, places[half:], bad)

    def _together(self, lines: list[str]) -> tuple[NDArray[Any], ...] | None:
        """The columns of `lines`; None where one of them is no row as it should be."""
        names, numerals = [str(place) for place in range(len(self.numeric))], self.dialect.numerals
        as_text = bool(numerals.group) or numerals.decimal == self.dialect.delimiter
        ends = self._ends()
        texts = [not kind or as_text or bool(end) for kind, end in zip(self.numeric, ends, strict=True)]
        kinds = dict(zip(names, (pa.string() if text else pa.float64() for text in texts), strict=True))
        try:
            if self.dialect.delimiter == BLANKS:
                lines = ["\t".join(line.split()) for line in lines]
            table = pa.csv.read_csv(
                pa.BufferReader("\n".join(lines).encode()),
                pa.csv.ReadOptions(use_threads=False, column_names=names, block_size=1 << 30),
                pa.csv.ParseOptions(
                    delimiter="\t" if self.dialect.delimiter == BLANKS else self.dialect.delimiter,
                    newlines_in_values=False,
                ),
                pa.csv.ConvertOptions(
                    column_types=kinds,
                    null_values=sorted(MISSING),
                    strings_can_be_null=False,
                    decimal_point="." if as_text else numerals.decimal,
                ),
            )
        except (pa.ArrowInvalid, UnicodeError):
            return None
        columns: list[NDArray[Any]] = []
        for name, kind, text, end in zip(names, self.numeric, texts, ends, strict=True):
            column = table[name].combine_chunks()
            values = numerals.values(_without(column, end)) if kind and text else table[name].to_numpy()
            if values is None or (kind and np.isinf(values).any()):
                return None
            columns.append(numerals.read(values) if kind else values)
        return None if table.num_rows != len(lines) else tuple(columns)

    def _singly(self, lines: list[str], places: list[int], bad: dict[int, tuple[str, str]]) -> Iterator[Lines]:
        rows: list[tuple[int, list[float | str]]] = []
        ends = self._ends()
        for place in places:
            row = self._row(lines[place], ends)
            if isinstance(row, tuple):
                bad[place] = row
            else:
                rows.append((place, row))
        if rows:
            columns = zip(*(row for _, row in rows), strict=True)
            kinds = [np.float64 if kind else object for kind in self.numeric]
            arrays = tuple(np.array(values, kind) for values, kind in zip(columns, kinds, strict=True))
            yield Lines(np.array([place for place, _ in rows]), arrays)

    def _row(self, line: str, ends: Sequence[str]) -> list[float | str] | tuple[str, str]:
        """The values of one line, or (column, why it cannot be read)."""
        row = cells(line, self.dialect.delimiter)
        if len(row) != len(self.numeric):
            count = f"has {len(row):,} field{'s' * (len(row) != 1)} where the header has {len(self.numeric):,}"
            return "", self.no_row or count
        values: list[float | str] = []
        beyond: list[tuple[str, str]] = []
        for name, cell, numeric, end in zip(self.dialect.names, row, self.numeric, ends, strict=True):
            if not numeric:
                value: float | str | None = cell
            elif end:
                value = _csv_units.value(cell.strip(), end, self.dialect.numerals)
            else:
                value = self.dialect.numerals.value(cell)
            if value is None:
                return name, f'text "{cell.strip()[:SHOWN]}" where numbers are'
            if numeric and BEYOND.match(cell.strip()):
                beyond.append((name, cell.strip()))
            values.append(value)
        for name, cell in beyond:  # of a row that can be read whole
            first, before = self.bounds.get(name, (cell, 0))
            self.bounds[name] = first, before + 1
        return values

    def _ends(self) -> list[str]:
        """What each cell of a column ends in, "" in most: a unit."""
        return [self.dialect.in_cells.get(name, "") for name in self.dialect.names]


def _without(cells: pa.Array, end: str) -> pa.Array:
    """Cells without the unit that they end in."""
    return pc.replace_substring_regex(cells, rf"\s*{re.escape(end)}\s*$", "") if end else cells
