"""The rows of a ledger in their order: each checked against itself and all before it, and hashed into one tree."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from eventsourcing.persistence import Notification

from ingest.errors import IngestError
from ingest.facts.chain import Head, Tree, entry
from ingest.facts.events import LedgerSealed
from ingest.facts.ledger_row import Recorded, decode

Tail = tuple[int, str | None]  # of a stream: its last version, and the digest where that is known


class Flaw(NamedTuple):
    """What is wrong in a ledger, in one line; `stream` of the event that it is about, None where it is about none."""

    says: str
    stream: str | None = None


@dataclass
class LedgerHistory:
    """`recorded`: the events that are whole, from the first row that was added. `findings`: what is wrong with the
    others, in the order of the ledger."""

    recorded: list[Recorded] = field(default_factory=list)
    findings: list[Flaw] = field(default_factory=list)
    position: int = 0  # of the last row
    tree: Tree = field(default_factory=Tree)
    moment: str = ""  # when the last row was recorded
    tail_of: Callable[[str], Tail] = lambda stream: (0, None)  # of a stream in the rows before the first
    resumed: bool = False  # behind rows that were added before: `recorded` lacks these
    halfway: bool = False  # an interrupt (Ctrl-C) came while a row was added: nothing may be built on this
    _tails: dict[str, Tail] = field(default_factory=dict)

    @property
    def head(self) -> Head:
        """Position of the last row and Merkle root over all rows up to it."""
        return Head(self.position, self.tree.root)

    def behind(self, position: int) -> list[Recorded]:
        """The events after `position`."""
        return self.recorded[bisect_right(self.recorded, position, key=lambda one: one.position) :]

    def add(self, row: Notification) -> None:
        """Check the next row against itself and all rows before it."""
        stream = row.originator_id if isinstance(row.originator_id, str) else None
        where = f"event {row.id} ({row.originator_id!r} version {row.originator_version!r})"
        self.halfway = True
        self._count(row.id, where, stream)
        try:
            one = decode(row, row.id)
        except IngestError as error:
            self.findings.append(Flaw(str(error), stream))
            if isinstance(row.originator_version, int):
                self._tails[str(row.originator_id)] = (row.originator_version, None)
        else:
            self._chain(one, where)
            self._seal(one, where)
            self.recorded.append(one)
        self._grow(row)
        self.halfway = False

    def _count(self, position: int, where: str, stream: str | None) -> None:
        if position < 1:
            self.findings.append(Flaw(f"{where}: its number was changed, the first event is number 1", stream))
        elif position != self.position + 1:
            self.findings.append(Flaw(f"events {self.position + 1} to {position - 1} are missing"))

    def _chain(self, one: Recorded, where: str) -> None:
        version, digest = self._tails.get(one.stream) or self.tail_of(one.stream)
        if one.version != version + 1:
            says = f"{where}: follows version {version} of its stream: events are missing or in another order"
            self.findings.append(Flaw(says, one.stream))
        elif one.previous != digest and (digest or version == 0):
            says = f"{where}: does not follow the event before it in its stream, which is another one now"
            self.findings.append(Flaw(says, one.stream))
        if one.recorded <= self.moment:
            says = f"{where}: was recorded before the event in front of it: the order was changed"
            self.findings.append(Flaw(says, one.stream))
        self._tails[one.stream] = (one.version, one.digest)
        self.moment = one.recorded

    def _seal(self, one: Recorded, where: str) -> None:
        sealed = one.event
        if isinstance(sealed, LedgerSealed) and Head(sealed.position, sealed.root) != self.head:
            says = f"{where}: the seal does not fit: something in events 1 to {self.position} was changed since then"
            self.findings.append(Flaw(says))

    def _grow(self, row: Notification) -> None:
        try:
            self.tree.add(entry(row.id, str(row.originator_id), row.originator_version, row.topic, row.state))
        except (IngestError, TypeError):
            self.tree.add(b"")  # a column of another type, already found; no root fits any more
        self.position = max(self.position, row.id)
