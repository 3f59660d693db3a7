"""Events as commands append them, for the tests of ledger, facts and store."""

from __future__ import annotations

import hashlib
from typing import Any

from ingest.facts.events import DecodeCompleted, RawFileSealed, SessionRecorded
from ingest.facts.store import Store


def sha(text: str) -> str:
    """SHA-256 (hex) of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def raw(name: str, data: bytes = b"") -> RawFileSealed:
    """A sealed log of this name."""
    return RawFileSealed(
        sha256=hashlib.sha256(data or name.encode()).hexdigest(), name=name, size=len(data), format="blf"
    )


def put(store: Store, name: str) -> None:
    """Seal a log that holds its own name, and record it."""
    store.archive.seal(name.encode())
    one = raw(name, name.encode())
    store.ledger.append(f"file-{one.sha256}", one)


def decode(number: str, of: str, bench: str | None = None, **more: Any) -> DecodeCompleted:
    """The decode of a raw file, under a bench file where one is given; `more` fields of the event."""
    given: dict[str, Any] = {
        "databases": [],
        "decoder": "1",
        "outcome": "decoded",
        "why": None,
        "absolute": True,
        "start_ns": 1_700_000_000_000_000_000,
        "end_ns": 1_700_000_060_000_000_000,
        "balance": {"found": 3, "decoded": 2, "unknown_id": 1},
    }
    return DecodeCompleted(decode=number, raw=of, bench=bench, **(given | more))


def session(number: str, name: str, start_ns: int | None = 0, bench: str | None = None) -> SessionRecorded:
    """A session of this number and name."""
    return SessionRecorded(
        session=number,
        name=name,
        kind="s1",
        kind_why="given by the bench file",
        specimen=None,
        batch=None,
        bench=bench,
        configuration=None,
        attributes={},
        absolute=start_ns is not None,
        start_ns=start_ns or 0,
        end_ns=(start_ns or 0) + 1,
        files=[],
    )
