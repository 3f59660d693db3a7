"""What is made of logs, in this process or by workers: their recordings, then samples, in a working folder.

A worker reads and writes files alone; what it made is kept, and becomes facts, in the one process that writes the
ledger. Work whose worker ended is done again over whatever that left.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from ingest.bench.resolving import ResolvedChannel
from ingest.errors import DamageError, IngestError, UnreadableLogError
from ingest.facts.events import COUNTS, DecodeCompleted
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from ingest.formats import Format, recognise
from ingest.intake.setup import Setup, kept_name, resolved, sealed_setup
from ingest.log.decode import RECORDING, decode_file, identity, is_made_here
from ingest.log.reading import LogReading, Reader
from ingest.units.each import Lost, Workers, each, told
from ingest.units.shared import InProcess, Shared, share


@dataclass(frozen=True)
class LogFile:
    """A log that is to be read: its file, SHA-256 and format."""

    path: Path
    raw: str
    form: Format

    def identity(self, setup: Setup) -> dict[str, Any]:
        """What its decode is known by (`ingest.log.decode.identity`)."""
        return identity(self.raw, setup.databases_of(self.form), setup.bench, setup.model)


@dataclass(frozen=True)
class ReadLog:
    """A log whose recording lies in the working folder, and what it holds; or why there is none."""

    log: LogFile
    reading: LogReading | None
    why: str | None


@dataclass(frozen=True)
class _Job:
    """What a worker needs of a log: what is `done` of it so far, and `channels` of the bench file for it. All but the
    setup is small, and that is shared."""

    done: ReadLog
    setup: Shared[Setup] | InProcess[Setup]
    work: Path
    channels: Sequence[ResolvedChannel] = ()


def read_logs(
    logs: Sequence[LogFile], setup: Setup, work: Path, workers: Workers | None, tell: Callable[[str], None]
) -> list[ReadLog]:
    """Every log with its recording in the folder `work`, in their order; `tell` hears how far it is."""
    shared = _shared(setup, work, workers)
    jobs = [_Job(ReadLog(log, None, None), shared, work) for log in logs]
    found: dict[str, ReadLog] = {}
    with closing(Reader()) as reader:
        read = partial(_read, reader) if workers is None else _read_alone
        for job, done in told(each(read, jobs, workers), "reading", _shown(logs), tell):
            log = job.done.log
            found[log.raw] = _lost(log, done) if isinstance(done, Lost) else done
    return [found[log.raw] for log in logs]


def decode_logs(
    logs: Sequence[ReadLog],
    setup: Setup,
    channels: Mapping[str, Sequence[ResolvedChannel]],
    work: Path,
    workers: Workers | None,
    tell: Callable[[str], None],
) -> Iterator[tuple[ReadLog, DecodeCompleted]]:
    """Every log with its decode, one that could not be read as quarantined; in order in this process, as they are done
    elsewhere. What a decode made lies in `made_in`. `channels`: by the SHA-256 of a log."""
    shared = _shared(setup, work, workers)
    jobs = [_Job(one, shared, work, channels.get(one.log.raw, ())) for one in logs]
    shown = _shown([one.log for one in logs])
    for job, done in told(each(_decode, jobs, workers), "decoding", shown, tell):
        if isinstance(done, Lost):
            lost = _lost(job.done.log, done)
            yield lost, _quarantined(lost, setup)
        else:
            yield job.done, done


def made_in(work: Path, decode: DecodeCompleted) -> Path:
    """Where a decode's recording and samples lie before they are kept."""
    return work / decode.decode


def _shared(setup: Setup, work: Path, workers: Workers | None) -> Shared[Setup] | InProcess[Setup]:
    return InProcess(setup) if workers is None else share(setup, work)


def _shown(logs: Sequence[LogFile]) -> list[str]:
    """Names and sizes of logs, for those who wait."""
    return [f"{kept_name(log.path)}, {log.path.stat().st_size / 1e6:.1f} MB" for log in logs]


def _lost(log: LogFile, lost: Lost) -> ReadLog:
    return ReadLog(log, None, f"{kept_name(log.path)}: {lost.why}")


def _recording(work: Path, log: LogFile) -> Path:
    return work / f"{log.raw}.mcap"


def _read_alone(job: _Job) -> ReadLog:
    with closing(Reader()) as reader:
        return _read(reader, job)


