"""The same sessions in a store with its files in its folder and in one with them in a bucket: digests, and what it
costs."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from typing import TypeVar

from analytics import query, warehouse
from ingest.facts import facts
from ingest.facts.move_files import HERE, move_files
from ingest.facts.store import Store
from made.bucket import KEYS, bucket_server
from made.lines_of_damage import damage
from replay.engine.runs.campaign import replay_sessions

T = TypeVar("T")
STUMBLES = ("503", "cut")  # what the server does to every 10th request that reads or puts
ASKED = "SELECT session_name, channel, count(*), sum(value) FROM samples GROUP BY ALL ORDER BY ALL"


def in_a_bucket(store: Path, url: str | None) -> dict[str, object]:
    """Move a copy of the store in `store` to the bucket at `url`, or to a server of the benchmark's own that stumbles,
    replay and ask both, check every byte, and move it back."""
    moved = store.with_name("moved")
    shutil.copytree(store, moved)
    with ExitStack() as until:
        if url is None:
            os.environ.update(KEYS)
            server = until.enter_context(bucket_server())
            url, asked = server.url(), count(1)

            def stumble(method: str, key: str) -> str | None:
                number = next(asked)
                return STUMBLES[number // 10 % 2] if number % 10 == 0 and method in ("GET", "PUT") else None

            server.fault = stumble
        _, move_s = _timed(lambda: move_files(moved, url))
        here, here_s = _timed(lambda: _replayed(store))
        there, there_s = _timed(lambda: _replayed(moved))
        rows, sql_here_s = _timed(lambda: _answer(store))
        same, sql_there_s = _timed(lambda: _answer(moved))
        with Store.open(moved) as opened:
            damages, verify_s = _timed(lambda: len(damage(opened)))
        _, back_s = _timed(lambda: move_files(moved, HERE))
        with Store.open(moved) as opened:
            damages += len(damage(opened))
    return {
        "bucket_move_s": move_s,
        "bucket_back_s": back_s,
        "bucket_replay_s": there_s,
        "folder_replay_s": here_s,
        "bucket_sql_s": sql_there_s,
        "folder_sql_s": sql_here_s,
        "bucket_verify_s": verify_s,
        "bucket_damages": damages,
        "equal_in_a_bucket": (here, rows) == (there, same),
    }


def _timed(work: Callable[[], T]) -> tuple[T, float]:
    begun = time.perf_counter()
    done = work()
    return done, round(time.perf_counter() - begun, 2)


def _replayed(folder: Path) -> list[str]:
    with Store.open(folder, write=True) as store:
        found = replay_sessions(store, facts.at(store.ledger).sessions, None, "testing")
    return [one.run.digest if one.run else str(one.refusal) for one in found]


def _answer(folder: Path) -> object:
    with Store.open(folder) as store, warehouse.refresh(store) as opened:
        return query.run(opened.connection, ASKED).rows
