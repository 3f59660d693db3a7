"""Workbooks as openpyxl writes them: which sheet is read, what its cells become, and the line where one is refused."""

from __future__ import annotations

import re
import sys
import zipfile
from collections.abc import Sequence
from contextlib import closing
from datetime import date, datetime, time, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ingest.bench.bench_file import read_bench
from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec, recognise
from ingest.log.reading import Reader
from made.places import LOGS
from made.tables import read

openpyxl = pytest.importorskip("openpyxl")
pytest.importorskip("python_calamine")

S_NS = 1_000_000_000
MIDNIGHT = datetime(2024, 3, 1)
MIDNIGHT_NS = 1_709_251_200 * S_NS
Sheet = Sequence[Sequence[Any]]


def write(path: Path, **sheets: Sheet) -> Path:
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def write_sample(path: Path) -> None:
    """The small log of the contract: a sheet of notes before the one with the table, a spoiled cell, a missing time."""
    rows: list[list[Any]] = [
        ["Prüfstand 7"],
        [],
        ["Zeit", "T_mag", "Drehzahl", "Kommentar"],
        [None, "°C", "1/min", None],
        [MIDNIGHT - timedelta(seconds=1), 20.5, 0, "Start"],
        [MIDNIGHT, "20,6", "1.500,5", None],
        [MIDNIGHT + timedelta(seconds=0.5), "ERR", 1500, None],
        [None, 20.8, 1500, None],
        [MIDNIGHT + timedelta(seconds=2), None, 1600, "Ende"],
    ]
    write(path, Notizen=[["Bediener", "Öller"]], Messung=rows)


@pytest.mark.parametrize("made", [True, False])
def test_the_sample_is_read_whole(tmp_path: Path, made: bool) -> None:
    path = LOGS / "sample.xlsx"
    if made:
        write_sample(path := tmp_path / "sample.xlsx")
    log, t_ns, columns = read(path)
    assert t_ns == [MIDNIGHT_NS - S_NS, MIDNIGHT_NS, MIDNIGHT_NS + 2 * S_NS]
    np.testing.assert_array_equal(columns["T_mag"], [20.5, 20.6, np.nan])
    assert columns["Drehzahl"] == [0, 1500.5, 1600]
    assert columns["Kommentar"] == ["Start", "", "Ende"]
    assert log.units == {"T_mag": "°C", "Drehzahl": "1/min"}
    assert [(one.record, one.where, one.why) for one in log.rejected] == [
        (2, "row 7, column T_mag", 'text "ERR" where numbers are'),
        (3, "row 8, column Zeit", "no time"),
    ]
    assert log.settings == {
        "sheet": "Messung",
        "header_line": 3,
        "above_header": ["Prüfstand 7"],
        "units_row": True,
        "time_column": "Zeit",
        "time": "ISO 8601 in UTC",
        "backward_steps": 0,
    }


@pytest.mark.parametrize(
    ("header", "cells", "wanted", "absolute"),
    [
        (["Time"], [[time(0)], [time(0, 0, 1, 500_000)]], [0, 1_500_000_000], False),
        (["Uhrzeit"], [[time(23, 59, 59)], [time(0, 0, 0, 500_000)]], [86_399 * S_NS, 86_400_500_000_000], False),
        (["Time"], [[time(23, 59, 59)], [timedelta(hours=25)]], [86_399 * S_NS, 90_000 * S_NS], False),
        (["Time"], [[timedelta(hours=25)], [timedelta(hours=25, seconds=1)]], [90_000 * S_NS, 90_001 * S_NS], False),
        (["Time [ms]"], [[0], [250.5]], [0, 250_500_000], False),
        (["Datum", "Uhrzeit"], [[date(2024, 3, 1), time(0)], [date(2024, 3, 1), time(0, 0, 1)]], [0, S_NS], True),
        (["Zeit"], [["01.03.2024 00:00:00"], ["01.03.2024 00:00:01,5"]], [0, 1_500_000_000], True),
        (["when"], [[MIDNIGHT], [MIDNIGHT + timedelta(milliseconds=1)]], [0, 1_000_000], True),
        (["Time"], [["3/1/2024 12:00 AM"], ["3/13/2024 12:00 AM"]], [0, 12 * 86_400 * S_NS], True),
    ],
)
def test_the_time_may_be_dates_times_of_day_durations_numbers_or_texts(
    tmp_path: Path, header: list[str], cells: list[list[Any]], wanted: list[int], absolute: bool
) -> None:
    rows = [[*header, "T"], *([*cell, 20.5 + i] for i, cell in enumerate(cells))]
    log, t_ns, columns = read(write(tmp_path / "log.xlsx", Tabelle1=rows))
    assert t_ns == [one + (MIDNIGHT_NS if absolute else 0) for one in wanted]
    assert (log.absolute, columns) == (absolute, {"T": [20.5, 21.5]})


