"""Identifiers that several databases explain otherwise, as those of two buses do: which message is meant on a bus.

It is the one whose signals a bench file names with that bus (`can2:Bms.T_cell`), else that of the database given first.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from ingest.log.databases import Database, Message
from ingest.log.recording import bus_name, id_text

Place = tuple[int, int]  # bus, identifier
SHOWN = 3


def on_bus(databases: Sequence[Database], seen: Collection[Place], names: Collection[str]) -> dict[Place, Message]:
    """The messages of `seen` identifiers that `names` of signals tell, where databases differ about them."""
    told = ((place, _told(messages, place[0], names)) for place, messages in _differing(databases, seen).items())
    return {place: message for place, message in told if message}


def untold(databases: Sequence[Database], seen: Collection[Place], names: Collection[str]) -> str | None:
    """As which message identifiers are read of which databases differ, and no name tells it; None where there are
    none."""
    differing = _differing(databases, seen)
    left = {place: messages for place, messages in differing.items() if not _told(messages, place[0], names)}
    if not left:
        return None
    lines = [
        f"{id_text(*place)} is read as {first.name} of {first.source}, and not as {other.name} of {other.source}"
        for place, (first, other, *_) in sorted(left.items())
    ]
    more = f"; and {len(lines) - SHOWN:,} more" if len(lines) > SHOWN else ""
    return f"{'; '.join(lines[:SHOWN])}{more}: {_advice(left)}"


def _advice(left: Mapping[Place, Sequence[Message]]) -> str:
    others = (
        f'where it is the other, name its signals in the bench file as "{bus_name(bus)}:{other.name}.{signal.name}"'
        for (bus, _), (first, other, *_) in sorted(left.items(), reverse=True)
        for signal in other.signals
        if other.name != first.name
    )
    return next(others, "give only the databases of this log")


def _differing(databases: Sequence[Database], seen: Collection[Place]) -> dict[Place, list[Message]]:
    """The messages that databases say seen identifiers are, in the order of the databases, where they differ."""
    ids = {can_id for _, can_id in seen}
    found: dict[int, list[Message]] = {}
    for database in databases:
        for can_id in ids & database.messages.keys():
            known = found.setdefault(can_id, [])
            known += [database.messages[can_id]] if database.messages[can_id] not in known else []
    return {(bus, can_id): found[can_id] for bus, can_id in seen if len(found.get(can_id, ())) > 1}


def _told(messages: Sequence[Message], bus: int, names: Collection[str]) -> Message | None:
    begins = ((message, f"{bus_name(bus)}:{message.name}.") for message in messages)
    return next((message for message, begin in begins if any(name.startswith(begin) for name in names)), None)
