"""Stamps written as text, read column by column: a strptime format becomes one regular expression."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime, timedelta
from itertools import pairwise
from zoneinfo import ZoneInfo

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from ingest.errors import UnreadableLogError
from ingest.formats import YEARS

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

MONTHS = {name: number for number, names in enumerate(  # first three letters, of juillet four, in five languages
    ("jan jän gen ene", "feb fév fev", "mar mär mrz mae", "apr avr abr", "may mai mag", "jun jui giu", "jul juil lug",
     "aug aoû aou ago", "sep set", "oct okt ott", "nov", "dec déc dez dic"), 1
) for name in names.split()}  # fmt: skip
LETTER = r"[A-Za-zÀ-ɏ]"  # of a month's name: RE2 has no \w for letters beyond ASCII
MONTH = rf"(?P<b>[Jj][Uu][Ii][Ll]|{LETTER}{{3}})"
BLANK = "[\\s\u00a0\u202f]"  # RE2's \s are those of ASCII; browsers write a narrow no-break one before PM
ZONES = {"Z": 0, "UTC": 0, "GMT": 0, "CET": 1, "MEZ": 1, "CEST": 2, "MESZ": 2}  # hours before UTC
ZONE = rf"(?P<z>(?:UTC|GMT)?[+-]\d{{1,2}}(?::?\d{{2}})?|{'|'.join(sorted(ZONES, key=len, reverse=True))})"
DIRECTIVES = {
    "Y": r"(?P<Y>\d{4})", "y": r"(?P<y>\d{2})", "m": r"(?P<m>\d{1,2})", "d": r"(?P<d>\d{1,2})", "H": r"(?P<H>\d{1,2})",
    "I": r"(?P<I>\d{1,2})", "M": r"(?P<M>\d{1,2})", "S": r"(?P<S>\d{1,2})", "f": r"(?P<f>\d{1,9})",
    "p": r"(?P<p>[AaPp]\.?\s?[Mm]\.?)", "z": ZONE, "a": rf"{LETTER}{{2,10}}",
    "b": MONTH, "B": rf"{MONTH}{LETTER}*", "%": "%",
}  # fmt: skip
HALF = rf"(?:{BLANK}?{DIRECTIVES['p']})?"
CLOCK = rf"(?P<H>\d{{1,2}})[:.](?P<M>\d{{2}})(?:[:.](?P<S>\d{{2}})(?:[.,:;](?P<f>\d{{1,9}})\d*)?)?{HALF}"
GAP = rf"(?:[T_-]|,?{BLANK}{{1,3}})"  # between date and time of day
_SHORT = "mo|di|mi|do|fr|sa|so"
_DAYS = "mon|tue|wed|thu|fri|sat|sun|die|mit|don|fre|sam|son|lun|mar|mer|gio|ven|sab|dom|jeu|dim|mié|jue|vie|sáb"
WEEKDAY = rf"(?:(?i:{_SHORT}|(?:{_DAYS}){LETTER}{{0,8}})[.,]{{0,2}} )?"  # by what it begins with, in five languages
YEAR = r"(?:(?P<Y>\d{4})|(?P<y>\d{2}))"
DAY_FIRST, MONTH_FIRST = "day/month/year", "month/day/year"  # one cell seldom tells them apart
DATES = {
    "ISO 8601": rf"{WEEKDAY}(?P<Y>\d{{4}})-(?P<m>\d{{2}})-(?P<d>\d{{2}})",
    "year/month/day": r"(?P<Y>\d{4})[/.](?P<m>\d{1,2})[/.](?P<d>\d{1,2})",
    "day.month.year": rf"{WEEKDAY}(?P<d>\d{{1,2}})\.(?P<m>\d{{1,2}})\.{YEAR}",
    DAY_FIRST: rf"{WEEKDAY}(?P<d>\d{{1,2}})[/-](?P<m>\d{{1,2}})[/-]{YEAR}",
    "day month year": rf"{WEEKDAY}(?P<d>\d{{1,2}})[-./ ]{{1,2}}{MONTH}{LETTER}*[-./ ]{{1,2}}{YEAR}",
    "month day, year": rf"{WEEKDAY}{MONTH}{LETTER}*\.? {{1,2}}(?P<d>\d{{1,2}}),? (?P<Y>\d{{4}})",
    "year年month月day日": r"(?P<Y>\d{4})年(?P<m>\d{1,2})月(?P<d>\d{1,2})日",
    "'year-month-day": r"'(?P<y>\d{2})[-/](?P<m>\d{1,2})[-/](?P<d>\d{1,2})",
}
OFFSET = rf"\s?{ZONE}?"
KNOWN = {says: rf"^{date}{GAP}{CLOCK}{OFFSET}$" for says, date in DATES.items()}
KNOWN["month day time year"] = rf"^{WEEKDAY}{MONTH} {{1,2}}(?P<d>\d{{1,2}}) {CLOCK} (?:{ZONE} )?(?P<Y>\d{{4}})$"  # of C
BASIC = r"(?P<Y>\d{4})(?P<m>\d{2})(?P<d>\d{2})[T _-]?(?P<H>\d{2})(?P<M>\d{2})(?P<S>\d{2})(?:[.,]?(?P<f>\d{1,9})\d*)?"
KNOWN["ISO 8601 with other signs"] = (  # as names of files and DB2 have it
    r"^(?P<Y>\d{4})[-_](?P<m>\d{2})[-_](?P<d>\d{2})[-_T ](?P<H>\d{2})[-_.h](?P<M>\d{2})[-_.m](?P<S>\d{2})"
    r"(?:[-_.](?P<f>\d{1,9})\d*|s)?$"
)
KNOWN["ISO 8601 without its signs"] = f"^{BASIC}{OFFSET}$"
KNOWN["year and day of the year"] = rf"^(?P<Y>\d{{4}})[-:](?P<j>\d{{3}})[T :]{CLOCK}{OFFSET}$"  # 2026-062T09:00:00
OF_PARTS = rf"^{YEAR} (?P<m>\d{{1,2}}) (?P<d>\d{{1,2}}) (?P<H>\d{{1,2}}) (?P<M>\d{{1,2}})" + (
    r"(?: (?P<S>\d{1,2})(?:[.,](?P<f>\d{1,9})\d*)?)?$"  # cells of several columns
)
# a stamp that is a number as well
DIGITS_ALONE = r"^(?:19|20|21)\d{2}(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01])(?:[01]\d|2[0-3])(?:[0-5]\d){2}(?:\d{3})?$"
DAYS = {says: f"^{date}$" for says, date in DATES.items()}  # known where the bench file names the column
DATE_ALONE = "|".join(f"^{re.sub('[?]P<[A-Za-z]>', '?:', date)}$" for date in DATES.values())
CLOCK_ALONE = f"^{CLOCK}$"
# date and time of day as numbers: 20250314 or 14032025, and 140507.25 or 1405
_H_M = r"(?P<H>\d{1,2})(?P<M>[0-5]\d)"
CLOCK_DIGITS = {"hour minute second": rf"{_H_M}(?P<S>[0-5]\d)(?:[.,](?P<f>\d{{1,9}})\d*)?", "hour minute": _H_M}
DATE_DIGITS = {
    "year month day": r"(?P<Y>(?:19|20)\d{2})(?P<m>0[1-9]|1[0-2])(?P<d>[0-3]\d)",
    "day month year": r"(?P<d>[0-3]?\d)(?P<m>0[1-9]|1[0-2])(?P<Y>(?:19|20)\d{2})",
}
SHORT_DATE = r"[0-3]?\d(?:0[1-9]|1[0-2])\d\d|(?:0?[1-9]|1[0-2])[0-3]\d{3}|\d\d(?:0[1-9]|1[0-2])[0-3]\d"  # of any order
DIGITS = {
    f"{day} {clock} in digits": f"^{date} {time}$"
    for day, date in DATE_DIGITS.items()
    for clock, time in CLOCK_DIGITS.items()
}
_DAY_FIRST = re.compile(rf"^{DATES[DAY_FIRST]}(?!\d)")  # with or without a time of day
_STAMP = re.compile("|".join(re.sub("[?]P<[A-Za-z]>", "?:", one) for one in (DATE_ALONE, CLOCK_ALONE, *KNOWN.values())))
SECOND_NS, MINUTE_NS, DAY_NS = 1_000_000_000, 60_000_000_000, 86_400_000_000_000
FALL_BACK_NS = 30 * MINUTE_NS  # a local clock that goes back by this much or more has been put back


def pattern_of(text: str, log: str) -> str:
    """The regular expression of a strptime format. Raises UnreadableLogError for a directive that is not known."""
    parts, behind = ["^"], False  # right behind another number a number has all its digits
    for literal, directive in re.findall(r"([^%]+)|%(.)", text):
        if directive and directive not in DIRECTIVES:
            raise UnreadableLogError(
                f'{log}: format = "{text}" under [time] of the bench file holds %{directive}, which is not known. '
                f"Known are {' '.join('%' + name for name in DIRECTIVES)}."
            )
        number = DIRECTIVES.get(directive, "").replace("{1,2}", "{2}" if behind else "{1,2}")
        parts.append(number if directive else re.escape(literal).replace(r"\ ", r"\s+"))
        behind = directive != ""
    pattern = "".join(parts) + "$"
    if not all(any(f"(?P<{name}>" in pattern for name in names) for names in ("Yy", "mb", "d")):
        raise UnreadableLogError(
            f'{log}: format = "{text}" under [time] of the bench file holds no whole date. Stamps need day, month and '
            "year; for rows at a fixed rate say rate_hz instead."
        )
    return pattern


def month_first(pattern: str) -> str:
    """The pattern of stamps with day and month the other way round."""
    return re.sub("<([dm])>", lambda group: {"d": "<m>", "m": "<d>"}[group[1]], pattern)


def day_first(cells: Iterable[str]) -> bool | None:
    """Whether dates such as 24/12/2025 begin with the day: the first cell with a day above 12 tells; None without."""
    for match in filter(None, map(_DAY_FIRST.match, cells)):
        one, other = int(match["d"]), int(match["m"])
        if one <= 12 < other <= 31 or other <= 12 < one <= 31:
            return other <= 12
    return None


def either_way(cells: Iterable[str]) -> bool:
    """Whether dates are the same with the day first and with the month first, all of them: 3/3/2026 is."""
    return all(int(match["d"]) == int(match["m"]) for match in filter(None, map(_DAY_FIRST.match, cells)))


def year_may_be_first(cells: Iterable[str]) -> bool:
    """Whether dates of three numbers of two digits, such as 25/03/17, may be of 2025 as well as of 2017."""
    matches = [*filter(None, map(_DAY_FIRST.match, cells))]
    return bool(matches) and all(match["y"] and 1 <= int(match["y"]) <= 31 for match in matches)


def both_formats(cell: str) -> tuple[str, str]:
    """The strptime formats, with the day first and with the month first, that a stamp such as 5/6/2025 7:01 PM has; of
    one such as 25/03/17 with the day and with the year first."""
    match = re.match(KNOWN[DAY_FIRST], cell)
    assert match
    places = [(name, match.span(name)) for name in "YyHMSfpz" if match[name]]
    form = cell
    for name, (begin, end) in sorted(places, key=lambda place: place[1], reverse=True):
        form = f"{form[:begin]}%{'I' if name == 'H' and match['p'] else name}{form[end:]}"
    sign, rest = cell[match.end("d")], form[match.end("m") :]
    weekday = re.sub(f"^{LETTER}+", "%a", cell[: match.start("d")])
    other = f"%m{sign}%d{rest}"
    if int(match["d"]) > 12:
        other = f"%y{sign}%m{sign}%d{rest.removeprefix(f'{sign}%y')}"
    return f"{weekday}%d{sign}%m{rest}", f"{weekday}{other}"


def is_stamp(cell: str) -> bool:
    """Whether a cell is a date, a time of day or both, in a form that is known."""
    return _STAMP.match(cell) is not None


def fits(pattern: str, cells: list[str]) -> bool:
    """Whether most of `cells` are stamps of `pattern`."""
    matched = sum(re.match(pattern, cell) is not None for cell in cells)
    return 2 * matched > len(cells)


@dataclass
class LocalClock:
    """From a local clock to UTC.

    Where the clock is put back, an hour comes twice: it counts as the first until the stamps go back by half an hour or
    more inside it, then as the second. A log that begins inside that hour is taken to begin in the first. Where the
    clock is put forward, an hour does not exist.
    """

    zone: ZoneInfo
    ambiguous: int = 0  # rows inside an hour that comes twice
    _second: bool = False
    _last_ns: int | None = None

    def to_utc(self, local_ns: Ints) -> tuple[Ints, Flags]:
        """(nanoseconds UTC, whether there is no such time) of consecutive local stamps (N,) [ns]."""
        if not len(local_ns) or self.zone.key == "UTC":
            return local_ns, np.zeros(len(local_ns), bool)
        minutes, which = np.unique(local_ns // MINUTE_NS, return_inverse=True)
        first, second = (np.array([self._offset(minute, fold) for minute in minutes.tolist()]) for fold in (0, 1))
        twice = (first > second)[which]
        self.ambiguous += int(twice.sum())
        t_ns = local_ns - np.where(self._later(local_ns, twice), second[which], first[which])
        return t_ns, (first < second)[which]

    def _offset(self, minute: int, fold: int) -> int:
        local = datetime(1970, 1, 1, fold=fold) + timedelta(minutes=minute)
        offset = local.replace(tzinfo=self.zone, fold=fold).utcoffset()
        return round((offset or timedelta()).total_seconds()) * SECOND_NS

    def _later(self, local_ns: Ints, twice: Flags) -> Flags:
        """Which rows are in the second pass of an hour that comes twice."""
        before = self._last_ns if self._last_ns is not None else int(local_ns[0])
        back = np.diff(local_ns, prepend=before) <= -FALL_BACK_NS
        later = np.zeros(len(twice), bool)
        edges = [0, *(np.flatnonzero(np.diff(twice)) + 1).tolist(), len(twice)]
        for start, stop in pairwise(edges):
            if twice[start]:
                later[start:stop] = np.logical_or.accumulate(back[start:stop]) | (self._second and start == 0)
        self._second, self._last_ns = bool(later[-1]), int(local_ns[-1])
        return later


def parse(cells: NDArray[np.object_], pattern: str, clock: LocalClock) -> tuple[Ints, Flags]:
    """(t_ns, bad) of the stamps `cells` (N,) of str: nanoseconds UTC, and which cells are no time.

    A cell is none where it does not fit `pattern`, or names a local time that does not exist.
    """
    at, wall, fields = _walls(cells, pattern)
    t_ns, bad = np.zeros(len(cells), np.int64), np.ones(len(cells), bool)
    t_ns[at], bad[at] = _utc(wall, fields.get("z"), clock)
    return t_ns, bad


def time_of_day(cell: str, pattern: str) -> str | None:
    """ "02:30:00" of one stamp; None where it is none of `pattern`."""
    _, wall, _ = _walls(np.array([cell], object), pattern)
    return str(wall.astype("M8[ns]").astype("M8[s]")[0])[-8:] if len(wall) else None


def _walls(cells: NDArray[np.object_], pattern: str) -> tuple[Ints, Ints, dict[str, pa.Array]]:
    """The cells that are stamps of `pattern`: (their places, ns since 1970 of the wall clock, named groups)."""
    found = pc.extract_regex(pc.utf8_trim_whitespace(pa.array(cells, pa.string())), pattern)
    good = found.is_valid().to_numpy(zero_copy_only=False)
    part = found.filter(found.is_valid())
    fields = {field.name: part.field(field.name) for field in found.type}
    wall, right = _wall_ns(fields, len(part))
    kept = {name: values.filter(pa.array(right)) for name, values in fields.items()}
    return np.flatnonzero(good)[right], wall[right], kept


def _wall_ns(fields: dict[str, pa.Array], count: int) -> tuple[Ints, Flags]:
    """(ns since 1970 of the wall clock, whether there is such a date and time)."""

    def number(name: str, default: int) -> Ints:
        if name not in fields:
            return np.full(count, default, np.int64)
        text = pc.if_else(pc.equal(fields[name], ""), str(default), fields[name])
        return np.asarray(pc.cast(text, pa.int64()).to_numpy())

    year = number("Y", 0)
    if "y" in fields:
        short = number("y", -1)
        year = np.where(short < 0, year, short + np.where(short < 69, 2000, 1900))
    month = _month(fields["b"]) if "b" in fields else number("m", 1)
    day = number("j", 1) if "j" in fields else number("d", 1)
    hour, minute, second = number("H", 0), number("M", 0), number("S", 0)
    if "I" in fields:
        hour = number("I", 0) % 12
    if "p" in fields:
        hour = _of_half(hour, pc.utf8_lower(fields["p"]))
    possible = (year >= YEARS[0]) & (year <= YEARS[1]) & (month >= 1) & (month <= 12) & (day >= 1)
    months = np.where(possible, (year - 1970) * 12 + month - 1, 0).astype("M8[M]")
    days = months.astype("M8[D]") + (np.where(possible, day, 1) - 1).astype("m8[D]")
    whole = "M8[Y]" if "j" in fields else "M8[M]"  # what a day may not be beyond
    clock = (hour * 3600 + minute * 60 + second) * SECOND_NS + _fraction_ns(fields.get("f"), count)
    within = (clock <= DAY_NS) & (minute < 60) & (second < 60)  # 24:00:00 is the end of a day
    right = possible & (days.astype(whole) == months.astype(whole)) & within
    return days.astype(np.int64) * DAY_NS + clock, right


def _of_half(hour: Ints, half: pa.Array) -> Ints:
    """The hour of the day, by "am", "pm" or "p. m." where `half` says one; 25, which is none, for 13 pm."""
    said, pm = (flags.to_numpy(zero_copy_only=False) for flags in (pc.not_equal(half, ""), pc.starts_with(half, "p")))
    return np.where(said, np.where(hour > 12, 25, hour % 12 + 12 * pm), hour)


def _month(names: pa.Array) -> Ints:
    """The month of its name, 1 to 12; 0 for what is no month's name."""
    place = pc.index_in(pc.utf8_lower(names), pa.array(list(MONTHS)))
    numbers = np.array([0, *MONTHS.values()])
    return np.asarray(numbers[np.asarray(pc.fill_null(place, -1).to_numpy()) + 1], np.int64)


