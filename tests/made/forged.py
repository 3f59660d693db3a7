"""Ledgers changed by hand: as someone would who writes to the database, and as someone would who knows the format."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

from ingest.facts.chain import Tree, canonical, digest, entry

Row = tuple[int, str, int, str, bytes]  # position, stream, version, topic, state


def change(folder: Path, statement: str, *values: object) -> None:
    """Run a statement of SQL over the ledger of a store."""
    with closing(sqlite3.connect(folder / "ledger.sqlite")) as connection, connection:
        connection.execute(statement, values)


def stored(folder: Path) -> list[Row]:
    """The rows of its ledger, as they are."""
    with closing(sqlite3.connect(folder / "ledger.sqlite")) as connection:
        return connection.execute("SELECT rowid, * FROM stored_events ORDER BY rowid").fetchall()


def resealed(stream: str, version: int, topic: str, envelope: dict[str, Any]) -> dict[str, Any]:
    """`envelope` with a digest that fits: what someone makes who knows the format."""
    rest = {key: value for key, value in envelope.items() if key != "digest"}
    return rest | {"digest": digest(stream, version, topic, canonical(rest))}


def forge(folder: Path, position: int, *, chain: bool, **edits: Any) -> None:
    """Rewrite a row as someone would who knows the format; with `chain` all later digests of its stream too."""
    rows = stored(folder)
    stream = next(row[1] for row in rows if row[0] == position)
    previous: str | None = None
    for rowid, originator, version, topic, state in rows:
        if originator != stream:
            continue
        envelope = json.loads(state)
        if rowid == position:
            envelope["body"] |= edits
        if rowid == position or (chain and rowid > position):
            envelope["previous"] = previous if chain else envelope["previous"]
            envelope = resealed(stream, version, topic, envelope)
        previous = envelope["digest"]
        change(folder, "UPDATE stored_events SET state=? WHERE rowid=?", canonical(envelope), rowid)


def rewrite(folder: Path, position: int, **edits: Any) -> None:
    """Compute the whole history anew with another event: every digest, link and seal fits."""
    tree, tails = Tree(), dict[str, str]()
    for rowid, stream, version, topic, state in stored(folder):
        envelope = json.loads(state)
        if rowid == position:
            envelope["body"] |= edits
        if topic == "whyhot:LedgerSealed":
            envelope["body"]["root"] = tree.root
        envelope["previous"] = tails.get(stream)
        envelope = resealed(stream, version, topic, envelope)
        tails[stream] = envelope["digest"]
        tree.add(entry(rowid, stream, version, topic, canonical(envelope)))
        change(folder, "UPDATE stored_events SET state=? WHERE rowid=?", canonical(envelope), rowid)
