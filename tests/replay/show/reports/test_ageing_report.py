"""The report of ageing: what its pictures show, and that nothing steers or leaves the page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ingest.texts.plain import STEERING
from made.ageing import LONG, STILL, WORSE, aged, assessment, course
from replay.show.plots.ageing_plots import courses, forest
from replay.show.plots.lives_plots import arrhenius, left, survival
from replay.show.reports.ageing_report import courses_title, write_ageing_report
from replay.show.reports.report import ReportContext
from replay.show.verbs.ageing import ageing_text
from replay.studies.ageing.assessment import AssessedLives, OneLife

CONTEXT = ReportContext(command="whyhot ageing", store_head="4f0c91", versions={"whyhot": "0.1.0"})


def test_the_page_answers_first_and_a_hostile_name_is_only_shown(tmp_path: Path) -> None:
    write_ageing_report(aged(), tmp_path / "ageing.html", CONTEXT)
    page = (tmp_path / "ageing.html").read_text(encoding="utf-8")
    assert "Not as the others: batch B1" in page.split("<h2", 1)[0]
    assert "<b>stator" not in page and "&lt;b&gt;stator&lt;/b&gt;" in page
    assert not STEERING.search(page) and LONG not in page
    assert "src=" not in page and "http" not in page.replace("http-equiv", "")
    assert "S00 (B1): rises steadily" in page, "the words of the table below the picture"
    for section in ("Courses", "Specimens and batches", "Lives", "Every specimen", "What it rests on"):
        assert f">{section}</h2>" in page


def test_what_is_not_kept_names_no_command_that_would_find_it(tmp_path: Path) -> None:
    for kept in (True, False):
        write_ageing_report(aged(), tmp_path / "ageing.html", CONTEXT, kept)
        page = (tmp_path / "ageing.html").read_text(encoding="utf-8")
        assert ("whyhot lineage" in page) == ("whyhot sql" in ageing_text(aged(), kept)) == kept


def test_the_course_that_changes_most_is_the_steepest_whichever_way_it_goes() -> None:
    falling = [
        replace(WORSE, specimen=name, slope_percent_per_100h=slope) for name, slope in (("S1", -2.0), ("S2", -9.0))
    ]
    assert courses_title(assessment(*falling)).endswith(": S2 most, R −9.0 % per 100 h")


def test_of_too_few_checks_it_is_not_said_that_nothing_changes() -> None:
    brief = replace(WORSE, fitted=None, form="none", significant=False, slope_percent_per_100h=None)
    assert courses_title(assessment(brief)) == "Too few checks of a specimen for a course"
    assert courses_title(assessment(STILL, brief)) == "No specimen changes beyond repeatability"


def test_thousands_of_hours_are_apart_at_the_axis_as_in_the_table() -> None:
    plot = courses(assessment(course("S01", 3.0, hours=1500.0)), "t")
    assert plot is not None and ">1,000</text>" in plot.svg


def test_the_criterion_is_drawn_where_a_course_comes_near_it_and_told_where_not() -> None:
    near, far = assessment(course("S01", 30.0)), assessment(course("S02", 3.0))
    plots = [courses(found, courses_title(found)) for found in (near, far)]
    assert all(plots)
    notes = [plot.note for plot in plots if plot]
    assert "conductivity −50 % is dashed at 200 %" in notes[0] and "far above these, 200 %" in notes[1]


def test_a_course_without_a_form_is_drawn_as_its_checks_and_no_check_as_no_picture() -> None:
    plot = courses(assessment(STILL), "t")
    assert plot is None, "its checks have no sd"


def test_the_forest_lists_every_specimen_under_its_batch_the_worst_batch_first() -> None:
    plot = forest(aged())
    assert plot is not None
    assert plot.title == "Batch B1 deteriorates faster than the others"
    assert [row[1] for row in plot.table.rows] == ["B1"] * 4 + ["B2"] * 4
    assert "+5.1 sd" in plot.svg
    assert forest(assessment(course("alone", 9.0))) is None


@pytest.mark.parametrize(
    ("many", "title"),
    [
        (0, "No specimen deteriorates faster than the others beyond chance"),
        (1, "S00 deteriorates faster than the others"),
        (2, "S00 and S01 deteriorate faster than the others"),
        (6, "6 specimens deteriorate faster than the others"),
    ],
)
def test_the_forest_says_who_deteriorates_faster(many: int, title: str) -> None:
    found = assessment(*(replace(course(f"S{i:02}", 9.0), outlying=i < many) for i in range(8)))
    plot = forest(found)
    assert plot is not None and plot.title == title


def test_a_life_that_is_not_over_is_an_arrow_and_no_life_is_no_picture() -> None:
    life = aged().life
    plot = arrhenius(life, "k")
    assert plot is not None and plot.title == "Lives go with 1.20 eV: 3 of 4 specimens met their end"
    assert [row[3] for row in plot.table.rows] == ["340", "300", "1,100", "not yet"]
    none = AssessedLives(criterion="c", lives=[], law=None, why="no specimen")
    assert arrhenius(none, "k") is None and survival(none, "k") is None


def test_what_is_left_lies_between_what_is_sure_and_what_may_be() -> None:
    lives = [
        OneLife(specimen=str(i), degC=230.0, lower_h=low, upper_h=high)
        for i, (low, high) in enumerate(((100.0, 200.0), (150.0, None), (300.0, 400.0)))
    ]
    dose, sure, perhaps = left(lives, 500.0)
    for at in (0.0, 120.0, 170.0, 250.0, 450.0):
        k = int(np.searchsorted(dose, at, side="right")) - 1
        assert sure[k] == pytest.approx(sum(one.lower_h > at for one in lives) / 3)
        assert perhaps[k] == pytest.approx(sum(one.upper_h is None or one.upper_h > at for one in lives) / 3)
