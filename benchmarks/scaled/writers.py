"""Several writers at one store whose ledger lies in a PostgreSQL server, killed again and again, and the server too."""

from __future__ import annotations

import random
import sys
import time
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from benchmarks.attack.children import KILLED, ended, killed_within, started
from ingest.errors import LedgerError
from ingest.facts import facts
from ingest.facts.events import DecodeCompleted, RawFileSealed
from ingest.facts.move import move
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import take_in
from ingest.intake.setup import MotorFile, prepare
from made.lines_of_damage import damage
from made.postgres import PostgresServer, postgres, why_none
from made.tables import ONE_CHANNEL

FIGURES = ("writers_s", "clients_killed", "server_killed", "writers_lost", "writers_doubled", "writers_damages")
EQUAL = "equal_to_one_writer"
AT_ONCE = 20  # logs that one command takes in
RUN = 4  # logs of one run, which different writers take in


def writers(folder: Path, count: int, each: int, kills: int) -> dict[str, object]:
    """`count` processes take in `each` logs, `kills` of them are killed, and before each third kill the server. What
    they left is compared with what one writer makes of all logs."""
    if why := why_none():
        return dict.fromkeys((*FIGURES, EQUAL), f"left out: {why}")
    logs = _logs(folder, count * each)
    alone, shared = folder / "alone", folder / "shared"
    for store in (alone, shared):
        Store.open(store, create=True).close()
    begun = time.perf_counter()
    ended(started(partial(_take, alone, logs)))
    alone_s = time.perf_counter() - begun
    with postgres() as server:
        move(shared, server.url)
        begun = time.perf_counter()
        clients = _killed(server, shared, [logs[first::count] for first in range(count)], kills)
        seconds = time.perf_counter() - begun
        found = _left(shared, logs)
        equal = _known(shared) == _known(alone)
    return {
        "one_writer_s": round(alone_s, 1),
        "writers_s": round(seconds, 1),
        "clients_killed": clients,
        "server_killed": kills // 3,
        **found,
        EQUAL: equal,
    }


def _logs(folder: Path, count: int) -> list[Path]:
    """Logs of 2 minutes; those of a run follow each other, and are one session."""
    (folder / "bench.toml").write_text(ONE_CHANNEL)
    logs = [folder / f"{k}.csv" for k in range(count)]
    for k, log in enumerate(logs):
        begin = 1_760_000_000 + k // RUN * 86_400 + k % RUN * 120
        stamps = (time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(begin + s)) for s in range(0, 91, 10))
        log.write_text("\n".join(["time,T", *(f"{stamp},{20 + i + k % 7}" for i, stamp in enumerate(stamps))]) + "\n")
    return logs


def _take(folder: Path, logs: Sequence[Path]) -> int:
    """Take in the logs, a command for a few each; 2 where the server is away."""
    try:
        for first in range(0, len(logs), AT_ONCE):
            paths = logs[first : first + AT_ONCE]
            with Store.open(folder, write=True) as store:
                take_in(store, paths, prepare(paths, paths[0].with_name("bench.toml"), [], _no_motor), Override())
    except LedgerError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def _no_motor(path: Path) -> MotorFile:
    raise AssertionError(f"{path} should not be read")


def _killed(server: PostgresServer, folder: Path, jobs: Sequence[Sequence[Path]], kills: int) -> int:
    """Do all jobs at once, and those again that were killed or found no server. Returns how many were killed."""
    chance, said, clients = random.Random(1), folder.with_name("said.txt"), 0
    running = {started(partial(_take, folder, job), said): job for job in jobs}
    for number in range(1, kills + 1):
        pid = chance.choice(sorted(running))
        job = running.pop(pid)
        if number % 3 == 0:
            time.sleep(chance.uniform(0.2, 3.0))
            server.stop()
            server.start()
        clients += killed_within(pid, chance.uniform(0.2, 3.0)) == KILLED
        running[started(partial(_take, folder, job), said)] = job
    while running:
        pid, job = running.popitem()
        if ended(pid):
            running[started(partial(_take, folder, job), said)] = job
    return clients


def _left(folder: Path, logs: Sequence[Path]) -> dict[str, object]:
    with Store.open(folder) as store:
        damages, recorded = damage(store), store.ledger.events()
    sealed = Counter(one.event.name for one in recorded if isinstance(one.event, RawFileSealed))
    decoded = Counter(one.event.decode for one in recorded if isinstance(one.event, DecodeCompleted))
    return {
        "writers_lost": len({log.name for log in logs} - set(sealed)),
        "writers_doubled": sealed.total() + decoded.total() - len(sealed) - len(decoded),
        "writers_damages": len(damages),
    }


def _known(folder: Path) -> tuple[list[str], dict[str, DecodeCompleted]]:
    with Store.open(folder) as store:
        known = facts.at(store.ledger)
        return sorted(one.session for one in known.sessions), dict(known.decodes)
