"""Intake: log files become facts. Seal, record, decode, balance, group; the same bytes twice change nothing.

First everything is read into a working folder and checked, then it is sealed: blobs and products before the events that
name them. So an intake that is stopped at any moment leaves whole facts, and running it again finishes it.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ingest.errors import IngestError, UnreadableLogError
from ingest.facts import facts as ledger_facts
from ingest.facts.durable import sha256_of
from ingest.facts.events import SAME_NAME, DecodeCompleted, Event, QualityFlagged, RawFileSealed, SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.ledger import settled
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.formats import recognise
from ingest.intake.grouping import group_files
from ingest.intake.making import LogFile, ReadLog, decode_logs, made_in, read_logs
from ingest.intake.setup import Setup, keep_setup, kept_name, mend_setup, resolved
from ingest.log import specimens
from ingest.log.decode import newer
from ingest.log.findings import findings
from ingest.texts.names import handle
from ingest.units.each import Workers


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


def take_in(
    store: Store,
    paths: Sequence[Path],
    setup: Setup,
    said: Override,
    tell: Callable[[str], None] = lambda _: None,
    first: Sequence[tuple[str, Event]] = (),
    workers: Workers | None = None,
) -> Intake:
    """Take log files into the store; `tell` hears what is being done. `first`: facts that the sessions follow from;
    `workers`: where logs are read and decoded (None: in this process).

    Raises IngestError before anything is kept; a file that cannot be read is quarantined and does not stop the others.
    """
    known = ledger_facts.at(store.ledger)
    mend_setup(store, known, setup)
    work = store.work().absolute()
    try:
        found: list[Taken | LogFile] = []
        for path in paths:
            one = _known(known, path, setup, {one.raw for one in found})
            found.append(one)
            if isinstance(one, Taken) and one.raw in known.files and store.archive.damage(one.raw):
                store.archive.seal(path)  # the true bytes mend what was damaged or lost
        fresh = read_logs([one for one in found if isinstance(one, LogFile)], setup, work, workers, tell)
        read = [(one.log.raw, one.reading, kept_name(one.log.path)) for one in fresh if one.reading]
        for _, reading, _ in read:
            if reading.holds == "rows":
                specimens.Specimens(setup.bench, reading.columns)  # a column that is not there is refused here
        specs = resolved(setup, [reading for _, reading, _ in read], [name for *_, name in read], known)
        channels = dict(zip([raw for raw, *_ in read], specs, strict=True))
        again = _again(known, found)
        if fresh or again:
            keep_setup(store, known, setup)
        store.ledger.append_all([(f"file-{raw}", decode) for raw, decode in again.items()])
        kept = {
            one.log.raw: _keep(store, known, one, decode, work)
            for one, decode in decode_logs(fresh, setup, channels, work, workers, tell)
        }
        files = [kept[one.raw] if isinstance(one, LogFile) else one for one in found]
    finally:
        shutil.rmtree(work, ignore_errors=True)
    decodes = {one.raw: one.decode for one in files if one.decode}
    files = [replace(one, decode=decodes.get(one.raw)) for one in files]  # of a copy: that of the first
    raws = set(decodes)
    flags = [(one.name, flag) for one in files for flag in one.flags]
    grouped = group_files(store, raws, dict.fromkeys(raws, said) if said != Override() else {}, first)
    now = ledger_facts.at(store.ledger)
    touched = tuple(now.holding(raws))
    new = {file["raw"] for session in touched if session not in known.sessions for file in session.files}
    return Intake(
        tuple(replace(one, anew=one.known and one.raw in new) for one in files),
        touched,
        (*flags, *grouped.flags),
        (*grouped.left, *_taken_back(now, raws)),
    )


def _taken_back(now: Facts, raws: Collection[str]) -> list[str]:
    """A line for each session of these logs that a person took back."""
    gone = [one for one in now.retractions.values() if any(row["raw"] in raws for row in one.event.rows)]
    return [one.line for one in gone]


def _again(known: Facts, found: Sequence[Taken | LogFile]) -> dict[str, DecodeCompleted]:
    """Raw file -> the known decode to go back to: another bench or motor file had followed it."""
    given = {one.raw: one.decode for one in found if isinstance(one, Taken) and one.decode and one.decode.bench}
    decodes = [one for raw in given for one in known.decodes_of(raw)]
    latest = {one.raw: one for one in decodes if one.bench and one.outcome != "quarantined"}
    return {raw: decode for raw, decode in given.items() if latest.get(raw, decode) != decode}


def _known(known: Facts, path: Path, setup: Setup, before: set[str]) -> Taken | LogFile:
    """A file that is known, a copy of one `before` it, or no log; else a log that is to be read."""
    name, size = kept_name(path), path.stat().st_size
    try:
        form = recognise(path)
    except UnreadableLogError as error:
        return Taken(name, size, None, "", None, known=False, refusal=str(error))
    log = LogFile(path, sha256_of(path), form)
    if back := known.retractions.get(f"file-{log.raw}"):
        return Taken(name, size, form.holds, log.raw, None, known=False, refusal=back.line)
    if why := next(filter(None, (newer(one.decoder) for one in known.decodes_of(log.raw))), None):
        return Taken(name, size, form.holds, log.raw, None, known=True, refusal=f"{name}: {why}")
    decode = known.decodes.get(log.identity(setup)["decode"])
    if log.raw in before or (decode and decode.outcome != "quarantined"):
        return Taken(name, size, form.holds, log.raw, decode, known=True, refusal=None)
    return log


def _keep(store: Store, known: Facts, one: ReadLog, decode: DecodeCompleted, work: Path) -> Taken:
    """Seal the bytes, then the products, then the events that name them."""
    log = one.log
    name, size = kept_name(log.path), log.path.stat().st_size
    if store.archive.seal(log.path) != log.raw:
        raise IngestError(f"{name}: changed while it was read: wait until it is whole, then ingest it again.")
    if decode.products:
        store.publish(made_in(work, decode), decode.decode)
    flags = findings(name, decode)

    def record() -> None:
        events = _news(ledger_facts.now(store.ledger, known), log, decode, size, flags)
        store.ledger.append_all([(f"file-{log.raw}", event) for event in events])

    settled(record)
    return Taken(name, size, log.form.holds, log.raw, decode, known=False, refusal=one.why, flags=tuple(flags))


def _news(
    known: Facts, log: LogFile, decode: DecodeCompleted, size: int, flags: Sequence[QualityFlagged]
) -> list[Event]:
    """What a log that was decoded adds to the facts; nothing where another program took it in meanwhile."""
    name = kept_name(log.path)
    events: list[Event] = []
    if log.raw not in known.files or known.files[log.raw].name != name:
        events.append(RawFileSealed(sha256=log.raw, name=name, size=size, format=log.form.name))
    before = known.decodes.get(decode.decode)
    if before is None or before.why != decode.why:
        events += [decode, *flags]
    for twin in known.called(name):
        if log.raw not in known.files:
            says = f"{name}: another file of this name was ingested before, with other bytes ({handle(twin.sha256)})"
            events.append(QualityFlagged(flag=SAME_NAME, says=says, detail={"other": twin.sha256}))
    return events
