"""From the recording of a log to samples: bits, units, derived channels, and what became of every record.

Nothing is lost in silence: found = decoded + unknown_id + wrong_length + rejected, with `found` counted by the reader
of the log and `decoded` by the Parquet files that were written.
"""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.bench.bench_file import Bench
from ingest.bench.resolving import ResolvedChannel
from ingest.facts.durable import sha256_of
from ingest.facts.events import DecodeCompleted
from ingest.formats import SERIES, Frames, Rejected, Rows, TimeSpec
from ingest.log import clock, held, meant, recording, stamps
from ingest.log.ahead import ahead
from ingest.log.balance import Account, outcome
from ingest.log.clock import JUMP_NS, times_of
from ingest.log.databases import Database, merged
from ingest.log.frames import FrameBatch
from ingest.log.j1939 import Explained, explained
from ingest.log.plan import SignalGroup, groups_of, plan
from ingest.log.reading import LogReading
from ingest.log.recording import id_text, identifiers
from ingest.log.samples import GroupWriter, Samples
from ingest.log.specimens import Specimens
from ingest.log.transport import Unpacked

DECODER = "whyhot-decoder/18"
RECORDING = "recording.mcap"
WAITING_VALUES = 16_000_000  # of all groups that wait for their row group: 128 MB
WRITERS = 2  # threads that write or hash the files of the groups, each file by one of them at a time


def is_made_here(decoder: str) -> bool:
    """Whether a decode by `decoder` is what this version makes of a log."""
    return decoder == DECODER


def newer(decoder: str) -> str | None:
    """Why this version leaves a log alone that was decoded by `decoder`, as a clause; None where it need not."""
    number, own = (text.rpartition("/")[2] for text in (decoder, DECODER))
    if not number.isdecimal() or int(number) <= int(own):
        return None
    return f"was decoded by a newer version ({decoder}, this is {DECODER}): update whyhot"


def decode_id(raw: str, databases: Sequence[str], bench: str | None, model: str | None = None) -> str:
    """Identity of a decode: SHA-256 over decoder version and the SHA-256 of log, databases, bench and motor file.

    The order of the databases counts: where two differ about a message, the first is used. The motor file tells nodes
    from boundaries, so one bench file beside two motor files decodes a log twice.
    """
    named = [bench or "", *([model] if model else [])]
    return hashlib.sha256("\n".join([DECODER, raw, *databases, *named]).encode()).hexdigest()


def decode_file(
    reading: LogReading,
    raw: str,
    databases: Sequence[Database],
    bench: Bench | None,
    channels: Sequence[ResolvedChannel],
    folder: Path,
    model: str | None = None,
    name: str = "",
) -> DecodeCompleted:
    """Decode `folder / "recording.mcap"` into Parquet files beside it, one for each group; the event says what came.

    `raw` is the SHA-256 of the log and `name` its name, `model` the SHA-256 of the motor file, `channels` are those of
    `bench`, resolved. The same inputs give the same bytes. Raises BenchFileError where the bench file does not fit the
    log, DamageError where the recording is damaged, and IngestError where records were lost.
    """
    path = folder / RECORDING
    messages, notes = merged(databases)
    texts = _texts(path, reading) if reading.holds == "rows" else set()
    seen = identifiers(reading)
    names = {signal.qualified for one in channels for signal in one.signals}
    means = explained(messages, {can_id for _, can_id in seen}, meant.on_bus(databases, seen, names))
    groups = groups_of(reading, means)
    said: dict[str, Any] = {"databases": notes, "missing": plan(groups, channels, bench, texts)}
    said["databases_differ"] = meant.untold(databases, seen, names)
    said["changes"] = _changes(bench, reading)
    logger = bench.logger_of(name) if bench else None
    spec = bench.time_for(reading.format, name) if bench else TimeSpec()
    whose, table = (f"logger {logger.name}, ", "its [[logger]]") if logger else ("", "[time]")
    said["times"] = [f"{whose}{times_of(reading, spec, table)}"]
    specimens = Specimens(bench, reading.columns)
    faults = stamps.look(path) if _is_long(reading) else None  # only in such a log can a stamp be far off
    with ThreadPoolExecutor(WRITERS) as pool:
        work = _Work(groups, held.collect(path, groups, means), raw, folder, means, pool)
        for _, batch in ahead(recording.read(path)):
            placed = clock.without(batch, faults.strays) if faults else batch
            specimens.add(placed)
            work.add(placed)
        rows = work.close()
        written = [group for group in groups if group.name in rows]
        files = [RECORDING, *(group.file for group in written)]
        products = dict(zip(files, pool.map(sha256_of, [folder / name for name in files]), strict=True))
    if faults is None:
        faults = clock.StampFaults() if work.watch.rises else stamps.look(path)
    said |= specimens.unsaid()
    return DecodeCompleted(
        **identity(raw, databases, bench, model),
        **_outcome(reading, path, work.account, sum(rows.values()), said, specimens.within(faults), written, databases),
        groups=[group.entry(rows[group.name]) for group in written],
        channels=[output.channel for group in written for output in group.outputs if output.channel],
        products=products,
        parts=specimens.parts(),
    )


def identity(raw: str, databases: Sequence[Database], bench: Bench | None, model: str | None) -> dict[str, Any]:
    """What a decode was made of, as its event says it: the SHA-256 of each, and the id that follows from them."""
    shas, sha = [database.sha256 for database in databases], bench.sha256 if bench else None
    decode = decode_id(raw, shas, sha, model)
    return {"decode": decode, "decoder": DECODER, "raw": raw, "databases": shas, "bench": sha, "model": model}


