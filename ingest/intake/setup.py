"""What explains a log: bench file, signal databases and motor file, read, checked and kept with it."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from ingest.bench.bench_file import Bench, read_bench
from ingest.bench.changes import refuse_within
from ingest.bench.resolving import ResolvedChannel, check_nodes, refuse_unit_row, resolve
from ingest.bench.signals import Directory, Signal
from ingest.errors import BenchFileError, IngestError
from ingest.facts import facts as ledger_facts
from ingest.facts.events import (
    BenchRegistered,
    DecodeCompleted,
    Event,
    ModelPublished,
    MotorRegistered,
    SignalDatabaseRegistered,
)
from ingest.facts.facts import Facts
from ingest.facts.ledger import settled
from ingest.facts.store import Store
from ingest.formats import Format, TimeSpec
from ingest.log.databases import Database, merged, signals_of
from ingest.log.databases import load as load_database
from ingest.log.j1939 import explained
from ingest.log.meant import on_bus
from ingest.log.reading import LogReading
from ingest.log.recording import Attachment, bus_name, identifiers
from ingest.texts.nearest import hint


@dataclass(frozen=True)
class MotorFile:
    """A motor file that a bench file names, as far as an intake needs to know it."""

    data: bytes
    file: str
    motor: str
    regions: Mapping[str, str]  # node -> region, of every node
    boundaries: Sequence[str]
    configurations: Mapping[str, Collection[str]] = field(default_factory=dict)  # name -> its nodes and boundaries

    @property
    def model(self) -> str:
        return hashlib.sha256(self.data).hexdigest()


@dataclass(frozen=True)
class Setup:
    """What explains the logs: bench file, databases, motor file, checked. `model`: SHA-256 of the motor file."""

    bench: Bench | None
    bench_data: bytes
    databases: tuple[Database, ...]
    motor: MotorFile | None
    model: str | None = None

    def time(self, form: Format, log: str) -> TimeSpec:
        """How the stamps of a log of this format and name are to be understood."""
        return self.bench.time_for(form.name, log) if self.bench else TimeSpec()

    def databases_of(self, form: Format) -> tuple[Database, ...]:
        """The databases that a log of this format is decoded with: none for a table."""
        return self.databases if form.holds == "frames" else ()

    def attachments(self, form: Format) -> list[Attachment]:
        """What the recording of a log carries with it."""
        files = [Attachment(d.name, d.data, f"text/x-{d.kind.lower()}") for d in self.databases_of(form)]
        return files + ([Attachment(self.bench.name, self.bench_data, "application/toml")] if self.bench else [])


def kept_name(path: Path) -> str:
    """The file's name as text that can be kept: bytes that are no UTF-8 become question marks."""
    return path.name.encode("utf-8", "replace").decode("utf-8")


def refuse_missing(files: Sequence[Path]) -> None:
    """Raises IngestError for a log that is not there."""
    for path in files:
        if path.is_dir():
            raise IngestError(f"{path}: is a folder: name the log files in it.")
        if not path.is_file():
            raise IngestError(f"{path}: there is no such file: correct the path.")


def prepare(
    files: Sequence[Path], bench: Path | None, databases: Sequence[Path], motor_file: Callable[[Path], MotorFile]
) -> Setup:
    """Check that the logs are there, and read bench file, databases and the motor file that the bench file names.

    `motor_file` reads a motor file (this package knows nothing of networks). Raises BenchFileError, TomlError,
    UnitError, DatabaseError, or what `motor_file` raises.
    """
    refuse_missing(files)
    loaded = tuple(load_database(_bytes(path, "--dbc"), path.name) for path in databases)
    if bench is None:
        return Setup(None, b"", loaded, None)
    data = _bytes(bench, "--bench")
    read = read_bench(data, bench.name)
    motor = None
    if read.motor is not None:
        path = bench.parent / read.motor
        if not path.is_file():
            raise BenchFileError(
                f'{bench.name}: motor = "{read.motor}" is not there ({path}): correct the path, or leave `motor` out.'
            )
        motor = motor_file(path)
        for _, state in read.states():
            check_nodes(state, motor.regions, motor.boundaries)
        motor = _configured(read, motor)
    return Setup(read, data, loaded, motor, motor.model if motor else None)