def _read(reader: Reader, job: _Job) -> ReadLog:
    log, setup = job.done.log, job.setup.value()
    try:
        time, attachments = setup.time(log.form, kept_name(log.path)), setup.attachments(log.form)
        return ReadLog(log, reader.record(log.path, _recording(job.work, log), time, attachments), None)
    except UnreadableLogError as error:
        return ReadLog(log, None, str(error))


def _decode(job: _Job) -> DecodeCompleted:
    log, setup = job.done.log, job.setup.value()
    if job.done.reading is None:
        return _quarantined(job.done, setup)
    made = job.work / log.identity(setup)["decode"]
    made.mkdir(exist_ok=True)
    if (recording := _recording(job.work, log)).exists():
        recording.rename(made / RECORDING)
    databases, name = setup.databases_of(log.form), kept_name(log.path)
    return decode_file(job.done.reading, log.raw, databases, setup.bench, job.channels, made, setup.model, name)


def _quarantined(one: ReadLog, setup: Setup) -> DecodeCompleted:
    """The decode of a log that could not be read."""
    return DecodeCompleted(
        **one.log.identity(setup),
        outcome="quarantined",
        why=one.why,
        absolute=False,
        start_ns=None,
        end_ns=None,
        balance=dict.fromkeys(("found", *COUNTS), 0),
    )


# --- Once more, from sealed bytes -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Sealed:
    """A decode that is to be made again from the sealed files of a store."""

    store: Path
    facts: Shared[Facts] | InProcess[Facts]
    decode: str
    work: Path

    @property
    def own(self) -> Path:
        """The folder in which it is made."""
        return self.work / self.decode


def redecode(
    store: Store, known: Facts, workers: Workers | None = None, tell: Callable[[str], None] = lambda _: None
) -> list[str]:
    """Make recording and samples of every decode again from sealed bytes, and append what they are where that is not
    what the event named; `tell` hears what is made. Returns these decodes: what another version decoded would become
    another decode (`ingest.intake.upgrade`). Raises DamageError where the sealed bytes changed."""
    work = store.work().absolute()
    shared = InProcess(known) if workers is None else share(known.whole(), work)
    wanted = [k for k, one in known.decodes.items() if one.outcome != "quarantined" and is_made_here(one.decoder)]
    jobs = [_Sealed(store.folder.absolute(), shared, key, work) for key in wanted]
    with closing(Reader()) as reader:
        again = partial(_again, reader) if workers is None else _again_alone
        for number, (job, done) in enumerate(each(again, jobs, workers), 1):
            tell(f"made again {number:,} of {len(jobs):,}: {known.files[known.decodes[job.decode].raw].name}")
            if isinstance(done, Lost):
                raise IngestError(f"{known.files[known.decodes[job.decode].raw].name}: {done.why}")
            store.publish(made_in(job.own, done), done.decode)
            shutil.rmtree(job.own)
            named = known.decodes[job.decode]
            if named.products != done.products:  # another version of Arrow writes other bytes
                store.ledger.append(f"file-{named.raw}", replace(named, products=done.products))
    return wanted


def _again_alone(job: _Sealed) -> DecodeCompleted:
    with closing(Reader()) as reader:
        return _again(reader, job)


def _again(reader: Reader, job: _Sealed) -> DecodeCompleted:
    store, known = Store.files_of(job.store), job.facts.value()
    decode = known.decodes[job.decode]
    setup, sealed = sealed_setup(store, known, decode), known.files[decode.raw]
    shutil.rmtree(job.own, ignore_errors=True)
    job.own.mkdir()
    named = job.own / sealed.name  # readers know a format by its name
    try:
        store.archive.lend(decode.raw, named)
    except DamageError as error:
        raise DamageError(f"{sealed.name}: {error}: what was made from it before is left as it is") from None
    unread = ReadLog(LogFile(named, decode.raw, recognise(named)), None, None)
    one = _read(reader, _Job(unread, InProcess(setup), job.own))
    if one.reading is None:
        raise IngestError(f"{sealed.name}: could be read when it was ingested, and cannot now: {one.why}")
    [channels] = resolved(setup, [one.reading], [sealed.name], known)
    return _decode(_Job(one, InProcess(setup), job.own, channels))
