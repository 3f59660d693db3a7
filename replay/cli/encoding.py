"""Output that a terminal or pipe can take: where its encoding lacks a character, something it has stands instead."""

from __future__ import annotations

import codecs
import sys
from io import TextIOWrapper
from typing import TextIO

from ingest.texts.plain import plain
from replay.cli.colour import coloured

INSTEAD = {
    "−": "-",
    "–": "-",
    "—": "-",
    "’": "'",
    "→": "->",
    "…": "...",
    "·": "|",
    "│": "|",
    "°": "deg",
    "℃": "degC",
    "Ω": "Ohm",
    "±": "+-",
    "×": "x",
    "²": "2",
    "μ": "u",
    "µ": "u",
}


def fit_output() -> None:
    """From here on whatever is printed comes out: as `INSTEAD` says, or escaped, where it cannot as it is."""
    codecs.register_error("whyhot", _instead)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="whyhot")


def say(text: str, stream: TextIO | None = None, refused: bool = True) -> None:
    """Print `text` to standard output, or to `stream`: the one door to the terminal, which no name can steer.
    `refused`: whether what goes to standard error says that something was."""
    stream = stream or sys.stdout
    print(coloured(plain(text), stream, refused), file=stream)


def takes_all() -> bool:
    """Whether standard output has every character: JSON is escaped elsewhere, so that it reads back as it was."""
    return codecs.lookup(getattr(sys.stdout, "encoding", None) or "utf-8").name == "utf-8"


def _instead(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    written = (INSTEAD.get(one) or one.encode("ascii", "backslashreplace").decode("ascii") for one in lacking)
    return "".join(written), error.end
