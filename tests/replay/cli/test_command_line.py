"""The command line on fresh files: BLF and ASC logs with motor, bench and DBC files, no other step."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from made import can_bench
from replay.cli import main


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bench")
    can_bench.write_files(folder)
    can_bench.write_log(folder / "1_s1.blf", seconds=600, seed=1)
    can_bench.write_log(folder / "2_drive.asc", seconds=300, seed=2, start=can_bench.START + 86_400)
    can_bench.write_log(folder / "3_hot.blf", seconds=600, seed=3, start=can_bench.START + 2 * 86_400, magnet_loss=90.0)
    store = folder / "store"
    logs = [str(folder / name) for name in ("1_s1.blf", "2_drive.asc", "3_hot.blf")]
    words = ["ingest", *logs, "--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")]
    assert main([*words, "--store", str(store)]) == 0
    return folder


def _json(folder: Path, capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    assert main([*words, "--json", "--store", str(folder / "store")]) == 0
    answer: dict[str, Any] = json.loads(capsys.readouterr().out)
    return answer


def test_sessions_are_listed_in_the_order_of_their_start(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answer = _json(bench, capsys, "sessions")
    assert answer["schema"] == "whyhot.sessions/1"
    assert [s["name"] for s in answer["sessions"]] == ["1_s1", "2_drive", "3_hot"]
    first = answer["sessions"][0]
    assert first["start"] == "2025-10-09T08:53:20Z"
    assert first["duration_s"] == pytest.approx(599.9, abs=0.11)
    assert first["motor"] == "servo-5kW"
    assert first["specimen"] == "servo-01"
    assert first["sources"] == ["1_s1.blf"]
    assert first["channels"] == 7
    assert first["quarantined"] == 0


def test_the_last_sessions_are_shown_with_how_many_there_are(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    every = _json(bench, capsys, "sessions")["sessions"]
    assert _json(bench, capsys, "sessions", "--last", "2")["sessions"] == every[-2:]
    assert main(["sessions", "--last", "1", "--store", str(bench / "store")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "3 sessions, the last 1: --last N shows more"
    assert (len(lines), lines[2].split()[0]) == (5, "3_hot")
    assert lines[-1] == f"next: whyhot show --store {bench / 'store'} {every[-1]['session']}"


def test_a_replay_agrees_with_a_truth_of_other_origin(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answer = _json(bench, capsys, "replay", "1_s1", "2_drive")
    for run in answer["runs"]:
        assert set(run["mae_K"]) == {"winding", "yoke", "magnet"}
        assert max(run["mae_K"].values()) < 0.02, run["mae_K"]
        assert max(run["max_K"].values()) < 0.05, run["max_K"]


def test_a_wrong_loss_is_seen_where_it_is_and_with_its_sign(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (run,) = _json(bench, capsys, "replay", "3_hot")["runs"]
    assert run["bias_K"]["magnet"] > 1.0, "the real magnets are hotter than the model's"
    assert run["mae_K"]["magnet"] > 5 * run["mae_K"]["winding"]


def test_a_session_that_is_named_twice_counts_once(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (run,) = _json(bench, capsys, "replay", "3_hot", "3_hot")["runs"]
    page = bench / "twice.html"
    assert _json(bench, capsys, "report", "3_hot", "3_hot", "--out", str(page))["runs"] == [run["run"]]


def test_digests_repeat_in_one_process_and_in_two(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    once = _json(bench, capsys, "replay")
    again = _json(bench, capsys, "replay", "--workers", "2")
    assert [run["digest"] for run in once["runs"]] == [run["digest"] for run in again["runs"]]
    assert once["provenance"]["store_head"] == again["provenance"]["store_head"], "a known run is no new fact"


def test_the_same_files_again_change_nothing(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    head = _json(bench, capsys, "head")["root"]
    files = [str(bench / "1_s1.blf"), "--bench", str(bench / "bench.toml"), "--dbc", str(bench / "bench.dbc")]
    answer = _json(bench, capsys, "ingest", *files)
    assert answer["files"][0]["known"] is True
    assert _json(bench, capsys, "head")["root"] == head


def test_every_frame_is_accounted_for(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answer = _json(bench, capsys, "sql", "SELECT name, found, decoded, unknown_id, wrong_length, rejected FROM files")
    rows = {row["name"]: row for row in answer["rows"]}
    assert rows["1_s1.blf"]["found"] == 6600
    for row in rows.values():
        assert row["found"] == row["decoded"] + row["unknown_id"] + row["wrong_length"] + row["rejected"]


def test_show_needs_no_motor_file(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", "1_s1", "--store", str(bench / "store")]) == 0
    page = capsys.readouterr().out
    assert "TC_magnet" in page
    *lines, _ = page.splitlines()  # the last is a command, as long as its store is
    assert max(map(len, lines)) <= 100


def test_a_residual_is_followed_back_to_its_frame(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    query = """
        SELECT r.first_record, s.value, r.measured_degC FROM residuals r
        JOIN samples s ON s.file_id = r.file_id AND s.record = r.first_record AND s.channel = r.channel
        WHERE r.session_name = '1_s1' AND r.channel = 'TC_magnet' AND r.first_record = r.last_record
        ORDER BY r.t_ns LIMIT 50
    """
    main(["replay", "1_s1", "--store", str(bench / "store")])
    capsys.readouterr()
    rows = _json(bench, capsys, "sql", query)["rows"]
    assert len(rows) == 50
    for row in rows:
        assert row["value"] == row["measured_degC"]


def test_report_is_one_file_that_asks_for_nothing(
    bench: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    main(["replay", "3_hot", "--store", str(bench / "store")])
    assert main(["report", "3_hot", "--out", str(tmp_path / "r.html"), "--store", str(bench / "store")]) == 0
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "magnet" in page
    for request in ("http://", "https://", "<script src", "<link"):
        assert request not in page.replace("http://www.w3.org/", "")
    capsys.readouterr()


def test_an_unknown_session_is_refused_with_the_nearest(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", "1_s2", "--store", str(bench / "store")]) == 2
    assert "1_s1" in capsys.readouterr().err


def test_an_error_goes_into_the_json(bench: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "answer.json"
    assert main(["show", "nothing", "--json", str(out), "--store", str(bench / "store")]) == 2
    assert "nothing" in json.loads(out.read_text(encoding="utf-8"))["error"]
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize(
    "words",
    [
        ["show"],
        ["replay"],
        ["report"],
        ["view", "--write-only"],
        ["plan", "--sessions"],
        *([verb, "--on"] for verb in ("calibrate", "protocol", "diagnose", "sensors", "envelope")),
    ],
)
def test_what_reads_sessions_reads_them_as_they_were(
    bench: Path, capsys: pytest.CaptureFixture[str], words: list[str]
) -> None:
    verb, *flags = words
    assert main([verb, "--as-of", "1", "--store", str(bench / "store"), *flags, "1_s1"]) == 2
    assert capsys.readouterr().err.startswith("as of 1: session '1_s1': is not in this store")


def test_a_page_as_of_before_shows_what_was_known_and_names_the_store_that_was_asked(
    bench: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    store, page = str(bench / "store"), tmp_path / "r.html"
    runs = [run["run"] for run in _json(bench, capsys, "replay", "1_s1")["runs"]]
    then = _json(bench, capsys, "head")["position"]
    assert main(["retract", "1_s1.blf", "--reason", "a trial", "--store", store]) == 0
    capsys.readouterr()
    answer = _json(bench, capsys, "report", "1_s1", "--as-of", str(then), "--out", str(page))
    assert (answer["runs"], answer["provenance"]["settings"]["as_of"]) == (runs, str(then))
    assert f"whyhot report --store {store} 1_s1 --as-of {then}" in page.read_text(encoding="utf-8")
    assert main(["report", "1_s1", "--out", str(page), "--store", store]) == 2
    assert main(["retract", "1_s1.blf", "--undo", "--reason", "no trial", "--store", store]) == 0
    capsys.readouterr()
