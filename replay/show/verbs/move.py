"""What `whyhot move` answers: where ledger or files were, where they are, and the head that both have."""

from __future__ import annotations

from typing import TYPE_CHECKING

from replay.show.words.terminal import labelled

if TYPE_CHECKING:
    from ingest.facts.move import MovedStore


def moved_text(done: MovedStore) -> str:
    lines = [
        *labelled("Moved from", done.was),
        *labelled("To", done.now),
        *labelled("Head", f"{done.head}, as before"),
    ]
    return "\n".join([*lines, "", *labelled("Next", "whyhot verify")])
