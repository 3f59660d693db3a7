"""What becomes of each signal of a log: its group, its column, its unit, and which channel of the bench file it is."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from numpy.typing import NDArray

from ingest.bench.bench_file import Bench
from ingest.bench.resolving import ResolvedChannel
from ingest.bench.signals import TABLE, Signal
from ingest.errors import BenchFileError
from ingest.formats import RASTERS, SERIES
from ingest.log.clock import Stream
from ingest.log.databases import Message, signals_of
from ingest.log.j1939 import Explained
from ingest.log.reading import LogReading
from ingest.log.recording import bus_name, id_text, identifiers
from ingest.log.samples import FIXED, Column
from ingest.texts.guessing import guess
from ingest.texts.quantities import column_suffix
from ingest.texts.units import normal_unit

LONGEST_NAME = 100  # of a file
Source = tuple[str, str]  # group name, name of a signal in it


@dataclass(frozen=True)
class OutputColumn:
    """A column of a group and how its values come from signals; `channel` is its entry in the event (None for text).
    `held`: sources that come at other times than the group's rows, or than the first one: each holds its last value."""

    column: Column
    sources: tuple[Source, ...]  # the signal itself, or those of an expression in the order of its names
    spec: ResolvedChannel | None = None
    channel: dict[str, Any] | None = None
    held: frozenset[Source] = frozenset()

    def values(self, inputs: Sequence[NDArray[Any]]) -> NDArray[Any]:
        """The column (N,), from the values (N,) of `sources` as they stand in the file."""
        if self.spec is None or self.column.text:
            return inputs[0]
        if self.spec.formula is None:
            return self.spec.conversion(inputs[0])
        named = dict(zip(self.spec.formula.names, inputs, strict=True))
        return self.spec.conversion(self.spec.formula.evaluate(named))


@dataclass
class SignalGroup:
    """Signals that share their stamps: a message on a bus, or a table (`message` and `bus` None), or a
    `series` of one. `rasters`: column -> which of the tables that a table was joined of."""

    name: str
    message: Message | None = None
    bus: int | None = None
    signals: tuple[Signal, ...] = ()
    outputs: list[OutputColumn] = field(default_factory=list)
    series: str | None = None
    rasters: Mapping[str, int] = field(default_factory=dict)

    @property
    def stream(self) -> Stream:
        """The stream of the log that holds its records."""
        return (self.bus, self.message.can_id) if self.message and self.bus is not None else self.series

    @property
    def file(self) -> str:
        """Name of its Parquet file: that of the group, with some of its SHA-256 where a file cannot be called so."""
        plain = re.sub(r"[^\w.-]", "_", self.name, flags=re.ASCII)[:LONGEST_NAME]
        if plain != self.name:
            plain += f"-{hashlib.sha256(self.name.encode()).hexdigest()[:8]}"
        return f"{plain}.parquet"

    def entry(self, rows: int) -> dict[str, Any]:
        """A group of `rows` rows as `DecodeCompleted` lists it."""
        columns = [output.column.name for output in self.outputs]
        return {"name": self.name, "file": self.file, "rows": rows, "columns": columns}

    @property
    def held(self) -> set[Source]:
        """Signals that derived channels of the group need at other times than they come."""
        return set().union(*(output.held for output in self.outputs))

    def turn(self, name: str) -> object:
        """What tells in which of the group's rows a signal is: its page of a multiplexer, or its raster. None where it
        is in all."""
        if self.message is None:
            return self.rasters.get(name)
        signal = next(one for one in self.message.signals if one.name == name)
        return (signal.multiplexer, signal.when) if signal.multiplexer else None


def groups_of(reading: LogReading, means: Explained) -> list[SignalGroup]:
    """The groups of a log, without outputs: every message that was seen on a bus, or the table, or its series."""
    if reading.holds == "rows":
        signals = {name: Signal(name, unit=reading.units.get(name)) for name in reading.columns}
        series = reading.settings.get(SERIES, {"": reading.columns}).items()
        rasters = {name: place for place, names in enumerate(reading.settings.get(RASTERS, ())) for name in names}
        return [
            SignalGroup(
                f"{TABLE}_{place}" if name else TABLE,
                signals=tuple(signals[column] for column in columns),
                series=name or None,
                rasters=rasters,
            )
            for place, (name, columns) in enumerate(series, 1)
            if signals.keys() >= set(columns)  # of a table without one row that could be read there is nothing
        ]
    there = means.there(identifiers(reading))
    seen = [
        (bus, means.message(bus, can_id))
        for bus in reading.buses
        for can_id in means.messages
        if (bus, can_id) in there
    ]
    return [
        SignalGroup(name, message, bus, tuple(signals_of(message, bus_name(bus))))
        for (bus, message), name in zip(seen, _names(seen), strict=True)
    ]


def plan(
    groups: Sequence[SignalGroup], channels: Sequence[ResolvedChannel], bench: Bench | None, texts: Collection[str] = ()
) -> list[str]:
    """Give each group its outputs; returns the channels for which this log holds no signal.

    `texts`: names of the table's text columns. Without a bench file quantities are guessed. Raises BenchFileError
    where a channel needs numbers of a column of text.
    """
    home = {_identity(signal): group for group in groups for signal in group.signals}
    named = {_identity(spec.signals[0]): spec for spec in channels if not spec.derived}
    called, said = _channel_names(groups), {spec.name for spec in channels}
    _refuse_text(bench, channels, texts)
    for group in groups:
        taken = Counter(FIXED)
        for signal in group.signals:
            if signal.name in texts:
                column = Column(_unique(signal.name, taken), signal.name, text=True)
                group.outputs.append(OutputColumn(column, ((group.name, signal.name),)))
            elif spec := named.get(_identity(signal)):
                group.outputs.append(_bench_output(group, spec, [(group.name, signal.name)], taken, signal))
            else:
                name = called[group.name, signal.name]
                name = signal.alone if name in said else name  # a signal of another log is called so
                group.outputs.append(_file_output(group, signal, name, bench is None, taken))
    missing = [spec.name for key, spec in named.items() if key not in home and spec.role != "ignored"]
    for spec in (spec for spec in channels if spec.derived):
        homes = [home[_identity(signal)] for signal in spec.signals if _identity(signal) in home]
        if not homes or len(homes) < len(spec.signals):
            missing.append(spec.name)
            continue
        sources = [(group.name, signal.name) for group, signal in zip(homes, spec.signals, strict=True)]
        taken = Counter([*FIXED, *(output.column.name.lower() for output in homes[0].outputs)])
        output = _bench_output(homes[0], spec, sources, taken, None)
        homes[0].outputs.append(replace(output, held=_held(homes, sources)))
    return missing


