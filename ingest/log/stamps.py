"""The stamps of a recording, looked through stream by stream for what `ingest.log.clock` tells of them.

Records wait in memory while they are few, else in files beside the recording. What shares a stamp is found bucket by
bucket: equal stamps fall into the same one. So a log of any length takes about 100 MB.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from shutil import rmtree
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from ingest.facts.durable import scratch
from ingest.formats import Frames, Rows
from ingest.log import recording, spill
from ingest.log.clock import DAY_NS, JUMP_NS, SECOND_NS, Ints, StampFaults, Stream
from ingest.log.spill import Spill, Table

Prints = NDArray[np.uint64]  # of what a record holds: equal where records are
Flags = NDArray[np.bool_]

FAR_NS = 30 * DAY_NS  # a stamp so far off both its neighbours is no time of this log
CLOSE_NS = 3600 * SECOND_NS  # between neighbours of a log that runs: a table with a row a check has no strays or jumps
JITTER_NS = 1_000_000  # by which frames may come out of order
FALLS = 3  # steps, all of them back: a log that was exported from its end
MOST_STRAYS = 10  # in a row: what is longer is a clock that was set
MOST_FAR = 1_000_000  # steps so wide in one stream: beyond, no stamp is of one log with another, and none is left out
ODD = np.uint64(0x9E3779B97F4A7C15)
RECORD = np.dtype([("t_ns", "<i8"), ("record", "<i8"), ("print", "<u8")])
STAMP = np.dtype([("t_ns", "<i8"), ("at", "<i8"), ("print", "<u8"), ("follows", "?")])  # behind one of the same stamp
PLACE = np.dtype([("at", "<i8")])  # of a record in its stream
BACK = np.dtype([("at", "<i8"), ("by_ns", "<i8")])  # where a stream steps back, and by how much


def look(path: Path) -> StampFaults:
    """The faults of the stamps in the recording at `path`. Raises DamageError, and OSError where the disk is full."""
    found = StampFaults()
    strays: list[Ints] = []
    with scratch(path.parent) as place:
        streams: Spill[Stream] = Spill(place, RECORD)
        for _, batch in recording.read(path):
            for stream, at, prints in _taken_apart(batch):
                streams.add(stream, _table(RECORD, batch.t_ns[at], batch.record[at], prints))
        for stream in streams.names:
            one = _Look(streams, stream)
            strays.append(one.strays(found))
            one.count(found, place / "stream")
            rmtree(place / "stream", ignore_errors=True)  # few need one
    found.strays = np.sort(np.concatenate([found.strays, *strays]))
    return found


def _table(layout: np.dtype[np.void], *columns: NDArray[np.generic]) -> Table:
    table = np.empty(len(columns[0]), layout)
    for name, values in zip(layout.names or (), columns, strict=True):
        table[name] = values
    return table


def _taken_apart(batch: Frames | Rows) -> Iterator[tuple[Stream, NDArray[np.intp], Prints]]:
    if isinstance(batch, Rows):
        yield batch.series, np.arange(len(batch.t_ns)), _of_rows(batch)
        return
    prints = _of_frames(batch)
    order = np.argsort(batch.can_id, kind="stable")
    ids, starts = np.unique(batch.can_id[order], return_index=True)
    for can_id, at in zip(ids.tolist(), np.split(order, starts[1:]), strict=True):
        yield (int(batch.bus[0]), can_id), at, prints[at]


def _of_rows(rows: Rows) -> Prints:
    prints = np.zeros(len(rows.t_ns), np.uint64)
    for values in rows.columns.values():
        if values.dtype == object:
            own = np.array([crc32(str(one).encode("utf-8", "surrogatepass")) for one in values.tolist()], np.uint64)
        else:
            own = np.ascontiguousarray(values, np.float64).view(np.uint64)
        prints = (prints ^ own) * ODD
        prints ^= prints >> np.uint64(29)
    return prints


def _of_frames(frames: Frames) -> Prints:
    sizes = np.diff(frames.offsets)
    starts = frames.offsets[:-1] - frames.offsets[0]
    data = frames.data[frames.offsets[0] : frames.offsets[-1]].astype(np.uint64) + np.uint64(1)
    place = (np.arange(len(data)) - np.repeat(starts, sizes)).astype(np.uint64)
    mixed = data * ((place + np.uint64(1)) * ODD | np.uint64(1))
    mixed ^= mixed >> np.uint64(31)
    total = np.concatenate([np.zeros(1, np.uint64), np.cumsum(mixed * ODD, dtype=np.uint64)])
    return np.asarray(total[starts + sizes] - total[starts] + sizes.astype(np.uint64), np.uint64)


def near(step: Ints | NDArray[np.float64]) -> int:
    """How many steps from record to record (N,) [ns] are as short as those of a log that runs."""
    return int((np.abs(step) <= CLOSE_NS).sum())


def runs(close: int, steps: int) -> bool:
    """Whether a log runs, and is no table with a row a check: most of its steps are `near`."""
    return 2 * close > steps


class _Look:
    """One stream looked through, in as many passes as that takes."""

    def __init__(self, streams: Spill[Stream], stream: Stream) -> None:
        self._streams, self._stream = streams, stream
        self._strays = self._stray_places()

    def strays(self, found: StampFaults) -> Ints:
        """The records that are left out (N,)."""
        parts = [rows for rows, stray in self._batches() if stray.any() for rows in [rows[stray]]]
        if not parts:
            return np.empty(0, np.int64)
        rows = np.concatenate(parts)
        found.stray_ns = int(rows["t_ns"][0]) if found.stray_ns is None else found.stray_ns
        return np.asarray(rows["record"])

    def count(self, found: StampFaults, folder: Path) -> None:
        """Count the faults of all other records."""
        steps = _Steps(JITTER_NS if isinstance(self._stream, tuple) else 0, folder / "back")
        total = sum(len(stray) - int(stray.sum()) for _, stray in self._batches())
        doubled = _Doubled(total, folder)
        for rows, stray in self._batches():
            kept = rows[~stray]
            if len(kept):
                doubled.add(kept, steps.add(kept["t_ns"]))
        doubled.count(found, self._stream)
        before = found.span_ns or (steps.least, steps.greatest)
        found.span_ns = min(steps.least, before[0]), max(steps.greatest, before[1])
        steps.count(found, doubled)

    def _batches(self) -> Iterator[tuple[Table, Flags]]:
        """The rows (N,) of the stream, in order, and which of them are strays."""
        at = 0
        for rows in self._streams.batches(self._stream):
            end = at + len(rows)
            firsts, ends = self._strays[:, 0], self._strays[:, 1]
            here = self._strays[np.searchsorted(ends, at, "right") : np.searchsorted(firsts, end)] - at
            edges = np.zeros(len(rows) + 1, np.int8)
            edges[np.maximum(here[:, 0], 0)] = 1
            edges[np.minimum(here[:, 1], len(rows))] -= 1
            yield rows, np.cumsum(edges[:-1], dtype=np.int8) > 0
            at = end

    def _stray_places(self) -> Ints:
        """Runs (S, 2) of stamps, first and end, that are far off those before and after them, while these agree."""
        far: list[Ints] = []  # (3, M) where another stretch begins, the stamp before it, and its own
        last = np.empty(0, np.int64)
        count = close = wide = 0
        for rows in self._streams.batches(self._stream):
            t_ns = np.concatenate([last, rows["t_ns"]])
            step = np.abs(np.diff(t_ns.astype(np.float64)))
            at = np.flatnonzero(step > FAR_NS)
            far += [np.stack([at + 1 + count - len(last), t_ns[at], t_ns[at + 1]])] if len(at) else []
            close, wide = close + near(step), wide + len(at)
            last, count = t_ns[-1:], count + len(rows)
            if wide > MOST_FAR:
                break
        lone = far and count >= 3 and runs(close, count - 1) and wide <= MOST_FAR
        return _lone(np.concatenate(far, axis=1), count) if lone else np.empty((0, 2), np.int64)


def _lone(far: Ints, count: int) -> Ints:
    """The stretches (S, 2) of a stream of `count` records that are no time of its log; `far`: where each but the first
    begins, the stamp before it, and its own (3, M)."""
    edges = np.concatenate([[0], far[0], [count]])
    long = np.diff(edges)
    inner = np.zeros(len(long), np.bool_)
    inner[1:-1] = np.abs(far[2, 1:].astype(np.float64) - far[1, :-1]) <= FAR_NS
    ends = np.zeros(len(long), np.bool_)
    ends[[0, -1]] = long[[0, -1]] == 1
    lone = (long <= MOST_STRAYS) & (long < long.max()) & (inner | ends)
    return np.stack([edges[:-1][lone], edges[1:][lone]], axis=1)


class _Steps:
    """The steps of a stream from record to record; one back by `jitter_ns` is none."""

    def __init__(self, jitter_ns: int, folder: Path) -> None:
        self._jitter_ns = jitter_ns
        self._last = np.empty(0, np.int64)
        self._seen = self._count = self._close = self._jumps = self._jump_ns = self._forward = 0
        self._back = _ByPlace(folder, BACK)
        self.least, self.greatest = np.iinfo(np.int64).max, np.iinfo(np.int64).min

    def add(self, t_ns: Ints) -> Flags:
        """The next stamps (N,), and which of them equal the one before."""
        step = np.diff(np.concatenate([self._last, t_ns]))
        first = self._seen + len(t_ns) - len(step)
        back = np.flatnonzero(step < -self._jitter_ns)
        self._back.add(_table(BACK, back + first, -step[back]))
        jump = step[step > JUMP_NS]
        self._jumps, self._jump_ns = self._jumps + len(jump), max(self._jump_ns, int(jump.max(initial=0)))
        self._close += near(step)
        self._forward += int((step > 0).sum())
        self.least, self.greatest = min(self.least, int(t_ns.min())), max(self.greatest, int(t_ns.max()))
        self._last, self._seen, self._count = t_ns[-1:], self._seen + len(t_ns), self._count + len(step)
        return np.concatenate([np.zeros(len(t_ns) - len(step), np.bool_), step == 0])

    def count(self, found: StampFaults, doubled: _Doubled) -> None:
        """Add steps back and jumps; where a block begins that is written twice, or the newest record stands first, no
        clock steps back."""
        steps = most = 0
        for number in self._back.numbers:
            rows = self._back.within(number)
            by_ns = rows["by_ns"][~doubled.begins(number)[rows["at"]]]
            steps, most = steps + len(by_ns), max(most, int(by_ns.max(initial=0)))
        if steps >= FALLS and not self._forward:
            found.falls += 1
            return
        found.back_steps = max(found.back_steps, steps)
        found.back_ns = max(found.back_ns, most)
        if runs(self._close, self._count):
            found.jump_steps = max(found.jump_steps, self._jumps)
            found.jump_ns = max(found.jump_ns, self._jump_ns)


class _ByPlace:
    """Rows that have a place in a stream (`at`), by stretches of so many places as memory holds, numbered from 0."""

    def __init__(self, folder: Path, layout: np.dtype[np.void]) -> None:
        self._spill: Spill[int] = Spill(folder, layout)

    @property
    def numbers(self) -> list[int]:
        """Numbers of the stretches that hold rows."""
        return self._spill.names

    def add(self, rows: Table) -> None:
        """Rows (N,) in any order."""
        for number, some in _split(rows, rows["at"] // spill.MOST_ROWS):
            self._spill.add(number, some)

    def within(self, number: int) -> Table:
        """The rows of one stretch, `at` counted from where it begins. A stretch holds one row a place at most."""
        rows = np.concatenate([np.empty(0, self._spill.layout), *self._spill.batches(number)])
        rows["at"] -= number * spill.MOST_ROWS
        return rows


class _Doubled:
    """The `total` records of a stream, in buckets by stamp."""

    def __init__(self, total: int, folder: Path) -> None:
        self._seen = 0
        self._buckets = 1 + total // spill.MOST_ROWS
        self._spill: Spill[int] = Spill(folder, STAMP)
        self._again = _ByPlace(folder / "again", PLACE)  # repeats, but those right behind what they repeat

    def add(self, rows: Table, follows: Flags) -> None:
        """The next rows (N,), and which of them have the stamp of the one before."""
        at = np.arange(self._seen, self._seen + len(rows))
        table = _table(STAMP, rows["t_ns"], at, rows["print"], follows)
        self._seen += len(rows)
        bucket = (rows["t_ns"].astype(np.uint64) * ODD >> np.uint64(32)) % np.uint64(self._buckets)
        for number, some in _split(table, bucket):
            self._spill.add(number, some)

    def count(self, found: StampFaults, stream: Stream) -> None:
        """Add what has the stamp of another record, and what of it is written again as a block."""
        equal = other = 0
        for number in self._spill.names:
            for repeats, same in _repeats(self._spill.batches(number)):
                self._again.add(_table(PLACE, repeats["at"][same & ~repeats["follows"]]))
                equal, other = equal + int(same.sum()), other + int((~same).sum())
        blocks = written = 0
        for number in self._again.numbers:
            inside, begins = self._blocks(number)
            blocks, written = blocks + int(begins.sum()), written + int(inside.sum())
        found.blocks = max(found.blocks, blocks)
        found.block_records += written
        found.equal += equal - written
        found.other += other
        if equal + other:
            found.doubled.add(stream)

    def begins(self, number: int) -> Flags:
        """Of a stretch (MOST_ROWS,): the records with which a block begins that stands there twice."""
        return self._blocks(number)[1]

    def _blocks(self, number: int) -> tuple[Flags, Flags]:
        """Which records of a stretch are within a block of two and more, and with which one begins: (MOST_ROWS,)
        each."""
        again = np.zeros(spill.MOST_ROWS + 2, np.bool_)  # with the record before the stretch and the one behind it
        again[self._again.within(number)["at"] + 1] = True
        again[0] = (self._again.within(number - 1)["at"] == spill.MOST_ROWS - 1).any()
        again[-1] = (self._again.within(number + 1)["at"] == 0).any()
        here, before, behind = again[1:-1], again[:-2], again[2:]
        return here & (before | behind), here & ~before & behind


def _split(rows: Table, key: NDArray[np.integer]) -> Iterator[tuple[int, Table]]:
    """Rows (N,) by what each is put under (N,), in their order."""
    order = np.argsort(key, kind="stable")
    numbers, starts = np.unique(key[order], return_index=True)
    for number, (a, b) in zip(numbers.tolist(), pairwise([*starts.tolist(), len(rows)]), strict=True):
        yield number, rows[order[a:b]]


def _repeats(batches: Iterable[Table]) -> Iterator[tuple[Table, Flags]]:
    """A batch (N,) at a time: the rows (M,) whose stamp stood there before, and which equal the first of that stamp."""
    firsts = np.empty(0, STAMP)
    for batch in batches:
        rows = np.concatenate([firsts, batch])
        order = np.argsort(rows["t_ns"], kind="stable")
        new = np.diff(rows["t_ns"][order], prepend=rows["t_ns"][order[0]] - 1) != 0
        origin = order[np.maximum.accumulate(np.where(new, np.arange(len(order)), 0))]
        firsts = rows[order[new]]
        yield rows[order[~new]], rows["print"][order[~new]] == rows["print"][origin[~new]]
