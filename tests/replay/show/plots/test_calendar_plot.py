"""The calendar of a campaign: a row a session, where its clock says, as long as it was."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from made.runs import made_run
from replay.engine.results.run import Run
from replay.show.plots.calendar_plot import HOUR_NS, MOST, calendar

BAR = re.compile(r'<path d="M ([\d.]+) [\d.]+ L ([\d.]+) ')


def later(run: Run, hours: float) -> Run:
    return replace(run, t_ns=run.t_ns + int(hours * HOUR_NS))


def test_sessions_stand_in_the_order_of_time_with_what_was_set_aside() -> None:
    first, second = made_run("1_s1", masked=(0, 600)), later(made_run("2_s2"), 24.0)
    plot = calendar([second, made_run("3_wltp", absolute=False), first], [second.session])
    assert plot.title == "3 sessions on 2 days, 2 h 00 min in all; 1 kept from learning"
    assert plot.table.rows == (
        ("1_s1", "2025-10-09", "8.89", "40 min", "s1", "8.3", "learnt from"),  # a quarter of one channel of three
        ("2_s2", "2025-10-10", "8.89", "40 min", "s1", "0.0", "kept"),
        ("3_wltp", "no absolute time", "–", "40 min", "s1", "0.0", "learnt from"),
    )
    assert "from the midnight (UTC) before it began; one without absolute time begins at 0" in plot.note
    assert ">s1, 40 min, 8 % masked</text>" in plot.svg


def test_a_bar_is_as_long_as_its_session_and_begins_on_the_clock() -> None:
    short, long = made_run("1_s1", steps=3600), later(made_run("2_s2", steps=7200), 4.0)
    svg = calendar([short, long]).svg
    (left, right), (later_left, later_right) = [(float(a), float(b)) for a, b in BAR.findall(svg)][2:4]
    hour = right - left
    assert later_right - later_left == pytest.approx(2 * hour, rel=1e-3)
    assert later_left - left == pytest.approx(4 * hour, rel=1e-3)


def test_sessions_without_any_date_begin_at_their_start() -> None:
    plot = calendar([made_run("1_s1", absolute=False), made_run("2_s2", absolute=False)])
    assert plot.title == "2 sessions, 1 h 20 min in all"
    assert "time since start [h]" in plot.svg and "midnight" not in plot.note


def test_of_a_long_campaign_the_first_sessions_are_drawn_and_all_are_in_the_table() -> None:
    plot = calendar([later(made_run(f"s{i:02}", steps=60), i) for i in range(MOST + 2)])
    assert plot.note.endswith(f"Drawn: the first {MOST} of {MOST + 2}.")
    assert len(plot.table.rows) == MOST + 2
    assert "s39<" in plot.svg and "s40<" not in plot.svg
