"""The report of ageing: one HTML file that needs no other, reads in light and dark and prints on A4."""

from __future__ import annotations

from pathlib import Path

from replay.show.plots.ageing_plots import courses, density, forest
from replay.show.plots.lives_plots import arrhenius, survival
from replay.show.reports.report import ReportContext
from replay.show.verbs import ageing
from replay.show.words import words
from replay.show.words.page import template
from replay.studies.ageing.assessment import Assessment
from replay.written import write


def write_ageing_report(found: Assessment, target: Path, context: ReportContext, kept: bool = True) -> None:
    """Write the report of an assessment to `target`. The same assessment gives the same bytes. `kept`: whether it is in
    the store, for SQL and lineage."""
    pictures = {
        "Courses": [courses(found, courses_title(found)), density(found)],
        "Specimens and batches": [forest(found)],
        "Lives": [arrhenius(found.life, found.assessment), survival(found.life, found.assessment)],
    }
    page = template("ageing.html.j2").render(
        answer=ageing.answer(found),
        found=found,
        ageing=ageing,
        pictures={name: shown for name, plots in pictures.items() if (shown := [one for one in plots if one])},
        says=ageing.says(found),
        context=context,
        kept=kept,
    )
    write(target, page)


def courses_title(found: Assessment) -> str:
    """How many courses go beyond repeatability, and which is steepest."""
    changed = [one for one in found.specimens if one.significant and one.slope_percent_per_100h is not None]
    many = ageing.how_many_change(found.whole)
    if not changed:
        return _unchanged(found) if not found.whole.changed else many
    worst = max(changed, key=lambda one: abs(one.slope_percent_per_100h or 0.0))
    steepest = f"{words.signed(worst.slope_percent_per_100h or 0.0)} % per 100 h"
    return f"{many} beyond repeatability: {worst.specimen} most, R {steepest}"


def _unchanged(found: Assessment) -> str:
    if not any(one.fitted for one in found.specimens):
        return "Too few checks of a specimen for a course"
    return "No specimen changes beyond repeatability"
