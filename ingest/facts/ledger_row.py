"""An event and what is stored beside it: the row of the ledger, there and back."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from types import UnionType
from typing import Annotated, Any, ClassVar, get_args, get_origin, get_type_hints

from eventsourcing.persistence import StoredEvent

from ingest.errors import DamageError, LedgerError
from ingest.facts.chain import canonical, digest
from ingest.facts.events import EVENTS, Event

TIME = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}Z")  # as `utc_text` writes it
KEYS = {"v", "happened", "recorded", "code", "caused_by", "previous", "digest", "body"}


@dataclass(frozen=True)
class Recorded:
    """An event as it stands in the ledger, its digest checked."""

    position: int  # from 1, in the whole ledger
    stream: str
    version: int  # from 1, in its stream
    event: Event
    happened: str | None  # ISO 8601 UTC, as is `recorded`, which rises strictly with the position
    recorded: str
    code: str  # the program that wrote it
    caused_by: str | None
    previous: str | None  # digest of the stream's event before
    digest: str


def encode(
    event: Event, stream: str, tail: Recorded | None, recorded: str, happened: str | None
) -> tuple[StoredEvent, Recorded]:
    """The row of `event` behind `tail`, its stream's last, and what it reads as at no position yet (0).

    Raises LedgerError where it would not come back equal.
    """
    if EVENTS.get(event.TOPIC) is not type(event):
        raise LedgerError(f"{event.TOPIC}: is not an event of the ledger: declare it in ingest/facts/events.py")
    number = tail.version + 1 if tail else 1
    envelope: dict[str, Any] = {
        "v": event.VERSION,
        "happened": happened,
        "recorded": recorded,
        "code": _code(),
        "caused_by": None,  # nothing says it: what an event follows from is in its body
        "previous": tail.digest if tail else None,
        "body": vars(event),
    }
    proof = digest(stream, number, event.TOPIC, canonical(envelope))
    row = StoredEvent(stream, number, event.TOPIC, canonical(envelope | {"digest": proof}))
    one = decode(row, 0)
    if one.event != event:
        raise LedgerError(
            f"{event.TOPIC}: holds what JSON does not give back (a tuple, a number as key): use lists and text"
        )
    return row, one


def utc_text(moment: datetime) -> str:
    """A time as the ledger writes it, ISO 8601 UTC with microseconds; UTC where `moment` names no zone."""
    aware = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return aware.astimezone(UTC).replace(tzinfo=None).isoformat(timespec="microseconds") + "Z"


@cache
def _code() -> str:
    """The program that writes; looked up once, as it costs more than all else of an event."""
    return f"whyhot {version('whyhot')}"


def decode(row: StoredEvent, position: int) -> Recorded:
    """The event of a stored row. Raises DamageError where a byte was changed, LedgerError where it is none of ours."""
    stream, number, topic, state = row.originator_id, row.originator_version, row.topic, row.state
    where = f"event {position} ({stream!r} version {number!r})"
    if not (isinstance(stream, str) and type(number) is int and isinstance(topic, str) and isinstance(state, bytes)):
        raise DamageError(f"{where}: a column has another type than was written: restore the ledger from a backup")
    envelope = _parse(state)
    proof = envelope["digest"] if envelope else ""
    try:
        true = envelope is not None and proof == digest(stream, number, topic, without_digest(state, proof))
    except LedgerError:  # text that is no UTF-8
        true = False
    if envelope is None or not true:
        raise DamageError(f"{where}: is not what was written, its digest differs: restore the ledger from a backup")
    event = _event(topic, envelope, where)
    beside = {key: envelope[key] for key in KEYS - {"v", "body"}}
    if not _fits(beside, Recorded) or not TIME.fullmatch(beside["recorded"]):
        raise DamageError(f"{where}: what is stored beside it is nothing that whyhot writes: it was forged")
    return Recorded(position=position, stream=stream, version=number, event=event, **beside)


def without_digest(state: bytes, proof: str) -> bytes:
    """`state` with its member `digest` cut out, as it was when `proof` was computed; keys that sort later follow it."""
    return state.replace(f'"digest":"{proof}",'.encode(), b"", 1)


def _parse(state: bytes) -> dict[str, Any] | None:
    """The envelope, or None where `state` is none."""
    try:
        envelope = json.loads(state)
    except (ValueError, RecursionError):
        return None
    whole = isinstance(envelope, dict) and envelope.keys() == KEYS and isinstance(envelope["digest"], str)
    return envelope if whole else None


def _event(topic: str, envelope: dict[str, Any], where: str) -> Event:
    """The body as an event: only what is declared in `EVENTS`, never by importing what a topic names."""
    kind = EVENTS.get(topic)
    if kind is None:
        raise LedgerError(f"{where}: {topic!r} is not an event of this whyhot: it was forged, or a newer one wrote it")
    version, body = envelope["v"], envelope["body"]
    try:
        while version in kind.EARLIER:
            version, body = version + 1, kind.EARLIER[version](body)
        if version != kind.VERSION or not _fits(body, kind):
            raise TypeError
        return kind(**body)
    except (TypeError, LookupError):
        raise LedgerError(
            f"{where}: {topic} version {envelope['v']!r} does not fit this whyhot (it knows {kind.VERSION}): "
            "update whyhot"
        ) from None


def _fits(values: Any, kind: type) -> bool:
    """Whether `values` are named and typed as fields of `kind` are."""
    fields = _fields(kind)
    return isinstance(values, dict) and all(name in fields and fields[name](value) for name, value in values.items())


@cache
def _fields(kind: type) -> dict[str, Callable[[Any], bool]]:
    """Name of each field of a dataclass -> whether a value is of its type."""
    hints = get_type_hints(kind, include_extras=True)
    return {name: _is_of(hint) for name, hint in hints.items() if get_origin(hint) is not ClassVar}


def _is_of(hint: Any) -> Callable[[Any], bool]:
    """Whether a JSON value is of an annotated type: str, int (64 bits), float, bool, X | None, list[X], dict[str, X],
    Any; of a dict that is `Annotated` with the types of some keys, of these where they are there. Made once a field, as
    a large ledger holds a million values."""
    match get_origin(hint), get_args(hint):
        case (origin, (whole, inside)) if origin is Annotated:
            fits, keys = _is_of(whole), {name: _is_of(one) for name, one in inside.items()}
            return lambda value: fits(value) and all(keys[name](value[name]) for name in keys.keys() & value.keys())
        case (origin, kinds) if origin is UnionType:
            ways = [_is_of(one) for one in kinds]
            return lambda value: any(way(value) for way in ways)
        case (origin, (kind,)) if origin is list:
            entry = _is_of(kind)
            return lambda value: isinstance(value, list) and all(map(entry, value))
        case (origin, (_, kind)) if origin is dict:
            entry = _is_of(kind)
            return lambda value: isinstance(value, dict) and all(map(entry, value.values()))
    if hint is int:
        return lambda value: type(value) is int and -(2**63) <= value < 2**63
    if hint is float:
        return lambda value: type(value) in (float, int)
    return lambda value: hint is Any or type(value) is hint
