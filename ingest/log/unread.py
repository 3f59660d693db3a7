"""What of a log was not read as numbers, or may be read otherwise: kept as facts, so that nobody misses it unsaid."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ingest.facts.events import QualityFlagged
from ingest.texts.names import first_of

SHEETS, TEXTS, BOUNDS = "sheets_unread", "numbers_as_text", "bounds_missing"
TIMES, UNIT, DATE = "time_either", "time_unit_unsaid", "date_unread"
MESSAGES, CHANNELS, LAWS, SCALES = "databases_differ", "channels_unread", "unconverted", "unscaled"
SHOWN = 5  # channels


def findings(name: str, settings: Mapping[str, Any]) -> list[QualityFlagged]:
    """A flag of the file `name` for each: further sheets of a workbook, columns whose cells say more than a number, or
    one that may be two, cells that say but a bound, times that may be others or of another unit, a date that is none,
    frames of which databases differ, channels beside frames, and those whose conversion or scaling is not read."""
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
    if apart := settings.get(UNIT):
        told[UNIT] = (
            f"its times say no unit, go on by {apart:,.0f} from row to row, and are read as seconds; if they are none, "
            'say unit = "ms" or unit = "us" under [time] of the bench file'
        )
    if date := settings.get("date_not_understood"):
        told[DATE] = f'its date "{date}" is not understood, and not used: say start under [time] of the bench file'
    if differ := settings.get(MESSAGES):
        told[MESSAGES] = differ
    if names := settings.get(CHANNELS):
        says = f"holds frames and measured channels: these are not read ({first_of(names, SHOWN)})"
        told[CHANNELS] = f"{says}: export them as a file of their own"
    if laws := settings.get(LAWS):
        told[LAWS] = f"left out: {first_of([f'{name}: {why}' for name, why in laws.items()], SHOWN, '; ')}"
    if names := settings.get(SCALES):
        told[SCALES] = (
            f"its scaling cannot be read of {first_of(names, SHOWN)}: the values are as stored, and no quantity"
        )
    return [QualityFlagged(flag=flag, says=f"{name}: {says}", detail={"file": name}) for flag, says in told.items()]
