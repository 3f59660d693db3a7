"""What is attacked: a store of a few events, a test bench's with two logs and a replay; verbs that write or read."""

from __future__ import annotations

import hashlib
import random
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.attack.children import Verb
from ingest.facts import facts
from ingest.facts.chain import Head
from ingest.facts.events import RawFileSealed
from ingest.facts.store import Store
from ingest.facts.store_check import check
from ingest.log import decode
from made import can_bench, events

INGEST = ("ingest", "--bench", "bench.toml", "--dbc", "bench.dbc")
CALIBRATE = ("calibrate", "--on", "1_s1", "2_drive")
DIAGNOSE = ("diagnose", "--on", "4_learn", "--hold-out", "5_kept")
DIAGNOSIS = "DIAGNOSIS"  # among a verb's words: the id of the only diagnosis in the store
CHECKS = """\
schema = "whyhot.bench/1"
specimen_column = "specimen"
batch_column = "batch"
kind = "dc_check"
[[channel]]
signal = "dose_h"
quantity = "dose"
unit = "h"
[[channel]]
signal = "R_th"
quantity = "thermal_resistance"
unit = "K/W"
"""


@dataclass(frozen=True)
class Attacked:
    """A verb: its words, in a folder of `bench` to whose store `before` was done."""

    words: Sequence[str]
    before: Callable[[Path], object] = lambda folder: None

    def prepared(self, folder: Path) -> Verb:
        """The verb in that folder, after `before`. Raises RuntimeError where a command fails."""
        self.before(folder)
        return Verb([_diagnosis(folder) if word == DIAGNOSIS else word for word in self.words], folder)


def _diagnosis(folder: Path) -> str:
    with Store.open(folder / "store") as store:
        (name,) = facts.at(store.ledger).diagnoses
    return name


def _done(folder: Path, *commands: Sequence[str], before: Callable[[], object] = lambda: None) -> None:
    """Commands in a folder. Raises RuntimeError where one fails."""
    for words in commands:
        code, said = Verb(words, folder).ended(before)
        if code:
            raise RuntimeError(f"{' '.join(words)}: {code}: {said}")


def _exchanged(folder: Path, *more: Sequence[str]) -> None:
    """Two sessions long enough for a diagnosis, whose sensors at yoke and magnet are exchanged."""
    for name, seed in (("4_learn.csv", 3), ("5_kept.csv", 4)):
        write_table(folder / name, 960, seed, ("winding", "magnet", "yoke"))
    _done(folder, ("ingest", "--bench", "bench.toml", "4_learn.csv", "5_kept.csv"), *more)


def _checked(folder: Path) -> None:
    """DC checks of three specimens, evaluated elsewhere."""
    rows = [f"S{one},B1,{300 * check},{0.2 + 0.01 * check * one}" for one in range(3) for check in range(4)]
    (folder / "checks.csv").write_text("\n".join(["specimen,batch,dose_h,R_th", *rows]) + "\n", encoding="utf-8")
    (folder / "checks.toml").write_text(CHECKS, encoding="utf-8")
    _done(folder, ("ingest", "--bench", "checks.toml", "checks.csv"))


def _by_another_version(folder: Path) -> None:
    """A log whose samples another decoder made than this version's."""
    _done(folder, (*INGEST, "3_s2.csv"), before=lambda: setattr(decode, "DECODER", "whyhot-decoder/0"))


def _stale(folder: Path) -> None:
    """A calibration of two sessions, of which one was taken back since."""
    _done(folder, CALIBRATE, ("retract", "2_drive", "--reason", "the wrong motor"))


