"""docs/sql.md says what the views say, and its examples answer."""

from __future__ import annotations

import re

from analytics import warehouse
from analytics.query import run
from analytics.reference import examples, page
from ingest.facts.store import Store
from made.places import ROOT

PAGE = ROOT / "docs" / "sql.md"


def test_the_page_is_what_the_views_say() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run: python -m analytics.reference > docs/sql.md"


def test_a_frame_of_wrong_length_is_a_shorter_one() -> None:
    assert "| `wrong_length` | BIGINT | Frames shorter than their message; longer ones are decoded |" in page()


def blocks() -> list[str]:
    return re.findall(r"```sql\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


def test_the_page_shows_every_example() -> None:
    assert len(blocks()) == len(examples()) >= 10


def test_the_lineage_example_leads_from_a_residual_to_records_of_the_raw_log(shared_store: Store) -> None:
    (lineage,) = [sql for sql in blocks() if "first_record" in sql]
    with warehouse.refresh(shared_store) as opened:
        result = run(opened.connection, lineage)
    found = [dict(zip(result.columns, row, strict=True)) for row in result.rows]
    assert [row["record"] for row in found] == [5, 6, 7, 8]
    assert [row["value"] for row in found] == [25.0, 26.0, 27.0, 28.0]
    assert {(row["residual_K"], row["name"], row["file_id"]) for row in found} == {(3.0, "1_s1.blf", "1" * 64)}


def test_the_side_by_side_example_has_a_column_a_channel(shared_store: Store) -> None:
    (side,) = [sql for sql in blocks() if sql.startswith("PIVOT")]
    with warehouse.refresh(shared_store) as opened:
        result = run(opened.connection, side)
    assert result.columns == ("second", "speed", "MAG_1")
    assert result.rows[1] == (1.0, 100.0, 21.0)