def test_dates_are_local_where_the_bench_file_says_a_zone(tmp_path: Path) -> None:
    path = write(tmp_path / "log.xlsx", A=[["Time", "T"], [datetime(2024, 7, 1, 2), 1], [datetime(2024, 7, 1, 3), 2]])
    assert read(path, TimeSpec(zone="Europe/Rome"))[1][0] == read(path)[1][0] - 7200 * S_NS


@pytest.mark.parametrize("numbers", [False, True])
def test_days_of_a_workbook_of_1904_count_from_there(tmp_path: Path, numbers: bool) -> None:
    book = openpyxl.Workbook()
    book.epoch = openpyxl.utils.datetime.CALENDAR_MAC_1904
    book.active.append(["Date", "T"])
    for second in range(3):
        at = MIDNIGHT + timedelta(seconds=second)
        days = (at - datetime(1904, 1, 1)) / timedelta(days=1)
        book.active.append([days if numbers else at, 20])
    book.save(tmp_path / "log.xlsx")
    log, t_ns, _ = read(tmp_path / "log.xlsx")
    assert log.absolute
    np.testing.assert_allclose(t_ns, [MIDNIGHT_NS + k * S_NS for k in range(3)], rtol=0, atol=1_000_000)


def test_numbers_are_kept_to_the_last_digit_and_texts_and_codes_stay_what_they_are(tmp_path: Path) -> None:
    rows: list[list[Any]] = [
        ["t", "x", "serial", "on", "note", "R"],
        [0, 0.123456789012345, "0417", True, 'say "a"\tb\nc', "1.234,5"],
        [1, 1e-300, "0418", False, "it's", "998,25"],
        [2, 2**53 - 1, "0419", True, None, 7.5],
    ]
    log, _, columns = read(write(tmp_path / "log.xlsx", A=rows))
    assert columns["x"] == [0.123456789012345, 1e-300, 2**53 - 1]
    assert (columns["serial"], columns["on"]) == (["0417", "0418", "0419"], [1, 0, 1])
    assert columns["note"] == ['say "a" b c', "it's", ""]
    assert (columns["R"], list(log.rejected)) == ([1234.5, 998.25, 7.5], [])


def test_a_sheet_is_the_first_with_a_table_or_the_one_that_is_told(tmp_path: Path) -> None:
    table: Sheet = [["t", "T"], [0, 20], [1, 21]]
    other: Sheet = [["t", "n"], [0, 5], [1, 6]]
    path = write(tmp_path / "log.xlsx", Deckblatt=[["Bericht"]], Leer=[], A=table, B=other)
    log, _, columns = read(path)
    assert (columns, log.settings["other_sheets"]) == ({"T": [20, 21]}, ["B"])
    assert read(path, TimeSpec(sheet="B"))[2] == {"n": [5, 6]}
    with pytest.raises(UnreadableLogError) as refused:
        read(path, TimeSpec(sheet="b "))
    assert str(refused.value).startswith(
        'log.xlsx: sheet = "b " under [time] of the bench file is no sheet with cells. Nearest: B.'
    )
    assert read_bench(b'schema = "whyhot.bench/1"\n[time.xlsx]\nsheet = "B"\n', "b").time_of["xlsx"].sheet == "B"


