"""All that goes past one process and one bench, in one run: workers that are killed, a ledger in a server, files in a
bucket, a thousand sessions, a fleet, and a store as it grows. The same digests, and what each costs.

    python benchmarks/scale.py [--sessions N] [--seconds N] [--kills N] [--writers N] [--logs N] [--wltp N]
        [--motors N] [--stored N] [--bucket URL] [--quick] [--json FILE]

Sessions of a small motor are replayed in this process, in two processes, and by a dask scheduler with two worker
processes on loopback, of which one is killed at a random moment and started anew, again and again; then a store of its
own ingests their logs on that cluster, and reads every byte again, while workers are killed in the same way. Without
dask (the extra `cluster`) its figures are left out. Before, the same store is moved to a bucket and back, and replayed
and asked there: on a server of the benchmark's own, of which every 10th request fails, or at the URL of a prefix that
is free (`scaled/bucket.py`).

Then several writers take logs into one store whose ledger lies in a PostgreSQL server of the benchmark's own, N logs
each; they and the server are killed meanwhile (`scaled/writers.py`). `--wltp`: sessions of a motor of 21 nodes,
replayed with filter and smoother (`scaled/campaign.py`); `--motors`: the largest fleet that is taken in and asked
(`fleet_growth.py`, which also has it assessed); `--stored`: the largest store on which each verb is timed (`store.py`).
0 of `--sessions`, `--writers`, `--wltp`, `--motors` or `--stored` leaves that part out.
"""

from __future__ import annotations

import os
import random
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from itertools import count, cycle
from pathlib import Path
from tempfile import TemporaryDirectory

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path += [str(HERE.parent), str(HERE.parent / "tests")]

from benchmarks import asked, fleet_growth, store
from benchmarks.scaled.bucket import in_a_bucket
from benchmarks.scaled.campaign import wltp_campaign
from benchmarks.scaled.writers import writers
from benchmarks.shared import stored
from ingest.facts import facts
from ingest.facts.store import Store
from ingest.facts.store_check import check
from ingest.units.each import Workers, processes
from made import can_bench
from replay.engine.runs.campaign import replay_sessions
from replay.engine.runs.cluster import cluster

ROOT = HERE.parent


def main() -> None:
    parser = asked.parser(
        __doc__,
        sessions=(16, 2),
        seconds=(600, 60),
        kills=(50, 1),
        writers=(8, 2),
        logs=(200, 2),
        wltp=(1000, 1),
        motors=(100_000, 0),  # as small ones, `fleet_growth.py` and `store.py` are run by themselves
        stored=(20_000, 0),
    )
    parser.add_argument("--bucket", metavar="URL", help="s3://BUCKET/PREFIX, instead of a server of its own")
    args = parser.parse_args()
    found: dict[str, object] = {}
    with TemporaryDirectory() as place:
        made = Path(place)
        if args.writers:  # first, as it forks
            found |= writers(made, args.writers, args.logs, args.kills)
        if args.sessions:
            folder = _campaign(made, args.sessions, args.seconds)
            found |= in_a_bucket(folder, args.bucket)
            found |= _replayed(made, folder, args.sessions, args.kills)
        if args.wltp:
            found |= wltp_campaign(made / "wltp", args.wltp, args.seconds)
        if args.motors:
            found |= _fleets(made, args.motors)
        if args.stored:
            found |= _growth(args.stored)
    for name, value in found.items():
        print(f"{name:24} {value}")
    asked.keep(found, args.json)


def _replayed(made: Path, folder: Path, sessions: int, kills: int) -> dict[str, object]:
    alone, alone_s = _timed(folder, None)
    two, two_s = _timed(folder, processes(2))
    found: dict[str, object] = {
        "sessions": sessions,
        "alone_s": alone_s,
        "two_processes_s": two_s,
        "equal_on_two_processes": two == alone,
    }
    return found | (_on_cluster(folder, made, alone, kills) if find_spec("distributed") else {})


