"""Signal databases (DBC): which message an identifier is, and where its signals lie.

cantools reads the file; what decoding needs is kept in a small model of our own. Identifiers match exactly, 29-bit ones
too: J1939 source addresses and priorities are not masked.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from ingest.bench.signals import Signal
from ingest.errors import DatabaseError
from ingest.formats import EXTENDED
from ingest.log.bits import FLOATS, Layout


@dataclass(frozen=True)
class MessageSignal:
    """A signal of a message. With `multiplexer` it is in a frame only where that signal's bits are one of `when`."""

    name: str
    layout: Layout
    unit: str | None = None
    multiplexer: str | None = None
    when: tuple[int, ...] = ()


@dataclass(frozen=True)
class Message:
    """A CAN message."""

    name: str
    can_id: int  # bit 31 set for a 29-bit identifier, as in `Frames`
    length: int  # of the payload [bytes]
    signals: tuple[MessageSignal, ...]
    source: str = field(default="", compare=False)  # name of the database's file


@dataclass(frozen=True)
class Database:
    """A DBC file. `sha256` of its bytes is its identity; `notes` say what was read although it should not be there."""

    sha256: str
    name: str
    messages: Mapping[int, Message]  # by can_id
    data: bytes = field(default=b"", repr=False)
    notes: tuple[str, ...] = ()


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
    """The DBC in `data` (UTF-8, else Windows-1252); `name` is the file's, for messages.

    Signals that overlap or leave their message are noted and read all the same. Raises DatabaseError (file and line).
    """
    text = _text(data)
    notes: list[str] = []
    entries = _parse(text, name, notes)
    messages: dict[int, Message] = {}
    for entry in entries:
        message = _message(entry, name, notes)
        if messages.setdefault(message.can_id, message) is not message:
            kept = messages[message.can_id].name
            notes.append(f"{name}: {message.name} has the identifier of {kept}: {kept}, the first, is used")
    return Database(hashlib.sha256(data).hexdigest(), name, messages, data, tuple(notes))


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


def _text(data: bytes) -> str:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    return text.replace("\r\n", "\n")


def _parse(text: str, name: str, notes: list[str]) -> list[Any]:
    """The cantools messages of a DBC text; what makes cantools refuse it only when strict becomes a note."""
    from cantools.database.errors import Error

    try:
        return _cantools(text, name, strict=True)
    except Error as error:
        why = str(error)
    try:
        messages = _cantools(text, name, strict=False)
    except Error as error:
        raise _refused(text, name, error) from error
    notes.append(f"{name}{_line_of(text, why)}: {why.rstrip('.')}: read all the same")
    return messages


def _cantools(text: str, name: str, strict: bool) -> list[Any]:
    import textparser
    from cantools.database.can.formats.dbc import load_string
    from cantools.database.errors import Error

    try:
        return list(load_string(text, strict=strict).messages)
    except Error:
        raise
    except textparser.ParseError as error:
        raise DatabaseError(_not_a_dbc(text, name, error.line, error.column)) from error
    except Exception as error:  # a foreign parser on foreign bytes: whatever it trips over is the file's
        raise _refused(text, name, error) from error


def _refused(text: str, name: str, error: Exception) -> DatabaseError:
    says = str(error).rstrip(".") or type(error).__name__
    return DatabaseError(f"{name}{_line_of(text, says)}: {says}. Correct the DBC, then give it again.")


def _not_a_dbc(text: str, name: str, line: int, column: int) -> str:
    lines = text.split("\n")
    says = lines[line - 1].strip()[:60] if line <= len(lines) else ""
    what = f'"{says}" is not DBC at column {column}' if says else "the DBC ends before its end"
    return f"{name}:{line}: {what}. Export the database again, or correct the line."


def _line_of(text: str, says: str) -> str:
    """ ":12" where the message that an error names begins, nothing where it names none."""
    named = re.search(r"message (\w+)", says)
    begins = named and re.search(rf"^[ \t]*BO_\s+\d+\s+{named[1]}\s*:", text, re.MULTILINE)
    return f":{text.count(chr(10), 0, begins.start()) + 1}" if begins else ""


def _message(entry: Any, name: str, notes: list[str]) -> Message:
    can_id = entry.frame_id | (int(EXTENDED) if entry.is_extended_frame else 0)
    signals = []
    for signal in entry.signals:
        layout = _layout(signal)
        if not (1 <= layout.length <= 64) or (layout.is_float and layout.length not in FLOATS):
            notes.append(f"{name}: {entry.name}.{signal.name} has {layout.length} bits: left out")
            continue
        when = tuple(signal.multiplexer_ids or ())
        signals.append(MessageSignal(signal.name, layout, signal.unit or None, signal.multiplexer_signal, when))
    return Message(entry.name, can_id, entry.length, tuple(signals), name)


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
