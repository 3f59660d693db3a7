"""What is to be looked at in a log, as one decode of it tells: of its stamps, its numbers, its texts and its rows."""

from __future__ import annotations

from ingest.facts.events import DecodeCompleted, QualityFlagged
from ingest.log import clock, j1939, other_units, specimens, unread


def findings(name: str, decode: DecodeCompleted) -> list[QualityFlagged]:
    """A flag of the file `name` for each thing that its decode says."""
    return [
        *clock.findings(name, decode.settings.get("clock", {}), decode.absolute),
        *j1939.findings(name, decode.settings),
        *unread.findings(name, decode.settings),
        *other_units.findings(name, decode),
        *specimens.findings(name, decode.settings),
    ]
