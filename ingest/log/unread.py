"""What of a log was not read as numbers, or may be read otherwise: kept as facts, so that nobody misses it unsaid."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ingest.facts.events import QualityFlagged

SHEETS, TEXTS, TIMES, DATE = "sheets_unread", "numbers_as_text", "time_either", "date_unread"
MESSAGES, CHANNELS = "databases_differ", "channels_unread"
SHOWN = 5  # channels


def findings(name: str, settings: Mapping[str, Any]) -> list[QualityFlagged]:
    """A flag of the file `name` for each: further sheets of a workbook, columns whose cells say more than a number, or
    one that may be two, times that may be others, a date that is none, frames of which databases differ, and channels
    beside frames."""
    told = {}
    if others := settings.get("other_sheets"):
        told[SHEETS] = f"sheet {settings['sheet']} was read, and not {', '.join(others)} ([time] sheet tells another)"
    if cells := settings.get("numbers_with_units"):
        said = ", ".join(f'{column} ("{cell}")' for column, cell in cells.items())
        told[TEXTS] = f"read as text and not as numbers: {said}: export it as plain numbers"
    if cell := settings.get("time_either"):
        told[TIMES] = (
            f'"{cell}" in {settings["time_column"]} is read as hours and minutes; if it is minutes and seconds, say '
            'format = "%M:%S" under [time] of the bench file'
        )
    if date := settings.get("date_not_understood"):
        told[DATE] = f'its date "{date}" is not understood, and not used: say start under [time] of the bench file'
    if differ := settings.get(MESSAGES):
        told[MESSAGES] = differ
    if names := settings.get(CHANNELS):
        more = f" and {len(names) - SHOWN:,} more" if len(names) > SHOWN else ""
        says = f"holds frames and measured channels: these are not read ({', '.join(names[:SHOWN])}{more})"
        told[CHANNELS] = f"{says}: export them as a file of their own"
    return [QualityFlagged(flag=flag, says=f"{name}: {says}", detail={"file": name}) for flag, says in told.items()]
