"""A folder of pages: what is as it was is left alone, what is no more goes, and nothing else is touched."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import pytest

from ingest.errors import DamageError
from made.runs import made_run
from replay.errors import ReplayDataError
from replay.show.reports.site import RECORD, Course, PageWanted, write_site
from replay.show.reports.site_index import MOST, SessionRow, course_svg, listed
from replay.show.reports.site_pages import COLUMNS, residual_course

ONE, TWO = "sessions/a1.html", "diagnoses/d-4f0c.html"


def page(key: str, course: Course = ()) -> PageWanted:
    def write(target: Path) -> Course:
        target.write_text(f"made of {key}", encoding="utf-8")
        return course

    return PageWanted(key, write)


def index(pages: Mapping[str, Course]) -> str:
    return json.dumps(dict(pages))


def test_what_is_as_it_was_is_not_written_again(tmp_path: Path) -> None:
    wanted = {ONE: page("1", [0.5, None]), TWO: page("2")}
    first = write_site(tmp_path / "site", wanted, index)
    assert first.written == [ONE, TWO, "index.html", RECORD]
    times = {path: path.stat().st_mtime_ns for path in (tmp_path / "site").rglob("*")}
    again = write_site(tmp_path / "site", wanted, index)
    assert (again.written, again.kept) == ([], first.written)
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "site").rglob("*")} == times
    assert json.loads((tmp_path / "site" / "index.html").read_text(encoding="utf-8"))[ONE] == [0.5, None]


def test_a_page_made_of_something_else_or_gone_from_the_folder_is_written(tmp_path: Path) -> None:
    write_site(tmp_path, {ONE: page("1"), TWO: page("2")}, index)
    (tmp_path / TWO).unlink()
    done = write_site(tmp_path, {ONE: page("other"), TWO: page("2")}, index)
    assert done.written == [ONE, TWO, RECORD]
    assert (tmp_path / ONE).read_text(encoding="utf-8") == "made of other"


def test_a_page_that_is_no_more_is_taken_away_and_a_false_record_leads_to_nothing(tmp_path: Path) -> None:
    site, mine = tmp_path / "site", tmp_path / "mine.html"
    mine.write_text("mine", encoding="utf-8")
    write_site(site, {ONE: page("1"), TWO: page("2")}, index)
    record = json.loads((site / RECORD).read_text(encoding="utf-8"))
    (site / RECORD).write_text(json.dumps(record | {"../mine.html": record[ONE]}), encoding="utf-8")
    assert write_site(site, {TWO: page("2")}, index).removed == [ONE]
    assert not (site / ONE).exists() and mine.exists()


@pytest.mark.parametrize("text", ["", "[]", '{"a": 1}', '{"sessions/a1.html": {"key": 1}}'])
def test_a_record_that_cannot_be_read_writes_all_anew(tmp_path: Path, text: str) -> None:
    write_site(tmp_path, {ONE: page("1")}, index)
    (tmp_path / RECORD).write_text(text, encoding="utf-8")
    assert ONE in write_site(tmp_path, {ONE: page("1")}, index).written


def test_damaged_bytes_cost_one_page_and_a_store_is_no_place_for_pages(tmp_path: Path) -> None:
    def damaged(_: Path) -> Course:
        raise DamageError("its bytes are other than sealed")

    done = write_site(tmp_path / "site", {ONE: PageWanted("1", damaged), TWO: page("2")}, index)
    assert done.refused == [f"{ONE}: its bytes are other than sealed"]
    assert TWO in done.written
    (tmp_path / "store.json").touch()
    with pytest.raises(ReplayDataError, match="is a store"):
        write_site(tmp_path, {}, index)


def test_the_course_is_the_residual_of_the_channel_that_is_furthest_off() -> None:
    course = residual_course(made_run(masked=(0, 600)))
    assert len(course) == COLUMNS
    assert course[: COLUMNS // 4] == [None] * (COLUMNS // 4)
    assert course[COLUMNS // 4 : COLUMNS // 2] == [-0.2] * (COLUMNS // 4)
    assert course[COLUMNS // 2 :] == [6.0] * (COLUMNS // 2)
    drawn = course_svg(course, 6.0)
    assert "residual from −0.2 K to +6.0 K" in drawn
    assert drawn.count("M") == 2, "the zero line and one stroke"


def test_of_sessions_without_a_report_the_first_page_lists_the_last_ones_only() -> None:
    def row(number: int, link: str) -> SessionRow:
        return SessionRow(
            f"s{number}", "dc_check", "M", "", "", link, worst="", without="no motor file", wrong=False, course=""
        )

    rows = [row(number, "sessions/a.html" if number in (3, MOST) else "") for number in range(2 * MOST)]
    shown = listed(rows)
    assert len(shown) == MOST + 2
    assert [one.name for one in shown[:3]] == ["s3", f"s{MOST - 1}", f"s{MOST}"]
    assert listed(shown[1:]) == shown[1:]
