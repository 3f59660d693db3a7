"""Two sessions of one point that were read differently are named in the answer, with where."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from ingest.texts.times import clock
from made import can_bench
from made.can_bench import Floats
from replay.cli import main

SECONDS = 3000


def held(seconds: int, _: int) -> tuple[Floats, Floats]:
    """One point all along."""
    return np.full(10 * seconds, 3000.0), np.full(10 * seconds, 12.0)


def test_sessions_that_contradict_each_other_are_named_with_the_moments(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(can_bench, "drive", held)
    can_bench.write_files(tmp_path)
    for number, loss in ((1, 30.0), (2, 120.0)):
        log = tmp_path / f"{number}_s1.blf"
        can_bench.write_log(log, SECONDS, number, can_bench.START + 86_400 * number, magnet_loss=loss)
        words = ["ingest", str(log), "--bench", str(tmp_path / "bench.toml"), "--dbc", str(tmp_path / "bench.dbc")]
        assert main([*words, "--store", str(tmp_path / "store")]) == 0
    asked = ["diagnose", "--on", "1_s1", "2_s1", "--store", str(tmp_path / "store")]
    capsys.readouterr()
    assert main([*asked, "--json", str(tmp_path / "answer.json")]) == 0
    answer = json.loads((tmp_path / "answer.json").read_text(encoding="utf-8"))
    (found,) = answer["contradicting"]
    assert found["sessions"] == answer["train"]
    assert found["channel"] == "TC_magnet" and found["node"] == "magnet"
    assert found["at"] == pytest.approx({"speed_rpm": 3000.0, "current_A": 12.0}, abs=0.1)
    assert found["differ_K"] < -10 and 0.5 < found["sd_K"] < 2
    text = " ".join(capsys.readouterr().out.split())
    moments = [f"{name} ({clock(t_s)})" for name, t_s in zip(answer["train_names"], found["t_s"], strict=True)]
    assert f"Contradiction {' and '.join(moments)} ran alike at 3,000 rpm and at 12 A, but TC_magnet (magnet)" in text
    assert "Not judged 2 sessions to learn from and none kept cannot say which is wrong where the two disagree" in text
