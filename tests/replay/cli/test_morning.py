"""`whyhot morning`: a folder of logs looked through, with nothing stored, beside the last run of the test."""

from __future__ import annotations

import json
import re
import shutil
from datetime import UTC, datetime
from pathlib import Path

import pytest

from ingest.catalogue.kinds import wltc
from ingest.facts.events import ClockAligned
from ingest.facts.store import Store
from made import can_bench
from made.browser import faults
from made.places import ROOT
from made.repeated import BENCH, write_table
from replay.cli import main

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Monday's run in a store, and a folder with Tuesday's, which was broken off with a sensor 6 K off, and a note."""
    folder = tmp_path_factory.mktemp("morning")
    (folder / "bench.toml").write_text(BENCH, encoding="utf-8")
    write_table(folder / "monday.csv", 0)
    ingest = ["ingest", str(folder / "monday.csv"), "--bench", str(folder / "bench.toml")]
    assert main([*ingest, "--store", str(folder / "store")]) == 0
    (folder / "night").mkdir()
    write_table(folder / "whole.csv", 1, winding_K=6.0)
    lines = (folder / "whole.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    (folder / "night" / "tuesday.csv").write_text("".join(lines[:2001]), encoding="utf-8")
    (folder / "night" / "notes.txt").write_text("the pump was loud\n", encoding="utf-8")
    return folder


ASKED = ["morning", "night", "--report", "night.html"]


def test_the_page_shows_what_is_printed(lab: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    monkeypatch.chdir(lab)
    before = (lab / "store" / "ledger.sqlite").read_bytes()
    assert main([*ASKED, "--store", "store"]) == 0
    printed = capsys.readouterr()
    assert printed.err == "notes.txt: is a text without a table. Skipped.\n"
    page = (ROOT / "docs" / "morning.md").read_text(encoding="utf-8")
    shown = printed.out.replace("whyhot morning --store store night", "whyhot morning night")
    assert f"```console\n$ whyhot {' '.join(ASKED)}\n{shown}```" in page
    assert (lab / "store" / "ledger.sqlite").read_bytes() == before, "nothing is stored unless it is asked for"


def test_the_report_is_one_file_with_pictures_and_the_same_bytes_again(
    lab: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(lab)
    assert faults(lab / "night.html") == []
    first = (lab / "night.html").read_bytes()
    assert main([*ASKED, "--store", "store"]) == 0
    assert (lab / "night.html").read_bytes() == first
    page = first.decode().replace("\N{NO-BREAK SPACE}", " ")
    assert page.count("<svg") == 3, "the session's course, where it was driven, and the run before"
    assert "Off monday by more than its floor: T_winding" in page
    assert "aborted: driven as monday for 33 min" in page
    assert "notes.txt: is a text without a table. Skipped." in page
    assert not re.search(r"(?:src|href)=\"[^#]", page), "it needs no other file"


def test_a_sensor_without_a_value_is_told_once_and_is_no_fault_of_the_log(
    lab: Path, tmp_path: Path, capsys: Capture
) -> None:
    head, *rows = (lab / "whole.csv").read_text(encoding="utf-8").splitlines()
    column = head.split(",").index("T_winding")
    cells = [row.split(",") for row in rows]
    text = "\n".join([head, *(",".join([*row[:column], "", *row[column + 1 :]]) for row in cells)])
    (tmp_path / "dead.csv").write_text(f"{text}\n", encoding="utf-8")
    words = ["morning", str(tmp_path / "dead.csv"), "--bench", str(lab / "bench.toml"), "--store", str(tmp_path / "s")]
    assert main(words) == 0
    told = capsys.readouterr().out
    assert told.count("T_winding has no value at all") == 1 and "log fault" not in told


def test_a_sensor_that_goes_open_is_something_to_look_at(lab: Path, tmp_path: Path, capsys: Capture) -> None:
    head, *rows = (lab / "whole.csv").read_text(encoding="utf-8").splitlines()
    column = head.split(",").index("T_winding")
    cells = [row.split(",") for row in rows]
    for row in cells[len(cells) // 2 :]:
        row[column] = "OPEN"
    (tmp_path / "open.csv").write_text("\n".join([head, *map(",".join, cells), ""]), encoding="utf-8")
    words = ["morning", str(tmp_path / "open.csv"), "--bench", str(lab / "bench.toml"), "--store", str(tmp_path / "s")]
    assert main(words) == 0
    told = capsys.readouterr().out
    assert "To look at: 1 gap." in told and "1 channel, the longest 25 min (T_winding)" in told


def test_it_works_without_a_store_and_without_a_bench_file(lab: Path, tmp_path: Path, capsys: Capture) -> None:
    target = tmp_path / "answer.json"
    words = ["morning", str(lab / "night" / "tuesday.csv"), "--store", str(tmp_path / "none"), "--json", str(target)]
    assert main(words) == 0
    assert "no bench file says what the signals mean" in capsys.readouterr().out
    data = json.loads(target.read_text(encoding="utf-8"))
    assert (data["schema"], data["setup"], data["kept"]) == ("whyhot.morning/1", "no bench file", False)
    (session,) = data["sessions"]
    assert session["before"] is None
    assert {"kind", "ended", "sensors", "channels", "sources", "power", "operating_points"} <= set(session)
    assert data["provenance"]["store_head"] is None
    assert not (tmp_path / "none").exists()


def test_a_log_without_units_is_taken_as_in_rpm_and_newton_metres(tmp_path: Path, capsys: Capture) -> None:
    rows = "\n".join(f"{t},{min(t, 60) * 50},80,{20 + t / 100:.2f}" for t in range(0, 1500, 5))
    (tmp_path / "night.csv").write_text(f"time,motor_speed,torque,stator_winding\n{rows}\n", encoding="utf-8")
    assert main(["morning", str(tmp_path), "--store", str(tmp_path / "none"), "--json"]) == 0
    (session,) = json.loads(capsys.readouterr().out)["sessions"]
    assert (session["kind"], session["kind_why"]) == ("s1", "3,000 rpm and 80 Nm held for 24 min")


def test_with_ingest_the_logs_are_kept_and_compared_with_what_was_there(lab: Path, tmp_path: Path) -> None:
    shutil.copytree(lab / "store", tmp_path / "store")
    target, store = tmp_path / "answer.json", ("--store", str(tmp_path / "store"))
    assert main(["morning", str(lab / "night"), "--ingest", *store, "--json", str(target)]) == 0
    (session,) = json.loads(target.read_text(encoding="utf-8"))["sessions"]
    assert session["before"]["name"] == "monday"
    assert session["ended"]["reason"] == "aborted"
    assert main(["repeat", "monday", "tuesday", *store]) == 0


def test_the_bench_file_and_databases_of_a_folder_are_taken(tmp_path: Path, capsys: Capture) -> None:
    can_bench.write_files(tmp_path)
    can_bench.write_log(tmp_path / "night.asc", seconds=20)
    assert main(["morning", str(tmp_path), "--store", str(tmp_path / "none"), "--json"]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    data = json.loads(printed.out)
    assert data["setup"] == "bench.toml, bench.dbc"
    assert [one["motor"] for one in data["sessions"]] == ["servo-5kW"]


def test_a_file_that_cannot_be_read_or_is_a_copy_is_said_and_stops_no_other(
    lab: Path, tmp_path: Path, capsys: Capture
) -> None:
    night = tmp_path / "night"
    shutil.copytree(lab / "night", night)
    (night / "cut.blf").write_bytes(b"LOGG" + bytes(200))
    shutil.copy(night / "tuesday.csv", night / "tuesday copy.csv")
    assert main(["morning", str(night), "--store", str(tmp_path / "none")]) == 1
    printed = capsys.readouterr()
    assert "cut.blf: " in printed.err
    told = " ".join(printed.out.split())
    assert (
        "1 log, 2,000 records" in told
        and "1 file could not be read. tuesday.csv is a copy of tuesday copy.csv." in told
    )
    assert "1 refused or incomplete log" in printed.out.split("Balance")[0]


def test_the_clock_of_a_second_logger_is_a_fact_of_a_store_that_keeps_its_log(tmp_path: Path, capsys: Capture) -> None:
    """The bench's own table, and an analyser's whose clock is 7 s late."""
    drive, bench = wltc() * 40.0, 'schema = "whyhot.bench/1"\n'
    for name, late_s in (("bench", 0), ("analyser", 7)):
        stamps = [datetime.fromtimestamp(1.76e9 + late_s + k, UTC).strftime("%Y-%m-%dT%H:%M:%SZ") for k in range(1801)]
        rows = [f"{stamp},{speed:.0f}" for stamp, speed in zip(stamps, drive, strict=True)]
        (tmp_path / f"{name}.csv").write_text("\n".join([f"time,n_{name}", *rows]) + "\n", encoding="utf-8")
        bench += f'[[channel]]\nsignal = "n_{name}"\nquantity = "speed"\nunit = "rpm"\n'
    (tmp_path / "bench.toml").write_text(bench, encoding="utf-8")
    store = ("--store", str(tmp_path / "store"))
    assert main(["morning", str(tmp_path), "--ingest", *store, "--json"]) == 0
    (clock,) = json.loads(capsys.readouterr().out)["clocks"]
    assert clock["offset"]["offset_s"] == pytest.approx(7.0 if clock["clock"] == "analyser" else -7.0, abs=0.1)
    assert main(["show", "bench", *store]) == 0
    assert clock["says"][:30] in capsys.readouterr().out
    assert main(["morning", str(tmp_path), "--ingest", *store]) == 0
    with Store.open(tmp_path / "store") as kept:
        assert len(kept.ledger.events(ClockAligned)) == 1


def test_a_bench_file_of_the_store_that_fits_no_log_is_left_out_and_one_that_is_named_is_refused(
    lab: Path, tmp_path: Path, capsys: Capture
) -> None:
    (tmp_path / "other.csv").write_text("time,T_oven\n0,20.0\n60,21.0\n120,22.0\n", encoding="utf-8")
    store = ("--store", str(lab / "store"))
    assert main(["morning", str(tmp_path), *store]) == 0
    assert "no bench file, as bench.toml does not fit" in " ".join(capsys.readouterr().out.split())
    assert main(["morning", str(tmp_path), "--bench", str(lab / "bench.toml"), *store]) == 2


def test_a_database_of_the_folder_that_cannot_be_read_is_left_out(tmp_path: Path, capsys: Capture) -> None:
    can_bench.write_files(tmp_path)
    can_bench.write_log(tmp_path / "night.asc", seconds=20)
    (tmp_path / "broken.dbc").write_text('VERSION ""\nBO_ 291 Motor 8 Vector__XXX\n', encoding="utf-8")
    assert main(["morning", str(tmp_path), "--store", str(tmp_path / "none"), "--json"]) == 0
    printed = capsys.readouterr()
    data = json.loads(printed.out)
    assert data["setup"] == "bench.toml, bench.dbc"
    (line,) = data["skipped"]
    assert line.startswith("broken.dbc:") and line.endswith("Left out.") and line in printed.err
