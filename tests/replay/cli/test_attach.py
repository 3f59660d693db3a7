"""`whyhot attach`, and what other verbs then say of it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from replay.cli import main


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A store with one session of stator-07, and a photograph."""
    log = tmp_path / "oven_1.csv"
    log.write_text("time,winding [degC]\n2025-12-23T08:00:00Z,230\n2025-12-23T20:00:00Z,230\n", encoding="utf-8")
    (tmp_path / "end.jpg").write_bytes(b"\xff\xd8 a picture")
    words = ["ingest", str(log), "--specimen", "stator-07", "--kind", "ageing"]
    assert main([*words, "--store", str(tmp_path / "store")]) == 0
    return tmp_path


def attach(folder: Path, *words: str) -> int:
    return main(["attach", str(folder / "end.jpg"), *words, "--store", str(folder / "store")])


CRACK = ("--specimen", "stator-07", "--finding", "resin cracked at slot 3")


def test_a_photograph_is_attached_once_and_found_in_show_and_sql(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    assert attach(folder, *CRACK, "--session", "oven_1") == 0
    said = capsys.readouterr()
    assert said.out.splitlines()[:2] == ["Specimen          stator-07", "Finding           resin cracked at slot 3"]
    assert "Sealed            end.jpg" in said.out and said.err == ""
    assert attach(folder, *CRACK, "--session", "oven_1", "--json") == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["schema"], [one["written"] for one in answer["inspections"]]) == ("whyhot.attach/1", [False])
    assert main(["show", "oven_1", "--store", str(folder / "store")]) == 0
    assert "end.jpg: resin cracked at slot 3" in capsys.readouterr().out
    assert main(["sql", "SELECT happened, finding FROM inspections", "--store", str(folder / "store"), "--csv"]) == 0
    assert "2025-12-23T20:00:00Z,resin cracked at slot 3" in capsys.readouterr().out.replace(" 20:", "T20:")
    assert main(["verify", "--read", "--store", str(folder / "store")]) == 0


def test_a_specimen_that_no_session_has_is_pointed_out(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert attach(folder, "--specimen", "stator-7", "--finding", "crack", "--when", "2025-12-24T08:00:00Z") == 0
    line = 'specimen "stator-7": no session of it is in this store yet. Nearest: stator-07.\n'
    assert capsys.readouterr().err == line


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ((*CRACK, "--when", "yesterday"), '--when "yesterday": is no time: write it as 2025-12-24T08:00:00Z'),
        ((*CRACK, "--session", "oven_2"), "session 'oven_2': is not in this store. Nearest: oven_1."),
    ],
)
def test_what_cannot_be_placed_is_refused_in_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], line: str
) -> None:
    capsys.readouterr()
    assert attach(folder, *words) == 2
    said = capsys.readouterr().err
    assert said.startswith(line) and said.count("\n") == 1


def test_a_time_and_a_session_at_once_are_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        attach(folder, *CRACK, "--session", "oven_1", "--when", "2025-12-24")
    assert ended.value.code == 2
    assert "not allowed with argument" in capsys.readouterr().err