def _configured(bench: Bench, motor: MotorFile) -> MotorFile:
    """The motor file as far as the bench file's configuration has it. Raises BenchFileError."""
    name = bench.configuration
    if name is None:
        return motor
    if name not in motor.configurations:
        known = hint(name, motor.configurations) or f" It has: {', '.join(motor.configurations) or 'none'}."
        raise BenchFileError(f'{bench.name}: configuration = "{name}" is not in {motor.file}.{known}')
    there = motor.configurations[name]
    for channel in (one for _, state in bench.states() for one in state.channels):
        gone = [place for place in (channel.node, *channel.weights) if place and place not in there]
        if gone and channel.role != "ignored":
            raise BenchFileError(
                f'{bench.name}:{channel.at("node")}: node "{gone[0]}" of {channel.called} is not there in '
                f'configuration "{name}": take the channel out, or write role = "ignored".'
            )
    return replace(
        motor,
        regions={node: region for node, region in motor.regions.items() if node in there},
        boundaries=[boundary for boundary in motor.boundaries if boundary in there],
    )


def resolved(
    setup: Setup, readings: Sequence[LogReading], names: Sequence[str], known: Facts
) -> list[Sequence[ResolvedChannel]]:
    """The bench file's channels for each of these logs (`names`, as in messages), against the signals of all that it
    means the same in, together. Raises BenchFileError."""
    bench = setup.bench
    if bench is None or not readings:
        return [() for _ in readings]
    if not setup.databases and any(one.holds == "frames" for one in readings):
        raise IngestError(
            f"{bench.name}: names signals, and no signal database tells where they lie in the frames: "
            "add --dbc FILE.dbc"
        )
    for one, name in zip(readings, names, strict=True):
        _refuse_no_date(bench, one, name)
    alike = [len(bench.changes_at(one.start_ns)) if one.start_ns is not None else 0 for one in readings]
    found: dict[int, Sequence[ResolvedChannel]] = {}
    for one, state in zip(readings, alike, strict=True):
        if state not in found:
            of_state = zip(readings, names, alike, strict=True)
            together = [(other, name) for other, name, its in of_state if its == state]
            now = bench.at(one.start_ns if one.absolute else None)
            for other, name in together:
                refuse_unit_row(now, other.units, name)
            found[state] = _resolved(setup, now, [other for other, _ in together], readings, known)
    return [found[state] for state in alike]


def _refuse_no_date(bench: Bench, reading: LogReading, name: str) -> None:
    """Raises BenchFileError where nothing tells which state of the bench file is that of a log."""
    if bench.changes and reading.start_ns is not None and reading.end_ns is not None:
        if not reading.absolute:
            raise BenchFileError(
                f"{bench.name}:{bench.changes[0].line}: {name} has no date, so nothing tells whether it is from before "
                f"{bench.changes[0].since}: say its start under [time], or give it a bench file without [[change]]."
            )
        refuse_within(bench.changes, bench.name, name, (reading.start_ns, reading.end_ns))


def _resolved(
    setup: Setup, state: Bench, together: Sequence[LogReading], every: Sequence[LogReading], known: Facts
) -> Sequence[ResolvedChannel]:
    here = signals_in(setup.databases, together, state)
    signals = [*here, *_elsewhere(state, here, signals_in(setup.databases, every, state), known)]
    if setup.motor is None:
        return resolve(state, signals)
    return resolve(state, signals, setup.motor.boundaries, setup.motor.regions)


def _elsewhere(bench: Bench, here: Sequence[Signal], given: Sequence[Signal], known: Facts) -> list[Signal]:
    """Signals of the bench file that only other logs hold: those given, or taken in earlier (a late file of a session
    may come alone)."""
    now = Directory(here)
    names = [name for name in sorted(named_in(bench)) if not now.find(name)]
    if not names:
        return []
    decodes = sorted(known.decodes.values(), key=lambda decode: decode.bench != bench.sha256)
    before = Directory([*given, *(Signal(**c["signal"]) for decode in decodes for c in decode.channels if c["signal"])])
    return [before.find(name)[0] for name in names if before.find(name)]


