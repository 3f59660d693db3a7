"""Progress on standard error: one line that is overwritten, and none where nobody looks (a pipe, a dumb terminal)."""

from __future__ import annotations

import re
import sys
from time import monotonic

from ingest.texts.plain import plain_line
from replay.cli.colour import overwrites
from replay.show.words.width import width
from replay.show.words.words import duration

COUNT = re.compile(r"(?<![\w.])([\d,]+) of ([\d,]+)")  # which is being done, of how many
_begun = ("", 0, 0.0)  # what is counted, the first of it that was told, and when [s]


def tell(line: str) -> None:
    """Show what is being done now; the empty line clears it. A line with "3 of 12" is told its pace and the time that
    is left, from its second on."""
    if overwrites(sys.stderr):
        paced = COUNT.sub(lambda count: count[0] + _pace(line[: count.start()], count), line, count=1)
        print(f"\r\033[K{plain_line(paced)[: width(sys.stderr) - 1]}", end="", file=sys.stderr, flush=True)


def _pace(what: str, count: re.Match[str]) -> str:
    global _begun
    number, of = (int(digits.replace(",", "")) for digits in count.groups())
    told, first, since_s = _begun
    now_s = monotonic()
    if told != f"{what}{of}" or number <= first:
        _begun = (f"{what}{of}", number, now_s)
        return ""
    each_s = (now_s - since_s) / (number - first)
    pace = f"{each_s:.1f} s each" if each_s >= 1.0 else f"{1 / max(each_s, 1e-9):,.0f} a second"
    return f" ({pace}, {duration(each_s * (of - number + 1))} left)"
