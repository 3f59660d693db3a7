"""What is wrong with the stamps of a log: steps back, jumps, records that come twice, stamps far off all others.

A stream is a table, or the frames of one identifier on one bus: within it a logger's stamps rise. A record whose stamp
is far off both its neighbours, which agree, is a stray: it is left out and counted, as it would put the log's end into
another century. All else is kept as it was recorded, and said.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from ingest.facts.events import QualityFlagged
from ingest.formats import Frames, Rows
from ingest.log import recording

Ints = NDArray[np.int64]
Prints = NDArray[np.uint64]  # of what a record holds: equal where records are
Stream = tuple[int, int] | None  # bus and identifier, None of a table

SECOND_NS = 1_000_000_000
DAY_NS = 86_400 * SECOND_NS
JUMP_NS = 7 * DAY_NS  # shorter ones are gaps: a log that pauses over the weekend
FAR_NS = 30 * DAY_NS  # a stamp so far off both its neighbours is no time of this log
CLOSE_NS = 3600 * SECOND_NS  # between neighbours of a log that runs: a table with a row a check has no strays or jumps
JITTER_NS = 1_000_000  # by which frames may come out of order
MOST_STRAYS = 10  # in a row: what is longer is a clock that was set
STRAY = "its stamp is more than 30 days off those before and after it"
ODD = np.uint64(0x9E3779B97F4A7C15)


@dataclass
class StampFaults:
    """Counts over all streams; of steps back and jumps those of the stream that has most, as all have one clock.

    `strays`: records that are left out; `doubled`: stream -> records that repeat the stamp of another one.
    """

    back_steps: int = 0
    back_ns: int = 0  # the largest
    jump_steps: int = 0
    jump_ns: int = 0
    equal: int = 0  # records with the stamp and the values of another one
    other: int = 0  # with other values
    blocks: int = 0  # runs of records that are written again as they were
    block_records: int = 0
    span_ns: tuple[int, int] | None = None  # of the records that are not left out
    strays: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    stray_ns: int | None = None  # the first of them
    doubled: dict[Stream, Ints] = field(default_factory=dict)

    def counted(self) -> dict[str, Any]:
        """What is not 0, as the decode's settings keep it."""
        numbers = {name: value for name, value in vars(self).items() if isinstance(value, int) and value}
        return numbers | ({"strays": len(self.strays)} if len(self.strays) else {})


class Watch:
    """Whether the stamps of every stream rise, batch after batch: only where they do not, `look` is worth a pass."""

    def __init__(self) -> None:
        self._last: dict[Any, int] = {}
        self.rises = True

    def add(self, stream: object, t_ns: Ints) -> None:
        """The next stamps (N,) of a stream, in the order of the file."""
        if len(t_ns):
            before = self._last.get(stream)
            self.rises &= bool((np.diff(t_ns) > 0).all()) and (before is None or int(t_ns[0]) > before)
            self._last[stream] = int(t_ns[-1])


def look(path: Path) -> StampFaults:
    """The faults of the stamps in the recording at `path`; it takes 24 bytes of memory a record. Raises DamageError."""
    found = StampFaults()
    strays: list[Ints] = []
    for stream, (t_ns, record, prints) in _streams(path).items():
        stray = _strays(t_ns)
        if stray.any():
            strays.append(record[stray])
            found.stray_ns = int(t_ns[stray][0]) if found.stray_ns is None else found.stray_ns
        kept = ~stray
        least, greatest = int(t_ns[kept].min()), int(t_ns[kept].max())
        before = found.span_ns or (least, greatest)
        found.span_ns = min(least, before[0]), max(greatest, before[1])
        _count(found, stream, t_ns[kept], record[kept], prints[kept])
    found.strays = np.sort(np.concatenate([found.strays, *strays]))
    return found


def without(batch: Frames | Rows, records: Ints) -> Frames | Rows:
    """A batch without these records."""
    kept = ~np.isin(batch.record, records)
    if kept.all():
        return batch
    if isinstance(batch, Rows):
        columns = {name: values[kept] for name, values in batch.columns.items()}
        return Rows(batch.t_ns[kept], columns, batch.record[kept])
    sizes = np.diff(batch.offsets)
    return Frames(
        t_ns=batch.t_ns[kept],
        bus=batch.bus[kept],
        can_id=batch.can_id[kept],
        flags=batch.flags[kept],
        offsets=np.concatenate([[0], np.cumsum(sizes[kept])]).astype(np.int64),
        data=batch.data[batch.offsets[0] : batch.offsets[-1]][np.repeat(kept, sizes)],
        record=batch.record[kept],
    )


def findings(name: str, counted: Mapping[str, Any], absolute: bool) -> list[QualityFlagged]:
    """A flag a kind of fault of the file `name`, from what `StampFaults.counted` says."""
    told = {
        "clock_back": _steps(counted, "back", "its clock steps back"),
        "clock_jump": _steps(counted, "jump", "its clock jumps on, or the log paused,"),
        "doubled_equal": _records(counted, "equal", "with stamp and values of another one"),
        "doubled_other": _records(counted, "other", "with the stamp of another one and other values"),
        "block_twice": _blocks(counted),
        "stray_stamp": _strays_said(counted, absolute),
    }
    return [
        QualityFlagged(flag=flag, says=f"{name}: {says}", detail={"file": name, **counted})
        for flag, says in told.items()
        if says
    ]


