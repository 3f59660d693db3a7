"""Without the folder `analytics`: logs are taken in and replayed, and what needs it says so in one line."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from made import can_bench
from made.places import ROOT
from replay.cli import main
from replay.engine.runs import sources

AGEING = "terms = [{coefficient = 12.0, ageing = {above_degC = 180.0, percent_per_100h = -3.0}}]"
NEEDED = "needs the package analytics, which is missing here or another's: install whyhot again"
Capture = pytest.CaptureFixture[str]


@pytest.fixture
def without_analytics(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """No import finds the package, and the folder that holds our packages lacks it."""
    for name in [name for name in sys.modules if name.partition(".")[0] == "analytics"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "analytics", None)
    house = tmp_path / "house"
    house.mkdir()
    for package in ("ingest", "twin", "replay", "whyhot"):
        (house / package).symlink_to(ROOT / package)
    monkeypatch.setattr(sources, "ROOT", house)
    sources.code_of.cache_clear()
    yield
    sources.code_of.cache_clear()


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two logs of one motor, and its motor file also with a link that ages."""
    can_bench.write_files(tmp_path)
    for day, name in enumerate(("1_s1.blf", "2_s1.blf")):
        can_bench.write_log(tmp_path / name, seconds=60, start=can_bench.START + 86_400 * day)
    text = (tmp_path / "motor.toml").read_text(encoding="utf-8")
    assert "terms = [{coefficient = 12.0}]" in text
    aged = text.replace("terms = [{coefficient = 12.0}]", AGEING)
    (tmp_path / "aged.toml").write_text(aged, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.usefixtures("bench", "without_analytics")
def test_logs_are_replayed_and_what_needs_analytics_says_what_is_missing(capsys: Capture) -> None:
    def answer(command: str) -> tuple[int, list[str]]:
        code = main(shlex.split(command))
        return code, capsys.readouterr().err.splitlines()

    for command in ("ingest 1_s1.blf 2_s1.blf --bench bench.toml --dbc bench.dbc", "show 1_s1", "replay"):
        assert answer(command) == (0, []), command
    for command in ('sql "SELECT 1"', "rebuild", "ageing", "replay 2_s1 --model aged.toml"):
        code, (line,) = answer(command)
        assert (code, line.startswith(f"whyhot {command.split()[0]} {NEEDED}")) == (2, True), line
    code, (line,) = answer("doctor")
    assert code == 1
    assert line.startswith("package analytics of whyhot is missing: install whyhot again")