def _fleets(made: Path, motors: int) -> dict[str, object]:
    """What fleets of each size cost: taken in, and asked beside a plain read."""
    found: dict[str, object] = {}
    for size in fleet_growth.sizes(motors):
        taken = fleet_growth.of_fleet(made / f"whole{size}", size, assessed=False)["ingest"]
        found[f"fleet_{size}_ingest_s"] = round(taken["busy_s"], 2)
        views = fleet_growth.of_views(made / f"views{size}", size)
        found |= {
            f"fleet_{size}_{view}_times_read": round(of["times_read"], 2)
            for view, of in views.items()
            if view != "motors"
        }
    return found


def _growth(most: int) -> dict[str, object]:
    """Each verb on a store of so many sessions, as a ratio to one of a hundredth."""
    least = max(most // 100, 2)
    times = store.run([least, most], rounds=1 if most < 100 else 5)["times"][most]
    return {f"store_{most}_{verb}_times_{least}": round(ratio, 2) for verb, ratio in times.items()}


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


def _on_cluster(folder: Path, made: Path, alone: list[str], kills: int) -> dict[str, object]:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    url = f"tcp://127.0.0.1:{port}"

    def dask(*words: str) -> subprocess.Popen[bytes]:
        env = {**os.environ, "PYTHONPATH": str(ROOT)}
        command = [sys.executable, "-m", "dask", *words, "--no-dashboard"]
        with (made / "dask.txt").open("ab") as said:
            return subprocess.Popen(command, cwd=made, env=env, stdout=said, stderr=said)

    def worker() -> subprocess.Popen[bytes]:
        return dask("worker", url, "--nthreads", "1", "--no-nanny")

    scheduler, workers = dask("scheduler", "--host", "127.0.0.1", "--port", str(port)), [worker(), worker()]
    try:
        _ready(url)
        first, _ = _timed(folder, cluster(url))  # they load whyhot
        calm, calm_s = _timed(folder, cluster(url))
        killed = _killed(_works(folder, made), url, kills, workers, worker)
    finally:
        for program in (scheduler, *workers):
            program.kill()
            program.wait()
    return {"cluster_s": calm_s, "equal_on_cluster": first == calm == alone, "kills": kills, **killed}


Work = Callable[[Workers | None], list[str]]


def _works(folder: Path, made: Path) -> dict[str, Work]:
    """What workers are killed in, by its verb: each gives lines that are the same wherever it ran."""
    logs, stores = sorted(made.glob("*.blf")), count()

    def replayed(workers: Workers | None) -> list[str]:
        return _timed(folder, workers)[0]

    def ingested(workers: Workers | None) -> list[str]:
        with stored(made, logs, made / f"ingested{next(stores)}", workers) as new:
            return sorted(f"{one.decode} {one.products}" for one in facts.at(new.ledger).decodes.values())

    def verified(workers: Workers | None) -> list[str]:
        with Store.open(folder) as there:
            found = check(there, workers=workers)
        return [*map(str, found.damages), *found.hints, str(found.whole)]

    return {"replay": replayed, "ingest": ingested, "verify": verified}


def _killed(
    works: Mapping[str, Work],
    url: str,
    kills: int,
    workers: list[subprocess.Popen[bytes]],
    worker: Callable[[], subprocess.Popen[bytes]],
) -> dict[str, object]:
    """A worker is killed in each work in turn: how often each gave what it gives in one process, and mean seconds."""
    seed, equal, spent = random.Random(1), dict.fromkeys(works, 0), 0.0
    turns = [verb for _, verb in zip(range(kills), cycle(works), strict=False)]
    alone = {verb: works[verb](None) for verb in set(turns)}
    for verb in turns:
        victim = workers.pop(0)
        killer = threading.Timer(seed.uniform(0.0, 2.0), victim.kill)
        killer.start()
        begun = time.perf_counter()
        equal[verb] += works[verb](cluster(url)) == alone[verb]
        spent += time.perf_counter() - begun
        killer.join()
        victim.wait()
        workers.append(worker())
        _ready(url)
    of_each = {f"{verb}_equal_after_kills": f"{equal[verb]} of {turns.count(verb)}" for verb in works}
    return {
        "equal_after_kills": sum(equal.values()),
        **of_each,
        "campaign_with_a_kill_s": round(spent / kills, 2),
    }


def _ready(url: str) -> None:
    from distributed import Client

    with Client(url, timeout=60, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=60)


if __name__ == "__main__":
    main()
