"""What of a log was not read as numbers, though it may hold some: kept as facts, so that nobody misses it unsaid."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ingest.facts.events import QualityFlagged

SHEETS, TEXTS = "sheets_unread", "numbers_as_text"


def findings(name: str, settings: Mapping[str, Any]) -> list[QualityFlagged]:
    """A flag of the file `name` for each: further sheets of a workbook, and columns whose cells say more
    than a number, or one that may be two."""
    told = {}
    if others := settings.get("other_sheets"):
        told[SHEETS] = f"sheet {settings['sheet']} was read, and not {', '.join(others)} ([time] sheet tells another)"
    if cells := settings.get("numbers_with_units"):
        said = ", ".join(f'{column} ("{cell}")' for column, cell in cells.items())
        told[TEXTS] = f"read as text and not as numbers: {said}: export it as plain numbers"
    return [QualityFlagged(flag=flag, says=f"{name}: {says}", detail={"file": name}) for flag, says in told.items()]
