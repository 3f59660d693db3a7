"""Intake: log files become facts. Seal, record, decode, balance, group; the same bytes twice change nothing.

First everything is read into a working folder and checked, then it is sealed: blobs and products before the events that
name them. So an intake that is stopped at any moment leaves whole facts, and running it again finishes it.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

from ingest import facts as ledger_facts
from ingest import sessions
from ingest.bench import Bench, read_bench
from ingest.catalogue import kinds, quality
from ingest.catalogue.channels import load
from ingest.databases import Database, merged, signals_of
from ingest.databases import load as load_database
from ingest.decode import DECODER, RECORDING, decode_file, decode_id
from ingest.errors import BenchFileError, DamageError, IngestError, UnreadableLogError
from ingest.events import (
    BenchRegistered,
    DecodeCompleted,
    Event,
    ModelPublished,
    MotorRegistered,
    QualityFlagged,
    RawFileSealed,
    SessionRecorded,
    SessionRegrouped,
    SignalDatabaseRegistered,
)
from ingest.expressions import parse
from ingest.facts import Facts
from ingest.formats import Format, TimeSpec, recognise
from ingest.reading import Reading, record
from ingest.recording import Attachment, bus_name, id_text
from ingest.resolving import ResolvedChannel, check_nodes, resolve
from ingest.sessions import Override
from ingest.signals import Directory, Signal
from ingest.specimens import Specimens
from ingest.store import Store


@dataclass(frozen=True)
class MotorFile:
    """A motor file that a bench file names, as far as an intake needs to know it."""

    data: bytes
    file: str
    motor: str
    nodes: Sequence[str]
    boundaries: Sequence[str]

    @property
    def model(self) -> str:
        return hashlib.sha256(self.data).hexdigest()


@dataclass(frozen=True)
class Setup:
    """What explains the logs: bench file, databases and motor file, read and checked."""

    bench: Bench | None
    bench_data: bytes
    databases: tuple[Database, ...]
    motor: MotorFile | None

    @property
    def time(self) -> TimeSpec:
        return self.bench.time if self.bench else TimeSpec()

    def attachments(self) -> list[Attachment]:
        files = [Attachment(d.name, d.data, "text/x-dbc") for d in self.databases]
        return files + ([Attachment(self.bench.name, self.bench_data, "application/toml")] if self.bench else [])


@dataclass(frozen=True)
class Taken:
    """What became of one file. `holds` "frames" or "rows", None where no format claims it; `decode` None where it was
    refused before anything was kept; `known` where nothing was new."""

    name: str
    size: int
    holds: str | None
    raw: str
    decode: DecodeCompleted | None
    known: bool
    refusal: str | None


def _refusal(one: Taken) -> str | None:
    if one.refusal or one.decode is None or one.decode.why is None:
        return one.refusal
    return f"{one.name}: {one.decode.why}"


@dataclass(frozen=True)
class Intake:
    """What an intake did: per file, the sessions touched, and what a person should look at (one line each)."""

    files: tuple[Taken, ...]
    sessions: tuple[SessionRecorded, ...]
    flags: tuple[tuple[str, QualityFlagged], ...]  # session name, flag

    @property
    def refused(self) -> bool:
        """Whether anything was refused, quarantined or cut."""
        return bool(self.refusals)

    @property
    def refusals(self) -> list[str]:
        """What was refused, quarantined, cut or not decoded, one line a file."""
        return [line for line in map(_refusal, self.files) if line]


@dataclass(frozen=True)
class _Read:
    """A file that was read into the working folder, not yet kept: its recording, or why there is none."""

    path: Path
    raw: str
    form: Format
    recording: Path
    reading: Reading | None
    why: str | None


def prepare(
    files: Sequence[Path], bench: Path | None, databases: Sequence[Path], motor_file: Callable[[Path], MotorFile]
) -> Setup:
    """Check that the logs are there, and read bench file, databases and the motor file that the bench file names.

    `motor_file` reads a motor file (this package knows nothing of networks). Raises BenchFileError, TomlError, UnitError,
    DatabaseError, or what `motor_file` raises.
    """
    for path in files:
        if not path.is_file():
            raise IngestError(f"{path}: {'is a folder' if path.is_dir() else 'there is no such file'}: name log files.")
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
        check_nodes(read, motor.nodes, motor.boundaries)
    return Setup(read, data, loaded, motor)


def take_in(
    store: Store, paths: Sequence[Path], setup: Setup, said: Override, tell: Callable[[str], None] = lambda _: None
) -> Intake:
    """Take log files into the store; `tell` hears what is being done.

    Raises IngestError before anything is kept; a file that cannot be read is quarantined and does not stop the others.
    """
    known = ledger_facts.at(store.ledger)
    work = store.work()
    try:
        found: list[Taken | _Read] = []
        for i, path in enumerate(paths, 1):
            tell(f"reading {i} of {len(paths)}: {_name(path)}, {path.stat().st_size / 1e6:.1f} MB")
            found.append(_read(known, path, setup, work, {one.raw for one in found}))
        tell("decoding")
        fresh = [one for one in found if isinstance(one, _Read)]
        for one in fresh:
            if one.reading and one.reading.holds == "rows":
                Specimens(setup.bench, one.reading.columns)  # a column that is not there is refused here
        channels = _resolved(setup, [one.reading for one in fresh if one.reading], known)
        if fresh:
            _keep_setup(store, known, setup)
        files = [_keep(store, known, one, setup, channels) if isinstance(one, _Read) else one for one in found]
    finally:
        shutil.rmtree(work, ignore_errors=True)
    decodes = {one.raw: one.decode for one in files if one.decode}
    files = [replace(one, decode=decodes.get(one.raw)) for one in files]  # of a copy: that of the first
    kept = set(decodes)
    flags = _group(store, dict.fromkeys(kept, said) if said != Override() else {})
    now = ledger_facts.at(store.ledger)
    touched = tuple(session for session in now.sessions if kept & {file["raw"] for file in session.files})
    return Intake(tuple(files), touched, flags)


def redecode(store: Store, known: Facts) -> None:
    """Make recording and samples of every decode again, from sealed bytes alone.

    Raises DamageError where a sealed blob is not what it was.
    """
    for decode in known.decodes.values():
        if decode.outcome != "quarantined":
            _redecode(store, known, decode)


def _redecode(store: Store, known: Facts, decode: DecodeCompleted) -> None:
    setup = _sealed_setup(store, known, decode)
    sealed = known.files[decode.raw]
    damage = store.archive.damage(decode.raw)
    if damage:
        raise DamageError(f"{sealed.name}: {damage}: what was made from it before is left as it is")
    work = store.work()
    try:
        named = work / sealed.name  # readers know a format by its name
        named.symlink_to(store.archive.path(decode.raw).absolute())
        one = _record(named, decode.raw, recognise(named), setup, work)
        if one.reading is None:
            raise IngestError(f"{sealed.name}: could be read when it was ingested, and cannot now: {one.why}")
        _decode(store, one, one.reading, setup, _resolved(setup, [one.reading], known))
    finally:
        shutil.rmtree(work, ignore_errors=True)


# ---- one file ------------------------------------------------------------------------------------------------------


def _read(known: Facts, path: Path, setup: Setup, work: Path, before: set[str]) -> Taken | _Read:
    """Read a file into the working folder; one that is known, a copy of one read `before`, or no log is done with here."""
    size = path.stat().st_size
    try:
        form = recognise(path)
    except UnreadableLogError as error:
        return Taken(_name(path), size, None, "", None, known=False, refusal=str(error))
    with path.open("rb") as file:
        raw = hashlib.file_digest(file, "sha256").hexdigest()
    decode = known.decodes.get(_decode_id(raw, setup))
    if raw in before or (decode and decode.outcome != "quarantined"):
        return Taken(_name(path), size, form.holds, raw, decode, known=True, refusal=None)
    return _record(path, raw, form, setup, work)


def _record(path: Path, raw: str, form: Format, setup: Setup, work: Path) -> _Read:
    recording = work / f"{raw}.mcap"
    try:
        reading = record(path, recording, setup.time, setup.attachments())
        return _Read(path, raw, form, recording, reading, None)
    except UnreadableLogError as error:
        return _Read(path, raw, form, recording, None, str(error))


def _keep(store: Store, known: Facts, one: _Read, setup: Setup, channels: Sequence[ResolvedChannel]) -> Taken:
    """Seal the bytes, then the products, then the events that name them."""
    size = one.path.stat().st_size
    if store.archive.seal(one.path) != one.raw:
        raise IngestError(
            f"{_name(one.path)}: changed while it was read: wait until it is whole, then ingest it again."
        )
    if one.raw not in known.files or known.files[one.raw].name != _name(one.path):
        sealed = RawFileSealed(sha256=one.raw, name=_name(one.path), size=size, format=one.form.name)
        store.ledger.append(f"file-{one.raw}", sealed)
    decode = _decode(store, one, one.reading, setup, channels) if one.reading else _quarantined(one, setup)
    before = known.decodes.get(decode.decode)
    if before is None or before.why != decode.why:
        store.ledger.append(f"file-{one.raw}", decode)
    for twin in known.files.values():
        if twin.name == _name(one.path) and twin.sha256 != one.raw and one.raw not in known.files:
            says = f"{_name(one.path)}: another file of this name was ingested before, with other bytes ({twin.sha256[:12]})"
            flag = QualityFlagged(flag="same_name_other_bytes", says=says, detail={"other": twin.sha256})
            store.ledger.append(f"file-{one.raw}", flag)
    return Taken(_name(one.path), size, one.form.holds, one.raw, decode, known=False, refusal=one.why)


def _decode(
    store: Store, one: _Read, reading: Reading, setup: Setup, channels: Sequence[ResolvedChannel]
) -> DecodeCompleted:
    made = one.recording.parent / _decode_id(one.raw, setup)
    made.mkdir()
    one.recording.rename(made / RECORDING)
    decode = decode_file(reading, one.raw, setup.databases, setup.bench, channels, made)
    store.publish(made, decode.decode)
    return decode


def _name(path: Path) -> str:
    """The file's name as text that can be kept: what is no UTF-8 in it becomes a question mark."""
    return path.name.encode("utf-8", "replace").decode("utf-8")


