"""Progress on standard error: one line that is overwritten, and none where nobody looks (a pipe, a dumb terminal)."""

from __future__ import annotations

import sys

from ingest.texts.plain import plain_line
from replay.cli.colour import overwrites
from replay.show.words.width import width


def tell(line: str) -> None:
    """Show what is being done now; the empty line clears it."""
    if overwrites(sys.stderr):
        print(f"\r\033[K{plain_line(line)[: width(sys.stderr) - 1]}", end="", file=sys.stderr, flush=True)
