"""How wide printed text is: as `COLUMNS` says, or as the terminal, within reason."""

from __future__ import annotations

import os
import sys
from typing import TextIO

LEAST, MOST = 60, 140  # columns: below, tables no longer fit; above, lines are too long to be read
ELSEWHERE = 100  # in a pipe or a file


def width(stream: TextIO | None = None) -> int:
    """Columns that the environment's `COLUMNS` asks for, else those of the terminal behind `stream` (standard output
    where none is given), else of text that goes elsewhere."""
    asked = os.environ.get("COLUMNS", "")
    if asked.isdecimal() and int(asked):
        return min(max(int(asked), LEAST), MOST)
    try:
        columns = os.get_terminal_size((stream or sys.stdout).fileno()).columns
    except (OSError, ValueError, AttributeError):  # a pipe, a closed stream, none at all
        return ELSEWHERE
    return min(max(columns, LEAST), MOST) if columns else ELSEWHERE
