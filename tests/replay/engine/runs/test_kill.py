"""Killed at any moment, the store stays whole, and the same commands finish what was begun."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from ingest.facts import facts
from ingest.facts.store import Store
from ingest.facts.store_check import damage
from made import can_bench
from replay.cli import main

KILLS = 6
CODE = "import sys; from replay.cli import main; sys.exit(main(sys.argv[1:]))"


@pytest.mark.skipif(os.name == "nt", reason="no SIGKILL on Windows")
def test_ingest_and_replay_survive_a_kill_at_any_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    can_bench.write_files(tmp_path)
    for k in range(3):
        can_bench.write_log(tmp_path / f"{k}.blf", seconds=60, seed=k, start=can_bench.START + 10_000 * k)
    ingest = ["ingest", "0.blf", "1.blf", "2.blf", "--bench", "bench.toml", "--dbc", "bench.dbc"]
    delays = np.random.default_rng(1).uniform(0.3, 3.0, KILLS)
    for k, delay in enumerate(delays):
        words = ingest if k % 2 == 0 else ["replay"]
        with subprocess.Popen(
            [sys.executable, "-c", CODE, *words],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        ) as process:
            time.sleep(delay)
            os.killpg(process.pid, signal.SIGKILL)
        if Path("whyhot-store/store.json").exists():
            with Store.open(Path("whyhot-store")) as store:
                assert damage(store) == [], f"seed 1, kill {k} after {delay:.2f} s"
    assert main(ingest) == 0
    assert main(["replay"]) == 0
    with Store.open(Path("whyhot-store")) as store:
        assert damage(store) == []
        known = facts.at(store.ledger)
        assert len(known.sessions) == 3
        assert {run.session for run in known.runs.values()} == {session.session for session in known.sessions}