WRITING = {
    "ingest": Attacked((*INGEST, "3_s2.csv")),
    "morning": Attacked(("morning", "3_s2.csv", "--bench", "bench.toml", "--ingest")),
    "replay": Attacked(("replay", "2_drive")),
    "calibrate": Attacked(CALIBRATE),
    "diagnose": Attacked(DIAGNOSE, _exchanged),
    "accept": Attacked(("accept", DIAGNOSIS), lambda folder: _exchanged(folder, DIAGNOSE)),
    "ageing": Attacked(("ageing",), _checked),
    "stale": Attacked(("stale", "--redo"), _stale),
    "retract": Attacked(("retract", "1_s1", "--reason", "the wrong motor")),
    "forget": Attacked(("forget", "1_s1.blf", "--reason", "the contract ended")),
    "correct": Attacked(("correct", "1_s1", "--specimen", "servo-02", "--reason", "misread")),
    "attach": Attacked(("attach", "crack.jpg", "--specimen", "servo-01", "--finding", "crack")),
    "upgrade": Attacked(("upgrade",), _by_another_version),
    "rebuild": Attacked(("rebuild",)),
    "backup": Attacked(("backup", "copy"), lambda folder: _done(folder, (*INGEST, "3_s2.csv"))),
    "restore": Attacked(("restore", "copy", "--store", "new")),
}
READING = {
    "status": Attacked(()),
    "sessions": Attacked(("sessions",)),
    "show": Attacked(("show", "1_s1")),
    "export": Attacked(("export", "1_s1", "--to", "csv")),
    "sql": Attacked(("sql", "SELECT channel, count(*), sum(value) FROM samples GROUP BY ALL ORDER BY ALL")),
    "lineage": Attacked(("lineage", "1_s1")),
    "verify": Attacked(("verify", "--read")),
    "head": Attacked(("head",)),
    "inspect": Attacked(("inspect", "3_s2.csv")),
    "report": Attacked(("report", "1_s1")),
    "index": Attacked(("index", "--out", "pages")),
    "as of": Attacked(("show", "1_s1", "--as-of", "11")),
    "look": Attacked(("morning", "3_s2.csv", "--bench", "bench.toml")),
    "motor": Attacked(("motor", "check", "motor.toml")),
}
VERBS = {**WRITING, **READING}


def put(store: Store, text: str) -> None:
    """One command's worth: a sealed log, its product, the events of both; all is on disk when this returns."""
    sha256 = store.archive.seal(text.encode() * 50)
    made = store.work()
    (made / "recording.mcap").write_text(text)
    products = {"recording.mcap": hashlib.sha256(text.encode()).hexdigest()}
    done = events.decode(f"d{sha256[:16]}", sha256, products=products)
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
    """What `verify --read` finds, a line each; nothing where a stopped command had not made the store yet, or had
    recorded nothing in it and nothing is known of before."""
    if not (folder / "store.json").exists():
        return []
    with Store.open(folder) as store:
        if since is None and store.ledger.place.stamp() and not any(store.ledger.rows()):
            return []
        return [one.says for one in check(store, since=since).damages]


def write_bench(folder: Path) -> None:
    """Motor, bench and database files and three logs: two on CAN, and a table that is not ingested yet."""
    can_bench.write_files(folder)
    can_bench.write_log(folder / "1_s1.blf", seconds=60, seed=1)
    can_bench.write_log(folder / "2_drive.asc", seconds=60, seed=2, start=can_bench.START + 86_400)
    write_table(folder / "3_s2.csv", 40)
    (folder / "crack.jpg").write_bytes(random.Random(1).randbytes(200_000))  # larger than what SQLite writes for it


def write_table(path: Path, rows: int, seed: int = 0, nodes: Sequence[str] = ("winding", "yoke", "magnet")) -> None:
    """A table with a row a second; `nodes`: where the sensors that read winding, yoke and magnet are said to be."""
    speed, current = can_bench.drive(rows, seed)
    temperatures = can_bench.truth(speed, current, 30.0)
    lines = [f"time,MotorSpeed,MotorTorque,PhaseCurrent,{','.join(f'TC_{node}' for node in nodes)},TC_coolant"]
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
    _done(folder, (*INGEST, "1_s1.blf", "2_drive.asc"), ("replay", "1_s1"), ("backup", "copy"))
    return folder


def copied(bench: Path, to: Path) -> Path:
    """A copy of that folder, whatever lay there before."""
    shutil.rmtree(to, ignore_errors=True)
    return shutil.copytree(bench, to, symlinks=True)


def meaning(folder: Path) -> list[str]:
    """What a store says, without the times and numbers of its events: logs, samples, sessions, answers, what is
    current, what was taken back."""
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
    yield from (f"calibration {one.calibration} {model} {one.covariance}" for model, one in known.calibrations.items())
    yield from (f"diagnosis {one.diagnosis} {one.artefact}" for one in known.diagnoses.values())
    yield from (f"assessment {one.assessment} {one.digest}" for one in known.assessments.values())
    yield from (f"current {new} in place of {old}" for old, new in known.successors.items())
    yield from (f"taken back {stream}" for stream in known.retractions)
    yield from (f"inspection {one}" for one in known.inspections)
    yield from (f"there {path.name}" for path in (store.folder / "decoded").glob("*/*"))
    yield from (f"gone {sha256}" for sha256 in store.forgotten.files if not store.archive.has(sha256))
