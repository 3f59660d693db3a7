"""What `whyhot upgrade` prints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from replay.show.words.terminal import labelled
from replay.show.words.words import counted

if TYPE_CHECKING:
    from ingest.intake.upgrade import Upgrade


def upgrade_text(found: Upgrade, logs: Sequence[str], dry_run: bool) -> str:
    """Who wrote the events, and which logs are decoded anew; `logs`: their names."""
    written = ", ".join(f"{count:,} by {code}" for code, count in found.events.items()) or "none yet"
    lines = labelled("Events", f"{written}; all are read by this version, and stay as they are")
    if not logs and found.left:
        return "\n".join([*lines, *labelled("Samples", "none made by an earlier version: nothing to do")])
    if not logs:
        return "\n".join([*lines, *labelled("Samples", "all made by this version: nothing to do")])
    says = "to be decoded again" if dry_run else "decoded again"
    lines += labelled("Samples", f"{counted(len(logs), 'log')} {says}, made by an earlier version: {', '.join(logs)}")
    step = "whyhot upgrade" if dry_run else "whyhot stale"
    return "\n".join([*lines, "", *labelled("Next", step)])