def test_a_sheet_with_times_goes_before_one_that_tells_of_the_meter(tmp_path: Path) -> None:
    """What heads a workbook may look like a table of one row; the rows that the log is for have times."""
    info: Sheet = [["Power Analyser LMG671"], ["Serial", 1234], ["Channels", 6]]
    data: Sheet = [["Time", "P_Sum"], [None, "kW"], [MIDNIGHT, 1.5], [MIDNIGHT + timedelta(seconds=1), 1.6]]
    path = write(tmp_path / "log.xlsx", Info=info, Data=data)
    log, t_ns, columns = read(path)
    assert (t_ns, columns) == ([MIDNIGHT_NS, MIDNIGHT_NS + S_NS], {"P_Sum": [1.5, 1.6]})
    assert (log.settings["sheet"], log.settings["other_sheets"]) == ("Data", ["Info"])
    assert read(path, TimeSpec(rate_hz=1.0))[0].settings["sheet"] == "Info"


def test_a_hidden_sheet_is_read_where_no_other_holds_a_table(tmp_path: Path) -> None:
    table: Sheet = [["t", "T"], [0, 20], [1, 21]]
    path = write(tmp_path / "log.xlsx", Alt=table, Neu=[["t", "n"], [0, 5], [1, 6]], Text=[["Bericht"]])
    book = openpyxl.load_workbook(path)
    book["Alt"].sheet_state = "hidden"
    book.save(path)
    log, _, columns = read(path)
    assert (columns, log.settings["other_sheets"]) == ({"n": [5, 6]}, ["Alt"])
    del book["Neu"]
    book.save(path)
    assert read(path)[2] == {"T": [20, 21]}


def test_cells_that_are_merged_above_the_names_are_no_names(tmp_path: Path) -> None:
    """With dates as the numbers that a spreadsheet keeps them as, and a cell that holds an error."""
    head = [["Zeit", "Temperaturen", None], [None, "T_w [°C]", "T_j [°C]"]]
    rows = [[45352.375 + k / 86_400, "#DIV/0!" if k == 1 else 20 + k, 30 + k] for k in range(4)]
    path = write(tmp_path / "log.xlsx", A=[["Prüfung 7"], *head, *rows])
    book = openpyxl.load_workbook(path)
    for merged in ("A1:C1", "B2:C2", "A2:A3"):
        book["A"].merge_cells(merged)
    book.save(path)
    log, t_ns, columns = read(path)
    assert [round(t / 1e9) for t in t_ns] == [MIDNIGHT_NS // S_NS + 9 * 3600 + k for k in range(4)]
    np.testing.assert_array_equal(columns["T_w [°C]"], [20, np.nan, 22, 23])
    assert (columns["T_j [°C]"], log.settings["header_line"]) == ([30, 31, 32, 33], 3)


def test_a_sheet_may_be_a_long_table(tmp_path: Path) -> None:
    rows = [[tag, MIDNIGHT + timedelta(seconds=k), 20.0 + k] for k in range(3) for tag in ("T", "n")]
    log, _, columns = read(write(tmp_path / "log.xlsx", A=[["Tag", "Zeit", "Wert"], *rows]))
    assert (columns, log.found) == ({"T": [20, 21, 22], "n": [20, 21, 22]}, 6)


def test_blank_rows_are_no_rows_and_rows_are_counted_as_the_workbook_does(tmp_path: Path) -> None:
    rows: Sheet = [[], ["t", "T"], [0, 20], [], [1, "x"], [2, 22], [3, 23]]
    log, t_ns, _ = read(write(tmp_path / "log.xlsx", A=rows))
    assert (log.found, t_ns) == (4, [0, 2 * S_NS, 3 * S_NS])
    assert [one.where for one in log.rejected] == ["row 5, column T"]


@pytest.mark.parametrize("numbered", [True, False])
def test_a_long_sheet_is_read_through_a_part_at_a_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, numbered: bool
) -> None:
    """As Excel writes its rows, and as other programs may: without their numbers, and with a prefix."""
    monkeypatch.setattr("ingest.formats._xlsx_sheets.PART", 1)
    monkeypatch.setattr("ingest.formats.xlsx.TOGETHER", 450)
    rows: list[list[Any]] = [["t", "T"], *([k, 20 + k / 8] for k in range(3000))]
    rows[2501] = [2500, "abc"]
    path = write(tmp_path / "log.xlsx", A=rows)
    with zipfile.ZipFile(path) as packed:
        files = {name: packed.read(name) for name in packed.namelist()}
    sheet = files["xl/worksheets/sheet1.xml"]
    assert len(sheet) > 5 * max(len(one) for name, one in files.items() if "sheet1" not in name)  # so many parts
    if not numbered:
        bare = re.sub(rb' r="\w+"', b"", sheet)
        files["xl/worksheets/sheet1.xml"] = re.sub(rb"<(/?)(\w)", rb"<\1x:\2", bare).replace(b"xmlns=", b"xmlns:x=")
    with zipfile.ZipFile(path, "w") as packed:
        for name, one in files.items():
            packed.writestr(name, one)
    log, t_ns, columns = read(path)
    assert (log.found, len(t_ns), t_ns[-1], columns["T"][-1]) == (3000, 2999, 2999 * S_NS, 20 + 2999 / 8)
    assert [(one.record, one.where) for one in log.rejected] == [(2500, "row 2,502, column T")]


