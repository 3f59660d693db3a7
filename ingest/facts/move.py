"""The ledger of a store from its folder into a PostgreSQL server, from one server into another, or back.

The rows are copied as they are, read back and compared by their root; then one rename of the mark makes the new ones
the ledger. What is stopped before it leaves the store whole on the old ledger, and after it on the new one. No other
process writes meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from ingest.errors import IngestError, LedgerError, StoreError
from ingest.facts.chain import Head
from ingest.facts.durable import sync_folder, sync_tree
from ingest.facts.ledger import INDEX, PAGE, Ledger, placed
from ingest.facts.ledger_history import LedgerHistory
from ingest.facts.ledger_place import DATABASE_ERRORS, LedgerPlace, SqliteFile
from ingest.facts.ledger_server import Server, ServerTable, shown
from ingest.facts.store import Store, mark_of

HERE = "sqlite"  # the word for a ledger in the store's folder
FILE = "ledger.sqlite"


@dataclass(frozen=True)
class MovedStore:
    """Where ledger or files were and where they are, without passwords; the head, equal in both; `left`: a line for
    each thing at the old place that could not be removed."""

    was: str
    now: str
    head: Head
    left: tuple[str, ...]


def move(folder: Path, to: str, tell: Callable[[str], None] = lambda line: None) -> MovedStore:
    """Move the ledger of the store in `folder` to the URL `to`, or with "sqlite" into the folder.

    Raises StoreError where it is there already, LedgerError where `to` is no URL of a server or the server refuses,
    DamageError where the ledger is damaged; then nothing has changed.
    """
    server = None if to == HERE else Server.new(to)
    old = mark_of(folder).ledger
    if (old and old.url) == (server and server.url):
        where = shown(to) if server else "its folder"
        raise StoreError(f"{folder}: its ledger is in {where} already: nothing was moved")
    with closing(Store.open(folder, write=True, alone=True)) as store:
        tell("checking every event")
        store.ledger.events()
        made = _copied(store, server, tell)
        head = store.ledger.head()
        store.put_mark(store.mark._replace(ledger=server))
        was = store.ledger.place
        return MovedStore(was.where, made.where, head, _removed(store.folder, was))


def _copied(store: Store, server: Server | None, tell: Callable[[str], None]) -> LedgerPlace:
    """The place of the new ledger, with all rows of the old one, on disk. Where that fails nothing of it stays."""
    work = store.work()
    place = placed(work, server, write=True, create=True)
    try:
        with place.plain_words():
            _fill(place, store.ledger, tell)
        place.disconnect()
        if server is None:
            place = _put_here(work, store.folder)
        tell("reading them back")
        with place.plain_words():
            head = _head(place)
        if head != store.ledger.head():
            raise LedgerError(f"{place.where}: does not give back what was stored there: nothing was moved")
    except BaseException:
        if isinstance(place, ServerTable):
            with suppress(*DATABASE_ERRORS, IngestError):
                place.remove()
        raise
    finally:
        place.disconnect()
    return place


def _fill(place: LedgerPlace, ledger: Ledger, tell: Callable[[str], None]) -> None:
    place.recorder()
    rows, end, done = ledger.rows(), ledger.head().position, 0
    while page := [*islice(rows, PAGE)]:
        place.insert(page, done)
        done = page[-1].id
        tell(f"event {done:,} of {end:,}")


def _put_here(work: Path, folder: Path) -> SqliteFile:
    """Move the filled file from `work` to its place in the store, whose ledger it is not yet."""
    sync_tree(work)
    _remove_files(folder)  # what a move that was stopped left
    (work / FILE).replace(folder / FILE)
    sync_folder(folder)
    return SqliteFile(folder / FILE, write=False, create=False)


def _head(place: LedgerPlace) -> Head:
    seen = LedgerHistory()
    while page := place.recorder().select_notifications(seen.position + 1, PAGE):
        for row in page:
            seen.add(row)
    return seen.head


def _removed(folder: Path, was: LedgerPlace) -> tuple[str, ...]:
    """Remove the old ledger, and the index that was made of it. Returns a line where that fails."""
    (folder / INDEX).unlink(missing_ok=True)
    try:
        if isinstance(was, ServerTable):
            with was.plain_words():
                was.remove()
        else:
            _remove_files(folder)
    except (IngestError, OSError) as error:
        return (f"the old ledger is still there, and is no longer used: {error}",)
    finally:
        was.disconnect()
    return ()


def _remove_files(folder: Path) -> None:
    for path in folder.glob(f"{FILE}*"):
        path.unlink()
