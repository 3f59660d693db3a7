"""Texts in columns of a terminal."""

from __future__ import annotations

import pytest

from ingest.texts.cells import cell, places


@pytest.mark.parametrize(
    ("text", "taken"), [("T_Coil", 6), ("コイル温度", 10), ("Ｔ", 2), ("ｺｲﾙ", 3), ("Wärme", 5), ("Wa\u0308rme", 5)]
)
def test_a_letter_takes_the_places_that_a_terminal_gives_it(text: str, taken: int) -> None:
    assert places(text) == taken


@pytest.mark.parametrize(
    ("text", "right", "shown"),
    [
        ("コイル", False, "コイル  "),
        ("コイル", True, "  コイル"),
        ("コイル温度", False, "コイル… "),
        ("コイル温度", True, " コイル…"),
        ("T_Coil_mean", False, "T_Coil_…"),
    ],
)
def test_a_cell_is_as_wide_as_its_column_and_says_where_its_end_is_missing(text: str, right: bool, shown: str) -> None:
    assert cell(text, 8, right) == shown
    assert places(cell(text, 8, right)) == 8
