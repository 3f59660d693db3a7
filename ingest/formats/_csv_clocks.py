"""Clocks of tables: how the rows have their time, from a rate, from numbers that count, or from stamps."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ingest.formats import SHOWN
from ingest.formats._csv_numbers import MISSING
from ingest.formats._csv_stamps import BLANK, LocalClock, parse, time_of_day

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

OF_FRACTION = -1  # digits of a part of a second that is written as one: 0.25
WRAP = 2**32  # what a counter of 32 bits begins anew at: of milliseconds after 50 days, of microseconds after 72 min
DAY_S = 86_400.0
LATEST_NS = 9.2e18  # what int64 holds


@dataclass(kw_only=True)
class Clock(ABC):
    """How the rows of a table have their time."""

    says: str
    absolute: bool
    columns: tuple[str, ...] = ()  # those that hold it: none, one, or several (date, time of day, milliseconds)
    is_text: bool = False  # their cells are wanted as text
    origin_ns: int = 0  # what is counted counts from it

    @abstractmethod
    def t_ns(self, cells: NDArray[Any], record: Ints) -> tuple[Ints, Flags]:
        """(t_ns, bad) of consecutive rows (N,); bad where their cell, as `cells` gives it, is no time."""

    def counting_from(self, origin_ns: int, record: int) -> Clock:
        """The clock of a logger that was started anew at `origin_ns`, with that record next."""
        return replace(self, origin_ns=origin_ns)

    def cells(self, columns: Sequence[NDArray[Any]]) -> NDArray[Any]:
        """The cells of `columns` (each (N,)) as one a row (N,)."""
        return columns[0] if len(columns) == 1 else joined(*columns)

    def why(self, cell: str) -> str:
        """Why a cell that `t_ns` called bad is no time."""
        return f'"{cell[:SHOWN]}" is no time ({self.says})'

    def counted(self) -> dict[str, Any]:
        """What was counted, or guessed, on the way, for the settings."""
        return {}


@dataclass(kw_only=True)
class Rate(Clock):
    """Rows at a fixed rate: row k is at k / `rate_hz` after the origin."""

    rate_hz: float

    def counting_from(self, origin_ns: int, record: int) -> Clock:
        return replace(self, origin_ns=origin_ns - round(record * 1e9 / self.rate_hz))

    def t_ns(self, cells: NDArray[Any], record: Ints) -> tuple[Ints, Flags]:
        return self.origin_ns + np.rint(record * (1e9 / self.rate_hz)).astype(np.int64), np.zeros(len(record), bool)


@dataclass(kw_only=True)
class Counted(Clock):
    """Numbers of a unit; `zero` of them is the origin. `step_ns`: what they are rounded to. A counter of 32 bits that
    begins anew goes on."""

    unit_ns: float
    parts: float = 1.0  # of a second, of which the last of two columns counts how many are to be added
    zero: float = 0.0
    step_ns: int = 1
    apart: float = 0.0  # from row to row, where no unit is said and seconds are unlikely
    _wraps: int = field(default=0, init=False)
    _last: float = field(default=np.nan, init=False)

    def cells(self, columns: Sequence[NDArray[Any]]) -> NDArray[Any]:
        return columns[0] if len(columns) == 1 else np.asarray(columns[0] + columns[1] / self.parts)

    def t_ns(self, cells: NDArray[Any], record: Ints) -> tuple[Ints, Flags]:
        steps = (self._unwrapped(cells) - self.zero) * (self.unit_ns / self.step_ns)
        bad = ~(np.abs(steps) < (LATEST_NS - self.origin_ns) / self.step_ns)
        return self.origin_ns + np.rint(np.where(bad, 0.0, steps)).astype(np.int64) * self.step_ns, bad

    def _unwrapped(self, cells: NDArray[np.float64]) -> NDArray[np.float64]:
        wraps = self._wraps + wraps_of(cells, self._last)
        said = np.flatnonzero(~np.isnan(cells))
        if len(said):
            self._wraps, self._last = int(wraps[-1]), float(cells[said[-1]])
        return np.asarray(cells + wraps * float(WRAP)) if self._wraps else cells

    def counted(self) -> dict[str, Any]:
        said = {"counter_wraps": self._wraps, "time_unit_unsaid": self.apart}
        return {what: value for what, value in said.items() if value}


def wraps_of(counts: NDArray[np.float64], before: float = np.nan) -> Ints:
    """How often a counter of 32 bits has begun anew up to each of `counts` (N,), since the count `before` them."""
    wraps = np.zeros(len(counts), np.int64)
    said = np.flatnonzero(~np.isnan(counts))
    fell = np.diff(counts[said], prepend=before) < -0.9 * WRAP
    top = np.append(before, counts[said][:-1]) < WRAP if len(said) else fell
    wraps[said] = fell & top
    return np.cumsum(wraps)


@dataclass(kw_only=True)
class Serial(Counted):
    """Days since 1899-12-30 of a local clock, as spreadsheets count them."""

    local: LocalClock

    def t_ns(self, cells: NDArray[Any], record: Ints) -> tuple[Ints, Flags]:
        wall, bad = super().t_ns(cells, record)
        t_ns, gone = self.local.to_utc(wall)
        return t_ns, bad | gone


@dataclass(kw_only=True)
class SerialOfTwo(Serial):
    """Such days in one column, and the part of the day in another, to a microsecond: doubles hold no more of both."""

    step_ns: int = 1000


@dataclass(kw_only=True)
class OfDay(Clock):
    """Hours, minutes and seconds without a date, from the midnight before the first row. A clock that goes back by more
    than half a turn, which is a day, has begun the next one."""

    either: str = ""  # its first time, where that may be minutes and seconds as well as hours and minutes
    called: ClassVar[str] = "time of day"
    turn_s: ClassVar[float] = DAY_S
    is_text: bool = field(default=True, init=False)
    _turns: int = field(default=0, init=False)
    _last_s: float = field(default=np.nan, init=False)

    def seconds(self, cell: str) -> float:
        """Since the turn began; NaN of what is no time."""
        return seconds_of_day(cell)

    def t_ns(self, cells: NDArray[Any], record: Ints) -> tuple[Ints, Flags]:
        seconds = np.array([self.seconds(cell) for cell in cells], float)
        bad, fine = np.isnan(seconds), np.flatnonzero(~np.isnan(seconds))
        turns = np.zeros(len(cells), np.int64)
        turns[fine] = np.diff(seconds[fine], prepend=self._last_s) < -self.turn_s / 2
        turns = self._turns + np.cumsum(turns)
        if len(fine):
            self._turns, self._last_s = int(turns[-1]), float(seconds[fine[-1]])
        t_s = np.where(bad, 0.0, seconds + turns * self.turn_s)
        return self.origin_ns + np.rint(t_s * 1e6).astype(np.int64) * 1000, bad

    def counted(self) -> dict[str, Any]:
        return {"time_either": self.either} if self.either else {}


class OfHour(OfDay):
    """Minutes and seconds, all that is left of a time of day which a spreadsheet shows so and saves as shown."""

    called = "minutes and seconds"
    turn_s = 3600.0

    def seconds(self, cell: str) -> float:
        return seconds_of_hour(cell)


class OfMinutes(OfDay):
    """Hours and minutes of a day, as recorders write that have a row a minute."""

    called = "hours and minutes"

    def seconds(self, cell: str) -> float:
        return seconds_of_minutes(cell)


class OfDigits(OfDay):
    """Hours, minutes and seconds as one number, 140507.25."""

    called = "time of day in digits"

    def seconds(self, cell: str) -> float:
        return seconds_of_digits(cell)


OF_DAY = re.compile(
    rf"(?:(?P<days>\d{{1,4}})(?:\.| ?d(?:ays?)?,? ))?(\d{{1,4}}):(\d{{2}}):(\d{{2}})(?:[.,:](\d{{1,9}}))?"
    rf"(?:{BLANK}?([AaPp])\.?{BLANK}?[Mm]\.?)?",
    re.ASCII,
)


def seconds_of_day(cell: str) -> float:
    """Seconds of `14:02:07.5`, `02:02:07 PM` or, counted from a start, `100:06:40`, `4 days 04:06:40`, as pandas writes
    it, and `4.04:06:40`, as .NET does; NaN where it is none."""
    match = OF_DAY.fullmatch(cell.strip())
    if match is None:
        return float("nan")
    days, *parts, fraction, half = match.groups()
    hours, minutes, seconds = map(int, parts)
    if minutes > 59 or seconds > 59 or (half and not 1 <= hours <= 12):
        return float("nan")
    hours = hours % 12 + 12 * (half in "Pp") if half else hours
    return int(days or 0) * DAY_S + hours * 3600 + minutes * 60 + seconds + float(f"0.{fraction or 0}")


OF_HOUR = re.compile(r"(?P<minutes>\d{1,4}):(?P<seconds>[0-5]\d(?:[.,]\d{1,9})?)", re.ASCII)


def seconds_of_hour(cell: str) -> float:
    """Seconds of `07:30.5`, minutes and seconds; NaN where it is none."""
    match = OF_HOUR.fullmatch(cell.strip())
    return int(match["minutes"]) * 60 + float(match["seconds"].replace(",", ".")) if match else float("nan")


MINUTES = re.compile(r"\s*\d{1,2}:\d\d(?![:.,\d])", re.ASCII)


def seconds_of_minutes(cell: str) -> float:
    """Seconds of `14:02` and `02:02 PM`, hours and minutes; NaN where it is none."""
    return seconds_of_day(MINUTES.sub(r"\g<0>:00", cell, count=1)) if MINUTES.match(cell) else float("nan")


DIGITS = re.compile(r"([01]?\d|2[0-3])([0-5]\d)([0-5]\d(?:[.,]\d{1,9})?)", re.ASCII)


def seconds_of_digits(cell: str) -> float:
    """Seconds of `140507.25`, hours, minutes and seconds in one number; NaN where it is none."""
    match = DIGITS.fullmatch(cell.strip())
    if match is None:
        return float("nan")
    return int(match[1]) * 3600 + int(match[2]) * 60 + float(match[3].replace(",", "."))


def carried(dates: Iterable[str], before: str = "") -> list[str]:
    """Dates, each in all rows down to the next; `before` them stood another one."""
    filled = []
    for date in dates:
        before = date if date.strip() not in MISSING else before
        filled.append(before)
    return filled


def joined(day: NDArray[Any], *clock: NDArray[Any]) -> NDArray[np.object_]:
    """Cells of several columns as one stamp each (N,)."""
    return np.array([" ".join(cells) for cells in zip(day, *clock, strict=True)], object)


@dataclass(kw_only=True)
class Stamped(Clock):
    """Dates and times of a pattern, local or with their own offset."""

    pattern: str
    local: LocalClock
    digits: int = 0  # of the part of the second that the last of the columns holds: 3 of ms, `OF_FRACTION` of 0.25 s
    zoned: bool = False  # the last of them, behind that, holds the zone
    zone_said: str = ""  # of all stamps, which say none: UTC+1
    sparse_dates: bool = False  # the first of them holds a date where it is another one, as ALMEMO writes it
    is_text: bool = field(default=True, init=False)
    _day: str = field(default="", init=False)  # the date that was said last

    def cells(self, columns: Sequence[NDArray[Any]]) -> NDArray[Any]:
        if self.sparse_dates and len(columns[0]):
            days = carried(columns[0].tolist(), self._day)
            self._day, columns = days[-1], [np.array(days, object), *columns[1:]]
        own = columns[: len(columns) - self.zoned - (self.digits != 0)]
        stamps = super().cells(own)
        if self.digits:
            parts = (part.strip() for part in columns[len(own)])
            if self.digits == OF_FRACTION:
                parts = (re.sub(r"^0?[.,]?(?=\d)", "", part) for part in parts)
            both = zip(stamps, parts, strict=True)
            stamps = np.array([f"{one}.{part:0>{max(self.digits, 0)}}" for one, part in both], object)
        if self.zone_said:
            return np.array([f"{one.strip()} {self.zone_said}" if one.strip() else "" for one in stamps], object)
        return joined(stamps, columns[-1]) if self.zoned else stamps

    def t_ns(self, cells: NDArray[Any], record: Ints) -> tuple[Ints, Flags]:
        return parse(cells, self.pattern, self.local)

    def why(self, cell: str) -> str:
        clock = time_of_day(cell, self.pattern)
        if clock is None:
            return super().why(cell)
        return f"{clock} does not exist in {self.local.zone.key} on that day (clocks went forward)"

    def counted(self) -> dict[str, Any]:
        return {"ambiguous_rows": self.local.ambiguous} if self.local.ambiguous else {}
