"""`whyhot inspect`: what to do next, and the draft that it writes or not."""

from __future__ import annotations

import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from ingest.bench.bench_file import read_bench
from made import can_bench
from replay.cli import main

Capture = pytest.CaptureFixture[str]
DBC = ("--dbc", "bench.dbc")


@pytest.fixture
def logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    can_bench.write_files(tmp_path)
    can_bench.write_log(tmp_path / "a b.asc", seconds=5)
    (tmp_path / "tc.csv").write_text("time,T_winding\n0,25.0\n1,25.1\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("words", "following"),
    [
        (("a b.asc",), "whyhot inspect 'a b.asc' --dbc FILE.dbc --bench-draft bench.toml"),
        (("a b.asc", *DBC), "whyhot inspect 'a b.asc' --dbc bench.dbc --bench-draft bench.toml"),
        (("tc.csv",), "whyhot inspect tc.csv --bench-draft bench.toml"),
        (
            ("a b.asc", "tc.csv", *DBC, "--bench-draft", "d.toml"),
            "complete d.toml, then whyhot ingest 'a b.asc' tc.csv --bench d.toml --dbc bench.dbc",
        ),
        (("tc.csv", "--bench-draft", "d.toml"), "complete d.toml, then whyhot ingest tc.csv --bench d.toml"),
        (("a b.asc", "tc.csv", "--bench-draft", "d.toml"), "--dbc FILE.dbc --bench-draft d.toml"),
        (("a b.asc", *DBC, "--bench", "bench.toml"), "whyhot ingest 'a b.asc' --bench bench.toml --dbc bench.dbc"),
    ],
)
def test_the_next_step_follows_from_what_was_given(
    logs: Path, capsys: Capture, words: tuple[str, ...], following: str
) -> None:
    assert main(["inspect", *words]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("next: ") and last.endswith(following)


def test_a_stamp_far_off_all_others_is_not_in_the_length_of_a_log(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    rows = [f"2026-11-23T22:{minute:02}:00,{20 + minute}" for minute in range(60)]
    rows[30] = "2106-02-07T06:28:15,25.0"
    Path("a.csv").write_text("\n".join(["time,T", *rows]), encoding="utf-8")
    assert main(["inspect", "a.csv"]) == 0
    first, stray, *_ = capsys.readouterr().out.splitlines()
    assert first == "a.csv   csv   60 rows in 59 min, from 2026-11-23 22:00:00 UTC"
    assert stray == "  1 record with a stamp far off all others (2106-02-07 06:28:15 UTC): left out"


def test_a_draft_gives_a_rate_to_the_logs_of_one_format_where_others_have_stamps(logs: Path, capsys: Capture) -> None:
    """A rate in `[time]` itself would have taken the stamps from all tables."""
    pq.write_table(pa.table({"T": [20.0, 21.0]}), "a.parquet")
    Path("tc.csv").write_text("time,T_winding\n2026-11-23T22:00:00,25.0\n2026-11-23T22:00:01,25.1\n", encoding="utf-8")
    assert main(["inspect", "a.parquet", "tc.csv", "--bench-draft", "d.toml"]) == 0
    assert "2 rows in 1 s, from 2026-11-23 22:00:00 UTC" in capsys.readouterr().out
    bench = read_bench(Path("d.toml").read_bytes(), "d.toml")
    assert (bench.time.rate_hz, bench.time_of["parquet"].rate_hz) == (None, 1.0)


def test_a_draft_of_frames_without_a_database_is_refused_in_one_line(logs: Path, capsys: Capture) -> None:
    assert main(["inspect", "a b.asc", "--bench-draft", "new/d.toml", "--json"]) == 1
    printed = capsys.readouterr()
    assert printed.err == (
        "new/d.toml: no draft was written: frames show no signals without their database. Add --dbc FILE.dbc.\n"
    )
    assert json.loads(printed.out)["bench_draft"] is None
    assert not Path("new").exists()


@pytest.mark.parametrize("verb", ["inspect", "ingest"])
def test_a_log_that_is_not_there_is_told_from_a_folder_without_logs(verb: str, logs: Path, capsys: Capture) -> None:
    Path("monday").mkdir()
    for name, says, code in (
        ("tcc.csv", "tcc.csv: there is no such file: correct the path.", 2),
        ("monday", "monday: holds no log: correct the path, or name the files.", 1),
    ):
        assert main([verb, "tc.csv", name]) == code
        assert capsys.readouterr().err.strip() == says


def test_one_row_is_not_rows(logs: Path, capsys: Capture) -> None:
    Path("one.csv").write_text("Time,T\n2025-10-09T08:53:21Z,20\n", encoding="utf-8")
    assert main(["inspect", "one.csv"]) == 0
    assert capsys.readouterr().out.startswith("one.csv   csv   1 row in 0 s")


def test_the_folders_of_a_draft_are_made(logs: Path, capsys: Capture) -> None:
    assert main(["inspect", "tc.csv", "--bench-draft", "new/folder/d.toml"]) == 0
    assert "draft bench file: new/folder/d.toml" in capsys.readouterr().out.splitlines()
    assert read_bench(Path("new/folder/d.toml").read_bytes(), "d.toml").channels[0].node == "winding"


@pytest.mark.parametrize("verb", ["inspect", "ingest"])
def test_a_folder_is_read_and_what_is_no_log_in_it_is_named(verb: str, logs: Path, capsys: Capture) -> None:
    folder = logs / "monday"
    folder.mkdir()
    (logs / "tc.csv").rename(folder / "tc.csv")
    (folder / "notes.txt").write_text("all well\n", encoding="utf-8")
    assert main([verb, "monday", "--json", "answer.json"]) == 0
    printed = capsys.readouterr()
    assert printed.err == "notes.txt: is a text without a table. Skipped.\n"
    answer = json.loads(Path("answer.json").read_text(encoding="utf-8"))
    assert [one["name"] for one in answer["files"]] == ["tc.csv"]
    assert (answer["skipped"], answer["refused"]) == ([printed.err.strip()], [])
    if verb == "inspect":
        assert printed.out.splitlines()[-1] == "next: whyhot inspect monday --bench-draft bench.toml"


def test_identifiers_and_notes_beyond_those_that_are_shown_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    frames = (f"(1760000000.{k:06d}) can1 {0x100 + k % 25:03X}#00\n" for k in range(60))
    Path("run.log").write_text("".join(frames), encoding="utf-8")
    wide = "".join(f'BO_ {k} M{k}: 16 E\n SG_ s : 0|128@1+ (1,0) [0|0] "" E\n' for k in range(1, 13))
    Path("wide.dbc").write_text(f'VERSION ""\nNS_ :\nBS_:\nBU_: E\n{wide}', encoding="utf-8")
    assert main(["inspect", "run.log", "--dbc", "wide.dbc"]) == 0
    said = capsys.readouterr().out
    assert "  and 30 frames of 15 more identifiers (--json has all)\n  wide.dbc: M1.s has 128 bits: left out\n" in said
    assert "  and 2 more notes on the databases (--json has all)\n" in said


def test_signals_of_messages_that_no_log_has_are_counted_and_not_drafted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("run.log").write_text("(1760000000.000000) can1 100#0000\n", encoding="utf-8")
    message = 'BO_ {0} M{0}: 2 E\n SG_ T{0} : 0|16@1- (1,0) [0|0] "degC" E\n'
    vehicle = "".join(message.format(number) for number in range(1, 100))
    Path("car.dbc").write_text(f"{vehicle}{message.format(256)}", encoding="utf-8")
    Path("other.dbc").write_text(vehicle, encoding="utf-8")
    assert main(["inspect", "run.log", "--dbc", "car.dbc", "--bench-draft", "draft.toml"]) == 0
    said = capsys.readouterr().out
    assert "  can1:M256.T256  degC     temperature\n  99 signals of the databases in no frame of these logs\n" in said
    assert [one.signal for one in read_bench(Path("draft.toml").read_bytes(), "draft.toml").channels] == ["T256"]
    main(["inspect", "run.log", "--dbc", "other.dbc", "--bench-draft", "none.toml"])
    captured = capsys.readouterr()
    assert "no message of the databases is in these logs. Name theirs with --dbc." in captured.out + captured.err
    assert not Path("none.toml").exists()
