"""What is attacked: a store of a few events, and a test bench's with two logs and a replay."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterator
from pathlib import Path

from benchmarks.attack.children import Verb
from ingest.facts import facts
from ingest.facts.chain import Head
from ingest.facts.events import RawFileSealed
from ingest.facts.store import Store
from ingest.facts.store_check import check
from made import can_bench
from made.events import decode

INGEST = ("ingest", "--bench", "bench.toml", "--dbc", "bench.dbc")
WRITING = {  # verb -> its words, in a folder of `bench`
    "ingest": (*INGEST, "3_s2.csv"),
    "replay": ("replay", "2_drive"),
    "retract": ("retract", "1_s1", "--reason", "the wrong motor"),
    "forget": ("forget", "1_s1.blf", "--reason", "the contract ended"),
    "correct": ("correct", "1_s1", "--specimen", "servo-02", "--reason", "misread"),
    "attach": ("attach", "motor.toml", "--specimen", "servo-01", "--finding", "crack"),
    "rebuild": ("rebuild",),
    "backup": ("backup", "copy"),
    "restore": ("restore", "copy", "--store", "new"),
}


def put(store: Store, text: str) -> None:
    """One command's worth: a sealed log, its product, the events of both; all is on disk when this returns."""
    sha256 = store.archive.seal(text.encode() * 50)
    made = store.work()
    (made / "recording.mcap").write_text(text)
    products = {"recording.mcap": hashlib.sha256(text.encode()).hexdigest()}
    done = decode(f"d{sha256[:16]}", sha256, products=products)
    store.publish(made, done.decode)
    sealed = RawFileSealed(sha256=sha256, name=text, size=50 * len(text), format=None)
    store.ledger.append_all([(f"file-{sha256}", sealed), (f"file-{sha256}", done)])


def filled(folder: Path, count: int) -> Head:
    """A new store in `folder` with so many logs; its head."""
    with Store.open(folder, create=True) as store:
        for number in range(count):
            put(store, f"log-{number}")
    return head(folder)


def names(folder: Path) -> list[str]:
    """The logs of a store, in the order of its events."""
    with Store.open(folder) as store:
        return [one.event.name for one in store.ledger.events(RawFileSealed) if isinstance(one.event, RawFileSealed)]


def head(folder: Path) -> Head:
    """What its ledger ends with."""
    with Store.open(folder) as store:
        return store.ledger.head()


def damages(folder: Path, since: Head | None = None) -> list[str]:
    """What `verify --read` finds, a line each; nothing where a stopped command had not made the store yet."""
    if not (folder / "store.json").exists():
        return []
    with Store.open(folder) as store:
        return [one.says for one in check(store, since=since).damages]


def write_bench(folder: Path) -> None:
    """Motor, bench and database files and three logs: two on CAN, and a table that is not ingested yet."""
    can_bench.write_files(folder)
    can_bench.write_log(folder / "1_s1.blf", seconds=60, seed=1)
    can_bench.write_log(folder / "2_drive.asc", seconds=60, seed=2, start=can_bench.START + 86_400)
    write_table(folder / "3_s2.csv", 40)


def write_table(path: Path, rows: int, seed: int = 0) -> None:
    """A table with a row a second."""
    speed, current = can_bench.drive(rows, seed)
    temperatures = can_bench.truth(speed, current, 30.0)
    lines = ["time,MotorSpeed,MotorTorque,PhaseCurrent,TC_winding,TC_yoke,TC_magnet,TC_coolant"]
    for k in range(rows):
        drive = f"{speed[10 * k]},{0.8 * current[10 * k]:.3f},{current[10 * k]}"
        lines.append(f"{k},{drive},{','.join(f'{value:.4f}' for value in temperatures[k])},30")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def make_bench(folder: Path) -> Path:
    """`write_bench`, both logs on CAN ingested and one of them replayed, a backup beside. Returns the folder.

    Raises RuntimeError where a command fails.
    """
    folder.mkdir()
    write_bench(folder)
    for words in ([*INGEST, "1_s1.blf", "2_drive.asc"], ["replay", "1_s1"], ["backup", "copy"]):
        code, said = Verb(words, folder).ended()
        if code:
            raise RuntimeError(f"{words}: {code}: {said}")
    return folder


def copied(bench: Path, to: Path) -> Path:
    """A copy of that folder, whatever lay there before."""
    shutil.rmtree(to, ignore_errors=True)
    return shutil.copytree(bench, to, symlinks=True)


def meaning(folder: Path) -> list[str]:
    """What a store says, without the times and numbers of its events: logs, samples, sessions, runs, what was taken
    back."""
    with Store.open(folder) as store:
        return sorted(_facts(store))


def _facts(store: Store) -> Iterator[str]:
    known = facts.at(store.ledger)
    yield from (f"log {one.sha256} {one.name}" for one in known.files.values())
    for one in known.decodes.values():
        yield f"decode {one.decode} {one.outcome} {one.balance} {one.products}"
    for session in known.sessions:
        yield f"session {session.session} {session.name} {session.kind} {session.specimen}"
    yield from (f"run {run.run} {run.digest}" for run in known.runs.values())
    yield from (f"taken back {stream}" for stream in known.retractions)
    yield from (f"inspection {one}" for one in known.inspections)
    yield from (f"there {path.name}" for path in (store.folder / "decoded").glob("*/*"))
    yield from (f"gone {sha256}" for sha256 in store.forgotten.files if not store.archive.has(sha256))
