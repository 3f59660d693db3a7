"""What is wrong with the stamps of a log, of any format: found, counted, kept, and said."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from made import can_bench
from made.every_format import WRITERS, Record, can_be_read, write_csv
from replay.cli import main

Capture = pytest.CaptureFixture[str]

GOOD: list[Record] = [(0.5 * i, 20 + i / 100) for i in range(400)]
BENCH = """\
schema = "whyhot.bench/1"
[[channel]]
signal = "TC_winding"
quantity = "temperature"
unit = "degC"
node = "winding"
"""


every_format = pytest.mark.parametrize("suffix", ["csv", "blf", "asc"])


def answer(capsys: Capture, *words: str) -> dict[str, Any]:
    capsys.readouterr()
    assert main([*words, "--json"]) in (0, 1)
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def said(folder: Path, capsys: Capture, suffix: str, records: Sequence[Record]) -> list[str]:
    """What is said of the stamps: the same by `inspect`, `ingest` and `show`."""
    (folder / "bench.toml").write_text(BENCH, encoding="utf-8")
    (folder / "bench.dbc").write_text(can_bench.DBC, encoding="utf-8")
    log, store = folder / f"log.{suffix}", ["--store", str(folder / "store")]
    WRITERS[suffix](log, records)
    dbc = [] if suffix == "csv" else ["--dbc", str(folder / "bench.dbc")]
    (file,) = answer(capsys, "inspect", str(log), *dbc)["files"]
    taken = answer(capsys, "ingest", str(log), "--bench", str(folder / "bench.toml"), *dbc, *store)
    told = [flag["says"] for flag in taken["flags"] if flag["says"].startswith(log.name)]
    assert told == [f"{log.name}: {says}" for says in file["stamps"]]
    assert set(told) <= set(answer(capsys, "show", "log", *store)["findings"])
    return list(file["stamps"])


def rows(folder: Path, capsys: Capture, query: str) -> list[dict[str, Any]]:
    return list(answer(capsys, "sql", query, "--store", str(folder / "store"))["rows"])


@every_format
def test_stamps_that_rise_have_no_finding(tmp_path: Path, capsys: Capture, suffix: str) -> None:
    assert said(tmp_path, capsys, suffix, GOOD) == []
    assert rows(tmp_path, capsys, "SELECT count(*) AS n FROM samples WHERE doubled") == [{"n": 0}]


@every_format
def test_a_clock_that_steps_back_is_said(tmp_path: Path, capsys: Capture, suffix: str) -> None:
    late = [(t_s if i < 300 else t_s - 37.25, value) for i, (t_s, value) in enumerate(GOOD)]
    assert said(tmp_path, capsys, suffix, late) == ["its clock steps back by 36.8 s"]


def test_a_log_with_its_newest_record_first_has_no_clock_that_steps_back(tmp_path: Path, capsys: Capture) -> None:
    assert said(tmp_path, capsys, "csv", GOOD[::-1]) == [
        "it runs from the newest record to the oldest: put in the order of time"
    ]


@every_format
def test_stamps_that_come_twice_are_counted_by_whether_their_values_are_equal(
    tmp_path: Path, capsys: Capture, suffix: str
) -> None:
    doubled = [one for i, r in enumerate(GOOD) for one in ([r, r] if i % 40 == 3 else [r])]
    assert said(tmp_path, capsys, suffix, [*doubled, (GOOD[-1][0], 30.0)]) == [
        "10 records with stamp and values of another one",
        "1 record with the stamp of another one and other values",
    ]
    counted = rows(
        tmp_path,
        capsys,
        "SELECT count(*) FILTER (doubled) AS twice, count(*) AS n FROM samples WHERE channel = 'TC_winding'",
    )
    assert counted == [{"twice": 11, "n": 411}]
    left = "SELECT count(*) - count(DISTINCT t_ns) AS more FROM samples WHERE NOT doubled AND channel = 'TC_winding'"
    assert rows(tmp_path, capsys, left) == [{"more": 0}]


@every_format
def test_other_values_at_one_time_are_flagged_row_by_row(tmp_path: Path, capsys: Capture, suffix: str) -> None:
    rounded = [(float(int(t_s)), value) for t_s, value in GOOD]  # two records a second
    assert said(tmp_path, capsys, suffix, rounded) == ["200 records with the stamp of another one and other values"]
    counts = rows(
        tmp_path,
        capsys,
        "SELECT doubled, count(*) AS n FROM samples WHERE channel = 'TC_winding' GROUP BY ALL ORDER BY ALL",
    )
    assert counts == [{"doubled": False, "n": 200}, {"doubled": True, "n": 200}]


@every_format
def test_a_block_that_is_written_twice_is_no_step_of_the_clock(tmp_path: Path, capsys: Capture, suffix: str) -> None:
    twice = [*GOOD[:200], *GOOD[150:200], *GOOD[200:]]
    assert said(tmp_path, capsys, suffix, twice) == ["a block of 50 records in all stands in it twice"]
    assert rows(tmp_path, capsys, "SELECT count(*) AS n FROM samples WHERE NOT doubled AND channel = 'TC_winding'") == [
        {"n": len(GOOD)}
    ]


@every_format
def test_a_clock_that_jumps_by_days_is_said(tmp_path: Path, capsys: Capture, suffix: str) -> None:
    set_on = [(t_s if i < 300 else t_s + 10 * 86_400, value) for i, (t_s, value) in enumerate(GOOD)]
    assert said(tmp_path, capsys, suffix, set_on) == ["its clock jumps on, or the log paused, by 10.0 days"]


def test_every_fault_is_told_of_a_log_of_any_format(tmp_path: Path, capsys: Capture) -> None:
    records = [
        *GOOD[:100],
        *GOOD[60:100],  # a block again
        *(one for record in GOOD[100:103] for one in (record, record)),
        *(one for t_s, value in GOOD[103:105] for one in ((t_s, value), (t_s, value + 1))),
        *GOOD[105:200],
        *((t_s - 37.25, value) for t_s, value in GOOD[200:300]),
        *((t_s + 10 * 86_400, value) for t_s, value in GOOD[300:]),
    ]
    for name in can_be_read():
        WRITERS[name](tmp_path / name, records)
    found = {one["name"]: one["stamps"] for one in answer(capsys, "inspect", str(tmp_path))["files"]}
    says = [
        "its clock steps back by 36.8 s",
        "its clock jumps on, or the log paused, by 10.0 days",
        "3 records with stamp and values of another one",
        "2 records with the stamp of another one and other values",
        "a block of 40 records in all stands in it twice",
    ]
    assert found == dict.fromkeys(can_be_read(), says)


@pytest.mark.parametrize("stamp_s", [2.3e9, -1.7e9], ids=["2098", "1971"])
@pytest.mark.parametrize("place", [0, 250, 399])
def test_one_absurd_stamp_is_left_out_and_blocks_nothing(
    tmp_path: Path, capsys: Capture, stamp_s: float, place: int
) -> None:
    records = [(stamp_s, value) if i == place else (t_s, value) for i, (t_s, value) in enumerate(GOOD)]
    (says,) = said(tmp_path, capsys, "csv", records)
    assert says.startswith("1 record with a stamp far off all others (") and says.endswith(" UTC): left out")
    (file,) = rows(tmp_path, capsys, "SELECT found, decoded, rejected FROM files")
    assert file == {"found": 400, "decoded": 399, "rejected": 1}
    (session,) = answer(capsys, "sessions", "--store", str(tmp_path / "store"))["sessions"]
    assert session["duration_s"] <= 200.0
    write_csv(tmp_path / "next.csv", [(t_s + 86_400, value) for t_s, value in GOOD])
    words = ["ingest", str(tmp_path / "next.csv"), "--bench", str(tmp_path / "bench.toml")]
    assert main([*words, "--store", str(tmp_path / "store")]) == 0


def test_an_absurd_stamp_of_a_bus_is_left_out(tmp_path: Path, capsys: Capture) -> None:
    records = [(2.3e9, value) if i == 250 else (t_s, value) for i, (t_s, value) in enumerate(GOOD)]
    (says,) = said(tmp_path, capsys, "blf", records)
    assert says.startswith("1 record with a stamp far off all others (209")
    assert rows(tmp_path, capsys, "SELECT decoded, rejected FROM files") == [{"decoded": 399, "rejected": 1}]


def test_a_clock_that_was_set_within_the_log_blocks_nothing(tmp_path: Path, capsys: Capture) -> None:
    """Half of the log is of the year 2000: nothing says which half is right, so both are kept."""
    halves = [(t_s - 8e8 if i < 200 else t_s, value) for i, (t_s, value) in enumerate(GOOD)]
    (says,) = said(tmp_path, capsys, "csv", halves)
    assert says.startswith("its clock jumps on, or the log paused, by 9,259.")
    (session,) = answer(capsys, "sessions", "--store", str(tmp_path / "store"))["sessions"]
    assert session["kind"] == "other"
    assert "its stamps span 25 years" in answer(capsys, "show", "log", "--store", str(tmp_path / "store"))["kind_why"]


def test_a_table_with_a_row_a_check_has_no_strays(tmp_path: Path, capsys: Capture) -> None:
    checks = [(86_400.0 * 40 * i, 20.0) for i in range(12)]
    assert said(tmp_path, capsys, "csv", checks) == []
    assert rows(tmp_path, capsys, "SELECT decoded FROM files") == [{"decoded": 12}]


def test_specimens_that_no_bench_file_tells_apart_are_said_and_not_taken_for_a_fault_of_the_clock(
    tmp_path: Path, capsys: Capture
) -> None:
    log, store = tmp_path / "checks.csv", ["--store", str(tmp_path / "store")]
    log.write_text("time,specimen,R_iso [GOhm]\n9,M1,1.2\n9,M2,1.1\n9,M3,1.2\n30,M1,1.1\n", encoding="utf-8")
    line = 'say specimen_column = "specimen" above the first [table] of a bench file'
    says = f"checks.csv: rows of 3 specimens, taken as one: {line}"
    taken = answer(capsys, "ingest", str(log), *store)
    assert [flag["says"] for flag in taken["flags"] if flag["flag"] != "gap"] == [says]
    assert says in answer(capsys, "show", "checks", *store)["findings"]
    (tmp_path / "bench.toml").write_text('schema = "whyhot.bench/1"\nspecimen_column = "specimen"\n', encoding="utf-8")
    assert answer(capsys, "ingest", str(log), "--bench", str(tmp_path / "bench.toml"), *store)["flags"] == []


def test_the_end_of_summer_time_is_told_and_a_zone_mends_it(tmp_path: Path, capsys: Capture) -> None:
    hours = ["01:59:00", "02:00:00", *(f"02:{m:02}:00" for m in range(1, 60)), *(f"02:{m:02}:00" for m in range(60))]
    rows = "".join(f"26.10.2025 {hour},{20 + i}\n" for i, hour in enumerate([*hours, "03:00:00"]))
    log = tmp_path / "oven.csv"
    log.write_text(f"time,TC_winding\n{rows}", encoding="utf-8")
    (file,) = answer(capsys, "inspect", str(log))["files"]
    assert file["stamps"][0] == (
        "its clock steps back by 59 min, as a local clock does when summer time ends: say its `zone` under [time]"
    )
    bench = tmp_path / "bench.toml"
    bench.write_text(BENCH.replace("[[channel]]", '[time]\nzone = "Europe/Berlin"\n[[channel]]', 1), encoding="utf-8")
    taken = answer(capsys, "ingest", str(log), "--bench", str(bench), "--store", str(tmp_path / "store"))
    assert taken["flags"] == []
