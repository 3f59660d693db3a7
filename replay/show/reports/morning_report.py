"""The report of a morning: one HTML file that needs no other, reads in light and dark and prints on A4."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ingest.facts.events import COUNTS
from ingest.intake.intake import Taken
from ingest.morning.morning import Morning, Night
from replay.show.plots.morning_plots import beside, course, operating_map
from replay.show.reports.report import COLUMNS, LINES, ReportContext
from replay.show.verbs.morning import answer, balance, clock_lines, look_at, meaning, told
from replay.show.words import words
from replay.show.words.figure import Plot
from replay.show.words.page import template
from replay.written import write

MOST_PICTURES = 60  # of a page; sessions beyond are told without


@dataclass(frozen=True)
class Told:
    """A session on the page: its lines as the terminal has them, its pictures, and how many things to look at."""

    night: Night
    start: str
    length: str
    looks: int
    lines: tuple[tuple[str, str], ...]
    plots: tuple[Plot, ...]


def write_morning_report(found: Morning, notes: Sequence[str], target: Path, context: ReportContext) -> None:
    """Write the report to `target`; `notes`: a line for each file that was skipped or refused. The same morning gives
    the same bytes."""
    page = template("morning.html.j2").render(
        answer=answer(found),
        balance=balance(found),
        meaning=meaning(found),
        logs=[_log(one) for one in found.intake.files],
        notes=notes,
        counts=[name.replace("_", " ") for name in COUNTS],
        clocks=clock_lines(found),
        nights=_nights(found),
        kept=found.kept,
        context=context,
    )
    write(target, page)


def _log(taken: Taken) -> tuple[str, ...]:
    """A row of the table of logs: name, records found, what became of them, and why one was not read whole."""
    balanced = taken.decode.balance if taken.decode else {}
    return taken.name, *(f"{balanced.get(key, 0):,}" for key in ("found", *COUNTS)), taken.line or ""


def _nights(found: Morning) -> list[Told]:
    lines = sum(2 + len(night.channels) for night in found.nights)
    columns = max(60, min(COLUMNS, COLUMNS * LINES // max(lines, 1)))
    pictures = 0
    nights = []
    for night in found.nights:
        plots = _plots(night, columns) if pictures < MOST_PICTURES else ()
        pictures += len(plots)
        one = night.description
        start = one.start.replace("T", " ")[:16] if one.start else "–"
        looks = sum(1 for _ in look_at(night))
        nights.append(Told(night, start, words.duration(one.duration_s), looks, tuple(told(night)), plots))
    return nights


def _plots(night: Night, columns: int) -> tuple[Plot, ...]:
    key, points = night.description.session, night.description.operating_points
    plots = (
        course(night, columns),
        operating_map(points, key) if points else None,
        beside(night.before, key, columns) if night.before else None,
    )
    return tuple(plot for plot in plots if plot is not None)