def _steps(counted: Mapping[str, Any], what: str, says: str) -> str:
    times, largest_s = counted.get(f"{what}_steps", 0), counted.get(f"{what}_ns", 0) / SECOND_NS
    by = f"{largest_s:,.3g} s" if largest_s < 600 else f"{largest_s / 60:,.0f} min"
    by = f"{largest_s / 86_400:,.1f} days" if largest_s >= 86_400 else by
    return "" if not times else f"{says} by {by}" if times == 1 else f"{says} {times:,} times, by up to {by}"


def _records(counted: Mapping[str, Any], key: str, says: str) -> str:
    count = counted.get(key, 0)
    return f"{count:,} record{'s' * (count != 1)} {says}" if count else ""


def _blocks(counted: Mapping[str, Any]) -> str:
    blocks, records = counted.get("blocks", 0), counted.get("block_records", 0)
    which = "a block" if blocks == 1 else f"{blocks:,} blocks"
    return f"{which} of {records:,} records in all stands in it twice" if blocks else ""


def _strays_said(counted: Mapping[str, Any], absolute: bool) -> str:
    seconds = counted.get("stray_ns", 0) / SECOND_NS
    first = f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M:%S} UTC" if absolute else f"{seconds:,.6g} s"
    says = _records(counted, "strays", "with a stamp far off all others")
    return f"{says} ({first}): left out" if says else ""


def _streams(path: Path) -> dict[Stream, tuple[Ints, Ints, Prints]]:
    """Stamps, records and prints of each stream, in the order of the file."""
    parts: defaultdict[Stream, list[tuple[Ints, Ints, Prints]]] = defaultdict(list)
    for _, batch in recording.read(path):
        for stream, at, prints in _taken_apart(batch):
            parts[stream].append((batch.t_ns[at], batch.record[at], prints))
    return {
        stream: (
            np.concatenate([t_ns for t_ns, _, _ in some]),
            np.concatenate([record for _, record, _ in some]),
            np.concatenate([prints for _, _, prints in some]),
        )
        for stream, some in parts.items()
    }


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


def _strays(t_ns: Ints) -> NDArray[np.bool_]:
    """Which stamps (N,) are far off those before and after them, while these agree."""
    stray = np.zeros(len(t_ns), np.bool_)
    if len(t_ns) < 3 or float(np.median(np.abs(np.diff(t_ns)))) > CLOSE_NS:
        return stray
    far = np.flatnonzero(np.abs(np.diff(t_ns.astype(np.float64))) > FAR_NS) + 1  # where another stretch begins
    edges = [0, *far.tolist(), len(t_ns)]
    longest = max(b - a for a, b in pairwise(edges))
    for k, (a, b) in enumerate(pairwise(edges)):
        if b - a > MOST_STRAYS or b - a == longest:
            continue
        before, after = float(t_ns[a - 1]) if a else None, float(t_ns[b]) if b < len(t_ns) else None
        inner = before is not None and after is not None and abs(after - before) <= FAR_NS
        ends = (before is None or after is None) and edges[k : k + 2] != [0, len(t_ns)]
        stray[a:b] = inner or (ends and b - a == 1)
    return stray


def _count(found: StampFaults, stream: Stream, t_ns: Ints, record: Ints, prints: Prints) -> None:
    order = np.argsort(t_ns, kind="stable")
    first = np.concatenate([[True], np.diff(t_ns[order]) != 0])
    origin = order[np.maximum.accumulate(np.where(first, np.arange(len(order)), 0))]
    repeats, origin = order[~first], origin[~first]
    same = prints[repeats] == prints[origin]
    again = np.sort(repeats[same & (t_ns[repeats - 1] != t_ns[repeats])])  # not right behind what they repeat
    blocks = [run for run in np.split(again, np.flatnonzero(np.diff(again) > 1) + 1) if len(run) > 1]
    written = sum(len(block) for block in blocks)
    found.blocks = max(found.blocks, len(blocks))
    found.block_records += written
    found.equal += int(same.sum()) - written
    found.other += int((~same).sum())
    if len(repeats):
        found.doubled[stream] = np.sort(record[repeats])
    _steps_of(found, t_ns, [int(block[0]) for block in blocks], JITTER_NS if stream else 0)


def _steps_of(found: StampFaults, t_ns: Ints, blocks: Sequence[int], jitter_ns: int) -> None:
    """Count steps back and jumps of a stream; where a block begins that is written twice, no clock steps back."""
    step = np.diff(t_ns)
    back = -step[(step < -jitter_ns) & ~np.isin(np.arange(1, len(t_ns)), blocks)]
    found.back_steps = max(found.back_steps, len(back))
    found.back_ns = max(found.back_ns, int(back.max(initial=0)))
    jump = step[step > JUMP_NS] if len(step) and np.median(np.abs(step)) <= CLOSE_NS else step[:0]
    found.jump_steps = max(found.jump_steps, len(jump))
    found.jump_ns = max(found.jump_ns, int(jump.max(initial=0)))
