"""Where in a text another table begins: below names, that of a time among them, stand rows."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

from ingest.formats._csv_dialect import DELIMITERS, STAMPED, cells, is_value
from ingest.formats._csv_no_rows import is_row
from ingest.formats._csv_numbers import MISSING
from ingest.formats._csv_time_names import is_date_name, is_time_name

TIME_SAID = re.compile("time|zeit|stamp|dat|epoch|elapsed|tempo|ora|^.?ts?[^a-z]", re.IGNORECASE)  # as a name may
BELOW = 4  # lines that show whether names stand above rows


def is_header(lines: Sequence[str], delimiter: str) -> bool:
    """Whether the first of some lines holds names, that of a time among them, and one of the next a row below them."""
    if not TIME_SAID.search(lines[0]) or not is_row(lines[0]):
        return False
    names, *below = ([cell.strip() for cell in cells(line, delimiter)] for line in lines)
    said = [name for name in names if name]
    named = 1 < len(said) == len(set(said)) and not any(
        cell in MISSING or is_value(cell) or STAMPED.search(cell) for cell in said
    )
    rows = (row for row in below if len(row) == len(names) and any(map(is_value, row)))
    return named and any(is_time_name(name) or is_date_name(name) for name in said) and any(rows)


def first_table(lines: Sequence[str]) -> Sequence[str]:
    """Lines up to where another table begins, below two rows of the first or more: fewer are of what heads a table."""
    for delimiter in DELIMITERS:
        heads = [place for place in range(len(lines)) if is_header(lines[place : place + BELOW], delimiter)]
        for first, other in pairwise(heads):
            rows = [place for place in range(first, other) if any(map(is_value, cells(lines[place], delimiter)))]
            if lines[first] != lines[other] and len(rows) > 1:
                return lines[:other]
    return lines
