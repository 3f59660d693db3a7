"""What of a log was not read as numbers, or may be read otherwise: said as it is looked at, kept as it is ingested."""

from __future__ import annotations

from pathlib import Path

import openpyxl
import pytest

from replay.cli import main


def test_a_further_table_and_cells_with_units_are_said_and_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    book = openpyxl.Workbook()
    for name, sheet in (("cold", book.active), ("hot", book.create_sheet("hot"))):
        assert sheet is not None
        sheet.title = name
        for row in (["t", "T", "p"], [0, 20, "1.0 bar"], [1, 21, "1.1 rpm"]):
            sheet.append(row)
    book.create_sheet("notes").append(["all well"])  # holds no table: nobody misses it
    book.save("two.xlsx")
    says = [
        "two.xlsx: sheet cold was read, and not hot ([time] sheet tells another)",
        'two.xlsx: read as text and not as numbers: p ("1.0 bar"): export it as plain numbers',
    ]
    assert main(["inspect", "two.xlsx"]) == 0
    looked = capsys.readouterr().out
    assert all(f"\n  {one.removeprefix('two.xlsx: ')}\n" in looked for one in says)
    assert main(["ingest", "two.xlsx", "--store", "store"]) == 0
    assert main(["show", "two", "--store", "store"]) == 0
    taken, _, shown = capsys.readouterr().out.partition("\nLook at\n")
    assert all(
        one in " ".join(told.split()) for one in says for told in (taken, shown)
    )  # lines are as wide as terminals


def test_times_that_may_be_minutes_and_seconds_are_said_and_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("run.csv").write_text("Time,T\n05:00,20\n05:01,21\n", encoding="utf-8")
    says = '"05:00" in Time is read as hours and minutes; if it is minutes and seconds, say format = "%M:%S" under'
    for words in (["inspect", "run.csv"], ["ingest", "run.csv", "--store", "s"], ["show", "run", "--store", "s"]):
        assert main(words) == 0
        assert says in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("place", ["", "Begin Triggerblock "])
def test_a_date_that_is_not_understood_is_said_and_kept(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    head = "base hex  timestamps absolute\n"
    head = f"{head}{place}mer. 05.03.2025 10:00\n" if place else f"date mer. 05.03.2025 10:00\n{head}"
    Path("run.asc").write_text(f"{head}   0.250000 1  100  Rx   d 1 01\nEnd TriggerBlock\n", encoding="utf-8")
    says = 'its date "mer. 05.03.2025 10:00" is not understood, and not used: say start under [time] of the bench file'
    for words in (["inspect", "run.asc"], ["ingest", "run.asc", "--store", "s"], ["show", "run", "--store", "s"]):
        main(words)
        assert says in " ".join(capsys.readouterr().out.split())


def test_readings_beyond_the_range_of_a_meter_are_said_and_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("iso.csv").write_text("t,R_iso,T\n0,>200,20\n60,85,21\n120,> 200,>300\n", encoding="utf-8")
    says = 'beyond the range of the meter, so no number is known there: R_iso 2 times, as ">200", T once, as ">300"'
    for words in (["inspect", "iso.csv"], ["ingest", "iso.csv", "--store", "s"], ["show", "iso", "--store", "s"]):
        assert main(words) == 0
        assert says in " ".join(capsys.readouterr().out.split())
