"""What `show` says of a log's stamps: whose clock they are, and in which zone."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from made import mf4
from made.places import LOGS
from replay.cli import main

Capture = pytest.CaptureFixture[str]
HEAD = 'schema = "whyhot.bench/1"\n'


def said(folder: Path, capsys: Capture, log: Path, bench: str | None = None) -> str:
    words = ["--store", str(folder / "store")]
    given = []
    if bench is not None:
        (folder / "bench.toml").write_text(HEAD + bench, encoding="utf-8")
        (folder / "bus.dbc").write_text('VERSION ""\nBU_: A\nBO_ 1 M: 8 A\n SG_ s : 0|8@1+ (1,0) [0|0] "" A\n')
        given = ["--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bus.dbc")]
    main(["ingest", str(log), *given, *words])
    capsys.readouterr()
    assert main(["show", log.name.split(".")[0], "--json", *words]) == 0
    (source,) = json.loads(capsys.readouterr().out)["sources"]
    return str(source["times"])


@pytest.mark.parametrize(
    ("bench", "says"),
    [
        (None, "the recorder's wall clock, taken as UTC; say `zone` under [time] if it is another"),
        ('[time]\nzone = "Europe/Rome"\n', "the recorder's wall clock, taken as Europe/Rome"),
        (
            '[[logger]]\nname = "box"\nfiles = "sample*"\n',
            "logger box, the recorder's wall clock, taken as UTC; say `zone` under its [[logger]] if it is another",
        ),
        ("[time]\nstart = 2025-01-01T00:00:00Z\n", "counted from the start that the bench file says"),
    ],
)
def test_the_date_of_a_bus_log_is_the_wall_clock_of_its_recorder(
    tmp_path: Path, capsys: Capture, bench: str | None, says: str
) -> None:
    assert said(tmp_path, capsys, LOGS / "sample.asc", bench) == says


@pytest.mark.parametrize(
    ("column", "says"),
    [
        ("time\n0\n1\n2", "counted from the log's own start"),
        ("time\n2025-01-01T00:00:00\n2025-01-01T00:00:01", "ISO 8601 in UTC"),
        ("time\n09:00:02\n09:00:12", "times of day without a date: say `start` under [time]"),
        ("time\n00:00:02\n00:00:12", "counted from the log's own start"),
        ("epoch_s\n1760000000\n1760000001", "UTC, as the log says"),
    ],
)
def test_a_table_has_the_time_that_its_column_says(tmp_path: Path, capsys: Capture, column: str, says: str) -> None:
    head, *rows = column.split("\n")
    log = tmp_path / "log.csv"
    log.write_text(f"{head},T\n" + "".join(f"{one},20.5\n" for one in rows), encoding="utf-8")
    assert said(tmp_path, capsys, log) == says


@pytest.mark.parametrize("name", ["sample.atfx", "sample.busmaster", "shown.log", "local.mf4"])
def test_other_dates_without_a_zone_are_those_of_a_wall_clock_too(tmp_path: Path, capsys: Capture, name: str) -> None:
    (tmp_path / "shown.log").write_text(" (2025-03-05 10:00:00.000000)  can0  100   [1]  01\n", encoding="utf-8")
    file = mf4.Mf4()
    group = file.group((*mf4.PARTS, mf4.IN_RECORD), 1)
    local = file.data_group(group, file.block(b"DT", (), mf4.record(0, 0x100, b"\1")))
    file.save(tmp_path / "local.mf4", local, start_ns=1_760_000_000 * 10**9, local=True)
    log = LOGS / name if name.startswith("sample") else tmp_path / name
    assert said(tmp_path, capsys, log).startswith("the recorder's wall clock, taken as UTC; say `zone`")


@pytest.mark.parametrize(
    ("start", "rows", "begins"),
    [
        ("2026-03-03T09:00:00", ("09:00:02", "09:00:12"), "2026-03-03T08:00:02"),
        ("2026-03-03T09:00:00", ("09:40:00", "09:40:10"), "2026-03-03T08:40:00"),
        ("2026-03-03T00:00:00", ("09:00:02", "09:00:12"), "2026-03-03T08:00:02"),
        ("2026-03-03T09:00:00", ("00:00:02", "00:00:12"), "2026-03-03T08:00:02"),
        ("2026-03-03T09:00:00", ("00:20:00", "00:20:10"), "2026-03-03T08:20:00"),
        ("2026-03-03T00:10:00", ("00:10:00", "00:10:10"), "2026-03-02T23:10:00"),
    ],
)
def test_times_of_day_have_the_day_of_the_start_and_what_went_by_counts_from_it(
    tmp_path: Path, capsys: Capture, start: str, rows: tuple[str, str], begins: str
) -> None:
    log = tmp_path / "log.csv"
    log.write_text("time,s\n" + "".join(f"{row},{i}\n" for i, row in enumerate(rows)), encoding="utf-8")
    (tmp_path / "bench.toml").write_text(
        f'schema = "whyhot.bench/1"\n[time]\nzone = "Europe/Berlin"\nstart = {start}\n'
        '[[channel]]\nsignal = "s"\nquantity = "counter"\nunit = "1"\n',
        encoding="utf-8",
    )
    store = ["--store", str(tmp_path / "store")]
    assert main(["ingest", str(log), "--bench", str(tmp_path / "bench.toml"), *store]) == 0
    capsys.readouterr()
    assert main(["sql", "SELECT min(start) AS begins FROM sessions", "--json", *store]) == 0
    assert json.loads(capsys.readouterr().out)["rows"][0]["begins"].startswith(begins)
