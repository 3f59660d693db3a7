"""What is wrong with the stamps of a log: steps back, jumps, records that come twice, stamps far off all others.

A stream is a table, a series of a long one, or the frames of one identifier on one bus: within it a logger's stamps
rise. A record whose stamp is far off both its neighbours, which agree, is a stray: it is left out and counted, as it
would put the log's end into another century. All else is kept as it was recorded, and said.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.facts.events import QualityFlagged
from ingest.formats import WALL_CLOCK, Frames, Rows, TimeSpec
from ingest.log.reading import LogReading

Ints = NDArray[np.int64]
Stream = tuple[int, int] | str | None  # bus and identifier; the series of a long table; None: a table

SECOND_NS = 1_000_000_000
DAY_NS = 86_400 * SECOND_NS
JUMP_NS = 7 * DAY_NS  # shorter ones are gaps: a log that pauses over the weekend
STRAY = "its stamp is more than 30 days off those before and after it"


TIMES_OF_DAY = ("time of day", "hours and minutes", "time of day in digits")  # what tables say without a date
HOUR_NS = 3_600_000_000_000  # a first row below is rather what went by since the start
WALL_CLOCKS = ("blf", "asc", "trc", "lvm")  # formats whose date is always that of the recorder, without a zone


def times_of(reading: LogReading, spec: TimeSpec, table: str = "[time]") -> str:
    """What the stamps of a log are, in words: counted from its start, a wall clock taken as some zone, or UTC; and what
    to say in this `table` of the bench file where they may be others."""
    if not reading.absolute:
        is_time = reading.settings.get("time") in TIMES_OF_DAY and (reading.start_ns or 0) >= HOUR_NS
        return (
            f"times of day without a date: say `start` under {table}" if is_time else "counted from the log's own start"
        )
    if spec.start_ns is not None:
        return "counted from the start that the bench file says"
    said = reading.settings.get("time")
    if reading.format in WALL_CLOCKS or said == WALL_CLOCK:
        zone = spec.zone if spec.column is None else TimeSpec.zone
        advice = f"; say `zone` under {table} if it is another" if zone == TimeSpec.zone else ""
        return f"{WALL_CLOCK}, taken as {zone}{advice}"
    return said if isinstance(said, str) and " in " in said else "UTC, as the log says"


@dataclass
class StampFaults:
    """Counts over all streams; of steps back and jumps those of the stream that has most, as all have one clock.

    `strays`: records that are left out; `doubled`: streams with records that repeat the stamp of another one.
    """

    back_steps: int = 0
    back_ns: int = 0  # the largest
    jump_steps: int = 0
    jump_ns: int = 0
    falls: int = 0  # streams that run from the newest record to the oldest
    equal: int = 0  # records with the stamp and the values of another one
    other: int = 0  # with other values
    blocks: int = 0  # runs of records that are written again as they were
    block_records: int = 0
    span_ns: tuple[int, int] | None = None  # of the records that are not left out
    strays: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    stray_ns: int | None = None  # the first of them
    doubled: set[Stream] = field(default_factory=set)

    def counted(self) -> dict[str, Any]:
        """What is not 0, as the decode's settings keep it."""
        numbers = {name: value for name, value in vars(self).items() if isinstance(value, int) and value}
        return numbers | ({"strays": len(self.strays)} if len(self.strays) else {})


class Watch:
    """Whether the stamps of every stream rise, batch after batch: where they do, `stamps.look` is not worth a pass."""

    def __init__(self) -> None:
        self._last: dict[Any, int] = {}
        self.rises = True

    def add(self, stream: object, t_ns: Ints) -> None:
        """The next stamps (N,) of a stream, in the order of the file."""
        if len(t_ns):
            before = self._last.get(stream)
            self.rises &= bool((np.diff(t_ns) > 0).all()) and (before is None or int(t_ns[0]) > before)
            self._last[stream] = int(t_ns[-1])


def without(batch: Frames | Rows, records: Ints) -> Frames | Rows:
    """A batch without these records."""
    kept = ~np.isin(batch.record, records)
    if kept.all():
        return batch
    if isinstance(batch, Rows):
        columns = {name: values[kept] for name, values in batch.columns.items()}
        return Rows(batch.t_ns[kept], columns, batch.record[kept], batch.series)
    return batch.taken(np.flatnonzero(kept))


def findings(name: str, counted: Mapping[str, Any], absolute: bool) -> list[QualityFlagged]:
    """A flag a kind of fault of the file `name`, from what `StampFaults.counted` says."""
    told = {
        "newest_first": "it runs from the newest record to the oldest: put in the order of time" * ("falls" in counted),
        "clock_back": _steps(counted, "back", "its clock steps back") + _summer_ends(counted, absolute),
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


def _summer_ends(counted: Mapping[str, Any], absolute: bool) -> str:
    """What to do where one step back is an hour less the time between two records, of which few are over 15 min."""
    hour = counted.get("back_steps") == 1 and 2700 <= counted.get("back_ns", 0) / SECOND_NS <= 3600
    return ", as a local clock does when summer time ends: say its `zone` under [time]" if absolute and hour else ""


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