def _decode_id(raw: str, setup: Setup) -> str:
    return decode_id(raw, [d.sha256 for d in setup.databases], setup.bench.sha256 if setup.bench else None)


def _quarantined(one: _Read, setup: Setup) -> DecodeCompleted:
    return DecodeCompleted(
        decode=_decode_id(one.raw, setup),
        raw=one.raw,
        bench=setup.bench.sha256 if setup.bench else None,
        databases=[d.sha256 for d in setup.databases],
        decoder=DECODER,
        outcome="quarantined",
        why=one.why,
        absolute=False,
        start_ns=None,
        end_ns=None,
        balance={"found": 0, "decoded": 0, "unknown_id": 0, "wrong_length": 0, "rejected": 0},
    )


# ---- what explains the files ---------------------------------------------------------------------------------------


def _resolved(setup: Setup, readings: Sequence[Reading], known: Facts) -> Sequence[ResolvedChannel]:
    """The bench file's channels against the signals of all these logs together. Raises BenchFileError."""
    if setup.bench is None or not readings:
        return ()
    if not setup.databases and any(one.holds == "frames" for one in readings):
        raise IngestError(
            f"{setup.bench.name}: names signals, and no signal database tells where they lie in the frames: add --dbc FILE.dbc"
        )
    here = signals_in(setup.databases, readings)
    boundaries = setup.motor.boundaries if setup.motor else None
    return resolve(setup.bench, [*here, *_elsewhere(setup.bench, here, known)], boundaries)


