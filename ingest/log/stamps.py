"""The stamps of a recording, looked through stream by stream for what `ingest.log.clock` tells of them.

Records wait in memory while they are few, else in files beside the recording. What shares a stamp is found bucket by
bucket: equal stamps fall into the same one. So a log of any length takes about 100 MB.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from ingest.formats import Frames, Rows
from ingest.log import recording, spill
from ingest.log.clock import DAY_NS, JUMP_NS, SECOND_NS, Ints, StampFaults, Stream
from ingest.log.spill import Spill, Table

Prints = NDArray[np.uint64]  # of what a record holds: equal where records are
Flags = NDArray[np.bool_]

FAR_NS = 30 * DAY_NS  # a stamp so far off both its neighbours is no time of this log
CLOSE_NS = 3600 * SECOND_NS  # between neighbours of a log that runs: a table with a row a check has no strays or jumps
JITTER_NS = 1_000_000  # by which frames may come out of order
MOST_STRAYS = 10  # in a row: what is longer is a clock that was set
ODD = np.uint64(0x9E3779B97F4A7C15)
RECORD = np.dtype([("t_ns", "<i8"), ("record", "<i8"), ("print", "<u8")])
PLACE = np.dtype([("at", "<i8")])
STAMP = np.dtype([("t_ns", "<i8"), ("at", "<i8"), ("print", "<u8"), ("follows", "?")])  # behind one of the same stamp


def look(path: Path) -> StampFaults:
    """The faults of the stamps in the recording at `path`. Raises DamageError, and OSError where the disk is full."""
    found = StampFaults()
    strays: list[Ints] = []
    with TemporaryDirectory(dir=path.parent) as place:
        streams: Spill[Stream] = Spill(Path(place), RECORD)
        for _, batch in recording.read(path):
            for stream, at, prints in _taken_apart(batch):
                streams.add(stream, _table(RECORD, batch.t_ns[at], batch.record[at], prints))
        for stream in streams.names:
            one = _Look(streams, stream)
            strays.append(one.strays(found))
            with TemporaryDirectory(dir=place) as beside:
                one.count(found, Path(beside))
    found.strays = np.sort(np.concatenate([found.strays, *strays]))
    return found


def _table(layout: np.dtype[np.void], *columns: NDArray[np.generic]) -> Table:
    table = np.empty(len(columns[0]), layout)
    for name, values in zip(layout.names or (), columns, strict=True):
        table[name] = values
    return table


def _taken_apart(batch: Frames | Rows) -> Iterator[tuple[Stream, NDArray[np.intp], Prints]]:
    if isinstance(batch, Rows):
        yield None, np.arange(len(batch.t_ns)), _of_rows(batch)
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
        steps = _Steps(JITTER_NS if self._stream else 0)
        total = sum(len(stray) - int(stray.sum()) for _, stray in self._batches())
        doubled = _Doubled(total, folder)
        for rows, stray in self._batches():
            kept = rows[~stray]
            if len(kept):
                doubled.add(kept, steps.add(kept["t_ns"]))
        doubled.count(found, self._stream)
        before = found.span_ns or (steps.least, steps.greatest)
        found.span_ns = min(steps.least, before[0]), max(steps.greatest, before[1])
        steps.count(found, doubled.blocks)

    def _batches(self) -> Iterator[tuple[Table, Flags]]:
        """The rows (N,) of the stream, in order, and which of them are strays."""
        at = 0
        for rows in self._streams.batches(self._stream):
            stray = np.zeros(len(rows), np.bool_)
            for first, end in self._strays:
                stray[max(first - at, 0) : max(end - at, 0)] = True
            at += len(rows)
            yield rows, stray

    def _stray_places(self) -> list[tuple[int, int]]:
        """Runs (first, end) of stamps that are far off those before and after them, while these agree."""
        far: list[tuple[int, float, float]] = []  # where another stretch begins, the stamp before it, and its own
        last = np.empty(0)
        count = close = 0
        for rows in self._streams.batches(self._stream):
            t_ns = np.concatenate([last, rows["t_ns"].astype(np.float64)])
            step = np.abs(np.diff(t_ns))
            wide = np.flatnonzero(step > FAR_NS)
            places = (wide + 1 + count - len(last)).tolist()
            far += zip(places, t_ns[wide].tolist(), t_ns[wide + 1].tolist(), strict=True)
            close += int((step <= CLOSE_NS).sum())
            last, count = t_ns[-1:], count + len(rows)
        return _lone(far, count) if count >= 3 and 2 * close > count - 1 else []


def _lone(far: Sequence[tuple[int, float, float]], count: int) -> list[tuple[int, int]]:
    """The stretches (first, end) of a stream of `count` records that are no time of its log."""
    edges = [0, *(place for place, _, _ in far), count]
    longest = max(b - a for a, b in pairwise(edges))
    found = []
    for k, (a, b) in enumerate(pairwise(edges)):
        if b - a > MOST_STRAYS or b - a == longest:
            continue
        before, after = far[k - 1][1] if a else None, far[k][2] if b < count else None
        inner = before is not None and after is not None and abs(after - before) <= FAR_NS
        ends = (before is None or after is None) and (a, b) != (0, count)
        if inner or (ends and b - a == 1):
            found.append((a, b))
    return found


class _Steps:
    """The steps of a stream from record to record; one back by `jitter_ns` is none."""

    def __init__(self, jitter_ns: int) -> None:
        self._jitter_ns = jitter_ns
        self._last = np.empty(0, np.int64)
        self._seen = self._count = self._close = self._jumps = self._jump_ns = 0
        self._back: list[tuple[Ints, Ints]] = []  # places of the records behind a step back, and by how much
        self.least, self.greatest = np.iinfo(np.int64).max, np.iinfo(np.int64).min

    def add(self, t_ns: Ints) -> Flags:
        """The next stamps (N,), and which of them equal the one before."""
        step = np.diff(np.concatenate([self._last, t_ns]))
        first = self._seen + len(t_ns) - len(step)
        back = np.flatnonzero(step < -self._jitter_ns)
        self._back.append((back + first, -step[back]))
        jump = step[step > JUMP_NS]
        self._jumps, self._jump_ns = self._jumps + len(jump), max(self._jump_ns, int(jump.max(initial=0)))
        self._close += int((np.abs(step) <= CLOSE_NS).sum())
        self.least, self.greatest = min(self.least, int(t_ns.min())), max(self.greatest, int(t_ns.max()))
        self._last, self._seen, self._count = t_ns[-1:], self._seen + len(t_ns), self._count + len(step)
        return np.concatenate([np.zeros(len(t_ns) - len(step), np.bool_), step == 0])

    def count(self, found: StampFaults, blocks: Ints) -> None:
        """Add steps back and jumps; where a block begins that is written twice (its place), no clock steps back."""
        places, sizes = (np.concatenate(column) for column in zip(*self._back, strict=True))
        back = sizes[~np.isin(places, blocks)]
        found.back_steps = max(found.back_steps, len(back))
        found.back_ns = max(found.back_ns, int(back.max(initial=0)))
        if 2 * self._close > self._count:
            found.jump_steps = max(found.jump_steps, self._jumps)
            found.jump_ns = max(found.jump_ns, self._jump_ns)


class _Doubled:
    """The `total` records of a stream, in buckets by stamp. `blocks`: where those begin that stand there twice."""

    def __init__(self, total: int, folder: Path) -> None:
        self._seen = 0
        self._buckets = 1 + total // spill.MOST_ROWS
        self._spill: Spill[int] = Spill(folder, STAMP)
        self._folder = folder
        self.blocks = np.empty(0, np.int64)

    def add(self, rows: Table, follows: Flags) -> None:
        """The next rows (N,), and which of them have the stamp of the one before."""
        at = np.arange(self._seen, self._seen + len(rows))
        table = _table(STAMP, rows["t_ns"], at, rows["print"], follows)
        self._seen += len(rows)
        bucket = (rows["t_ns"].astype(np.uint64) * ODD >> np.uint64(32)) % np.uint64(self._buckets)
        order = np.argsort(bucket, kind="stable")
        numbers, starts = np.unique(bucket[order], return_index=True)
        for number, some in zip(numbers.tolist(), np.split(order, starts[1:]), strict=True):
            self._spill.add(number, table[some])

    def count(self, found: StampFaults, stream: Stream) -> None:
        """Add what has the stamp of another record, and what of it is written again as a block."""
        self._folder.joinpath("again").mkdir()
        again: Spill[int] = Spill(self._folder / "again", PLACE)  # part by part of the stream
        equal = other = 0
        for number in self._spill.names:
            rows = np.concatenate(list(self._spill.batches(number)))
            repeats, origin = _repeats(rows["t_ns"])
            same = rows["print"][repeats] == rows["print"][origin]
            apart = np.sort(rows["at"][repeats[same & ~rows["follows"][repeats]]])  # not right behind what they repeat
            part = apart // spill.MOST_ROWS
            for one in np.unique(part).tolist():
                again.add(one, _table(PLACE, apart[part == one]))
            equal, other = equal + int(same.sum()), other + int((~same).sum())
        blocks = _blocks(np.sort(np.concatenate([*again.batches(one)])["at"]) for one in sorted(again.names))
        written = int((blocks[:, 1] - blocks[:, 0]).sum())
        self.blocks = blocks[:, 0]
        found.blocks = max(found.blocks, len(blocks))
        found.block_records += written
        found.equal += equal - written
        found.other += other
        if equal + other:
            found.doubled.add(stream)


def _blocks(parts: Iterable[Ints]) -> Ints:
    """Runs (first, end) of two and more places, (M, 2); `parts` are places, ascending from part to part."""
    found = [np.empty((0, 2), np.int64)]
    open_first = open_end = -1
    for places in parts:
        cut = np.flatnonzero(np.diff(places) != 1) + 1
        runs = np.stack([places[np.append(0, cut)], places[np.append(cut, len(places)) - 1] + 1], axis=1)
        if runs[0, 0] == open_end:
            runs[0, 0] = open_first
        else:
            found.append(np.array([[open_first, open_end]]))
        open_first, open_end = runs[-1].tolist()
        found.append(runs[:-1][np.diff(runs[:-1])[:, 0] > 1])
    found.append(np.array([[open_first, open_end]]))
    every = np.concatenate(found)
    return every[every[:, 1] - every[:, 0] > 1]


def _repeats(t_ns: Ints) -> tuple[Ints, Ints]:
    """Places of the stamps (N,) that stood there before, and of the first of each: (M,) both."""
    order = np.argsort(t_ns, kind="stable")
    first = np.diff(t_ns[order], prepend=t_ns[order[0]] - 1) != 0
    origin = order[np.maximum.accumulate(np.where(first, np.arange(len(order)), 0))]
    return order[~first], origin[~first]
