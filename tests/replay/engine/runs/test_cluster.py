"""A real scheduler and two worker processes on loopback: the same digests, whoever is killed; what is refused."""

from __future__ import annotations

import os
import random
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from unittest.mock import patch

import pytest

from ingest.errors import StoreError
from ingest.facts import facts
from ingest.facts.store import Store
from ingest.units.each import Workers, each
from ingest.units.shared import Shared
from made import can_bench
from made.places import ROOT
from replay.cli import main
from replay.engine.runs import cluster as cluster_module
from replay.engine.runs.campaign import replay_sessions
from replay.engine.runs.cluster import cluster, installed
from replay.errors import ClusterError

SESSIONS = 4


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store of small sessions."""
    folder = tmp_path_factory.mktemp("campaign")
    can_bench.write_files(folder)
    logs = [folder / f"{i}_s1.blf" for i in range(SESSIONS)]
    for i, log in enumerate(logs):
        can_bench.write_log(log, seconds=60, seed=i, start=can_bench.START + i * 86_400)
    words = ["ingest", *map(str, logs), "--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")]
    assert main([*words, "--store", str(folder / "store")]) == 0
    return folder / "store"


def digests(folder: Path, workers: Workers | None) -> list[str]:
    with Store.open(folder, write=True) as store:
        outcomes = replay_sessions(store, facts.at(store.ledger).sessions, None, "testing", workers)
    assert [outcome.refusal for outcome in outcomes] == [None] * SESSIONS
    return [outcome.run.digest for outcome in outcomes if outcome.run]


def test_without_dask_one_line_says_what_to_install(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with patch.dict(sys.modules, {"distributed": None}):
        assert main(["replay", "--scheduler", "tcp://127.0.0.1:9", "--store", str(bench)]) == 2
    said = capsys.readouterr().err
    assert "dask distributed is not installed" in said
    assert len(said.splitlines()) == 1


@pytest.mark.parametrize("found", ["whyhot 0.0.9 (code 1f0c)", ModuleNotFoundError("No module named 'replay'")])
def test_a_worker_with_another_version_is_refused_and_both_are_named(found: str | Exception) -> None:
    with pytest.raises(ClusterError) as refused:
        cluster_module._refuse_others("tcp://h:8786", installed(), {"tcp://h:1": installed(), "tcp://h:2": found})
    assert str(refused.value).startswith("tcp://h:2: ")
    assert installed() in str(refused.value)
    assert str(found) in str(refused.value)


def test_a_worker_that_joins_with_another_version_refuses_its_job() -> None:
    with pytest.raises(ClusterError, match=r"has whyhot .*, this is another: install the same on both"):
        cluster_module._checked("another", len, "")


class Scheduler:
    """A scheduler with two workers, as docs/scale.md starts them."""

    def __init__(self, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.url = f"tcp://127.0.0.1:{port}"
        self._folder = folder
        self._programs = [self._start("scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard")]
        self.workers = [self.worker(), self.worker()]

    def worker(self) -> subprocess.Popen[bytes]:
        started = self._start("worker", self.url, "--nthreads", "1", "--no-nanny", "--no-dashboard")
        self._programs.append(started)
        return started

    def _start(self, *words: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-W", "ignore", "-m", "dask", *words]
        env = {**os.environ, "PYTHONPATH": str(ROOT)}
        with (self._folder / "said.txt").open("ab") as said:
            return subprocess.Popen(command, cwd=self._folder, env=env, stdout=said, stderr=said)

    def stop(self) -> None:
        for program in self._programs:
            with suppress(OSError):
                program.kill()
            program.wait()


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Scheduler]:
    distributed = pytest.importorskip("distributed", reason="dask distributed is not installed")
    started = Scheduler(tmp_path_factory.mktemp("dask"))
    try:
        with distributed.Client(started.url, timeout=30, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=60)
        yield started
    finally:
        started.stop()


def test_a_cluster_gives_the_digests_of_this_process_whichever_worker_is_killed(
    bench: Path, scheduler: Scheduler
) -> None:
    alone, seed = digests(bench, None), random.Random(4)
    assert digests(bench, cluster(scheduler.url)) == alone
    killer = threading.Timer(seed.uniform(0.1, 1.0), scheduler.workers[0].kill)
    killer.start()
    assert digests(bench, cluster(scheduler.url)) == alone
    killer.join()


def test_a_cluster_decodes_logs_as_this_process_does(bench: Path, scheduler: Scheduler, tmp_path: Path) -> None:
    logs = [str(bench.parent / f"{i}_s1.blf") for i in range(SESSIONS)]
    words = ["--bench", str(bench.parent / "bench.toml"), "--dbc", str(bench.parent / "bench.dbc")]
    there = str(tmp_path / "store")
    assert main(["ingest", *logs, *words, "--scheduler", scheduler.url, "--store", there]) == 0
    assert main(["rebuild", "--verify", "--scheduler", scheduler.url, "--store", there]) == 0
    made = []
    for folder in (bench, Path(there)):
        with Store.open(folder) as store:
            made.append({key: one.products for key, one in facts.at(store.ledger).decodes.items()})
    assert made[0] == made[1]
    assert len(made[0]) == SESSIONS


def test_a_worker_that_does_not_see_the_store_says_so(scheduler: Scheduler, tmp_path: Path) -> None:
    elsewhere: Shared[str] = Shared(tmp_path / ("0" * 64))
    with pytest.raises(StoreError, match=r"^worker on .*: the store must lie in a folder that every worker sees under"):
        [*each(Shared.value, [elsewhere], cluster(scheduler.url))]


def test_a_scheduler_that_goes_away_is_one_line_and_so_is_one_that_is_not_there(
    bench: Path, scheduler: Scheduler, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster_module, "WAIT_S", 1)
    monkeypatch.setattr(cluster_module, "_refuse_others", lambda *_: scheduler.stop())  # after it let us in
    for _ in ("goes away", "is not there"):
        assert main(["replay", "--scheduler", scheduler.url, "--store", str(bench)]) == 2
        said = capsys.readouterr().err
        assert said.startswith(f"--scheduler {scheduler.url}: no dask scheduler answers there")
        assert len(said.splitlines()) == 1
    assert main(["verify", "--read", "--store", str(bench)]) == 0
