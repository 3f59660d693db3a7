"""The report of a repeated test: one HTML file that needs no other, reads in light and dark and prints on A4."""

from __future__ import annotations

from pathlib import Path

from ingest.morning.morning import Before
from ingest.morning.repeat import Repeat
from replay.show.plots.morning_plots import beside
from replay.show.reports.report import COLUMNS, ReportContext
from replay.show.verbs.repeat import alike, answer, change_says, channel_head, channel_row, floor, not_compared
from replay.show.words.page import template
from replay.written import write


def write_repeat_report(found: Repeat, target: Path, context: ReportContext) -> None:
    """Write the report to `target`. The same comparison gives the same bytes."""
    first, second = found.first, found.second
    before = Before(first.session, first.name, first.start_ns if first.absolute else None, found.beside)
    page = template("repeat.html.j2").render(
        answer=answer(found),
        first=first.name,
        second=second.name,
        lines=[
            f"Driven alike: {alike(found.beside, first.name, second.name)}",
            f"Floor: {floor(found)}",
            *(f"Not compared: {says}" for says in not_compared(found)),
        ],
        plot=beside(before, second.session, COLUMNS),
        head=channel_head(first.name, second.name),
        rows=[(one.verdict, channel_row(one)) for one in found.beside.channels],
        changes=change_says(found),
        context=context,
    )
    write(target, page)