def signals_in(
    databases: Sequence[Database], readings: Sequence[LogReading], bench: Bench | None = None
) -> list[Signal]:
    """Every signal that these logs hold or that their databases know: of a seen message on its bus, else on none. The
    bench file tells what is meant where databases differ."""
    found = [Signal(name, unit=one.units.get(name)) for one in readings for name in one.columns]
    if any(one.holds == "frames" for one in readings):
        seen = {one for reading in readings for one in identifiers(reading)}
        told = on_bus(databases, seen, named_in(bench))
        means = explained(merged(databases)[0], {can_id for _, can_id in seen}, told)
        there = means.there(seen)
        for can_id, message in means.messages.items():
            buses = sorted((bus for bus, one in there if one == can_id), key=bus_name)
            found += [signal for bus in buses for signal in signals_of(means.message(bus, can_id), bus_name(bus))]
            found += signals_of(message) if not buses else []
    return list(dict.fromkeys(found))


def named_in(bench: Bench | None) -> set[str]:
    """The names of all signals that a bench file speaks of."""
    return {name for one in bench.channels for name in one.needs} if bench else set()


def keep_setup(store: Store, known: Facts, setup: Setup) -> None:
    """Seal and register what is new of databases, motor file and bench file."""
    settled(lambda: store.ledger.append_all(_sealed(store, ledger_facts.now(store.ledger, known), setup)))


def _sealed(store: Store, known: Facts, setup: Setup) -> list[tuple[str, Event]]:
    """What is new of a setup as facts, its bytes sealed."""
    events: list[tuple[str, Event]] = []
    for database in setup.databases:
        if database.sha256 not in known.databases:
            store.archive.seal(database.data)
            registered = SignalDatabaseRegistered(sha256=database.sha256, name=database.name)
            events.append((f"database-{database.sha256}", registered))
    motor = setup.motor
    if motor and motor.model not in known.models:
        store.archive.seal(motor.data)
        if not any(published.motor == motor.motor for published in known.models.values()):
            events.append((f"motor-{motor.motor}", MotorRegistered(name=motor.motor)))
        published = ModelPublished(model=motor.model, motor=motor.motor, file=motor.file, parent=None)
        events.append((f"motor-{motor.motor}", published))
    bench = setup.bench
    if bench:
        known_motor = known.models.get(setup.model or "")
        name = motor.motor if motor else known_motor.motor if known_motor else None
        now = BenchRegistered(sha256=bench.sha256, name=bench.name, motor=name, model=setup.model)
        if known.benches.get(bench.sha256) != now:
            store.archive.seal(setup.bench_data)
            events.append((f"bench-{bench.sha256}", now))
    return events


def mend_setup(store: Store, known: Facts, setup: Setup) -> None:
    """What was damaged or lost of sealed databases, bench and motor file is mended with the true bytes just given."""
    given = {database.sha256: database.data for database in setup.databases}
    if setup.bench:
        given[setup.bench.sha256] = setup.bench_data
    if setup.motor:
        given[setup.motor.model] = setup.motor.data
    for sha256, data in given.items():
        if sha256 in {*known.databases, *known.benches, *known.models} and store.archive.damage(sha256):
            store.archive.seal(data)


def sealed_setup(store: Store, known: Facts, decode: DecodeCompleted) -> Setup:
    """Bench file and databases of a decode as they were sealed; of its motor file only which it was."""
    databases = tuple(load_database(store.archive.read(sha), known.databases[sha].name) for sha in decode.databases)
    if decode.bench is None:
        return Setup(None, b"", databases, None)
    data, registered = store.archive.read(decode.bench), known.benches[decode.bench]
    return Setup(read_bench(data, registered.name), data, databases, None, decode.model)


def _bytes(path: Path, flag: str) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise IngestError(f"{flag} {path}: there is no such file: correct the path.") from None
