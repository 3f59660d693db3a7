"""Signal databases: which message an identifier is, and where its signals lie.

cantools reads the files (`ingest/log/database_files.py`); what decoding needs is kept in a small model of our own.
Identifiers match exactly, but for those of J1939 (`ingest/log/j1939.py`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ingest.bench.signals import Signal
from ingest.formats import EXTENDED
from ingest.log.bits import FLOATS, Layout
from ingest.log.database_files import DBC, read_database
from ingest.log.value_names import no_numbers_named

ANY_SOURCE = 0xFE  # source address of J1939 in databases: whoever sends it


@dataclass(frozen=True)
class MessageSignal:
    """A signal of a message. With `multiplexer` it is in a frame only where that signal's bits are one of `when`."""

    name: str
    layout: Layout
    unit: str | None = None
    multiplexer: str | None = None
    when: tuple[int, ...] = ()
    errors: tuple[int, ...] = ()  # its bits where they are no number: by their names an error
    not_available: tuple[int, ...] = ()  # and none at all


@dataclass(frozen=True)
class Message:
    """A CAN message."""

    name: str
    can_id: int  # bit 31 set for a 29-bit identifier, as in `Frames`
    length: int  # of the payload [bytes]
    signals: tuple[MessageSignal, ...]
    source: str = field(default="", compare=False)  # name of the database's file
    is_j1939: bool = False  # its identifier means its parameter group, whatever priority and sender


@dataclass(frozen=True)
class Database:
    """A database file. `sha256` of its bytes is its identity; `notes`: what was read though it should not be there."""

    sha256: str
    name: str
    messages: Mapping[int, Message]  # by can_id
    data: bytes = field(default=b"", repr=False)
    notes: tuple[str, ...] = ()
    kind: str = DBC


def signals_of(message: Message, bus: str | None = None) -> list[Signal]:
    """The signals of `message` as the bench file may name them, on `bus` ("can1")."""
    return [
        Signal(
            name=entry.name,
            message=message.name,
            bus=bus,
            unit=entry.unit,
            resolution=None if entry.layout.is_float else abs(float(entry.layout.scale)),
            source=message.source,
        )
        for entry in message.signals
    ]


def load(data: bytes, name: str) -> Database:
    """The DBC, KCD, SYM or ARXML in `data`; `name` is the file's, for messages.

    Signals that overlap or leave their message are noted and read all the same. Raises DatabaseError (file and line).
    """
    notes: list[str] = []
    file = read_database(data, name, notes)
    messages: dict[int, Message] = {}
    for entry in file.messages:
        message = _message(entry, name, notes, file.is_j1939)
        if messages.setdefault(message.can_id, message) is not message:
            kept = messages[message.can_id].name
            notes.append(f"{name}: {message.name} has the identifier of {kept}: {kept}, the first, is used")
    return Database(hashlib.sha256(data).hexdigest(), name, messages, data, tuple(notes), file.kind)


def merged(databases: Iterable[Database]) -> tuple[dict[int, Message], list[str]]:
    """All messages by can_id, and the notes. Where two databases differ about an identifier the first one is used."""
    messages: dict[int, tuple[Message, Database]] = {}
    notes: list[str] = []
    for database in databases:
        notes += database.notes
        for can_id, message in database.messages.items():
            used, first = messages.setdefault(can_id, (message, database))
            if used != message:
                notes.append(
                    f"{database.name}: {message.name} (0x{can_id & ~int(EXTENDED):X}) differs from {used.name} in "
                    f"{first.name}: {first.name}, given first, is used"
                )
    return {can_id: message for can_id, (message, _) in messages.items()}, notes


def _message(entry: Any, name: str, notes: list[str], is_j1939: bool) -> Message:
    can_id = entry.frame_id | (int(EXTENDED) if entry.is_extended_frame else 0)
    if entry.is_container:
        notes.append(f"{name}: {entry.name} holds other messages in itself: these are not read")
    signals: dict[str, MessageSignal] = {}
    for signal in entry.signals:
        layout = _layout(signal)
        if not (1 <= layout.length <= 64) or (layout.is_float and layout.length not in FLOATS):
            notes.append(f"{name}: {entry.name}.{signal.name} has {layout.length} bits: left out")
            continue
        when = tuple(signal.multiplexer_ids or ())
        none = no_numbers_named(signal.choices or {}, layout, signal.unit)
        one = MessageSignal(signal.name, layout, signal.unit or None, signal.multiplexer_signal, when, *none)
        _add(signals, one, f"{name}: {entry.name}", notes)
    j1939 = entry.is_extended_frame and (is_j1939 or entry.protocol == "j1939" or entry.frame_id & 0xFF == ANY_SOURCE)
    return Message(entry.name, can_id, entry.length, tuple(signals.values()), name, j1939)


def _add(signals: dict[str, MessageSignal], one: MessageSignal, where: str, notes: list[str]) -> None:
    """Add a signal. One that lies at the same place on several pages of a multiplexer is one signal; one that lies at
    another place on another page has the page in its name."""
    known = signals.get(one.name)
    if known == replace(one, when=known.when if known else ()):
        one = replace(one, when=tuple(sorted({*known.when, *one.when})))
    elif known:
        name = f"{one.name}_{one.multiplexer}{'_'.join(map(str, one.when))}"
        notes.append(f"{where}.{one.name} lies elsewhere on another page: {name} there")
        one = replace(one, name=name)
    signals[one.name] = one


def _layout(signal: Any) -> Layout:
    law = signal.conversion
    return Layout(
        start=signal.start,
        length=signal.length,
        big_endian=signal.byte_order == "big_endian",
        signed=signal.is_signed and not law.is_float,
        is_float=law.is_float,
        scale=law.scale,
        offset=law.offset,
    )
