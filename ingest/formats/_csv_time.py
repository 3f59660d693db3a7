"""The time of the rows of a table: which column holds it, and what its cells mean."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from datetime import datetime
from math import isnan
from statistics import median
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

from ingest.errors import UnreadableLogError
from ingest.formats import EPOCH, TimeSpec, utc_ns
from ingest.formats._csv_clocks import (
    DAY_S,
    OF_HOUR,
    WRAP,
    Clock,
    Counted,
    OfDay,
    OfDigits,
    OfHour,
    OfMinutes,
    Rate,
    Serial,
    SerialOfTwo,
    Stamped,
    seconds_of_day,
    seconds_of_hour,
    seconds_of_minutes,
    wraps_of,
)
from ingest.formats._csv_dialect import Dialect, cells
from ingest.formats._csv_digits import in_digits
from ingest.formats._csv_stamp_columns import (
    NO_RECORD,
    asked,
    column_fits,
    in_headed_zone,
    in_named_zone,
    known_forms,
    of_cells,
    of_parts,
    of_two,
    pairs,
    part_of_second,
    time_cells,
    times_of,
)
from ingest.formats._csv_stamps import DATE_ALONE, DAY_NS, DAYS, DIGITS_ALONE, SECOND_NS, LocalClock, pattern_of
from ingest.formats._csv_time_names import (
    UNITS_NS,
    base_and_unit,
    digits_of,
    is_date_name,
    is_like_time,
    is_time_name,
    is_x,
    unit_in_like,
    unit_of_time,
    words,
)
from ingest.formats._no_times import way_out
from ingest.texts.nearest import hint

RATED = re.compile(  # what a line above a table says of its rows
    r"(?i)(?P<name>(?:[a-z]+[ _-]*)?(?:rate|freq|frequency|frequenz|interval|intervall|period)|sampl[a-z]*[ _-]?time"
    r"|abtastzeit|delta[ _]t|dt|hresolution)\W+(?P<value>[\d.,]+(?:e[+-]?\d+)?)\W*(?P<unit>k?hz|[nuµm]?s|sec|min)?\W*"
)
POWER_OF_TEN = re.compile(r"[+-]?\d[.,]\d{1,9}[eE]\+0?(?:[5-9]|1\d)")  # 1.74194E+12
PER_S = {"hz": 1.0, "khz": 1e3}
SERIAL_D, SERIAL_NS = (36526.0, 73050.0), utc_ns(EPOCH.replace(year=1899, month=12, day=30))  # days of 2000 to 2099
DATENUM_D, DATENUM_1970_D = (730_486.0, 767_011.0), 719_529.0  # the same as MATLAB counts them, and 1970 there
SERIAL_STEP_D = 1e-3  # numbers so large that go on by less are no seconds: a thousand rows in each
EPOCH_NS = (1e18, 3.3e18)  # a column of numbers between these [ns] counts from 1970: years 2001 to 2074
SINCE_1904_S, ORIGIN_1904_NS = (3.3e9, 4.3e9), utc_ns(EPOCH.replace(year=1904))  # as LabVIEW counts: 2008 to 2040
TICKS = {  # of 100 ns, in words -> what they count from, and the ticks of 2000 and 2100
    "100 ns since the year 1 in UTC": (621_355_968_000_000_000, 6.3e17, 6.63e17),  # .NET
    "100 ns since 1601 in UTC": (116_444_736_000_000_000, 1.26e17, 1.575e17),  # Windows
}
WITHIN_DAY: Mapping[str, type[OfDay]] = {"%H:%M": OfMinutes, "%M:%S": OfHour}  # formats without a date
FAR_APART = 100.0  # seconds from row to row: a tenth of a second in ms
LOOSE_NS = 2_000_000_000  # stamps of whole seconds and what counts beside them: apart by this at most


def recognise_clock(time: TimeSpec, dialect: Dialect, log: str) -> Clock:
    """The clock that `[time]` of the bench file states, else the one that it shows. Raises UnreadableLogError."""
    start = time.start_ns
    if time.rate_hz is not None:
        says = f"{time.rate_hz:g} rows a second"
        return Rate(says=says, absolute=start is not None, rate_hz=time.rate_hz, origin_ns=start or 0)
    if time.column is not None:
        if time.column not in dialect.names:
            raise UnreadableLogError(
                f'{log}: column = "{time.column}" under [time] of the bench file is none of the table.'
                f"{hint(time.column, dialect.names)} Its columns: {', '.join(dialect.names)[:300]}."
            )
        clock = _stated(time, time.column, dialect, log)
    else:
        clock = _found(time, dialect, log)
    if isinstance(clock, Stamped):
        clock = clock if time.column else in_headed_zone(clock, dialect)
        return in_named_zone(clock, dialect, log)
    return clock


def _stated(time: TimeSpec, column: str, dialect: Dialect, log: str) -> Clock:
    if time.format is not None and time.format not in WITHIN_DAY:
        local = LocalClock(time.local)
        says = f"{time.format} in {time.zone}"
        return Stamped(says=says, absolute=True, columns=(column,), pattern=pattern_of(time.format, log), local=local)
    clock = _by_content(time, column, dialect)
    beside = [name for _, name in pairs(dialect) if not dialect.is_number(name)]  # a number may look like 8.30
    if clock is None and not beside:
        clock = of_cells(time, known_forms(time, DAYS), (column,), dialect)
    if clock is None and (question := asked(dialect)):
        raise UnreadableLogError(f"{log}: {question}")
    if clock is None:
        clock = _of_day(time, column, dialect)
    if clock is None:
        cell = next(iter(dialect.said(column)), "")
        example = "%d.%m.%Y" if re.match(DATE_ALONE, cell) else "%d.%m.%Y %H:%M:%S"
        example = example if isnan(seconds_of_minutes(cell)) else "%H:%M"
        raise UnreadableLogError(
            f'{log}: column "{column}" holds "{cell[:60]}", which is no number and no stamp that is known. '
            f'Say format = "{example}", with signs and order as they are there, under [time] of the bench file.'
        )
    return clock


def _found(time: TimeSpec, dialect: Dialect, log: str) -> Clock:
    parts = of_parts(time, dialect)
    named = [name for name in dialect.names if is_time_name(name) and not (parts and name in parts.columns)]
    named = named or [name for name in dialect.names if is_x(name, dialect)]
    if time.format is not None and time.format not in WITHIN_DAY:
        pattern = pattern_of(time.format, log)
        fitting = (name for name in (*named, *dialect.names) if column_fits(pattern, dialect, name))
        if column := next(fitting, None):
            return _stated(time, column, dialect, log)
        if clock := of_two(time, {f"{time.format} in {time.zone}": pattern}, dialect):
            return clock
    if rounded := next((name for name in named if _is_rounded(dialect.cells_of(name))), None):
        raise UnreadableLogError(
            f'{log}: "{rounded}" holds "{dialect.cells_of(rounded)[0]}" in several rows: its times were rounded as '
            "they were saved. Save them again as whole numbers (Excel: format 0; LabVIEW: %.3f), or under [time] of "
            "the bench file say rate_hz = 1.0 (rows at a fixed rate)."
        )
    if two := _serial_of_two(time, named, dialect):
        return two
    clocks = [clock for column in named if (clock := _of_named(time, column, dialect))]
    if clocks:
        dated = next((clock for clock in clocks if clock.absolute), None) or parts
        dated = dated or of_two(time, known_forms(time), dialect) or clocks[0]
        if fine := next((fine for one in clocks if (fine := _fine(time, one, dated, dialect))), None):
            return fine
        return clocks[0] if clocks[0].absolute else _dated(clocks[0], dated, dialect)
    if parts:
        return parts
    for column in dialect.names:
        if clock := _stamped(time, column, dialect) or _of_dates(time, column, dialect):
            return clock
    if clock := of_two(time, known_forms(time), dialect):
        return clock
    if time.untimed and not named:
        return Rate(says="rows without a time", absolute=False, rate_hz=1.0, origin_ns=0)
    if question := asked(dialect):
        raise UnreadableLogError(f"{log}: {question}")
    for column in [*named, *dialect.names]:
        if clock := _of_day(time, column, dialect):
            return clock
    if clock := _like_time(time, dialect) or _rated(time, dialect) or _first_in_seconds(time, dialect):
        return clock
    texts = [name for name in named if dialect.numeric[dialect.names.index(name)] is False]
    seen = next((cell for name in texts for cell in dialect.said(name)), None)
    holds = f' ("{texts[0]}" holds "{seen[:40]}", which is no whole stamp)' if seen is not None else ""
    instead = f"{way} Or under" if (way := way_out(dialect)) else "Under"
    days = next((name for name in dialect.names if _are_days(time, name, dialect)), None)
    column = f'column = "{days}" (its days)' if days else 'column = "..." with format or unit'
    if texts and _most(seconds_of_minutes, dialect.cells_of(texts[0])):
        column = 'format = "%H:%M" or format = "%M:%S"'
    raise UnreadableLogError(
        f"{log}: no column is recognised as its time{holds}. {instead} [time] of the bench file say rate_hz = 1.0 "
        f"(rows at a fixed rate), or {column}."
    )


def _are_days(time: TimeSpec, column: str, dialect: Dialect) -> bool:
    """Whether a column holds days alone: 08.00.00 has their form, and is none."""
    clock = of_cells(time, known_forms(time, DAYS), (column,), dialect)
    return clock is not None and not deepcopy(clock).t_ns(time_cells(clock, dialect), NO_RECORD)[1].all()


def _is_rounded(said: Sequence[str]) -> bool:
    """Whether times are all written as powers of ten, and come again as they have too few digits for their size."""
    return len(set(said)) < len(said) and all(POWER_OF_TEN.fullmatch(cell) for cell in said)


def _like_time(time: TimeSpec, dialect: Dialect) -> Clock | None:
    """The clock of the first column of numbers that go on in each row, as seconds since 1970 need not, and whose name
    may be that of a time."""
    for column in filter(is_like_time, dialect.names):
        steps = np.diff(dialect.numbers(column)) if dialect.is_number(column) else np.empty(0)
        unit = dialect.units.get(column) or unit_in_like(column)
        if len(steps) and (steps >= 0).all() and steps.any():
            units = dialect.units | ({column: unit} if unit else {})
            clock = _by_content(time, column, replace(dialect, units=units))
            if clock and ((steps > 0).all() or clock.absolute):
                return clock
    return None


def _first_in_seconds(time: TimeSpec, dialect: Dialect) -> Clock | None:
    """The clock of the first column, whatever it is called, where it says a unit of time and goes on as time does."""
    first = dialect.names[0]
    unit = unit_of_time(dialect.units.get(first))
    if unit is None or not dialect.is_number(first) or not rises(np.array(dialect.numbers(first))):
        return None
    return _by_content(time, first, replace(dialect, units=dialect.units | {first: unit}))


def _rated(time: TimeSpec, dialect: Dialect) -> Clock | None:
    """The clock of a table without times, of which a line above says the rate or the interval of its rows."""
    for line in dialect.lines_above:
        said = " ".join(cell.strip() for cell in cells(line, dialect.delimiter))
        found = RATED.fullmatch(said)
        value = dialect.numerals.value(found["value"]) if found else None
        if found and value:
            unit = (found["unit"] or ("hz" if re.search("(?i)rate|freq", found["name"]) else "s")).lower()
            rate_hz = value * PER_S[unit] if unit in PER_S else 1e9 / (value * UNITS_NS[unit])
            says, start = f'{rate_hz:g} rows a second, as "{said}" says', time.start_ns
            return Rate(says=says, absolute=start is not None, rate_hz=rate_hz, origin_ns=start or 0)
    return None


def _of_named(time: TimeSpec, column: str, dialect: Dialect) -> Clock | None:
    """The clock of a column that is called as times are; None for numbers that do not go on as time does."""
    if in_digits(column, dialect):
        return None
    counts = np.array(dialect.numbers(column)) if dialect.is_number(column) else None
    goes_on = counts is None or rises(counts + wraps_of(counts) * WRAP)
    clock = _by_content(time, column, dialect) if goes_on or time.column is None else None
    return clock if goes_on or (clock and clock.absolute) else None


def _fine(time: TimeSpec, counted: Clock, dated: Clock, dialect: Dialect) -> Clock | None:
    """The clock of `Time_ms` of Siemens' operator panels, which counts millionths of a day, finer than the stamps
    beside it; None where it does not go with these."""
    if not isinstance(counted, Counted) or counted.unit_ns != UNITS_NS["ms"] or not isinstance(dated, Stamped):
        return None
    says, local = f"millionths of a day since 1899-12-30 in {time.zone}", LocalClock(time.local)
    columns, unit_ns = counted.columns, DAY_NS / 1e6
    fine = Serial(
        says=says, absolute=True, columns=columns, unit_ns=unit_ns, origin_ns=SERIAL_NS, step_ns=1000, local=local
    )
    apart = np.abs(times_of(fine, dialect) - times_of(dated, dialect))
    return fine if np.median(apart) < LOOSE_NS else None


def _dated(counted: Clock, dated: Clock, dialect: Dialect) -> Clock:
    """The clock of a table with a column that counts and one of dates: the dates where they tell every row from the one
    before it; else what counts, from the date of the first row, where both go on alike; else what counts alone."""
    if not dated.absolute or not isinstance(counted, Counted):
        return counted
    (since, bad), (t_ns, none) = (replace(one).t_ns(time_cells(one, dialect), NO_RECORD) for one in (counted, dated))
    since, t_ns = since[~(bad | none)], t_ns[~(bad | none)]
    if len(t_ns) > 1 and (np.diff(t_ns) > 0).all():
        return dated
    if not len(t_ns) or abs(t_ns[-1] - t_ns[0] - (since[-1] - since[0])) > LOOSE_NS:
        return counted
    says = f"{counted.says}, dated by {dated.columns[0]}"
    return replace(counted, says=says, absolute=True, origin_ns=int(t_ns[0] - since[0]))


def clock_of(time: TimeSpec, column: str, said: str, dialect: Dialect) -> Clock | None:
    """The clock of one column whose header is `said`; None where it holds no times."""
    unit = None if column in dialect.units else base_and_unit(said)[1]
    units = dialect.units | ({column: unit} if unit else {})
    return _by_content(replace(time, column=column), column, replace(dialect, units=units))


def _by_content(time: TimeSpec, column: str, dialect: Dialect) -> Clock | None:
    """Numbers counted from the start or from 1970, or stamps of a known form; None for anything else."""
    if not dialect.is_number(column) or (time.unit is None and column_fits(DIGITS_ALONE, dialect, column)):
        return None if time.unit else _stamped(time, column, dialect)
    unit = time.unit or base_and_unit(column)[1] or dialect.units.get(column)
    candidates = [known] if (known := unit_of_time(unit)) else ["s", "ms", "us", "ns"]
    for candidate in candidates:
        middle = median(dialect.numbers(column)) * UNITS_NS[candidate]  # one absurd stamp takes nothing from the rest
        if EPOCH_NS[0] <= middle <= EPOCH_NS[1]:
            says, unit_ns = f"{candidate} since 1970", UNITS_NS[candidate]
            since_1970 = Counted(says=says, absolute=True, columns=(column,), unit_ns=unit_ns, step_ns=1000)
            return _with_part_counted(since_1970, dialect)
    if candidates[0] == "s" and SINCE_1904_S[0] <= median(dialect.numbers(column)) <= SINCE_1904_S[1]:
        says = "s since 1904"
        return Counted(
            says=says, absolute=True, columns=(column,), unit_ns=SECOND_NS, step_ns=1000, origin_ns=ORIGIN_1904_NS
        )
    for says, (of_1970, first, last) in TICKS.items() if unit is None else ():
        if first <= median(dialect.numbers(column)) < last:
            return Counted(says=says, absolute=True, columns=(column,), unit_ns=100, step_ns=1000, zero=of_1970)
    if unit is None and (serial := _serial(time, column, dialect)):
        return serial
    says, start, unit_ns = f"{candidates[0]} from the start", time.start_ns, UNITS_NS[candidates[0]]
    clock = Counted(says=says, absolute=start is not None, columns=(column,), unit_ns=unit_ns, origin_ns=start or 0)
    apart = _far_apart(dialect.numbers(column)) if known is None else 0.0
    return _with_part_counted(replace(clock, apart=apart), dialect)


def _far_apart(seconds: Sequence[float]) -> float:
    """What whole numbers go on by from row to row, where that is much for seconds, and no minutes; else 0."""
    step = median(np.abs(np.diff(seconds))) if len(seconds) > 1 else 0.0
    whole = all(one == int(one) for one in seconds)
    return float(step) if whole and step >= FAR_APART and step % 60 else 0.0


def _with_part_counted(clock: Counted, dialect: Dialect) -> Counted:
    """The clock of whole seconds, several rows in each, with the part of the second that a column of its own holds."""
    seconds, column = np.array(dialect.numbers(clock.columns[0])), part_of_second(clock.columns, dialect)
    often = np.ptp(seconds) > 0 and (np.diff(seconds) == 0).any() and not (seconds % 1).any()
    if column is None or not often or clock.unit_ns != SECOND_NS:
        return clock
    return replace(clock, columns=(*clock.columns, column), parts=10.0 ** digits_of(column))


def _stamped(time: TimeSpec, column: str, dialect: Dialect) -> Clock | None:
    if time.column is None and "utc" in words(column):  # its name says the zone
        time = replace(time, zone="UTC")
    return of_cells(time, known_forms(time), (column,), dialect)


def _serial(time: TimeSpec, column: str, dialect: Dialect) -> Clock | None:
    """The clock of dates as spreadsheets store them; None where numbers are none, or may be seconds as well."""
    days = np.array(dialect.numbers(column)) if dialect.is_number(column) else np.empty(0)
    if len(days) < 2 or not rises(days) or (np.median(np.diff(days)) >= SERIAL_STEP_D and not is_date_name(column)):
        return None
    own: dict[str, Any] = {"absolute": True, "columns": (column,), "unit_ns": DAY_NS, "local": LocalClock(time.local)}
    if ((days >= SERIAL_D[0]) & (days < SERIAL_D[1])).all():
        return Serial(says=f"days since 1899-12-30 in {time.zone}", origin_ns=SERIAL_NS, step_ns=1000, **own)
    if ((days >= DATENUM_D[0]) & (days < DATENUM_D[1])).all():
        return Serial(says=f"days as MATLAB counts them in {time.zone}", zero=DATENUM_1970_D, step_ns=10_000, **own)
    return None


def _serial_of_two(time: TimeSpec, named: Sequence[str], dialect: Dialect) -> Clock | None:
    """The clock of dates and times of day as spreadsheets store them, in two columns: whole days, and parts of one."""
    dates = [name for name in dialect.names if is_date_name(name) and dialect.is_number(name)]
    for date in dates:
        for part in (name for name in named if name not in dates and dialect.is_number(name)):
            days, parts = np.array(dialect.numbers(date)), np.array(dialect.numbers(part))
            whole = (days >= SERIAL_D[0]) & (days < SERIAL_D[1]) & (days % 1 == 0)
            if len(days) and whole.all() and len(parts) and ((parts >= 0) & (parts < 1)).all():
                says, local = f"days since 1899-12-30 in {time.zone}", LocalClock(time.local)
                columns, unit_ns = (date, part), float(DAY_NS)
                return SerialOfTwo(
                    says=says, absolute=True, columns=columns, unit_ns=unit_ns, origin_ns=SERIAL_NS, local=local
                )
    return None


def _of_dates(time: TimeSpec, column: str, dialect: Dialect) -> Clock | None:
    """The clock of a column of numbers that is called as dates are."""
    return _serial(time, column, dialect) if is_date_name(column) else None


def _of_day(time: TimeSpec, column: str, dialect: Dialect) -> Clock | None:
    """The clock of a column of times of day, with or without seconds, or of what is left of them within the hour, which
    nothing dates."""
    said, start, either = dialect.said(column), time.start_ns, ""
    kind = _kind_of_day(time.format, column, said, in_digits(column, dialect))
    if kind is None and said and seconds_of_minutes(said[0]) >= OfHour.turn_s:  # what counts begins below an hour
        kind, either = (OfHour, "") if any(map(_is_late, dialect.all_said(column))) else (OfMinutes, said[0])
    if kind is None:
        return None
    clock = kind(says=kind.called, absolute=start is not None, columns=(column,), origin_ns=start or 0, either=either)
    first_s = clock.seconds(said[0])
    if start is not None and kind.turn_s == DAY_S and _is_near(first_s, begins := _of_its_day_s(start, time.local)):
        clock = replace(clock, origin_ns=start - round(begins * 1e9))
    return clock


def _of_its_day_s(start_ns: int, zone: ZoneInfo) -> float:
    """The time of day of a stamp in a zone [s]."""
    begins = datetime.fromtimestamp(start_ns / 1e9, zone)
    return (begins - begins.replace(hour=0, minute=0, second=0, microsecond=0)).total_seconds()


def _is_near(first_s: float, begins_s: float) -> bool:
    """Whether a first row says the time of day of a start, and not what went by since: what has gone by for an hour is
    hardly a first row."""
    return abs(first_s - begins_s) <= (60.0 if first_s < 3600.0 else 3600.0)


def _kind_of_day(form: str | None, column: str, said: Sequence[str], digits: bool) -> type[OfDay] | None:
    """What the cells of a column are of the day; None where they are none, or nothing tells: `02:07` is what `form`
    says, or the column's name; minutes and seconds where it has parts of a second, or as no hour is so late; hours and
    minutes by `PM`."""
    if _most(seconds_of_day, said):
        return OfDay
    if digits:
        return OfDigits
    if not _most(seconds_of_hour, said) and not _most(seconds_of_minutes, said):
        return None
    name = words(column)
    if form in WITHIN_DAY or "ss" in name or "hh" in name:
        return WITHIN_DAY.get(form or "") or (OfMinutes if "hh" in name else OfHour)
    if any(map(_is_late, said)):
        return OfHour
    return OfMinutes if any(OF_HOUR.fullmatch(cell.strip()) is None for cell in said) else None


def _is_late(cell: str) -> bool:
    """Whether `38:20` or `02:07.5` are minutes and seconds: no day has such an hour, and no minute such parts."""
    match = OF_HOUR.fullmatch(cell.strip())
    return match is not None and (int(match["minutes"]) > 23 or not match["seconds"].isdecimal())


def _most(seconds: Callable[[str], float], said: Sequence[str]) -> bool:
    return 2 * sum(not isnan(seconds(cell)) for cell in said) > len(said)


def rises(values: NDArray[Any]) -> bool:
    """Whether numbers (N,) go on as time does: at most one step in ten back, most forward or the second half later than
    the first: a clock may have been started anew between both."""
    if len(values) < 2:
        return len(values) == 1
    steps, half = np.diff(values), len(values) // 2
    later = np.median(values[half:]) > np.median(values[:half])
    return 10 * int((steps < 0).sum()) <= len(values) and bool(later or 2 * int((steps > 0).sum()) > len(steps))
