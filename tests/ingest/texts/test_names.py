"""Names that must differ."""

from __future__ import annotations

from ingest.texts.names import each_once


def test_a_name_that_stands_twice_gets_a_number_that_no_other_name_has() -> None:
    assert each_once(["T", "T", "T_2", "n", "T"]) == ("T", "T_3", "T_2", "n", "T_4")
    assert each_once([]) == ()
