"""Is the ledger what was written? After SQLite's own check every stored column of every row is read."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from ingest.errors import IngestError, ServerError
from ingest.facts.chain import Head
from ingest.facts.ledger import PAGE, Ledger
from ingest.facts.ledger_history import Flaw, LedgerHistory
from ingest.facts.ledger_lock import reading_uri
from ingest.facts.ledger_place import DATABASE_ERRORS, SqliteFile

OTHERS = (
    "SELECT type, name FROM sqlite_schema WHERE (type, name) <> ('table', 'stored_events') AND name NOT LIKE 'sqlite_%'"
    " UNION ALL SELECT 'column', name FROM pragma_table_xinfo('stored_events')"
    " WHERE name NOT IN ('originator_id', 'originator_version', 'topic', 'state')"
)


def audit(ledger: Ledger, since: Head | None = None) -> LedgerHistory:
    """Read the whole of `ledger`; `since` is a head that was noted down before, or its beginning.

    Without it, a history that was rewritten whole, or cut off after its last seal, cannot be told from a true one.
    Raises ServerError where a server does not answer or let in: then nothing was checked.
    """
    seen = LedgerHistory()
    if isinstance(ledger.place, SqliteFile):
        seen.findings += _integrity(ledger.place.path)
    if _read(ledger, seen, since, PAGE):
        _read_around(ledger, seen, since)
    if since and since.position > seen.position:
        end = f"the ledger ends at event {seen.position}, the head given was {since.position}"
        seen.findings.append(Flaw(f"{end}: the end is missing"))
    return seen


def _read(ledger: Ledger, seen: LedgerHistory, since: Head | None, at_once: int) -> str | None:
    """Add the rows behind those that were seen. Returns why the next one cannot be read; None at the end."""
    try:
        for row in ledger.rows(seen.position + 1 if seen.position else None, at_once=at_once):
            seen.add(row)
            if since and since.position == row.id and not seen.head.root.startswith(since.root):
                says = f"event {row.id}: the root differs from the head given: the history up to here was changed"
                seen.findings.append(Flaw(says))
    except ServerError:
        raise
    except IngestError as error:
        return str(error)
    return None


def _read_around(ledger: Ledger, seen: LedgerHistory, since: Head | None) -> None:
    """Read row by row, past those that cannot be read, until PAGE of them lie side by side."""
    while why := _read(ledger, seen, since, at_once=1):
        first = seen.position + 1
        behind = next((place for place in range(first + 1, first + PAGE) if _is_readable(ledger, place)), None)
        if behind is None:
            seen.findings.append(Flaw(f"{why}: what follows event {seen.position} could not be checked"))
            return
        lost = f"event {first}" if behind == first + 1 else f"events {first} to {behind - 1}"
        seen.findings.append(Flaw(f"{why}: {lost} could not be read"))
        seen.position = behind - 1


def _is_readable(ledger: Ledger, position: int) -> bool:
    try:
        return next(ledger.rows(position, at_once=1), None) is not None
    except IngestError:
        return False


def _integrity(path: Path) -> list[Flaw]:
    """What SQLite itself finds: pages, indexes, types, and what beside the events may change them unseen, as a trigger
    does. It does not see most changed bytes."""
    try:
        with closing(sqlite3.connect(reading_uri(path), uri=True)) as connection:
            lines = [line for (line,) in connection.execute("PRAGMA integrity_check")]
            lines += [f"{kind} {name}: whyhot made none" for kind, name in connection.execute(OTHERS)]
    except DATABASE_ERRORS as error:
        lines = [str(error)]
    return [Flaw(f"{path}: SQLite: {' '.join(line.split())}") for line in lines if line != "ok"]
