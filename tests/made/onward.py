"""What verbs say to type next, typed as it is printed."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence

import pytest

from replay.cli import main
from replay.show.words.onward import NEXT

FILLED_BY_HAND = re.compile(r"\b(FILE|DIR)\b")
BETWEEN_TWO = re.compile(r" ·\s+|\n\s+(?=whyhot )")


def next_commands(printed: str) -> list[str]:
    """Each from `whyhot` to its end, less what is to be done by hand before it."""
    parts = [part for found in NEXT.finditer(printed) for part in BETWEEN_TWO.split(found[2])]
    assert all("whyhot " in part for part in parts), parts
    return ["whyhot " + " ".join(part.partition("whyhot ")[2].split()) for part in parts]


def followed(begin: Sequence[Sequence[str]], capsys: pytest.CaptureFixture[str]) -> dict[str, set[str]]:
    """Run these words of `whyhot`, then what each says is next, and so on until all is done; none may fail. Verb ->
    the commands that are next by it and were run."""
    left, done, by = [shlex.join(["whyhot", *words]) for words in begin], set[str](), dict[str, set[str]]()
    while left:
        command = left.pop(0)
        done.add(command)
        words = shlex.split(command)[1:]
        code = main(words)
        printed, said = capsys.readouterr()
        assert code == 0, (command, printed, said)
        new = [one for one in next_commands(printed) if not FILLED_BY_HAND.search(one)]
        by.setdefault(words[0] if words else "", set()).update(new)
        left += [one for one in new if one != "whyhot --help" and one not in done and one not in left]
    return by
