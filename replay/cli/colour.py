"""What stands out on a terminal: what is wrong, what was named, what was refused. No colour is anywhere else."""

from __future__ import annotations

import os
import re
import sys
from typing import TextIO

BOLD, WORST, NAMED, REFUSED = "1", "1;33", "1;36", "1;31"  # select graphic rendition (ECMA-48, 8.3.117)
LABELS = {"Answer": BOLD, "What is wrong": WORST, "Named cause": NAMED, "Stands out": NAMED, "Unknown": NAMED}
# A paragraph beside its label, as `replay.show.words.terminal.labelled` lays it out, with the lines that go on below.
PARAGRAPH = re.compile(rf"^({'|'.join(LABELS)}) {{2,}}\S.*(?:\n {{18}}\S.*)*", re.MULTILINE)


def overwrites(stream: TextIO) -> bool:
    """Whether somebody looks who sees lines overwritten and coloured: a terminal that is not dumb."""
    return stream.isatty() and os.environ.get("TERM") != "dumb"


def coloured(text: str, stream: TextIO, refused: bool = True) -> str:
    """`text` as `stream` shows it: on standard error all as `refused`, where it is, elsewhere paragraphs by their
    label. As it is where nobody looks, or NO_COLOR (https://no-color.org) is set."""
    if os.environ.get("NO_COLOR") or not overwrites(stream):
        return text
    if stream is sys.stderr:
        return _in(REFUSED, text) if refused else text
    return PARAGRAPH.sub(lambda found: _in(LABELS[found[1]], found[0]), text)


def _in(style: str, text: str) -> str:
    """Each line by itself, so that a pager that cuts one leaves the others as they are."""
    return "\n".join(f"\033[{style}m{line}\033[0m" for line in text.split("\n"))