def _fraction_ns(digits: pa.Array | None, count: int) -> Ints:
    if digits is None:
        return np.zeros(count, np.int64)
    nine = pc.utf8_slice_codeunits(pc.binary_join_element_wise(digits, "000000000", ""), 0, 9)
    return np.asarray(pc.cast(nine, pa.int64()).to_numpy())


def _utc(wall_ns: Ints, zones: pa.Array | None, clock: LocalClock) -> tuple[Ints, Flags]:
    """(nanoseconds UTC, whether there is no such time) of stamps: by their own offset, else by `clock`."""
    if zones is None:
        return clock.to_utc(wall_ns)
    said, which = np.unique(zones.to_numpy(zero_copy_only=False).astype(str), return_inverse=True)
    offset = np.array([_offset_ns(text) for text in said.tolist()], np.int64)[which]
    local = (said == "")[which]
    t_ns, gone = wall_ns - offset, np.zeros(len(wall_ns), bool)
    t_ns[local], gone[local] = clock.to_utc(wall_ns[local])
    return t_ns, gone


def _offset_ns(text: str) -> int:
    """By how much a zone is before UTC: `+01`, `+0530`, `UTC+5:30`, `CET`; 0 where it is none."""
    if not text or text in ZONES:
        return ZONES.get(text, 0) * 60 * MINUTE_NS
    digits = re.sub(r"\D", "", text)
    hours, minutes = (digits[:-2], digits[-2:]) if len(digits) > 2 else (digits, "0")
    return (-1 if "-" in text else 1) * (int(hours) * 60 + int(minutes)) * MINUTE_NS
