"""Is the ledger what was written? After SQLite's own check every stored column of every row is read."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import dataclass, field

from eventsourcing.persistence import Notification

from ingest.errors import IngestError
from ingest.facts.chain import Head, Tree, entry
from ingest.facts.events import LedgerSealed
from ingest.facts.ledger import DATABASE_ERRORS, PAGE, Ledger
from ingest.facts.ledger_lock import reading_uri
from ingest.facts.ledger_row import Recorded, decode


@dataclass
class Audit:
    """`findings`: what is wrong, one line each, in the order of the ledger. `recorded`: the events that are whole."""

    gapless: bool  # positions count 1, 2, 3 ... (a database server may leave numbers out)
    since: Head | None = None
    findings: list[str] = field(default_factory=list)
    recorded: list[Recorded] = field(default_factory=list)
    _tree: Tree = field(default_factory=Tree)
    position: int = 0  # of the last row that could be read
    _moment: str = ""
    _tails: dict[str, tuple[int, str | None]] = field(default_factory=dict)  # stream -> version, digest where known

    def add(self, row: Notification) -> None:
        """Check the next row against itself and all rows before it."""
        where = f"event {row.id} ({row.originator_id!r} version {row.originator_version!r})"
        if self.gapless and row.id != self.position + 1:
            self._find(f"events {self.position + 1} to {row.id - 1} are missing")
        try:
            one = decode(row, row.id)
        except IngestError as error:
            self._find(str(error))
            if isinstance(row.originator_version, int):
                self._tails[str(row.originator_id)] = (row.originator_version, None)
        else:
            self._chain(one, where)
            self._seal(one, where)
            self.recorded.append(one)
        self._grow(row)

    def end(self) -> None:
        """Check what can be said only at the end."""
        if self.since and self.since.position > self.position:
            end = f"the ledger ends at event {self.position}, the head given was {self.since.position}"
            self._find(f"{end}: the end is missing")

    def _chain(self, one: Recorded, where: str) -> None:
        version, digest = self._tails.get(one.stream, (0, None))
        if one.version != version + 1:
            self._find(f"{where}: follows version {version} of its stream: events are missing or in another order")
        elif one.previous != digest and (digest or version == 0):
            self._find(f"{where}: does not follow the event before it in its stream, which is another one now")
        if one.recorded <= self._moment:
            self._find(f"{where}: was recorded before the event in front of it: the order was changed")
        self._tails[one.stream] = (one.version, one.digest)
        self._moment = one.recorded

    def _seal(self, one: Recorded, where: str) -> None:
        sealed = one.event
        if isinstance(sealed, LedgerSealed) and (sealed.position, sealed.root) != (self.position, self._tree.root):
            self._find(
                f"{where}: the seal does not fit: something in events 1 to {self.position} was changed since then"
            )

    def _grow(self, row: Notification) -> None:
        try:
            self._tree.add(entry(row.id, str(row.originator_id), row.originator_version, row.topic, row.state))
        except (IngestError, TypeError):
            self._tree.add(b"")  # a column of another type, already found; no root fits any more
        self.position = row.id
        if self.since and self.since.position == row.id and self.since.root != self._tree.root:
            self._find(f"event {row.id}: the root differs from the head given: the history up to here was changed")

    def _find(self, says: str) -> None:
        self.findings.append(says)


def audit(ledger: Ledger, since: Head | None = None) -> Audit:
    """Read the whole of `ledger`; `since` is a head that was noted down before.

    Without it, a history that was rewritten whole, or cut off after its last seal, cannot be told from a true one.
    """
    result = Audit(ledger.is_file, since)
    if ledger.is_file:
        result.findings += _integrity(ledger)
    for at_once in (PAGE, 1):  # one by one where a page cannot be read, up to the row that is the reason
        try:
            for row in ledger.rows(result.position + 1, at_once=at_once):
                result.add(row)
            break
        except IngestError as error:
            reason = f"{error}: what follows event {result.position} could not be checked"
    else:
        result.findings.append(reason)
    result.end()
    return result


def _integrity(ledger: Ledger) -> list[str]:
    """What SQLite itself finds: pages, indexes, types. It does not see most changed bytes."""
    try:
        with closing(sqlite3.connect(reading_uri(ledger.path), uri=True)) as connection:
            lines = [line for (line,) in connection.execute("PRAGMA integrity_check")]
    except DATABASE_ERRORS as error:
        lines = [str(error)]
    return [f"{ledger.path}: SQLite: {' '.join(line.split())}" for line in lines if line != "ok"]
