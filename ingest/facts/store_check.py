"""Is everything that the facts cite in the store, and is it what was sealed? All damage is found, and read twice."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from ingest.errors import StoreError
from ingest.facts.archive import Archive
from ingest.facts.bucket import ObjectPath, Place, listed
from ingest.facts.chain import Head
from ingest.facts.cited import BACKUP, Cited, cited, forgotten, sessions_on, sessions_without_ground
from ingest.facts.durable import opened, sha256_of
from ingest.facts.events import DecodeCompleted
from ingest.facts.facts import Facts, fold
from ingest.facts.ledger import INDEX, ahead
from ingest.facts.ledger_audit import audit
from ingest.facts.ledger_history import Flaw, LedgerHistory
from ingest.facts.ledger_index import LedgerIndex
from ingest.facts.ledger_lock import has_wal_reset_bug
from ingest.facts.ledger_place import SqliteFile
from ingest.facts.store import Store, mark_of, place_of
from ingest.facts.sweeping import remains
from ingest.texts.names import handle
from ingest.units.each import Workers, each

AGAIN = "`whyhot rebuild` makes it again"
READ_WRONG = "was read wrong at first and right after: check the memory and disk of this machine"
FORGET = "the same `whyhot forget` again removes it"
LEDGER = "`whyhot restore BACKUP --store NEW`, or ingest the original logs into a new store (--store NEW)"


@dataclass(frozen=True)
class Damage:
    """What is not as it was written: `says` in one line; `affects`: names of sessions; `mend`: the next command."""

    says: str
    affects: tuple[str, ...]
    mend: str


@dataclass
class StoreCheck:
    """What a check found. `hints`: what is no damage but good to know, one line each. `whole`: what ("sealed files")
    -> how many are as they were written, and of how many; `sessions`: names of those that no damage affects. `head`:
    None where the ledger is damaged. `is_backup`: it holds no decoded file, as a backup does."""

    damages: list[Damage] = field(default_factory=list)
    hints: list[str] = field(default_factory=list)
    whole: dict[str, tuple[int, int]] = field(default_factory=dict)
    sessions: list[str] = field(default_factory=list)
    head: Head | None = None
    is_backup: bool = False

    def twice(self, path: Place, look: Callable[[], str | None]) -> str | None:
        """What `look` finds at `path`, where it finds something a second time too; else that is a hint."""
        first = look()
        if first is None:
            return None
        _from_disk(path)
        if look() is not None:
            return first
        self.hints.append(f"{path}: {READ_WRONG}")
        return None


def check(
    store: Store,
    read: bool = True,
    since: Head | None = None,
    workers: Workers | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> StoreCheck:
    """Check the ledger of `store` and all that it cites; with `read` every sealed byte and product is hashed again, by
    `workers` first, and what they do not find whole in this process. `tell` hears what is being done.

    `since` is a head that was noted down before.
    """
    found, place = StoreCheck(), store.ledger.place
    tell("checking every event of the ledger")
    seen = _audited(store, since)
    if seen.findings:
        if isinstance(place, SqliteFile):
            _from_disk(place.path)
        first, seen = seen, _audited(store, since)
        if not seen.findings:
            found.hints.append(f"{place.where}: was read wrong at first and right after: {first.findings[0].says}")
    whole = _whole_by(workers, store, seen) if read and workers else set()
    _check_files(found, store.files, store.archive, seen, read, whole, tell)
    index = store.folder.absolute() / INDEX
    kept = LedgerIndex.load(index, place.stamp())
    if kept and not seen.findings and not kept.says_as(seen.recorded):
        says = f"{index}: does not say where the events lie: delete it, the next command makes it again"
        found.damages.append(Damage(says, (), "delete it"))
    if isinstance(place, SqliteFile):
        found.hints += _sqlite()
    if not seen.findings and (late := ahead(seen.recorded)):
        found.hints.append(
            f"event {late.position} says it was recorded on {late.recorded[:10]}, later than now: a clock was wrong, "
            "then or now. Times of the events from there on tell their order alone: give --as-of a number"
        )
    found.head = None if seen.findings else seen.head
    return found


def _audited(store: Store, since: Head | None) -> LedgerHistory:
    """What `audit` sees; that the ledger's file is gone or empty, or holds no event where sealed or decoded files are,
    in one line of its own."""
    place = store.ledger.place
    if isinstance(place, SqliteFile) and not place.path.exists():
        says = "is missing"
    elif isinstance(place, SqliteFile) and place.path.stat().st_size == 0:
        says = "is an empty file"
    else:
        seen = audit(store.ledger, since)
        if seen.position or seen.findings:
            return seen
        forgotten = without_events(store)
        return LedgerHistory(findings=[Flaw(forgotten)]) if forgotten else seen
    return LedgerHistory(findings=[Flaw(f"{place.where}: {says}")])


def without_events(store: Store) -> str | None:
    """That files are here which no event names, in one line, of a store whose ledger holds no event."""
    sealed, decoded = len([*store.archive]), len(listed(store.files / "decoded", "*"))
    if not sealed + decoded:
        return None
    return (
        f"{store.ledger.place.where}: holds no event, though {sealed:,} sealed files and {decoded:,} decoded logs "
        "are here: its events were deleted, or the first command of this store was stopped (then give the same command "
        "again)"
    )


def _whole_by(workers: Workers, store: Store, seen: LedgerHistory) -> set[tuple[str, str]]:
    """Of sealed files and products, those that workers find whole: where each lies in the store, and its SHA-256."""
    jobs = [(_sealed(sha256), sha256) for sha256 in store.archive]
    for event in (one.event for one in seen.recorded):
        if isinstance(event, DecodeCompleted) and event.decode.isalnum():  # else forged: it may lead out of the store
            jobs += [(_product(event, name), sha256) for name, sha256 in event.products.items()]
    return {job for job, whole in each(partial(_is_whole, store.folder.absolute()), jobs, workers) if whole is True}


def _is_whole(folder: Path, job: tuple[str, str]) -> bool:
    """Whether a file of the store in `folder` has the SHA-256 that it should; a worker asks."""
    place, sha256 = job
    files = place_of(folder, mark_of(folder))
    try:
        return sha256_of(files / place) == sha256
    except (OSError, StoreError):
        return False  # who asked looks again, and says why


def _sealed(sha256: str) -> str:
    return f"archive/{sha256[:2]}/{sha256}"


def _product(decode: DecodeCompleted, name: str) -> str:
    return f"decoded/{decode.decode}/{Path(name).name}"


def check_without_ledger(folder: Path, why: str, read: bool = True) -> StoreCheck:
    """Check the store in `folder`, whose ledger cannot be opened (`why`): each sealed file against its name."""
    found = StoreCheck()
    unread = LedgerHistory(findings=[Flaw(why)])
    files: Place = folder
    with suppress(StoreError):
        files = place_of(folder, mark_of(folder))
    _check_files(found, files, Archive(files / "archive", None), unread, read)
    return found


def _check_files(
    found: StoreCheck,
    folder: Place,
    archive: Archive,
    seen: LedgerHistory,
    read: bool,
    whole: Collection[tuple[str, str]] = (),
    tell: Callable[[str], None] = lambda _: None,
) -> None:
    """`whole`: files that need not be looked at, as `_whole_by` gives them."""
    facts, files = fold(seen.recorded), cited(seen.recorded)
    for says, stream in seen.findings:
        affects = sessions_on(facts, stream.partition("-")[2]) if stream else sessions_without_ground(facts)
        found.damages.append(Damage(says, affects, LEDGER))
    _check_sealed(found, archive, files, read, partial(sessions_on, facts), whole, tell)
    _check_products(found, folder, facts, read, partial(sessions_on, facts), whole, tell)
    if not seen.findings:
        gone = forgotten(seen.recorded)
        decodes = {one.event.decode for one in seen.recorded if isinstance(one.event, DecodeCompleted)}
        found.hints += _strays(folder, archive, {*files, *gone.files}, decodes)
        found.hints += gone.logs.values()
        found.hints += (f"{path}: is still here, and {why}: {FORGET}" for path, why in remains(folder, archive, gone))
    affected = {name for one in found.damages for name in one.affects}
    found.sessions = [session.name for session in facts.sessions if session.name not in affected]


def _check_sealed(
    found: StoreCheck,
    archive: Archive,
    files: Mapping[str, Cited],
    read: bool,
    affects: Callable[[str], tuple[str, ...]],
    whole: Collection[tuple[str, str]],
    tell: Callable[[str], None],
) -> None:
    names, bad = sorted({*archive, *files}), 0
    for number, sha256 in enumerate(names, 1):
        tell(f"checking sealed file {number:,} of {len(names):,}: {handle(sha256)}")
        path = archive.folder / sha256[:2] / sha256
        if (_sealed(sha256), sha256) in whole:
            continue
        if says := found.twice(path, partial(archive.damage, sha256, read)):
            file = files.get(sha256, Cited(sha256, "no event cites it", "delete it: no event cites it"))
            found.damages.append(Damage(f"{says} ({file.what})", affects(file.run or sha256), file.mend))
            bad += 1
    found.whole["sealed files"] = len(names) - bad, len(names)


def _check_products(
    found: StoreCheck,
    folder: Place,
    facts: Facts,
    read: bool,
    affects: Callable[[str], tuple[str, ...]],
    whole: Collection[tuple[str, str]],
    tell: Callable[[str], None],
) -> None:
    """A product that is missing is a hint where a session needs it, as it is made again; one that is not what the
    decode gave is damage. Where all are missing, that is one hint."""
    decodes = facts.decodes.values()
    held = {file["decode"] for session in facts.sessions for file in session.files}
    count = bad = absent = 0
    every = sum(len(decode.products) for decode in decodes)
    missing: list[str] = []
    for decode in decodes:
        for name, sha256 in decode.products.items():
            path = folder / "decoded" / decode.decode / Path(name).name
            count += 1
            tell(f"checking decoded file {count:,} of {every:,}: {path.name}")
            if (_product(decode, name), sha256) in whole:
                continue
            says: str | None = None
            if not decode.decode.isalnum():
                says = f"{folder}: {decode.decode!r} is not the id of a decode: it was forged"
                found.damages.append(Damage(says, affects(decode.decode), BACKUP))
            elif not path.is_file():
                absent += 1
                says = f"{path}: is missing: {AGAIN}"
                if decode.decode in held:
                    missing.append(says)
            elif says := found.twice(path, partial(_changed, path, sha256, read)):
                found.damages.append(Damage(says, affects(decode.decode), "whyhot rebuild"))
            bad += says is not None
    found.is_backup = 0 < absent == count
    if 1 < absent == count:
        missing = [f"{folder / 'decoded'}: holds none of {count:,} decoded files, as in a backup: {AGAIN}"]
    found.hints += missing
    found.whole["decoded files"] = count - bad, count


def _changed(path: Place, sha256: str, read: bool) -> str | None:
    try:
        if not read or sha256_of(path) == sha256:
            return None
    except OSError as error:
        return f"{path}: cannot be read ({error.strerror}): {AGAIN}"
    return f"{path}: is damaged, its bytes are not those that the decode gave: {AGAIN}"


def _from_disk(path: Place) -> None:
    """Let what is read next come from the disk and not from memory, where the system can do that."""
    if isinstance(path, ObjectPath):
        return
    with suppress(OSError, AttributeError), opened(path) as file:
        os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def _strays(folder: Place, archive: Archive, files: set[str], decodes: set[str]) -> Iterator[str]:
    """What a command that was stopped leaves behind: bytes without an event. They do no harm."""
    for sha256 in archive:
        if sha256 not in files:
            yield f"{archive.path(sha256)}: no event cites it: a stopped command left it, it may stay"
    for made in listed(folder / "decoded", "*"):
        if made.name not in decodes:
            yield f"{made}: no event names it: a stopped command left it, it may be deleted"


def _sqlite() -> Iterator[str]:
    if has_wal_reset_bug():
        yield (
            f"SQLite {sqlite3.sqlite_version} can corrupt a database that two processes write at once (fixed in "
            "3.51.3). ledger.lock lets in one writer, so it is safe here: let no other program write to ledger.sqlite"
        )
