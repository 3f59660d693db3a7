"""Power cuts, enumerated: what a disk may hold where not all that was written had been brought to it.

A workload is run once, with every change of the disk looked at. A power cut after any of them may leave a file that was
not synced whole, empty or cut in half, and a name that its folder was not synced for as it is now or as it was at the
last sync. The ledger's rows are on disk when a transaction ends: SQLite's own care is not tried here.
"""

from __future__ import annotations

import itertools
import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

from benchmarks.attack import subjects
from benchmarks.attack.outcome import Arena, Attack, Outcome
from ingest.facts.backup import backup, restore
from ingest.facts.ledger_place import SqliteFile
from ingest.facts.store import Store
from ingest.intake.retractions import forget, retract

Names = dict[str, int]  # path -> number of the file (its inode); 0 for a folder
LEDGER = "ledger.sqlite"
MOST_OPEN = 3  # unsynced things that are varied together: most bugs need no more


@dataclass
class Disk:
    """What was brought to disk of a folder: `names` of its files as they were when their folder was synced last, and
    which files (`synced`) were since they were written last."""

    folder: Path
    names: Names = field(default_factory=dict)
    synced: dict[int, bytes] = field(default_factory=dict)
    states: list[State] = field(default_factory=list)

    def look(self) -> None:
        """Note what a power cut may leave now."""
        self.states.append(State(_names(self.folder), dict(self.names), _contents(self.folder), dict(self.synced)))

    def sync(self, handle: int) -> None:
        """A file, or the names in a folder, were brought to disk."""
        path = Path(f"/proc/self/fd/{handle}").readlink()
        if not path.is_relative_to(self.folder):
            return
        if path.is_dir():
            inside = path.relative_to(self.folder)
            kept = {name: number for name, number in self.names.items() if Path(name).parent != inside}
            now = {name: number for name, number in _names(self.folder).items() if Path(name).parent == inside}
            self.names = kept | now
        else:
            self.synced[path.stat().st_ino] = path.read_bytes()


@dataclass(frozen=True)
class State:
    """`now`: the names there are; `kept`: those on disk; `contents` and `synced`: file -> bytes, as they are and as
    they are on disk."""

    now: Names
    kept: Names
    contents: Mapping[int, bytes]
    synced: Mapping[int, bytes]

    def after_cut(self) -> Iterator[dict[str, bytes | None]]:
        """Path -> bytes (None: a folder) of everything that a power cut may leave."""
        ours = sorted(name for name in {*self.now, *self.kept} if LEDGER not in name)
        moved = [name for name in ours if self.now.get(name) != self.kept.get(name)][-MOST_OPEN:]
        numbers = [self.now[name] for name in ours if self.now.get(name)]
        torn = [one for one in numbers if self.contents[one] and self.synced.get(one) != self.contents[one]][
            -MOST_OPEN:
        ]
        for lost in itertools.product((False, True), repeat=len(moved)):
            names = {**self.now}
            for name, gone in zip(moved, lost, strict=True):
                if gone:
                    names.pop(name, None)
                    names |= {name: self.kept[name]} if name in self.kept else {}
            for left in itertools.product((1.0, 0.0, 0.5), repeat=len(torn)):
                data = {**self.synced, **self.contents}  # a file that was removed may be there again
                for number, share in zip(torn, left, strict=True):
                    data[number] = data[number][: int(share * len(data[number]))]
                yield {name: data.get(number, b"") if number else None for name, number in names.items()}


def _names(folder: Path) -> Names:
    found = {}
    for path in folder.rglob("*"):
        with suppress(FileNotFoundError):
            found[str(path.relative_to(folder))] = 0 if path.is_dir() else path.stat().st_ino
    return found


def _contents(folder: Path) -> dict[int, bytes]:
    found = {}
    for path in folder.rglob("*"):
        with suppress(FileNotFoundError, IsADirectoryError):  # SQLite's own come and go
            found[path.stat().st_ino] = path.read_bytes()
    return found


