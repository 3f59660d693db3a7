"""Intake: log files become facts. Seal, record, decode, balance, group; the same bytes twice change nothing.

First everything is read into a working folder and checked, then it is sealed: blobs and products before the events that
name them. So an intake that is stopped at any moment leaves whole facts, and running it again finishes it.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Collection, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ingest.bench.resolving import ResolvedChannel
from ingest.errors import DamageError, IngestError, UnreadableLogError
from ingest.facts import facts as ledger_facts
from ingest.facts.durable import sha256_of
from ingest.facts.events import COUNTS, DecodeCompleted, Event, QualityFlagged, RawFileSealed, SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.ledger import settled
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.formats import Format, recognise
from ingest.intake.grouping import group_files
from ingest.intake.setup import Setup, keep_setup, kept_name, mend_setup, resolved, sealed_setup
from ingest.log import clock, j1939
from ingest.log.decode import RECORDING, decode_file, identity
from ingest.log.reading import LogReading, Reader
from ingest.log.specimens import Specimens


@dataclass(frozen=True)
class Taken:
    """What became of one file."""

    name: str
    size: int  # bytes
    holds: str | None  # "frames" or "rows", None where no format claims it
    raw: str
    decode: DecodeCompleted | None  # None where it was refused before anything was kept
    known: bool  # it was decoded so before
    refusal: str | None
    flags: tuple[QualityFlagged, ...] = ()  # of its stamps
    anew: bool = False  # known, but its sessions are others now: by bench or motor file, specimen or another file

    @property
    def line(self) -> str | None:
        """Why it was refused, quarantined, cut or not decoded, None where it was not."""
        if self.refusal or self.decode is None or self.decode.why is None:
            return self.refusal
        return f"{self.name}: {self.decode.why}"


@dataclass(frozen=True)
class Intake:
    """What an intake did: per file, the sessions touched, and what a person should look at (one line each)."""

    files: tuple[Taken, ...]
    sessions: tuple[SessionRecorded, ...]
    flags: tuple[tuple[str, QualityFlagged], ...]  # name of the session, or of the file that it is of; flag
    left: tuple[str, ...] = ()  # a line for each session that cannot be recorded yet

    @property
    def refusals(self) -> list[str]:
        """What was refused, quarantined, cut or not decoded, one line a file, and the sessions that were left."""
        return [*(one.line for one in self.files if one.line), *self.left]


@dataclass(frozen=True)
class _Read:
    """A file that was read into the working folder, not yet kept: its recording, or why there is none."""

    path: Path
    raw: str
    form: Format
    recording: Path
    reading: LogReading | None
    why: str | None


def take_in(
    store: Store,
    paths: Sequence[Path],
    setup: Setup,
    said: Override,
    tell: Callable[[str], None] = lambda _: None,
    first: Sequence[tuple[str, Event]] = (),
) -> Intake:
    """Take log files into the store; `tell` hears what is being done. `first`: facts that the sessions follow from.

    Raises IngestError before anything is kept; a file that cannot be read is quarantined and does not stop the others.
    """
    known = ledger_facts.at(store.ledger)
    mend_setup(store, known, setup)
    work = store.work()
    try:
        found: list[Taken | _Read] = []
        with closing(Reader()) as reader:
            for i, path in enumerate(paths, 1):
                tell(f"reading {i} of {len(paths)}: {kept_name(path)}, {path.stat().st_size / 1e6:.1f} MB")
                one = _read(reader, known, path, setup, work, {one.raw for one in found})
                found.append(one)
                if isinstance(one, Taken) and one.raw in known.files and store.archive.damage(one.raw):
                    store.archive.seal(path)  # the true bytes mend what was damaged or lost
        tell("decoding")
        fresh = [one for one in found if isinstance(one, _Read)]
        for one in fresh:
            if one.reading and one.reading.holds == "rows":
                Specimens(setup.bench, one.reading.columns)  # a column that is not there is refused here
        read = [(one.raw, one.reading, kept_name(one.path)) for one in fresh if one.reading]
        specs = resolved(setup, [reading for _, reading, _ in read], [name for *_, name in read], known)
        channels = dict(zip([raw for raw, *_ in read], specs, strict=True))
        again = _again(known, found)
        if fresh or again:
            keep_setup(store, known, setup)
        store.ledger.append_all([(f"file-{raw}", decode) for raw, decode in again.items()])
        files = [
            _keep(store, known, one, setup, channels.get(one.raw, ())) if isinstance(one, _Read) else one
            for one in found
        ]
    finally:
        shutil.rmtree(work, ignore_errors=True)
    decodes = {one.raw: one.decode for one in files if one.decode}
    files = [replace(one, decode=decodes.get(one.raw)) for one in files]  # of a copy: that of the first
    kept = set(decodes)
    flags = [(one.name, flag) for one in files for flag in one.flags]
    grouped = group_files(store, kept, dict.fromkeys(kept, said) if said != Override() else {}, first)
    now = ledger_facts.at(store.ledger)
    touched = tuple(now.holding(kept))
    new = {file["raw"] for session in touched if session not in known.sessions for file in session.files}
    return Intake(
        tuple(replace(one, anew=one.known and one.raw in new) for one in files),
        touched,
        (*flags, *grouped.flags),
        (*grouped.left, *_taken_back(now, kept)),
    )


def _taken_back(now: Facts, kept: Collection[str]) -> list[str]:
    """A line for each session of these logs that a person took back."""
    gone = [one for one in now.retractions.values() if any(row["raw"] in kept for row in one.event.rows)]
    return [one.line for one in gone]


def _again(known: Facts, found: Sequence[Taken | _Read]) -> dict[str, DecodeCompleted]:
    """Raw file -> the known decode to go back to: another bench or motor file had followed it."""
    given = {one.raw: one.decode for one in found if isinstance(one, Taken) and one.decode and one.decode.bench}
    decodes = [one for raw in given for one in known.decodes_of(raw)]
    latest = {one.raw: one for one in decodes if one.bench and one.outcome != "quarantined"}
    return {raw: decode for raw, decode in given.items() if latest.get(raw, decode) != decode}


def redecode(store: Store, known: Facts) -> None:
    """Make recording and samples of every decode again from sealed bytes. Raises DamageError where these changed."""
    with closing(Reader()) as reader:
        for decode in known.decodes.values():
            if decode.outcome != "quarantined":
                _redecode(reader, store, known, decode)


def _redecode(reader: Reader, store: Store, known: Facts, decode: DecodeCompleted) -> None:
    setup = sealed_setup(store, known, decode)
    sealed = known.files[decode.raw]
    work = store.work()
    try:
        named = work / sealed.name  # readers know a format by its name
        try:
            store.archive.lend(decode.raw, named)
        except DamageError as error:
            says = f"{sealed.name}: {error}: what was made from it before is left as it is"
            raise DamageError(says) from None
        one = _record(reader, named, decode.raw, recognise(named), setup, work)
        if one.reading is None:
            raise IngestError(f"{sealed.name}: could be read when it was ingested, and cannot now: {one.why}")
        [channels] = resolved(setup, [one.reading], [sealed.name], known)
        _decode(store, one, one.reading, setup, channels)
    finally:
        shutil.rmtree(work, ignore_errors=True)


def _read(reader: Reader, known: Facts, path: Path, setup: Setup, work: Path, before: set[str]) -> Taken | _Read:
    """Read a file into the working folder, unless it is known, a copy of one read `before`, or no log."""
    size = path.stat().st_size
    try:
        form = recognise(path)
    except UnreadableLogError as error:
        return Taken(kept_name(path), size, None, "", None, known=False, refusal=str(error))
    raw = sha256_of(path)
    if back := known.retractions.get(f"file-{raw}"):
        return Taken(kept_name(path), size, form.holds, raw, None, known=False, refusal=back.line)
    decode = known.decodes.get(_identity(raw, form, setup)["decode"])
    if raw in before or (decode and decode.outcome != "quarantined"):
        return Taken(kept_name(path), size, form.holds, raw, decode, known=True, refusal=None)
    return _record(reader, path, raw, form, setup, work)


def _record(reader: Reader, path: Path, raw: str, form: Format, setup: Setup, work: Path) -> _Read:
    recording = work / f"{raw}.mcap"
    try:
        reading = reader.record(path, recording, setup.time(form), setup.attachments(form))
        return _Read(path, raw, form, recording, reading, None)
    except UnreadableLogError as error:
        return _Read(path, raw, form, recording, None, str(error))


def _keep(store: Store, known: Facts, one: _Read, setup: Setup, channels: Sequence[ResolvedChannel]) -> Taken:
    """Seal the bytes, then the products, then the events that name them."""
    name, size = kept_name(one.path), one.path.stat().st_size
    if store.archive.seal(one.path) != one.raw:
        raise IngestError(f"{name}: changed while it was read: wait until it is whole, then ingest it again.")
    decode = _decode(store, one, one.reading, setup, channels) if one.reading else _quarantined(one, setup)
    flags = clock.findings(name, decode.settings.get("clock", {}), decode.absolute) + j1939.findings(
        name, decode.settings
    )

    def record() -> None:
        events = _news(ledger_facts.now(store.ledger, known), one, decode, size, flags)
        store.ledger.append_all([(f"file-{one.raw}", event) for event in events])

    settled(record)
    return Taken(name, size, one.form.holds, one.raw, decode, known=False, refusal=one.why, flags=tuple(flags))


def _news(known: Facts, one: _Read, decode: DecodeCompleted, size: int, flags: Sequence[QualityFlagged]) -> list[Event]:
    """What a log that was decoded adds to the facts; nothing where another program took it in meanwhile."""
    name = kept_name(one.path)
    events: list[Event] = []
    if one.raw not in known.files or known.files[one.raw].name != name:
        events.append(RawFileSealed(sha256=one.raw, name=name, size=size, format=one.form.name))
    before = known.decodes.get(decode.decode)
    if before is None or before.why != decode.why:
        events += [decode, *flags]
    for twin in known.called(name):
        if one.raw not in known.files:
            says = f"{name}: another file of this name was ingested before, with other bytes ({twin.sha256[:12]})"
            events.append(QualityFlagged(flag="same_name_other_bytes", says=says, detail={"other": twin.sha256}))
    return events


def _decode(
    store: Store, one: _Read, reading: LogReading, setup: Setup, channels: Sequence[ResolvedChannel]
) -> DecodeCompleted:
    made = one.recording.parent / _identity(one.raw, one.form, setup)["decode"]
    made.mkdir()
    one.recording.rename(made / RECORDING)
    decode = decode_file(reading, one.raw, setup.databases_of(one.form), setup.bench, channels, made, setup.model)
    store.publish(made, decode.decode)
    return decode


def _identity(raw: str, form: Format, setup: Setup) -> dict[str, Any]:
    return identity(raw, setup.databases_of(form), setup.bench, setup.model)


def _quarantined(one: _Read, setup: Setup) -> DecodeCompleted:
    return DecodeCompleted(
        **_identity(one.raw, one.form, setup),
        outcome="quarantined",
        why=one.why,
        absolute=False,
        start_ns=None,
        end_ns=None,
        balance=dict.fromkeys(("found", *COUNTS), 0),
    )
