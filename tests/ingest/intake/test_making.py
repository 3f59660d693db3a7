"""Logs read and decoded by workers: the same files as in this process, and what a worker that ends costs."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from ingest.facts import facts
from ingest.facts.durable import sha256_of
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import Intake, take_in
from ingest.intake.making import redecode
from ingest.intake.setup import prepare
from ingest.units.each import Lost, Workers
from made import can_bench
from replay.engine.files.models import for_intake

DEADLY = "1_s1.blf"


class Mortal(ThreadPoolExecutor):
    """Workers that end whenever they are given the log DEADLY."""

    def submit(self, work: Callable[..., Any], job: Any, /) -> Future[Any]:  # type: ignore[override]
        if job.done.log.path.name != DEADLY:
            return super().submit(work, job)
        ended: Future[Any] = Future()
        ended.set_exception(BrokenProcessPool())
        return ended


def threads(jobs: int) -> Executor:
    return ThreadPoolExecutor(2)


def mortal(jobs: int) -> Executor:
    return Mortal(2)


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("logs")
    can_bench.write_files(folder)
    paths = [folder / f"{i}_s1.blf" for i in range(3)]
    for i, path in enumerate(paths):
        can_bench.write_log(path, seconds=20, seed=i, start=can_bench.START + i * 86_400)
    broken = folder / "broken.csv"
    broken.write_text("no log\n", encoding="utf-8")
    return [*paths, broken]


def taken(
    store: Store, logs: list[Path], workers: Workers | None, tell: Callable[[str], None] = lambda _: None
) -> Intake:
    folder = logs[0].parent
    setup = prepare(logs, folder / "bench.toml", [folder / "bench.dbc"], for_intake)
    return take_in(store, logs, setup, Override(), tell, workers=workers)


def made(store: Store) -> dict[str, str]:
    """Each file of each decode with its SHA-256."""
    return {
        f"{decode}/{name}": sha256_of(store.decoded(decode) / name)
        for decode, one in facts.at(store.ledger).decodes.items()
        for name in one.products
    }


def test_workers_make_the_files_of_this_process_and_again_from_sealed_bytes(logs: list[Path], tmp_path: Path) -> None:
    found = []
    for name, workers in (("here", None), ("there", Workers(threads))):
        with Store.open(tmp_path / name, create=True, write=True) as store:
            intake = taken(store, logs, workers)
            assert [one.name for one in intake.files] == [log.name for log in logs]
            assert [line.split(":")[0] for line in intake.refusals] == ["broken.csv"]
            found.append(made(store))
            shutil.rmtree(tmp_path / name / "decoded" / next(iter(found[0])).split("/")[0])
            told: list[str] = []
            redecode(store, facts.at(store.ledger), workers, told.append)
            found.append(made(store))
            counts = [line.partition(": ")[0] for line in told]
            assert counts == [f"made again {number} of {len(told)}" for number in range(1, len(told) + 1)] != []
    assert len(found[0]) >= len(logs) - 1
    assert found == [found[0]] * 4


def test_a_log_at_which_workers_end_is_quarantined_and_stops_no_other(logs: list[Path], tmp_path: Path) -> None:
    with Store.open(tmp_path / "store", create=True, write=True) as store:
        intake = taken(store, logs[:3], Workers(mortal))
        assert intake.refusals == [f"{DEADLY}: {Lost.why}"]
        assert [one.decode.outcome for one in intake.files if one.decode] == ["decoded", "quarantined", "decoded"]
        assert len(intake.sessions) == 2
        said: list[str] = []
        again = taken(store, logs[:3], None, said.append)
        assert again.refusals == []
        assert [line.split(",")[0] for line in said] == [f"{what} 1 of 1: {DEADLY}" for what in ("reading", "decoding")]
        assert len(facts.at(store.ledger).sessions) == 3


def test_bytes_of_another_writer_are_what_is_named_from_then_on(
    logs: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def again() -> int:
        """What lies there is what is named; the number of events."""
        redecode(store, facts.at(store.ledger))
        decodes = facts.at(store.ledger).decodes
        named = {f"{key}/{name}": sha256 for key, one in decodes.items() for name, sha256 in one.products.items()}
        assert made(store) == named
        return store.ledger.head().position

    with Store.open(tmp_path / "store", create=True, write=True) as store:
        taken(store, logs[:1], None)
        first, events = made(store), store.ledger.head().position
        assert again() == events, "the same bytes are no news"
        true = pq.ParquetWriter
        other = {"compression": "snappy", "compression_level": None}
        monkeypatch.setattr(pq, "ParquetWriter", lambda *args, **named: true(*args, **{**named, **other}))
        assert again() == events + 1
        assert {name for name, sha256 in made(store).items() if sha256 != first[name]} == {
            name for name in first if name.endswith(".parquet")
        }
        assert again() == events + 1
