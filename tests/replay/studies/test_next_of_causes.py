"""What the verbs about a cause say is next runs as it is printed."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from made.fleet import Fleet
from made.onward import followed
from replay.show.viewer import program


def test_every_next_command_about_a_cause_runs_as_it_is_printed(
    fleet: Fleet, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the diagnosis on; of the viewer, the files that it would show."""
    shutil.copytree(fleet.store, tmp_path / "the store")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("WHYHOT_STORE", "the store")
    viewed: list[Path] = []
    monkeypatch.setattr(program, "view", viewed.extend)
    name = f"d-{fleet.diagnosis[:8]}"
    begin = [
        ["diagnose", "--on", "b_1", "b_2"],
        ["seen", name],
        ["bisect", "TC_magnet", "--specimen", "servo-01"],
        ["review", name],
        ["calibrate", "--on", "c_1", "c_2"],
    ]
    by = followed(begin, capsys)
    assert {verb for verb, said in by.items() if said} >= {*(words[0] for words in begin), "accept"}
    assert viewed
