"""The page of a change to sign: what is in doubt of it stands on it. Its figures: `replay/studies/diagnosis`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from made.diagnoses import NAMED
from replay.show.reports.report import ReportContext
from replay.show.reports.review_report import document, review_text, write_review
from replay.studies.diagnosis.review import Replaced, Review

DOUBT = "The file is crude: its numbers had to move 2.1 times as far as usual"


def test_what_is_in_doubt_of_a_change_stands_in_all_that_is_signed(tmp_path: Path) -> None:
    file = Replaced("motor file", "0" * 64, "1" * 64, "+ speed2 = 1.0")
    found = Review(replace(NAMED, crudeness=2.13), ("loss.magnet.speed2",), None, (file,), (), (), ())
    page = tmp_path / "review.html"
    write_review(found, page, ReportContext("whyhot review", "4f0c", {}))
    assert DOUBT in page.read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    assert DOUBT in " ".join(review_text(found, page).split())
    (said,) = document(found)["in_doubt"]
    assert said.startswith(DOUBT)
    sure = replace(found, diagnosis=NAMED)
    assert document(sure)["in_doubt"] == [] and "In doubt" not in review_text(sure, page)
