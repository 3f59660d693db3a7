"""Tables without a column of times: how the program that wrote one writes it with them, where that is known."""

from __future__ import annotations

import re
from collections.abc import Mapping

from ingest.formats._csv_dialect import Dialect, is_value

# what stands above the rows of a table -> how its program writes the times too
WITH_TIMES: Mapping[str, str] = {
    r"^trace_(?:names|values)\b": "In ControlDesk of dSPACE export it with its time axis as a column, or as MF4.",
    r"^HBM_CATMAN": "In catman export it with its time channel.",
    r"^ETASAsciiItemFile": "In MDA of ETAS export it with its time channel, or as MDF.",
    r"^Data info": "In DewesoftX export it with its times, or as MDF4 (Analyse, Export).",
    r"^(?:TraceName|BlockNumber)\b": (
        "Of a Yokogawa DL scope one block at one rate is read: convert each to a CSV of its own in Xviewer."
    ),
    r"^Store No\.?$": "Let the power analyser store date and time with each row.",
}
NO_WHOLE_TIME = re.compile(r"\d{1,3}:\d\d")


def way_out(dialect: Dialect) -> str | None:
    """What to do with such a table in the program that wrote it; None where nothing tells that."""
    above = "\n".join([*(line.lstrip('"# ') for line in dialect.lines_above), *dialect.names])
    for looks, says in WITH_TIMES.items():
        if re.search(looks, above, re.MULTILINE):
            return says
    if sum(map(is_value, dialect.names)) * 2 >= len(dialect.names):
        return "Its channels seem to be rows: turn rows into columns (Excel: Copy, Paste Special, Transpose)."
    if any(all(map(NO_WHOLE_TIME.fullmatch, cells)) for cells in zip(*dialect.sample, strict=True)):
        return "Minutes and seconds alone may be hours and minutes: export it with times such as 00:12:34."
    return None
