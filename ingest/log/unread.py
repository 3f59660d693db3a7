"""What of a log was not read as numbers, or may be read otherwise: kept as facts, so that nobody misses it unsaid."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ingest.facts.events import QualityFlagged

SHEETS, TEXTS, BOUNDS, TIMES = "sheets_unread", "numbers_as_text", "bounds_missing", "time_either"


def findings(name: str, settings: Mapping[str, Any]) -> list[QualityFlagged]:
    """A flag of the file `name` for each: further sheets of a workbook, columns whose cells say more than a number, or
    one that may be two, cells that say but a bound, and times that may be others."""
    told = {}
    if others := settings.get("other_sheets"):
        told[SHEETS] = f"sheet {settings['sheet']} was read, and not {', '.join(others)} ([time] sheet tells another)"
    if cells := settings.get("numbers_with_units"):
        said = ", ".join(f'{column} ("{cell}")' for column, cell in cells.items())
        told[TEXTS] = f"read as text and not as numbers: {said}: export it as plain numbers"
    if bounds := settings.get("bounds"):
        often = {column: "once" if count == 1 else f"{count:,} times" for column, (_, count) in bounds.items()}
        said = ", ".join(f'{column} {often[column]}, as "{cell}"' for column, (cell, _) in bounds.items())
        told[BOUNDS] = f"beyond the range of the meter, so no number is known there: {said}"
    if cell := settings.get("time_either"):
        told[TIMES] = (
            f'"{cell}" in {settings["time_column"]} is read as hours and minutes; if it is minutes and seconds, say '
            'format = "%M:%S" under [time] of the bench file'
        )
    return [QualityFlagged(flag=flag, says=f"{name}: {says}", detail={"file": name}) for flag, says in told.items()]