def _held(homes: Sequence[SignalGroup], sources: Sequence[Source]) -> frozenset[Source]:
    """Which sources of a derived channel hold their last value: those of other groups than the first one's, and those
    that are never in one row with the first that is not in all."""
    turns = [group.turn(name) if group is homes[0] else None for group, (_, name) in zip(homes, sources, strict=True)]
    first = next((turn for turn in turns if turn is not None), None)
    together = zip(homes, sources, turns, strict=True)
    return frozenset(source for group, source, turn in together if group is not homes[0] or turn not in (None, first))


def _names(seen: Sequence[tuple[int, Message]]) -> list[str]:
    """Message names; with the bus before, and then the identifier behind, where that is not unique."""
    plain = Counter(message.name for _, message in seen)
    names = [m.name if plain[m.name] == 1 else f"{bus_name(bus)}_{m.name}" for bus, m in seen]
    with_bus = Counter(names)
    return [
        name if with_bus[name] == 1 else f"{name}_{id_text(bus, message.can_id).partition(':')[2]}"
        for name, (bus, message) in zip(names, seen, strict=True)
    ]


def _channel_names(groups: Sequence[SignalGroup]) -> dict[Source, str]:
    """Signal names; as a bench file writes them where others have that name too ("can2:Inverter.T"), with the group
    where two messages on one bus share even that."""
    signals = [(group.name, signal) for group in groups for signal in group.signals]
    bare = Counter(signal.name for signal in _apart(signal for _, signal in signals))
    full = Counter(signal.qualified for signal in _apart(signal for _, signal in signals))

    def name(group: str, signal: Signal) -> str:
        if bare[signal.name] == 1:
            return signal.name
        return signal.qualified if full[signal.qualified] == 1 else f"{group}.{signal.name}"

    return {(group, signal.name): name(group, signal) for group, signal in signals}


def _apart(signals: Iterable[Signal]) -> list[Signal]:
    """Signals of messages, and those of tables once each: a column that several series have is one channel."""
    some = list(signals)
    return [one for one in some if one.message] + list(dict.fromkeys(one for one in some if not one.message))


def _identity(signal: Signal) -> tuple[str | None, str | None, str]:
    return signal.bus, signal.message, signal.name


def _refuse_text(bench: Bench | None, channels: Sequence[ResolvedChannel], texts: Collection[str]) -> None:
    for spec in channels:
        found = next((signal.name for signal in spec.signals if signal.name in texts), None)
        if found is not None and spec.role != "ignored":
            raise BenchFileError(
                f'{bench.name if bench else "bench file"}:{spec.line}: signal "{found}" holds text in this log: it '
                f"cannot be {'part of ' if spec.derived else 'a '}{spec.quantity}. Correct the name, or add "
                'role = "ignored".'
            )


def _file_output(group: SignalGroup, signal: Signal, name: str, guessing: bool, taken: Counter[str]) -> OutputColumn:
    """A signal that no bench file speaks of, as the channel `name`: in its own unit, unconverted."""
    unit = normal_unit(signal.unit or "")
    column = Column(
        _unique(signal.name + column_suffix(unit), taken),
        signal.name,
        unit or signal.unit,
        guess(signal.name, signal.unit) if guessing else None,
    )
    entry = _entry(group, signal, column, "input" if guessing else "ignored") | {"name": name}
    return OutputColumn(column, ((group.name, signal.name),), None, entry)


def _bench_output(
    group: SignalGroup, spec: ResolvedChannel, sources: Sequence[Source], taken: Counter[str], signal: Signal | None
) -> OutputColumn:
    """A channel of the bench file, in the stored unit; `signal` None for a derived one."""
    bare = signal.name if signal else spec.name
    column = Column(_unique(bare + column_suffix(spec.quantity), taken), bare, spec.stored_unit, spec.quantity)
    said = {"name": spec.name, "node": spec.node, "region": spec.region, "derived": spec.derived}
    entry = _entry(group, signal, column, spec.role) | said
    return OutputColumn(column, tuple(sources), spec, entry)


def _entry(group: SignalGroup, signal: Signal | None, column: Column, role: str) -> dict[str, Any]:
    """A channel as `DecodeCompleted` lists it; `signal` is what file and database say of it."""
    return {
        "name": column.signal,
        "group": group.name,
        "column": column.name,
        "quantity": column.quantity,
        "unit": column.unit,
        "node": None,
        "region": None,
        "role": role,
        "derived": False,
        "signal": vars(signal) if signal else None,
    }


def _unique(name: str, taken: Counter[str]) -> str:
    """`name`, with a number behind it where the group has such a column already: in SQL case tells nothing apart."""
    taken[name.lower()] += 1
    if taken[name.lower()] == 1:
        return name
    return _unique(f"{name}_{taken[name.lower()]}", taken)
