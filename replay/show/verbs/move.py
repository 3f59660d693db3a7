"""What `whyhot move` answers: where the ledger was, where it is, and the head that both have."""

from __future__ import annotations

from typing import TYPE_CHECKING

from replay.show.words.terminal import labelled

if TYPE_CHECKING:
    from ingest.facts.move import MovedLedger


def moved_text(done: MovedLedger) -> str:
    lines = [*labelled("Moved from", done.was), *labelled("To", done.now), *labelled("Head", f"{done.head}, as before")]
    return "\n".join([*lines, "", *labelled("Next", "whyhot verify")])
