"""What is inside logs, before anything is stored."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ingest.bench.bench_file import read_bench
from ingest.bench.draft import draft_bench
from ingest.bench.draft_loggers import loggers
from ingest.bench.signals import Signal
from ingest.errors import UnreadableLogError
from ingest.facts.durable import scratch
from ingest.formats import Rows, TimeSpec, recognise
from ingest.intake.setup import Setup, kept_name, named_in, refuse_missing, signals_in
from ingest.log import clock, specimens, stamps
from ingest.log.databases import Database, load, merged
from ingest.log.j1939 import explained
from ingest.log.meant import untold
from ingest.log.reading import LogReading, Reader
from ingest.log.recording import identifier_in, identifiers, read
from ingest.log.specimens import Specimens
from ingest.texts.guessing import guess, labels, says_days, unit_in_name

NAMED = 3  # logs in the first comment of a draft; more are counted


@dataclass(frozen=True)
class FoundSignal:
    """One signal: `quantity` is guessed from name and unit; `low`, `high` for columns of tables, None otherwise."""

    signal: Signal
    quantity: str | None
    low: float | None
    high: float | None


@dataclass(frozen=True)
class InspectedFile:
    """One file. `reading` None where nothing can be read, `why` then says it; `ranges`: column -> (least, greatest);
    `stamps`: what is wrong with them, a line each; `days`: the column whose days are its times, which no bench file
    says; `texts`: the columns that hold text."""

    path: Path
    reading: LogReading | None
    why: str | None
    note: str | None
    ranges: dict[str, tuple[float, float]]
    stamps: tuple[str, ...] = ()
    days: str | None = None
    texts: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Inspection:
    """Everything seen. `unknown_ids`: "can1:0x123" -> frames that no database explains; `at_once`: the signals of each
    log and of those that run at the same time; `notes`: what the databases say that is not read, or twice; `texts`: the
    columns that hold text, in all tables that have them."""

    files: tuple[InspectedFile, ...]
    signals: tuple[FoundSignal, ...]
    unknown_ids: dict[str, int]
    at_once: tuple[frozenset[Signal], ...] = ()
    notes: tuple[str, ...] = ()
    texts: frozenset[str] = frozenset()

    @property
    def there(self) -> list[FoundSignal]:
        """The signals that the logs hold: not those of messages that a database describes and no log has."""
        return [seen for seen in self.signals if seen.signal.bus or not seen.signal.message]

    @property
    def refusals(self) -> list[str]:
        """What could not be read, one line a file."""
        return [one.why for one in self.files if one.why]


def inspect(files: Sequence[Path], databases: Sequence[Path], bench: Path | None) -> Inspection:
    """Read logs in a temporary folder and say what they hold. Raises IngestError for a file that is not there."""
    refuse_missing(files)
    loaded = [load(path.read_bytes(), path.name) for path in databases]
    said = Setup(read_bench(bench.read_bytes(), bench.name), b"", (), None) if bench else None
    with scratch() as folder, closing(Reader()) as reader:
        looked = tuple(_look(reader, path, folder, said) for path in files)
    readings = [one.reading for one in looked if one.reading]
    ranges: dict[str, tuple[float, float]] = {}
    for one in looked:
        _widen(ranges, one.ranges)
    texts = frozenset().union(*(one.texts for one in looked)) - ranges.keys()
    seen = tuple(
        FoundSignal(
            signal,
            None if not signal.message and signal.name in texts else guess(signal.name, signal.unit),
            *(ranges.get(signal.name, (None, None)) if not signal.message else (None, None)),
        )
        for signal in _signals(loaded, readings, said)
    )
    at_once = _at_once(loaded, readings, said)
    return Inspection(looked, seen, _unknown(loaded, readings), at_once, _notes(loaded, readings, said), texts)


def _signals(databases: Sequence[Database], readings: Sequence[LogReading], said: Setup | None) -> list[Signal]:
    """The signals of logs, each with the unit that its name ends in where the log says none."""
    found = signals_in(databases, readings, said.bench if said else None)
    return [replace(one, unit=one.unit or unit_in_name(one.name)) for one in found]


def _at_once(
    databases: Sequence[Database], readings: Sequence[LogReading], said: Setup | None
) -> tuple[frozenset[Signal], ...]:
    return tuple(
        frozenset(_signals(databases, [other for other in readings if other is one or _overlap(one, other)], said))
        for one in readings
    )


def _notes(databases: Sequence[Database], readings: Sequence[LogReading], said: Setup | None) -> tuple[str, ...]:
    seen = {place for one in readings for place in identifiers(one)}
    differ = untold(databases, seen, named_in(said.bench if said else None))
    return (*(note for one in databases for note in one.notes), *([differ] if differ else []))


def _overlap(one: LogReading, other: LogReading) -> bool:
    """Whether two logs run at the same time, as far as their stamps tell."""
    if not (one.absolute and other.absolute):
        return False
    begin, end = max(one.start_ns or 0, other.start_ns or 0), min(one.end_ns or 0, other.end_ns or 0)
    return begin <= end


def draft(found: Inspection) -> str:
    """A bench file for these logs, to be completed by a person."""
    untimed = next((one for one in found.files if one.note), None)
    logs = [one.path.name for one in found.files if one.reading]
    name = ", ".join(logs) if len(logs) <= NAMED else f"{len(logs)} logs"
    tables = [one.reading.columns for one in found.files if one.reading]
    settings: dict[str, Any] = {
        "labels": labels([name for name in tables[0] if all(name in one for one in tables)] if tables else ())
    }
    settings["texts"] = found.texts
    settings["loggers"] = loggers(
        {kept_name(one.path): one.reading.columns for one in found.files if one.reading and one.reading.holds == "rows"}
    )
    settings["absolute"] = any(one.reading.absolute for one in found.files if one.reading)
    if untimed and untimed.reading:
        forms = {one.reading.format for one in found.files if one.reading}
        settings |= {"untimed": untimed.note, "days": untimed.days}
        settings["format"] = untimed.reading.format if len(forms) > 1 else None
        wrote = (one.name for one in settings["loggers"] if one.wrote(kept_name(untimed.path)))
        settings["logger"] = next(wrote, None)
    return draft_bench([seen.signal for seen in found.there], settings, name, found.at_once)


def _look(reader: Reader, path: Path, folder: Path, said: Setup | None) -> InspectedFile:
    recording, note, days = folder / "preview.mcap", None, None
    try:
        reading = reader.record(path, recording, said.time(recognise(path), kept_name(path)) if said else None)
    except UnreadableLogError as error:
        if said:
            return InspectedFile(path, None, str(error), None, {})
        try:  # a table without a time column can be looked at all the same
            reading, days = _untimed(reader, path, recording)
        except UnreadableLogError:
            return InspectedFile(path, None, str(error), None, {})
        way = f'the days in "{days}"' if days else "one row a second"
        note = f"{str(error).removeprefix(f'{path.name}: ')} Looked at as {way}."
    faults, parts = stamps.look(recording), Specimens(said.bench if said else None, reading.columns)
    spans, held = _ranges(recording, parts)
    unnamed = reading.settings.get("renamed", {}).get("", ())  # as a delimiter at the end of each row makes one
    reading = replace(reading, columns=tuple(one for one in reading.columns if one in held or one not in unnamed))
    if faults.span_ns:  # less the stamps that are far off all others
        reading = replace(reading, start_ns=faults.span_ns[0], end_ns=faults.span_ns[1])
    flags = clock.findings(path.name, parts.within(faults).counted(), reading.absolute)
    flags += specimens.findings(path.name, parts.unsaid())
    said_of = tuple(flag.says.removeprefix(f"{path.name}: ") for flag in flags)
    return InspectedFile(path, reading, None, note, spans, said_of, days, frozenset(held - spans.keys()))


def _untimed(reader: Reader, path: Path, recording: Path) -> tuple[LogReading, str | None]:
    """A table whose times nothing says, by the days in a column that is called so, else as one row a second; and that
    column. Raises UnreadableLogError."""
    reading = reader.record(path, recording, TimeSpec(rate_hz=1.0))
    for column in filter(says_days, reading.columns):
        with suppress(UnreadableLogError):
            return reader.record(path, recording, TimeSpec(column=column)), column
        reading = reader.record(path, recording, TimeSpec(rate_hz=1.0))  # what failed left nothing
    return reading, None


def _ranges(recording: Path, parts: Specimens) -> tuple[dict[str, tuple[float, float]], set[str]]:
    """The least and the greatest value of each column of numbers, and which columns hold anything; `parts` is told of
    all rows."""
    spans, held = dict[str, tuple[float, float]](), set[str]()
    for _, batch in read(recording):
        if not isinstance(batch, Rows):
            return {}, held
        parts.add(batch)
        held |= {name for name, v in batch.columns.items() if v.dtype == object and (v != "").any()}
        numbers = {n: v for n, v in batch.columns.items() if v.dtype == np.float64 and np.isfinite(v).any()}
        _widen(spans, {name: (float(np.nanmin(v)), float(np.nanmax(v))) for name, v in numbers.items()})
    return spans, held | spans.keys()


def _widen(spans: dict[str, tuple[float, float]], more: Mapping[str, tuple[float, float]]) -> None:
    """Widen each of `spans` (column -> least and greatest value) by the span of the same column in `more`."""
    for name, (low, high) in more.items():
        before = spans.get(name, (low, high))
        spans[name] = (min(low, before[0]), max(high, before[1]))


def _unknown(databases: Sequence[Database], readings: Sequence[LogReading]) -> dict[str, int]:
    means = explained(merged(databases)[0], {can_id for one in readings for _, can_id in identifiers(one)})
    counts: Counter[str] = Counter()
    for one in readings:
        announced = one.settings.get("announced", {}) if means.transport else {}
        seen = {key: (identifier_in(key)[1], count) for key, count in (*one.ids.items(), *announced.items())}
        counts.update({key: count for key, (can_id, count) in seen.items() if not means.knows(can_id)})
    return dict(counts)
