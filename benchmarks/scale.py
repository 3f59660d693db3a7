"""A campaign on several processes and on a cluster whose workers are killed: the same digests, and what it costs.

    python benchmarks/scale.py [--sessions N] [--seconds N] [--kills N] [--writers N] [--logs N] [--bucket URL]
        [--quick] [--json FILE]

Sessions of a small motor are replayed in this process, in two processes, and by a dask scheduler with two worker
processes on loopback, of which one is killed at a random moment and started anew, again and again. Without dask
(the extra `cluster`) its figures are left out. Before, the same store is moved to a bucket and back, and replayed and
asked there: on a server of the benchmark's own, of which every 10th request fails, or at the URL of a prefix that is
free (`scaled/bucket.py`).

Then several writers take logs into one store whose ledger lies in a PostgreSQL server of the benchmark's own, N logs
each; they and the server are killed meanwhile (`scaled/writers.py`). `--sessions 0` or `--writers 0` leaves a part out.
"""

from __future__ import annotations

import os
import random
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path += [str(HERE.parent), str(HERE.parent / "tests")]

from benchmarks import asked
from benchmarks.scaled.bucket import in_a_bucket
from benchmarks.scaled.writers import writers
from benchmarks.shared import stored
from ingest.facts import facts
from ingest.facts.store import Store
from ingest.units.each import Workers, processes
from made import can_bench
from replay.engine.runs.campaign import replay_sessions
from replay.engine.runs.cluster import cluster

ROOT = HERE.parent


def main() -> None:
    parser = asked.parser(__doc__, sessions=(16, 2), seconds=(600, 60), kills=(50, 1), writers=(8, 2), logs=(200, 2))
    parser.add_argument("--bucket", metavar="URL", help="s3://BUCKET/PREFIX, instead of a server of its own")
    args = parser.parse_args()
    found: dict[str, object] = {}
    with TemporaryDirectory() as made:
        if args.writers:  # first, as it forks
            found |= writers(Path(made), args.writers, args.logs, args.kills)
        if args.sessions:
            store = _campaign(Path(made), args.sessions, args.seconds)
            found |= in_a_bucket(store, args.bucket)
            found |= _replayed(Path(made), store, args.sessions, args.kills)
    for name, value in found.items():
        print(f"{name:24} {value}")
    asked.keep(found, args.json)


def _replayed(folder: Path, store: Path, sessions: int, kills: int) -> dict[str, object]:
    alone, alone_s = _timed(store, None)
    two, two_s = _timed(store, processes(2))
    found: dict[str, object] = {
        "sessions": sessions,
        "alone_s": alone_s,
        "two_processes_s": two_s,
        "equal_on_two_processes": two == alone,
    }
    return found | (_on_cluster(store, folder, alone, kills) if find_spec("distributed") else {})


def _campaign(folder: Path, sessions: int, seconds: int) -> Path:
    can_bench.write_files(folder)
    logs = [folder / f"{i}.blf" for i in range(sessions)]
    for i, log in enumerate(logs):
        can_bench.write_log(log, seconds=seconds, seed=i, start=can_bench.START + i * 86_400)
    with stored(folder, logs) as store:
        return store.folder


def _timed(folder: Path, workers: Workers | None) -> tuple[list[str], float]:
    """Digests in the order of the sessions, and seconds."""
    with Store.open(folder, write=True) as store:
        begun = time.perf_counter()
        outcomes = replay_sessions(store, facts.at(store.ledger).sessions, None, "testing", workers)
        seconds = time.perf_counter() - begun
    return [outcome.run.digest if outcome.run else str(outcome.refusal) for outcome in outcomes], round(seconds, 2)


def _on_cluster(store: Path, folder: Path, alone: list[str], kills: int) -> dict[str, object]:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    url = f"tcp://127.0.0.1:{port}"

    def dask(*words: str) -> subprocess.Popen[bytes]:
        env = {**os.environ, "PYTHONPATH": str(ROOT)}
        command = [sys.executable, "-m", "dask", *words, "--no-dashboard"]
        with (folder / "dask.txt").open("ab") as said:
            return subprocess.Popen(command, cwd=folder, env=env, stdout=said, stderr=said)

    def worker() -> subprocess.Popen[bytes]:
        return dask("worker", url, "--nthreads", "1", "--no-nanny")

    scheduler, workers = dask("scheduler", "--host", "127.0.0.1", "--port", str(port)), [worker(), worker()]
    try:
        _ready(url)
        first, _ = _timed(store, cluster(url))  # they load whyhot
        calm, calm_s = _timed(store, cluster(url))
        equal, killed_s = _killed(store, url, alone, kills, workers, worker)
    finally:
        for program in (scheduler, *workers):
            program.kill()
            program.wait()
    return {
        "cluster_s": calm_s,
        "equal_on_cluster": first == calm == alone,
        "kills": kills,
        "equal_after_kills": equal,
        "campaign_with_a_kill_s": killed_s,
    }


def _killed(
    store: Path,
    url: str,
    alone: list[str],
    kills: int,
    workers: list[subprocess.Popen[bytes]],
    worker: Callable[[], subprocess.Popen[bytes]],
) -> tuple[int, float]:
    """How many campaigns gave the digests of one process though a worker was killed in them, and their mean seconds."""
    seed, equal, spent = random.Random(1), 0, 0.0
    for _ in range(kills):
        victim = workers.pop(0)
        killer = threading.Timer(seed.uniform(0.0, 2.0), victim.kill)
        killer.start()
        digests, seconds = _timed(store, cluster(url))
        killer.join()
        victim.wait()
        equal, spent = equal + (digests == alone), spent + seconds
        workers.append(worker())
        _ready(url)
    return equal, round(spent / kills, 2)


def _ready(url: str) -> None:
    from distributed import Client

    with Client(url, timeout=60, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=60)


if __name__ == "__main__":
    main()