def recorded(folder: Path, work: Callable[[], object]) -> list[State]:
    """The states that `work` in `folder` goes through, one for each change of the disk."""
    disk = Disk(folder, _names(folder), _contents(folder))
    with ExitStack() as patched:
        for owner, name in ((os, "fsync"), (os, "write"), (os, "replace"), (os, "mkdir"), (SqliteFile, "insert")):
            true, synced = getattr(owner, name), name == "fsync"
            patched.enter_context(mock.patch.object(owner, name, _watched(true, disk, synced)))
        work()
    return disk.states


def _watched(true: Callable[..., Any], disk: Disk, synced: bool) -> Callable[..., Any]:
    def step(*args: Any, **named: Any) -> Any:
        done = true(*args, **named)
        if synced:
            disk.sync(args[0])
        disk.look()
        return done

    return step


def _laid_out(files: Mapping[str, bytes | None], folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for name, data in sorted(files.items()):
        path = folder / name
        if data is None:
            path.mkdir(parents=True, exist_ok=True)
        elif path.parent.is_dir():  # else its folder's own name was lost
            path.write_bytes(data)


WORKLOADS: Mapping[str, Callable[[Path], object]] = {
    "a store is made": lambda folder: subjects.filled(folder / "store", 0),
    "a first log": lambda folder: subjects.filled(folder / "store", 1),
    "two logs": lambda folder: subjects.filled(folder / "store", 2),
    "one more log": lambda folder: _one_more(folder / "before"),
    "a product again": lambda folder: _again(folder / "before"),
    "a first backup": lambda folder: backup(folder / "before", folder / "store"),
    "a backup again": lambda folder: backup(folder / "before", folder / "copy"),
    "a restore": lambda folder: restore(folder / "copy", folder / "store"),
    "a log is taken back": lambda folder: _by_hand(folder / "before", retract),
    "a log is forgotten": lambda folder: _by_hand(folder / "before", forget),
}


def _one_more(folder: Path) -> None:
    with Store.open(folder, write=True) as store:
        subjects.put(store, "one more")


def _by_hand(folder: Path, put_right: Callable[[Store, Sequence[str], str], object]) -> None:
    with Store.open(folder, write=True) as store:
        put_right(store, ["log-0"], "drawn")


def _again(folder: Path) -> None:
    with Store.open(folder, write=True) as store:
        subjects.put(store, "log-0")


def power_cuts(arena: Arena) -> Outcome:
    """T3."""
    outcome = Outcome()
    for name, work in WORKLOADS.items():
        folder = arena.folder / name.replace(" ", "_")
        subjects.filled(folder / "before", 2)
        backup(folder / "before", folder / "copy")
        states = recorded(folder, partial(work, folder))
        all_of = len(WORKLOADS) * len(states)
        share, step = -(-arena.tries // all_of), max(1, all_of // arena.tries)
        for number in range(arena.chance.randrange(step), len(states), step):
            cuts = list(states[number].after_cut())
            for cut in arena.chance.sample(cuts, min(share, len(cuts))):
                _laid_out(cut, arena.folder / "cut")
                found = [line for one in sorted((arena.folder / "cut").iterdir()) for line in _wrong(one)]
                outcome.count(*[f"{name}, after change {number + 1}: {line}" for line in found])
    return outcome


def _wrong(store: Path) -> list[str]:
    try:
        found = subjects.damages(store)
        with Store.open(store, create=True) as opened:
            subjects.put(opened, "after the cut")
        return found + subjects.damages(store)
    except Exception as error:  # noqa: BLE001 -- a defect is a try that failed
        return [f"{store.name}: {type(error).__name__}: {error}"]


ATTACKS = (
    Attack(
        "T3",
        "power cut, what was not synced is lost",
        "no event without its bytes; the next command goes on",
        1500,
        40,
        power_cuts,
    ),
)