def _elsewhere(bench: Bench, here: Sequence[Signal], known: Facts) -> list[Signal]:
    """Signals of the bench file that only logs taken in earlier hold: a late file of a session may come alone."""
    now = Directory(here)
    decodes = sorted(known.decodes.values(), key=lambda decode: decode.bench != bench.sha256)
    before = Directory([Signal(**c["signal"]) for decode in decodes for c in decode.channels if c["signal"]])
    names = {n for c in bench.channels for n in (parse(c.expression).names if c.expression else (str(c.signal),))}
    return [before.find(name)[0] for name in sorted(names) if not now.find(name) and before.find(name)]


def signals_in(databases: Sequence[Database], readings: Sequence[Reading]) -> list[Signal]:
    """Every signal that these logs hold or that their databases know: of a seen message on its bus, else on none."""
    found = [Signal(name, unit=one.units.get(name)) for one in readings for name in one.columns]
    if any(one.holds == "frames" for one in readings):
        messages, _ = merged(databases)
        seen = {(bus, key) for one in readings for bus in one.buses for key in one.ids}
        for message in messages.values():
            buses: Sequence[str | None] = sorted(
                bus_name(bus) for bus, key in seen if key == id_text(bus, message.can_id)
            )
            found += [signal for bus in buses or [None] for signal in signals_of(message, bus)]
    return list(dict.fromkeys(found))