@pytest.mark.parametrize(
    ("sheets", "says"),
    [
        ({"A": []}, "log.xlsx: no sheet of it holds a cell: nothing to read. Save it again."),
        ({"A": [["T"], [1], [2]]}, "log.xlsx: no column is recognised as its time."),
        ({"A": [["Bericht"]]}, "log.xlsx: holds one line and no row below it: nothing to read."),
    ],
)
def test_a_workbook_without_a_table_is_refused(tmp_path: Path, sheets: dict[str, Sheet], says: str) -> None:
    with pytest.raises(UnreadableLogError) as refused:
        read(write(tmp_path / "log.xlsx", **sheets))
    assert str(refused.value).startswith(says)


def test_a_cut_file_a_password_and_an_archive_of_no_workbook_are_refused_with_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "log.xlsx"
    path.write_bytes((LOGS / "sample.xlsx").read_bytes()[:-100])
    with pytest.raises(UnreadableLogError, match=r"log\.xlsx: is no whole workbook \(.+\): nothing .* Copy it again"):
        read(path)
    with zipfile.ZipFile(path, "w") as other:
        other.writestr("word/document.xml", "<a/>")
    with pytest.raises(UnreadableLogError, match=r"log\.xlsx: is an Office document without sheets\. Save "):
        recognise(path)
    path.write_bytes(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(3000))  # so Excel encrypts
    with pytest.raises(UnreadableLogError, match=r"with a password\. Save it as XLSX without a password \("):
        recognise(path)


def test_a_workbook_that_unpacks_to_too_much_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ingest.formats.ALWAYS", 1 << 20)
    path = tmp_path / "bomb.xlsx"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr("xl/worksheets/sheet1.xml", b" " * (20 << 20))
    with pytest.raises(UnreadableLogError, match=r"bomb\.xlsx: unpacks to more than [\d,]+ bytes: it is no workbook"):
        read(path)


def test_one_that_hides_how_much_it_unpacks_to_is_refused(tmp_path: Path) -> None:
    path, large = tmp_path / "bomb.xlsx", b"x" * (2 << 20)
    with zipfile.ZipFile(write(path, A=[["t", "T"], [0, "x" * 200]])) as packed:
        contents = {name: packed.read(name).replace(b"x" * 200, large) for name in packed.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as bomb:
        for name, data in contents.items():
            bomb.writestr(name, data)
    size = max(map(len, contents.values()))
    path.write_bytes(path.read_bytes().replace(size.to_bytes(4, "little"), (1000).to_bytes(4, "little")))
    with pytest.raises(UnreadableLogError, match=r"Bad CRC-32 .*\): nothing of it is used\. Copy"):
        read(path)


def test_without_the_package_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "python_calamine", None)
    with pytest.raises(
        UnreadableLogError, match=r"the reader of XLSX files is not installed: .*\[view,notebooks,tdms,xlsx\]"
    ):
        read(LOGS / "sample.xlsx")


def test_it_goes_through_the_child_process(tmp_path: Path) -> None:
    with closing(Reader()) as reader:
        reading = reader.record(LOGS / "sample.xlsx", tmp_path / "recording.mcap")
    assert (reading.format, reading.found, reading.written, reading.rejected) == ("xlsx", 5, 3, 2)
