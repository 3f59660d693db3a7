"""JSON lines: an object a line, each a row of a table, read as the text of a table would be.

The names of all objects are the columns (`motor.T` of an object in an object), a row is empty where its object lacks
one. Numbers are those of the text, true is 1 and false 0; what a text holds (stamps, numbers) is recognised as in CSV,
and so are long tables. Lists of up to 64 are a column for each place (`phases.0`), longer ones left out and named. A
line that is no object is rejected.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ingest.errors import UnreadableLogError
from ingest.formats import Rows
from ingest.formats._text import TextFile, decoded
from ingest.formats.csv import CsvLog

MOST_NAMES = 5000
MOST_PLACES = 64  # of a list
PLAIN = {None: "", True: "1", False: "0"}
NO_NUMBER = {"NaN": "", "Infinity": "", "-Infinity": ""}  # as Python writes what JSON cannot say


@dataclass
class _ObjectText(TextFile):
    """The objects of a file as lines, cells between tabs, below a line of the names of all."""

    names: dict[str, None] = field(default_factory=dict)
    lists: dict[str, None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for block in super().blocks():
            for line in block.split(b"\n"):
                self.names |= dict.fromkeys(self._cells(line) or ())
            if len(self.names) > MOST_NAMES:
                raise UnreadableLogError(
                    f"{self.path.name}: its objects hold more than {MOST_NAMES:,} names: they are data, not names of "
                    "channels. Export it as a table."
                )
        if not self.names:
            raise UnreadableLogError(f"{self.path.name}: no line of it is a JSON object. Export it as CSV.")

    def blocks(self) -> Iterator[bytes]:
        head = "\t".join(map(_cell, self.names)).encode(errors="replace") + b"\n"
        for block in super().blocks():
            lines = block.split(b"\n")
            yield head + b"\n".join(map(self._row, lines))
            head = b""

    def _row(self, line: bytes) -> bytes:
        """An object as a row; another line as it is, without the signs that cut one."""
        cells = self._cells(line)
        if cells is None:
            return line.replace(b"\t", b" ")
        return "\t".join(cells.get(name, "") for name in self.names).encode(errors="replace")

    def _cells(self, line: bytes) -> dict[str, str] | None:
        """What the object in a line holds; None where there is none."""
        try:
            found = json.loads(decoded(line), parse_int=str, parse_float=str, parse_constant=NO_NUMBER.get)
            return dict(self._flat(found)) if isinstance(found, dict) and found else None
        except (ValueError, RecursionError):
            return None

    def _flat(self, found: Mapping[str, Any], within: str = "") -> Iterator[tuple[str, str]]:
        for name, value in found.items():
            if isinstance(value, dict):
                yield from self._flat(value, f"{within}{name}.")
            elif isinstance(value, list) and len(value) <= MOST_PLACES:
                yield from self._flat({f"{name}.{place}": one for place, one in enumerate(value)}, within)
            elif isinstance(value, list):
                self.lists[within + name] = None
            else:
                yield within + name, _cell(value) if isinstance(value, str) else PLAIN[value]


def _cell(text: str) -> str:
    """A text in one cell."""
    plain = " ".join(text.split())
    quoted = plain.replace('"', '""')
    return f'"{quoted}"' if quoted != plain else plain


@dataclass
class JsonLinesLog(CsvLog):
    """A table of objects, read from front to back in bounded memory."""

    unsaid = ("delimiter", "decimal", "units_row")
    no_row = "is no JSON object, or an empty one"
    _lines: int = -1  # that were read: the line of names is none of the file
    _objects: _ObjectText = field(init=False)

    def batches(self) -> Iterator[Rows]:
        """Rows in file order. Raises UnreadableLogError where no line is an object, or none has a time."""
        self.time = replace(self.time, skip_rows=0)  # said of texts with lines above their table
        yield from super().batches()

    def _text(self) -> TextFile:
        self._objects = _ObjectText(self.path)
        if self._objects.lists:
            self.settings["left_out"] = [*self._objects.lists]
        return self._objects


reader = JsonLinesLog
