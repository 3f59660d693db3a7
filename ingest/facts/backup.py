"""A second copy of a store in another folder: what is missing there is copied, and nothing twice.

The copy is a store like any other. Sealed bytes go first, each under its name only when it is whole and on disk; the
events that cite them go last, all at once. So a copy that is stopped at any moment holds what it held before, and the
next goes on from there. Only behind the events that say so the bytes of forgotten logs are removed. Another process may
write to the source meanwhile: its ledger only grows, and sealed bytes are there before the events that cite them.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from ingest.errors import DamageError, StoreError
from ingest.facts.chain import Head
from ingest.facts.cited import cited, forgotten
from ingest.facts.ledger_row import Recorded
from ingest.facts.store import MARK, Store
from ingest.facts.store_check import StoreCheck, check
from ingest.facts.sweeping import Swept, sweep


class Amount(NamedTuple):
    """How much: events, sealed files, and the bytes of these files."""

    events: int
    files: int
    bytes: int


@dataclass(frozen=True)
class Copied:
    """`copied` now and `there` already; `head`: what the copy holds now; `left`: a line for each sealed file that could
    not be copied, because the source has it damaged or not at all; `swept`: what was removed from the copy, of
    logs that were forgotten."""

    copied: Amount
    there: Amount
    head: Head
    left: Sequence[str]
    swept: Swept


def backup(folder: Path, target: Path, read: bool = False, tell: Callable[[str], None] = lambda line: None) -> Copied:
    """Bring the backup in `target` up to the store in `folder`; it is made where there is none. With `read` what it
    holds already is hashed again, and copied anew where it is damaged. `tell` is given what is being copied.

    Raises StoreError where `target` is the store itself, or holds what is no backup of it or a newer one, DamageError
    where a ledger is damaged, OSError where `target` cannot be written (disk full ...), and as `Store.open`.
    """
    if Path(os.path.realpath(target)).is_relative_to(os.path.realpath(folder)):
        raise StoreError(f"{target}: lies in the store {folder} itself: give a folder on another disk")
    with Store.open(folder) as store:
        _events(store)  # what is damaged makes no copy
        with closing(Store.open(target, create=True)) as copy:
            _refuse_others(store, copy, target)
            return _copy(store, copy, read, tell)


def restore(target: Path, folder: Path, tell: Callable[[str], None] = lambda line: None) -> tuple[Copied, StoreCheck]:
    """Make a store in the new `folder` from the backup in `target`, and check every byte of it. Where a restore left a
    file that it could not read, the next one brings it.

    Raises StoreError where there is no backup, or `folder` holds other events, a whole store or something else, and as
    `backup`.
    """
    if not (target / MARK).exists():
        raise StoreError(f"{target}: there is no backup here: `whyhot backup {target}` makes one")
    with Store.open(target) as copy:
        _events(copy)
        with closing(Store.open(folder, create=True)) as store:
            end = len(_events(store))
            if end and (store.ledger.head() != copy.ledger.head() or not check(store).damages):
                says = f"is a store already, with {end} events: nothing was written; give a new folder with --store"
                raise StoreError(f"{folder}: {says}")
            done = _copy(copy, store, end > 0, tell)
            tell("checking every byte")
            return done, check(store)


def _refuse_others(store: Store, copy: Store, target: Path) -> None:
    """Raises StoreError where the events of `copy` are not the first ones of `store`."""
    end, held = len(_events(store)), len(_events(copy))
    for ours, theirs in zip(store.ledger.rows(), copy.ledger.rows(), strict=False):
        if ours != theirs and ours.id == 1:
            raise StoreError(f"{target}: is the backup of another store: give another folder")
        if ours != theirs:
            raise StoreError(
                f"{target}: holds another event {ours.id} than this store: one of both was written to since its copy "
                "was made; give another folder, so that both are kept"
            )
    if held > end:
        raise StoreError(
            f"{target}: is newer than this store, it holds {held} events and the store {end}: `whyhot restore` makes a "
            "store of it; give another folder to keep this one too"
        )


def _copy(source: Store, target: Store, read: bool, tell: Callable[[str], None]) -> Copied:
    """Copy what `target` lacks: sealed files first, then the events that follow its own."""
    recorded, held = _events(source), len(_events(target))
    files, there, left = cited(recorded), list[int](), list[str]()
    copied = list[int]()
    for number, (sha256, file) in enumerate(files.items(), 1):
        if target.archive.damage(sha256, read) is None:
            there.append(target.archive.size(sha256))
            continue
        tell(f"sealed file {number:,} of {len(files):,}: {file.what}")
        try:
            target.archive.seal(source.archive.chunks(sha256))
            copied.append(target.archive.size(sha256))
        except DamageError as error:
            left.append(f"{error} ({file.what})")
    if len(recorded) > held:
        target.ledger.take_over(source.ledger.rows(held + 1, recorded[-1].position))
    return Copied(
        Amount(len(recorded) - held, len(copied), sum(copied)),
        Amount(held, len(there), sum(there)),
        target.ledger.head(),
        left,
        sweep(target, forgotten(recorded)),
    )


def _events(store: Store) -> list[Recorded]:
    """All events of a store; they count 1, 2, 3 ..."""
    try:
        return store.ledger.events()
    except DamageError as error:
        raise DamageError(f"{store.folder}: {error}") from None
