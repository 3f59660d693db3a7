"""Tables whose head has a label in each line, as Yokogawa's DL scopes and recorders write them.

Behind a label stands what it says of each trace, below the head the samples, behind an empty cell or their time:

    "TraceName","T_winding","n"
    "VUnit","C","rpm"
    "HResolution","1.0E-01","1.0E-01"
    "HUnit","s","s"
    ,2.05E+01,1.00E+03

The labels: https://www.easymanua.ls/yokogawa/dl6000-series/manual?p=383. Whether `Date` and `Time` are those of the
trigger or of the end depends on the model, so the samples count from their first.

Test stands write a line of descriptions beside those of names and units, which is neither.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from ingest.formats._csv_dialect import DELIMITERS, UNIT_WORDS, cells, is_value

NAMES, UNITS, STEP, STEP_UNIT, BLOCKS = "TraceName", "VUnit", "HResolution", "HUnit", "BlockNumber"
LOOKS = re.compile(rf'"?{NAMES}"?([,;\t])')
HEAD = 60  # lines, at most
REMARKS = frozenset(
    ("description", "beschreibung", "descrizione", "comment", "kommentar", "remark", "bemerkung", "rate", "long name")
)
NEAR = 3  # lines from that of the units


def labels_aside(lines: list[str]) -> list[str]:
    """The lines with such a head as one of others: the step in time, names and units right above the samples, blank
    lines for the rest of it, so that each line keeps its number. Other lines as they are, and those of several blocks,
    or of traces with steps of their own."""
    found = next(filter(None, map(LOOKS.match, lines[:HEAD])), None)
    if found is None or sum(LOOKS.match(line) is not None for line in lines) > 1:
        return lines
    delimiter = found[1]
    rows = [[cell.strip() for cell in cells(line, delimiter)] for line in lines[:HEAD]]
    first = next((place for place, row in enumerate(rows) if any(row) and (not row[0] or is_value(row[0]))), len(rows))
    said = {row[0]: row[1:] for row in rows[:first] if row}
    steps, blocks = set(said.get(STEP, ())) - {""}, said.get(BLOCKS, ["1"])
    if first < 3 or first == len(rows) or len(steps) != 1 or blocks[:1] != ["1"]:
        return lines
    unit = next(iter(said.get(STEP_UNIT, ())), "s")
    timed = f"time [{unit}]" if rows[first][0] else ""
    head = [[STEP, f"{steps.pop()} {unit}"], [timed, *said[NAMES]], ["", *said.get(UNITS, [""] * len(said[NAMES]))]]
    return [*[""] * (first - len(head)), *(_line(row, delimiter) for row in head), *lines[first:]]


def remarks_aside(lines: list[str]) -> list[str]:
    """The lines with blank ones for those near the line of units that are headed as descriptions, comments or rates."""
    for delimiter in DELIMITERS:
        rows = [[cell.strip() for cell in cells(line, delimiter)] for line in lines[:HEAD]]
        heads = [row[0].casefold().rstrip(":") if len(row) > 2 else "" for row in rows]
        units = next((place for place, head in enumerate(heads) if head in UNIT_WORDS), None)
        if units is not None:
            near = range(max(0, units - NEAR), min(units + NEAR + 1, len(rows)))
            aside = {place for place in near if heads[place] in REMARKS and len(rows[place]) == len(rows[units])}
            return ["" if place in aside else line for place, line in enumerate(lines)]
    return lines


def _line(row: Sequence[str], delimiter: str) -> str:
    return delimiter.join(" ".join(cell.replace(delimiter, " ").replace('"', "").split()) for cell in row)
