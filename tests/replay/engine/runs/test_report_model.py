"""`whyhot report --model`: the replays of an older model are reported too."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

import pytest

from made import can_bench
from made.onward import next_commands
from replay.cli import main


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session replayed with the motor file of its bench file, then with another; a second one with the first only."""
    folder = tmp_path_factory.mktemp("bench")
    can_bench.write_files(folder)
    hotter = can_bench.MOTOR.replace("coefficient = 30.0", "coefficient = 60.0")
    (folder / "hotter.toml").write_text(hotter, encoding="utf-8")
    (folder / "unused.toml").write_text(hotter.replace("60.0", "61.0"), encoding="utf-8")
    for number, name in enumerate(("1_first", "2_second")):
        can_bench.write_log(folder / f"{name}.blf", seconds=90, start=can_bench.START + number * 86_400)
    logs = [str(folder / f"{name}.blf") for name in ("1_first", "2_second")]
    explained = ["--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")]
    for words in (
        ["ingest", *logs, *explained],
        ["replay"],
        ["replay", "1_first", "--model", str(folder / "hotter.toml")],
    ):
        assert main([*words, "--store", str(folder / "store")]) == 0
    return folder


def test_the_next_command_of_a_replay_reports_that_replay(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Asked again, a replay is not recorded again: the last one recorded may be of another motor file."""
    store, hotter = ["--store", str(bench / "store")], str(bench / "hotter.toml")
    for words in (["replay", "1_first"], ["replay", "1_first", "--model", hotter]):
        assert main([*words, *store]) == 0
        (command,) = next_commands(capsys.readouterr().out)
        assert main([*words, *store, "--json"]) == 0
        (replayed,) = json.loads(capsys.readouterr().out)["runs"]
        assert main([*shlex.split(command)[1:], "--out", str(bench / "next.html"), "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["runs"] == [replayed["run"]]


def reported(bench: Path, capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, str]:
    """Session -> model of the runs in a report."""
    run_of = {run["run"]: (run["session_name"], run["model"]) for run in runs(bench, capsys)}
    out = str(bench / "report.html")
    assert main(["report", *words, "--out", out, "--json", "--store", str(bench / "store")]) == 0
    return dict(run_of[run] for run in json.loads(capsys.readouterr().out)["runs"])


def runs(bench: Path, capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    capsys.readouterr()
    query = "SELECT run, session_name, model FROM runs ORDER BY recorded"
    assert main(["sql", query, "--json", "--store", str(bench / "store")]) == 0
    rows: list[dict[str, Any]] = json.loads(capsys.readouterr().out)["rows"]
    return rows


def refused(bench: Path, capsys: pytest.CaptureFixture[str], *words: str) -> str:
    capsys.readouterr()
    assert main(["report", *words, "--out", str(bench / "no.html"), "--store", str(bench / "store")]) == 2
    assert not (bench / "no.html").exists()
    return capsys.readouterr().err.strip()


def test_a_report_shows_the_replay_with_the_current_model_and_with_a_model_those_of_that_model(
    bench: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old, hotter = (next(run["model"] for run in some) for some in (runs(bench, capsys), runs(bench, capsys)[::-1]))
    assert old != hotter
    assert reported(bench, capsys) == {"1_first": old, "2_second": old}
    assert reported(bench, capsys, "--model", old[:8]) == {"1_first": old, "2_second": old}
    assert reported(bench, capsys, "1_first", "--model", str(bench / "motor.toml")) == {"1_first": old}
    assert reported(bench, capsys, "--model", str(bench / "hotter.toml")) == {"1_first": hotter}
    again = f"whyhot report --store {bench / 'store'} --model {bench / 'hotter.toml'}"
    assert again in (bench / "report.html").read_text(encoding="utf-8")


def test_a_model_that_a_session_was_not_replayed_with_is_refused(
    bench: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    hotter = runs(bench, capsys)[-1]["model"][:8]
    assert refused(bench, capsys, "2_second", "--model", hotter) == (
        f"session 2_second was not replayed with model servo-5kW {hotter}: `whyhot replay --store {bench / 'store'} "
        f"2_second --model {hotter}`"
    )
    unused, lost = bench / "unused.toml", bench / "lost.toml"
    assert refused(bench, capsys, "--model", str(unused)) == (
        f"--model {unused}: nothing was replayed with this motor file: whyhot replay --model {unused}"
    )
    assert refused(bench, capsys, "--model", str(lost)) == (
        f"--model {lost}: there is no such file: correct the path, or give a model id."
    )
    assert refused(bench, capsys, "d-4f0c", "--model", hotter) == (
        f"--model {hotter}: d-4f0c shows the models of its own: leave --model out."
    )
