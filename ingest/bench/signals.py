"""The signals of a log and the ways a bench file may name them: `signal`, `message.signal`, `bus:message.signal`; a
column of a table `signal`, or `rows.signal` where a message has one of that name too."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from ingest.texts.nearest import nearest

BUS = r"can\d+"  # how a bus is called
TABLE = "rows"  # what stands for a message where the signal is a column of a table


@dataclass(frozen=True)
class Signal:
    """A signal of a log: of a CAN message, or a column of a table (then `message` is None)."""

    name: str
    message: str | None = None
    bus: str | None = None  # "can<n>", None where the message is not tied to one
    unit: str | None = None  # as database or unit row give it
    resolution: float | None = None  # smallest step, in that unit
    source: str | None = None  # the database's file name, for messages

    @property
    def qualified(self) -> str:
        """The longest name that a bench file may use for it."""
        full = f"{self.message}.{self.name}" if self.message else self.name
        return f"{self.bus}:{full}" if self.bus else full

    @property
    def alone(self) -> str:
        """The name that means no signal of another kind of log."""
        return self.qualified if self.message else f"{TABLE}.{self.name}"

    def __str__(self) -> str:
        """ "EW_A_3v (bench.dbc, TempA)"."""
        home = ", ".join(part for part in (self.source, self.bus, self.message) if part)
        return f"{self.name} ({home})" if home else self.name


class Directory:
    """The signals of some logs by every name they go by."""

    def __init__(self, signals: Sequence[Signal]) -> None:
        self._by_name: dict[str, list[Signal]] = {}
        for signal in dict.fromkeys(signals):
            for name in _names(signal):
                self._by_name.setdefault(name, []).append(signal)

    def find(self, name: str) -> list[Signal]:
        """Every signal that `name` may mean; more than one is for the caller to refuse.

        "can2:Message.signal" finds a signal that is tied to no bus, and ties it to that one.
        """
        found = self._by_name.get(name, [])
        tied = re.fullmatch(rf"({BUS}):(.+)", name, re.DOTALL)
        if found or not tied:
            return found
        free = [signal for signal in self._by_name.get(tied[2], []) if signal.bus is None and signal.message]
        return [replace(signal, bus=tied[1]) for signal in free if tied[2] != signal.name]

    def nearest(self, name: str) -> str:
        """The signal whose name reads most like `name`, as a clause " Nearest: X (database, message).", or nothing."""
        bare = re.sub(rf"^{BUS}:", "", name)
        close = nearest(bare, self._by_name) or nearest(bare.rpartition(".")[2], self._by_name)
        return f" Nearest: {self._by_name[close[0]][0]}." if close else ""


def _names(signal: Signal) -> Iterator[str]:
    yield signal.name
    if signal.message:
        yield f"{signal.message}.{signal.name}"
        if signal.bus:
            yield signal.qualified
    else:
        yield signal.alone