def _changes(bench: Bench | None, reading: LogReading) -> list[str]:
    """What the bench file says is other about channels by the time of a log: "2025-02-11: T3: node yoke (was
    winding)"."""
    here = bench.changes_at(reading.start_ns) if bench and reading.absolute and reading.start_ns is not None else ()
    return [f"{one.since}: {one.says}{f' ({one.reason})' if one.reason else ''}" for one in here]


def _is_long(reading: LogReading) -> bool:
    return reading.start_ns is not None and reading.end_ns is not None and reading.end_ns - reading.start_ns > JUMP_NS


def _clock(faults: clock.StampFaults, written: Sequence[SignalGroup]) -> dict[str, Any]:
    """What the settings say of the stamps: counts, and the groups with stamps that come twice."""
    doubled = [group.name for group in written if group.stream in faults.doubled]
    return faults.counted() | ({"doubled": doubled} if doubled else {})


def _outcome(
    reading: LogReading,
    path: Path,
    account: Account,
    decoded: int,
    said: Mapping[str, Any],
    faults: clock.StampFaults,
    written: Sequence[SignalGroup],
    databases: Sequence[Database],
) -> dict[str, Any]:
    """What the event says of the records. Raises IngestError where the balance does not hold."""
    account.refuse(recording.read_rejected(path) if reading.rejected else ())
    account.refuse(Rejected(one, f"record {one + 1:,}", clock.STRAY) for one in faults.strays.tolist())
    balance = account.balance(reading, decoded)
    result, why = outcome(reading, account, balance, [database.name for database in databases])
    lengths = dict(sorted(account.wrong_length.items()))
    start_ns, end_ns = faults.span_ns or (reading.start_ns, reading.end_ns)
    notable = {**said, "wrong_length": lengths, "rejected": account.reasons(), "clock": _clock(faults, written)}
    notable |= {name: dict(sorted(getattr(account, name).items())) for name in ("not_available", "errors")}
    return {
        "outcome": result,
        "why": why,
        "absolute": reading.absolute,
        "start_ns": start_ns,
        "end_ns": end_ns,
        "balance": balance,
        "unknown_ids": dict(sorted(account.unknown_id.items())),
        "rejections": account.rejections(),
        "settings": {**reading.settings, **{name: value for name, value in notable.items() if value}},
    }


def _texts(path: Path, reading: LogReading) -> set[str]:
    """The names of the text columns of a table: those of its first rows, or of its series."""
    batches = (batch for _, batch in recording.read(path) if isinstance(batch, Rows))
    some = batches if "" in reading.settings.get(SERIES, ()) else islice(batches, 1)
    return {name for batch in some for name, values in batch.columns.items() if values.dtype == object}


class _Work:
    """Decodes batch after batch into the files of the groups, and keeps account of what could not be decoded."""

    def __init__(
        self,
        groups: Sequence[SignalGroup],
        others: held.Held,
        raw: str,
        folder: Path,
        means: Explained,
        pool: ThreadPoolExecutor,
    ) -> None:
        self.account = Account()
        self.watch = clock.Watch()
        self._groups = {group.stream: group for group in groups}
        self._others, self._raw, self._folder = others, raw, folder
        self._writers: dict[str, GroupWriter] = {}
        self._unpacked = Unpacked(means)
        self._pool = pool

    def add(self, batch: Frames | Rows) -> None:
        """Decode a batch of frames or rows."""
        if isinstance(batch, Rows):
            self._write(self._groups[batch.series], batch.t_ns, batch.record, batch.columns)
        else:
            for part in self._unpacked.parts(batch):
                self._add_frames(FrameBatch(part.frames), part.carried)
        if sum(writer.waiting for writer in self._writers.values()) > WAITING_VALUES:
            deque(self._pool.map(GroupWriter.flush, self._writers.values()), 0)

    def close(self) -> dict[str, int]:
        """Finish the files: group name -> rows, as the file itself says."""
        self._unpacked.finish()
        self.account.break_off(self._unpacked.broken)
        return dict(zip(self._writers, self._pool.map(GroupWriter.close, self._writers.values()), strict=True))

    def _add_frames(self, batch: FrameBatch, carried: NDArray[np.int64] | None) -> None:
        """Decode frames. `carried` (N,): how many frames of the log each is, None where each is one."""

        def frames(at: NDArray[np.intp]) -> int:
            return len(at) if carried is None else int(carried[at].sum())

        self.account.reject(batch)
        for bus, can_id, at in batch.by_identifier():
            group = self._groups.get((bus, can_id))
            if group is None or group.message is None:
                self.account.unknown_id[id_text(bus, can_id)] += frames(at)
                continue
            if carried is not None:  # those without data managed messages: decoded in these
                self.account.carried += frames(at[batch.lengths[at] == 0])
                at = at[batch.lengths[at] > 0]
            whole = batch.long_enough(group.message, at)
            if len(whole) < len(at):
                short = frames(at) - frames(whole)
                self.account.wrong_length[f"{id_text(bus, can_id)} {group.message.name}"] += short
            self.account.carried += frames(whole) - len(whole)
            if len(whole):
                signals = batch.signals(group.message, whole)
                self._write(group, batch.frames.t_ns[whole], batch.frames.record[whole], signals)
        self.account.missing(batch)

    def _write(
        self,
        group: SignalGroup,
        t_ns: NDArray[np.int64],
        record: NDArray[np.int64],
        signals: Mapping[str, NDArray[Any]],
    ) -> None:
        self.watch.add(group.name, t_ns)
        values = [
            output.values(
                [self._others.at(one, t_ns) if one in output.held else signals[one[1]] for one in output.sources]
            )
            for output in group.outputs
        ]
        if group.name not in self._writers:
            columns = [output.column for output in group.outputs]
            self._writers[group.name] = GroupWriter(self._folder / group.file, self._raw, columns)
        self._writers[group.name].add(Samples(t_ns, record, values))
