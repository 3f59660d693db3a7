"""Progress on standard error: one line that is overwritten, and none where nobody looks (a pipe, a dumb terminal)."""

from __future__ import annotations

import os
import sys

from ingest.texts.plain import plain_line


def tell(line: str) -> None:
    """Show what is being done now; the empty line clears it."""
    if sys.stderr.isatty() and os.environ.get("TERM") != "dumb":
        print(f"\r\033[K{plain_line(line)[:99]}", end="", file=sys.stderr, flush=True)
