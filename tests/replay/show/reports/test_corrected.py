"""What the bench file takes off a session is said wherever the session is shown."""

from __future__ import annotations

from pathlib import Path

import pytest

from ingest.facts.facts import at
from ingest.facts.store import Store
from made import meters
from replay.cli import main
from replay.show.reports.documents import seen
from replay.show.viewer.layers import _says

CORRECTIONS = """\
[[correction]]
cause = "sensor.winding.bias"
amount = 1.5
[[correction]]
cause = "clock.1_run.offset"
amount = 24
[[correction]]
cause = "clock.thermo.offset"
amount = 3
"""
OFF = "sensor.winding.bias 1.5 K, clock.1_run.offset 24 s"


def test_corrections_that_hold_for_a_session_are_said_where_it_is_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    meters.write(tmp_path, bench=meters.BENCH + CORRECTIONS)
    folder, page = tmp_path / "store", tmp_path / "page.html"
    store = ["--store", str(folder)]
    assert main(["ingest", str(tmp_path / "1_run.csv"), "--bench", str(tmp_path / "bench.toml"), *store]) == 0
    capsys.readouterr()
    assert main(["show", "1_run", *store]) == 0
    assert f"corrected below and in what is computed, by bench.toml: {OFF}" in " ".join(capsys.readouterr().out.split())
    assert main(["replay", "1_run", *store]) == 0
    assert main(["report", "1_run", "--out", str(page), *store]) == 0
    sentence = f"eadings and times are corrected, as the bench file says: {OFF}"
    assert f"1_run: r{sentence}" in page.read_text(encoding="utf-8")
    opened = Store.open(folder)
    facts = at(opened.ledger)
    assert f"R{sentence}." in _says(seen(opened, facts, facts.session("1_run")))
