"""The names a person probably meant: for every refusal of an unknown name."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


def nearest(name: str, names: Iterable[str], count: int = 1) -> list[str]:
    """At most `count` of `names` that read like `name`, best first; upper and lower case do not matter."""
    by_folded: dict[str, str] = {}
    for candidate in names:
        by_folded.setdefault(candidate.casefold(), candidate)
    return [by_folded[match] for match in get_close_matches(name.casefold(), by_folded, n=count, cutoff=0.6)]


def hint(name: str, names: Iterable[str]) -> str:
    """ " Nearest: X." with a leading blank, or nothing where no name is near."""
    found = nearest(name, names)
    return f" Nearest: {found[0]}." if found else ""
