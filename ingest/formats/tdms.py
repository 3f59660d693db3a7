"""TDMS, the format of LabVIEW and DIAdem.

A row is what channels of one time base say of one moment: channels with the same start and increment
(`wf_start_time`, `wf_increment`, in any group), or those of a group with a channel of stamps, or of numbers that is
called time. Of several bases a row is what all of them say at one time, in the order of time; a column is empty where
its base has no value then. Columns are named as the channels, with the group before (`Oven/T1`) where two channels are
called alike. Scalings are applied. A row without a time is rejected.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.errors import UnreadableLogError
from ingest.formats import EARLIEST_NS, EPOCH, LATE_NS, SHOWN, Rejected, Rows, rows_at_once, utc_ns
from ingest.formats._csv_clocks import LATEST_NS
from ingest.formats._csv_time import rises
from ingest.formats._csv_time_names import UNITS_NS, base_and_unit, is_time_name, unit_of_time
from ingest.formats._joined_tables import NO_DATE, JoinedTables, OwnTimes, held
from ingest.formats._tdms_file import TdmsFile, is_number, is_scaled, is_text, is_time, open_tdms, stamps_ns, values
from ingest.texts.nearest import hint

SECOND_NS = 1_000_000_000
SINCE_1904_S = (2.9e9, 4.3e9)  # a column of seconds between these counts from 1904, as LabVIEW does: years 1995 to 2040
SINCE_1970_S = (1e9, 2.9e9)  # and between these from 1970

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class _Waveform:
    """Rows at a fixed step: row k is at origin + offset + k times step. `again`: (k, ns) of rows from which on it
    counts anew, ns after the origin."""

    step_ns: float
    offset_ns: float
    origin_ns: int | None
    again: tuple[tuple[int, int], ...] = ()

    @property
    def says(self) -> str:
        return f"{SECOND_NS / self.step_ns:g} rows a second"

    def t_ns(self, start: int, count: int) -> tuple[Ints, Flags, Sequence[bytes]]:
        """(t_ns, whether there is none, bytes of the file that say so) of `count` rows from `start` on (count,)."""
        firsts, begun_ns = np.array([(0, 0), *self.again], np.int64).T
        rows = np.arange(start, start + count)
        stretch = np.searchsorted(firsts, rows, "right") - 1
        since = np.rint(self.offset_ns + (rows - firsts[stretch]) * self.step_ns)
        origins = (self.origin_ns or 0) + begun_ns[stretch]
        bad = ~(np.abs(since) < LATEST_NS - origins)
        return origins + np.where(bad, 0.0, since).astype(np.int64), bad, []


@dataclass(frozen=True)
class _Stamps:
    """The stamps, or numbers, of a channel. A stamp of a year that no log is from is none."""

    channel: Any
    unit_ns: float
    origin_ns: int | None

    @property
    def says(self) -> str:
        return f'channel "{self.channel.name}" of group "{self.channel.group_name}"'

    def t_ns(self, start: int, count: int) -> tuple[Ints, Flags, Sequence[bytes]]:
        """As `_Waveform.t_ns`."""
        t_ns, bad = np.zeros(count, np.int64), np.ones(count, bool)
        found = values(self.channel, start, count)
        if found is None:
            return t_ns, bad, []
        if is_time(self.channel):
            some = stamps_ns(found)
            wrong = (some < EARLIEST_NS) | (some >= LATE_NS)
        else:
            since = np.asarray(found, np.float64) * self.unit_ns
            wrong = ~(np.abs(since) < LATEST_NS - abs(self.origin_ns or 0))
            some = (self.origin_ns or 0) + np.rint(np.where(wrong, 0.0, since)).astype(np.int64)
        t_ns[: len(some)], bad[: len(some)] = some, wrong
        return t_ns, bad, [value.tobytes() for value in found]


NO_CLOCK = "no time: the channel has no wf_increment, and its group no channel that holds the time"


@dataclass(frozen=True)
class _Untimed:
    """No time at all, or none that can be compared, in a file whose other rows have one."""

    group: str
    why: str = NO_CLOCK
    says: str = "none"
    origin_ns: int | None = 0

    def t_ns(self, start: int, count: int) -> tuple[Ints, Flags, Sequence[bytes]]:
        """As `_Waveform.t_ns`."""
        return np.zeros(count, np.int64), np.ones(count, bool), []


_Base = _Waveform | _Stamps | _Untimed


@dataclass
class TdmsLog(JoinedTables):
    """A TDMS file, read in bounded memory where it has one base; of several all stamps are held."""

    _names: dict[int, str] = field(default_factory=dict)  # id of a channel -> its column
    _damaged: dict[str, None] = field(default_factory=dict)  # columns with values that cannot be read

    def batches(self) -> Iterator[Rows]:
        """Rows in the order of time. Raises UnreadableLogError where nothing can be read, or no row has a time."""
        with closing(open_tdms(self.path)) as file:
            yield from self._of_bases(file)
        ended = file.ended
        if ended is None and self._damaged:
            ended = f"holds values that cannot be read ({', '.join(self._damaged)})"
        self.end_rows(ended, self.rejected[0].why if self.rejected else "its channels hold no value")

    def _of_bases(self, file: TdmsFile) -> Iterator[Rows]:
        kept = [channel for channel in file.channels if is_number(channel) or is_text(channel) or is_time(channel)]
        self._names = _names(kept)
        bases = self._bases(kept, file)
        stamps = {id(base.channel) for base in bases if isinstance(base, _Stamps)}
        columns = [channel for channel in kept if id(channel) not in stamps]
        self.absolute = all(base.origin_ns is not None for base in bases)
        self.units = {self._names[id(one)]: unit for one in columns if (unit := _unit(one))}
        self.settings["time"] = sorted({base.says for base in bases})
        if raw := [self._names[id(one)] for one in columns if not is_scaled(one)]:
            self.settings["unscaled"] = raw
        if left := [f"{one.group_name}/{one.name}" for one in file.channels if one not in kept]:
            self.settings["left_out"] = left
        own = {base: [one for one in channels if id(one) not in stamps] for base, channels in bases.items()}
        if len(own) > 1:
            yield from self._joined([self._table(file, base, channels) for base, channels in own.items() if channels])
        for base, channels in own.items() if len(own) == 1 else ():
            yield from self._base_rows(file, base, channels, columns)

    def _table(self, file: TdmsFile, base: _Base, channels: Sequence[Any]) -> OwnTimes:
        """One base of several."""
        length, step = max(len(channel) for channel in channels), rows_at_once(1)
        parts = [base.t_ns(start, min(step, length - start))[:2] for start in range(0, length, step)]
        t_ns = np.concatenate([np.empty(0, np.int64), *(stamps for stamps, _ in parts)])
        bad = np.concatenate([np.empty(0, bool), *(wrong for _, wrong in parts)])

        def raw(i: int) -> bytes:
            shown = base.t_ns(i, 1)[2]
            return shown[0][:SHOWN] if shown else b"\0"

        return OwnTimes(
            name=channels[0].group_name,
            columns=tuple(self._names[id(one)] for one in channels),
            units=("",) * len(channels),
            count=length,
            times=held(t_ns, bad),
            cells=lambda place, start, stop: self._column(channels[place], True, start, stop - start),
            raw=raw,
            why=lambda _: _why(base),
            where=partial(_where, file, channels, np.arange(length)),
        )

    def _base_rows(
        self, file: TdmsFile, base: _Base, channels: Sequence[Any], columns: Sequence[Any]
    ) -> Iterator[Rows]:
        """The rows of one base. `columns`: all channels of the file that hold values."""
        length = max((len(channel) for channel in channels), default=0)
        for start in range(0, length, step := rows_at_once(len(columns))):
            count = min(step, length - start)
            t_ns, bad, raw = base.t_ns(start, count)
            table = {self._names[id(one)]: self._column(one, one in channels, start, count) for one in columns}
            record = self.found + np.arange(count)
            self.found += count
            for i in np.flatnonzero(bad).tolist():
                shown = raw[i] if i < len(raw) else b"\0"
                where = f'group "{channels[0].group_name}", value {start + i + 1:,}'
                self.rejected.append(Rejected(int(record[i]), where, _why(base), shown[:SHOWN]))
            fine = np.flatnonzero(~bad)
            self.note_places(record[fine], partial(_where, file, channels, start + fine))
            if len(fine):
                yield Rows(t_ns[fine], {name: cells[fine] for name, cells in table.items()}, record[fine])

    def _column(self, channel: Any, own: bool, start: int, count: int) -> NDArray[Any]:
        """`count` cells of a channel from `start` on; empty ones where it has ended, or the rows are not its `own`."""
        cells = np.full(count, np.nan) if is_number(channel) else np.full(count, "", object)
        if not own or start >= len(channel):
            return cells
        found = values(channel, start, count)
        if found is None:
            self._damaged[self._names[id(channel)]] = None
            return cells
        if is_time(channel):
            found = np.datetime_as_string(stamps_ns(found).astype("M8[ns]"))
        cells[: len(found)] = found
        return cells

    # ---- time ------------------------------------------------------------------------------------------------------

    def _bases(self, channels: Sequence[Any], file: TdmsFile) -> dict[_Base, list[Any]]:
        """Time base -> its channels. Raises UnreadableLogError where the stated time is none, or none is found."""
        stated, origin = self._stated(channels), self.time.start_ns
        found: dict[_Base, list[Any]] = {}
        for group, some in groupby(channels, key=lambda channel: channel.group_name):
            own = list(some)
            clock = stated if stated in own else next((one for one in own if is_time(one)), None)
            clock = clock or next((one for one in own if _is_clock(one)), None)
            by_clock = self._clocked(clock, origin) if clock is not None else None
            waves = {(wave, len(one)) for one in own if (wave := self._waveform(one, origin, file))}
            for channel in own:
                by_clock_alone = clock is not None and (clock is channel or clock is stated)
                base = None if by_clock_alone else self._waveform(channel, origin, file)
                beside = [wave for wave, length in waves if len(waves) == 1 and length == len(channel)]
                found.setdefault(base or by_clock or next(iter(beside), _Untimed(group)), []).append(channel)
        if all(isinstance(base, _Untimed) for base in found):
            raise UnreadableLogError(
                f"{self.path.name}: no channel says its time (wf_increment), and none holds it. Under [time] of the "
                'bench file say rate_hz = 1.0 (rows at a fixed rate), or column = "..." with unit.'
            )
        return _dated(found)

    def _stated(self, channels: Sequence[Any]) -> Any | None:
        """The channel that `[time]` of the bench file names."""
        column = self.time.column
        if column is None:
            return None
        named = {self._names[id(one)]: one for one in channels}
        if column not in named:
            raise UnreadableLogError(
                f'{self.path.name}: column = "{column}" under [time] of the bench file is no channel of the file.'
                f"{hint(column, named)} Its channels: {', '.join(named)[:300]}."
            )
        if is_text(named[column]):
            raise UnreadableLogError(
                f'{self.path.name}: column = "{column}" under [time] of the bench file holds text: '
                "name a channel of stamps or numbers."
            )
        return named[column]

    def _waveform(self, channel: Any, origin: int | None, file: TdmsFile) -> _Waveform | None:
        """The base that the properties of a channel, or a stated rate, give; None without."""
        increment = 1 / self.time.rate_hz if self.time.rate_hz else _number(channel, "wf_increment")
        if not increment or not 1e-9 <= increment <= 1e9:
            return None
        offset = 0.0 if self.time.rate_hz else _number(channel, "wf_start_offset") or 0.0
        starts = file.starts(channel, increment * SECOND_NS)
        if not starts or not all(EARLIEST_NS <= ns < LATE_NS for _, ns in starts):
            return _Waveform(increment * SECOND_NS, offset * SECOND_NS, origin)
        begun = starts[0][1]
        again = tuple((number, ns - begun) for number, ns in starts[1:])
        return _Waveform(increment * SECOND_NS, offset * SECOND_NS, origin if origin is not None else begun, again)

    def _clocked(self, clock: Any, origin: int | None) -> _Stamps:
        if is_time(clock):
            return _Stamps(clock, 1.0, 0)
        unit = unit_of_time(self.time.unit or base_and_unit(clock.name)[1] or _unit(clock))
        unit_ns = UNITS_NS[unit or "s"]
        begin = values(clock, 0, 1)
        first = float(begin[0]) * unit_ns / SECOND_NS if begin is not None else 0.0
        if SINCE_1904_S[0] <= first <= SINCE_1904_S[1]:
            return _Stamps(clock, unit_ns, utc_ns(EPOCH.replace(year=1904)))
        return _Stamps(clock, unit_ns, 0 if SINCE_1970_S[0] <= first <= SINCE_1970_S[1] else origin)


def _is_clock(channel: Any) -> bool:
    """A channel of numbers that is called time, and goes on."""
    if not is_number(channel) or not is_time_name(channel.name):
        return False
    found = values(channel, 0, 200)
    return found is not None and rises(found.astype(np.float64))


def _names(channels: Sequence[Any]) -> dict[int, str]:
    often = Counter(channel.name for channel in channels)
    return {id(one): one.name if often[one.name] == 1 else f"{one.group_name}/{one.name}" for one in channels}


def _unit(channel: Any) -> str | None:
    said = channel.properties.get("unit_string") or channel.properties.get("NI_UnitDescription")
    return str(said).strip() or None if said else None


def _number(channel: Any, name: str) -> float | None:
    try:
        found = float(channel.properties[name])
    except (KeyError, TypeError, ValueError):
        return None
    return found if np.isfinite(found) else None


def _where(file: TdmsFile, channels: Sequence[Any], numbers: Ints, i: int) -> str:
    """Where row `i` stands, value `numbers[i]` of its channels: that of the first one that goes so far."""
    number = int(numbers[i])
    return file.where(next(one for one in channels if number < len(one)), number)


def _dated(found: dict[_Base, list[Any]]) -> dict[_Base, list[Any]]:
    """The bases, those without a date as none at all where others have one: nothing says how they lie to each other."""
    timed = [base for base in found if not isinstance(base, _Untimed)]
    if len({base.origin_ns is None for base in timed}) < 2:
        return found
    dated: dict[_Base, list[Any]] = {}
    for base, channels in found.items():
        undated = _Untimed(channels[0].group_name, NO_DATE) if base.origin_ns is None else base
        dated.setdefault(undated, []).extend(channels)
    return dated


def _why(base: _Base) -> str:
    if isinstance(base, _Untimed):
        return base.why
    return f"no time in {base.says}" if isinstance(base, _Stamps) else "its time is beyond what can be kept"


reader = TdmsLog
