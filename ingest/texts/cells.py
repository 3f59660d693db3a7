"""Texts in columns of a terminal, where a letter of China, Japan or Korea takes two places and an accent none."""

from __future__ import annotations

import unicodedata
from itertools import accumulate, takewhile

WIDE = ("W", "F")  # East Asian Width (Unicode Standard Annex 11): wide, and fullwidth forms of Latin letters
OVER = ("Mn", "Me")  # marks that stand over or under the letter before


def places(text: str) -> int:
    """How many places of a terminal `text` takes: 6 for `コイル`."""
    return len(text) if text.isascii() else sum(map(_places, text))


def cell(text: str, width: int, right: bool = False) -> str:
    """`text` in exactly `width` places, flush left or `right`; what does not fit loses its end, which `…` says."""
    if places(text) > width:
        fitting = takewhile(lambda end: end < width, accumulate(map(_places, text)))
        text = text[: sum(1 for _ in fitting)] + "…"
    blanks = " " * (width - places(text))
    return blanks + text if right else text + blanks


def _places(letter: str) -> int:
    return 0 if unicodedata.category(letter) in OVER else 1 + (unicodedata.east_asian_width(letter) in WIDE)