def _keep_setup(store: Store, known: Facts, setup: Setup) -> None:
    """Seal and register what is new of databases, motor file and bench file."""
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
        now = BenchRegistered(
            sha256=bench.sha256,
            name=bench.name,
            motor=motor.motor if motor else None,
            model=motor.model if motor else None,
        )
        if known.benches.get(bench.sha256) != now:
            store.archive.seal(setup.bench_data)
            events.append((f"bench-{bench.sha256}", now))
    if events:
        store.ledger.append_all(events)


def _sealed_setup(store: Store, known: Facts, decode: DecodeCompleted) -> Setup:
    """Bench file and databases of a decode as they were sealed."""
    databases = tuple(load_database(store.archive.read(sha), known.databases[sha].name) for sha in decode.databases)
    if decode.bench is None:
        return Setup(None, b"", databases, None)
    data, registered = store.archive.read(decode.bench), known.benches[decode.bench]
    return Setup(read_bench(data, registered.name), data, databases, None)


def _bytes(path: Path, flag: str) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise IngestError(f"{flag} {path}: there is no such file: correct the path.") from None


# ---- sessions ------------------------------------------------------------------------------------------------------


def _group(store: Store, said: Mapping[str, Override]) -> tuple[tuple[str, QualityFlagged], ...]:
    """Group all files into sessions, append what is new, and say what a person should look at in new ones."""
    known = ledger_facts.at(store.ledger)
    benches = {sha: read_bench(store.archive.read(sha), one.name) for sha, one in known.benches.items()}
    names = {sha: one.name for sha, one in known.files.items()}
    overrides = {**sessions.overrides_of(known.sessions, benches), **said}
    new = sessions.group(list(known.decodes.values()), benches, names, overrides)
    flags: list[tuple[str, QualityFlagged]] = []
    for event in sessions.regroup(known.sessions, new):
        if isinstance(event, SessionRegrouped):
            store.ledger.append(f"session-{event.session}", event)
            continue
        channels = load(store, known, event)
        if not event.kind:
            kind, why = kinds.recognise(channels)
            event = replace(event, kind=kind, kind_why=why)
        found = [*_overlaps(known, event), *quality.findings(quality.assess(channels))]
        stream = f"session-{event.session}"
        store.ledger.append_all([(stream, event), *((stream, flag) for flag in found)])
        flags += [(event.name, flag) for flag in found]
    return tuple(flags)


def _overlaps(known: Facts, session: SessionRecorded) -> list[QualityFlagged]:
    """Files of a session that hold the same messages at the same time: a copy, or the same test logged twice."""
    decodes = [known.decodes[file["decode"]] for file in session.files]
    flags = []
    for a, b in combinations(decodes, 2):
        common = {group["name"] for group in a.groups} & {group["name"] for group in b.groups}
        from_ns, to_ns = max(a.start_ns or 0, b.start_ns or 0), min(a.end_ns or 0, b.end_ns or 0)
        if common and a.raw != b.raw and to_ns > from_ns:
            names = " and ".join(known.files[one.raw].name for one in (a, b))
            says = f"{names} hold the same messages for {(to_ns - from_ns) / 1e9:.0f} s: equal samples count once in a replay"
            flags.append(QualityFlagged(flag="overlap", says=says, detail={"groups": sorted(common)}))
    return flags
