"""The start that stands above a table whose times count from it."""

from __future__ import annotations

from pathlib import Path

import pytest

from ingest.formats import TimeSpec
from made.tables import DECEMBER_NS, S_NS, read, table
from replay.cli import main

COUNTED = "t [s],T,n\n0.5,20,5\n1.5,21,6\n"
RATED = "Sample rate: 1 Hz\nT,n\n20,5\n21,6\n"


@pytest.mark.parametrize(
    "line",
    [
        "Start time: 24/12/2025 08:00:00",
        "Start,2025-12-24T09:00:00+01:00",
        '"Start Time","2025-12-24","08:00:00"',
        "# Recording started at 2025-12-24 08:00:00",
        "Messbeginn;24.12.2025 08:00:00",
        "Messung gestartet am: Mi 24.12.2025 08:00",
        "T0 = 24.12.2025 08:00:00",
        '"Trigger Time","\'25-12-24 08:00:00.000"',
        "Start Date: 24.12.2025\nStart Time: 08:00:00",
        "Inizio prova: 24/12/2025 08:00:00\nFine prova: 24/12/2025 10:00:00",
        "Test: 7\nStart of measurement: Wed Dec 24 08:00:00 2025\nStart channel: 3",
    ],
)
@pytest.mark.parametrize("rows", [COUNTED, RATED])
def test_times_count_from_the_start_that_stands_above(tmp_path: Path, line: str, rows: str) -> None:
    log, t_ns, columns = read(table(tmp_path, f"{line}\n{rows}"))
    first_ns = S_NS // 2 if rows == COUNTED else 0
    assert (log.absolute, t_ns) == (True, [DECEMBER_NS + first_ns, DECEMBER_NS + first_ns + S_NS])
    assert list(columns) == ["T", "n"]


def test_a_start_is_local_as_stamps_in_a_column_are(tmp_path: Path) -> None:
    path = table(tmp_path, "Start: 24.12.2025 09:00:00\n" + COUNTED)
    assert read(path, TimeSpec(zone="Europe/Rome"))[1][0] == DECEMBER_NS + S_NS // 2
    path = table(tmp_path, "Start (UTC): 24.12.2025 08:00:00\n" + COUNTED)
    assert read(path, TimeSpec(zone="Europe/Rome"))[1][0] == DECEMBER_NS + S_NS // 2


@pytest.mark.parametrize("first", ["08:00:02", "00:00:02"])
def test_times_of_day_are_of_the_day_of_the_start_and_others_count_from_it(tmp_path: Path, first: str) -> None:
    path = table(tmp_path, f"Start: 24.12.2025 08:00:00\nTime,T\n{first},20\n")
    assert read(path)[1] == [DECEMBER_NS + 2 * S_NS]


@pytest.mark.parametrize(
    ("above", "rows"),
    [
        ("Start time: 05/06/2025 08:00:00", COUNTED),  # of May or of June
        ("Start: 24.12.2025 08:00:00\nStart of test: 24.12.2025 07:00:00", COUNTED),  # which of both
        ("Start: 24.12.2025 08:00:00", "t [s],T\n7200,20\n7201,21\n"),  # what counts is older than that
        ("Program start: 24.12.2025 08:00:00\nDate: 24.12.2025", COUNTED),
    ],
)
def test_a_start_that_may_be_another_dates_nothing(tmp_path: Path, above: str, rows: str) -> None:
    log, _, _ = read(table(tmp_path, f"{above}\n{rows}"))
    assert not log.absolute and "begun" not in log.settings


def test_a_start_whose_day_may_be_its_month_is_said_not_to_be_used(tmp_path: Path) -> None:
    log, t_ns, _ = read(table(tmp_path, "Start time: 4/3/2025 08:00:00\nTime (s),T\n0,20\n1,21\n"))
    assert (t_ns, log.absolute) == ([0, S_NS], False)
    assert log.settings["date_not_understood"] == "4/3/2025 08:00:00"
    log, _, _ = read(table(tmp_path, "Start time: 3/3/2025 08:00:00\nTime (s),T\n0,20\n1,21\n"))
    assert log.absolute and "date_not_understood" not in log.settings


@pytest.mark.parametrize(
    ("head", "row"),
    [("t [s],T", "{0},20"), ("Sample rate: 1 Hz\nT,n", "20,{0}"), ("Time,T", "0{1}:00:0{0},20")],
)
def test_a_logger_that_was_started_anew_counts_from_its_new_start(tmp_path: Path, head: str, row: str) -> None:
    text = ""
    for day, hour in ((24, 8), (25, 9)):
        rows = [row.format(second, hour) for second in range(8)]
        text += "\n".join(["Logger 7", f"Start: {day}.12.2025 0{hour}:00:00", head, *rows, ""])
    log, t_ns, _ = read(table(tmp_path, text))
    begins_ns = (DECEMBER_NS, DECEMBER_NS + 25 * 3600 * S_NS)
    assert t_ns == [begin_ns + second * S_NS for begin_ns in begins_ns for second in range(8)]
    assert (log.found, list(log.rejected), log.settings["backward_steps"]) == (16, [], 0)


def test_what_the_bench_file_says_of_the_start_goes_before(tmp_path: Path) -> None:
    path = table(tmp_path, "Start: 24.12.2025 08:00:00\n" + COUNTED)
    assert read(path, TimeSpec(start_ns=S_NS))[1][0] == S_NS + S_NS // 2


def test_the_line_that_dates_a_log_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = table(tmp_path, "Start: 24.12.2025 08:00:00\n" + COUNTED)
    assert main(["inspect", str(path)]) == 0
    said = capsys.readouterr().out
    assert 'its times count from what stands above it: "Start: 24.12.2025 08:00:00"' in said
    assert "from 2025-12-24 08:00:00 UTC" in said
