"""The time of the rows of a table: which column holds it, and what its cells mean."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from math import isnan
from statistics import median
from typing import Any
from zoneinfo import ZoneInfo, available_timezones

import numpy as np
from numpy.typing import NDArray

from ingest.errors import UnreadableLogError
from ingest.formats import EPOCH, TimeSpec, utc_ns
from ingest.formats._csv_clocks import (
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
    carried,
    seconds_of_day,
    seconds_of_hour,
    seconds_of_minutes,
    wraps_of,
)
from ingest.formats._csv_dialect import Dialect, cells
from ingest.formats._csv_digits import digit_pairs, in_digits, says_seconds
from ingest.formats._csv_numbers import MISSING
from ingest.formats._csv_stamps import (
    CLOCK_ALONE,
    DATE_ALONE,
    DAY_FIRST,
    DAY_NS,
    DAYS,
    DIGITS,
    DIGITS_ALONE,
    KNOWN,
    MONTH_FIRST,
    OF_PARTS,
    SECOND_NS,
    ZONE,
    LocalClock,
    both_formats,
    day_first,
    fits,
    month_first,
    pattern_of,
    year_may_be_first,
)
from ingest.formats._csv_time_names import (
    PARTS_OF_STAMP,
    UNITS_NS,
    base_and_unit,
    digits_of,
    is_date_name,
    is_time_name,
    is_x,
    is_zone_name,
    unit_of_time,
    words,
)
from ingest.formats._no_times import way_out
from ingest.texts.nearest import hint

ORDER_IN_NAME = re.compile(r"\b(dd|mm)[-./](?:dd|mm)[-./]yy", re.IGNORECASE)  # `Date (MM/DD/YYYY)`
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
LOOSE_NS = 2_000_000_000  # stamps of whole seconds and what counts beside them: apart by this at most
NO_RECORD = np.empty(0, np.int64)  # stamps need none


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
    return _in_named_zone(clock, dialect, log) if isinstance(clock, Stamped) else clock


def _stated(time: TimeSpec, column: str, dialect: Dialect, log: str) -> Clock:
    if time.format is not None and time.format not in WITHIN_DAY:
        local = LocalClock(time.local)
        says = f"{time.format} in {time.zone}"
        return Stamped(says=says, absolute=True, columns=(column,), pattern=pattern_of(time.format, log), local=local)
    clock = _by_content(time, column, dialect)
    beside = [name for _, name in _pairs(dialect) if not _is_number(dialect, name)]  # a number may look like 8.30
    if clock is None and not beside:
        clock = _of_cells(time, _known(time, DAYS), (column,), dialect)
    if clock is None and (asked := _asked(dialect)):
        raise UnreadableLogError(f"{log}: {asked}")
    if clock is None:
        clock = _of_day(time, column, dialect)
    if clock is None:
        cell = next((cell for cell in _cells(dialect, column) if cell not in MISSING), "")
        example = "%d.%m.%Y" if re.match(DATE_ALONE, cell) else "%d.%m.%Y %H:%M:%S"
        example = example if isnan(seconds_of_minutes(cell)) else "%H:%M"
        raise UnreadableLogError(
            f'{log}: column "{column}" holds "{cell[:60]}", which is no number and no stamp that is known. '
            f'Say format = "{example}", with signs and order as they are there, under [time] of the bench file.'
        )
    return clock


def _found(time: TimeSpec, dialect: Dialect, log: str) -> Clock:
    parts = _of_parts(time, dialect)
    named = [name for name in dialect.names if is_time_name(name) and not (parts and name in parts.columns)]
    named = named or [name for name in dialect.names if is_x(name, dialect)]
    if time.format is not None and time.format not in WITHIN_DAY:
        pattern = pattern_of(time.format, log)
        fitting = (name for name in (*named, *dialect.names) if _fits(pattern, dialect, name))
        if column := next(fitting, None):
            return _stated(time, column, dialect, log)
        if clock := _of_two(time, {f"{time.format} in {time.zone}": pattern}, dialect):
            return clock
    if rounded := next((name for name in named if _is_rounded(_cells(dialect, name))), None):
        raise UnreadableLogError(
            f'{log}: "{rounded}" holds "{_cells(dialect, rounded)[0]}" in several rows: its times were rounded as they '
            "were saved. Save them again as whole numbers (Excel: format 0; LabVIEW: %.3f), or under [time] of the "
            "bench file say rate_hz = 1.0 (rows at a fixed rate)."
        )
    if two := _serial_of_two(time, named, dialect):
        return two
    clocks = [clock for column in named if (clock := _of_named(time, column, dialect))]
    if clocks:
        dated = next((clock for clock in clocks if clock.absolute), None) or parts
        dated = dated or _of_two(time, _known(time), dialect) or clocks[0]
        if fine := next((fine for one in clocks if (fine := _fine(time, one, dated, dialect))), None):
            return fine
        return clocks[0] if clocks[0].absolute else _dated(clocks[0], dated, dialect)
    if parts:
        return parts
    for column in dialect.names:
        if clock := _stamped(time, column, dialect) or _of_dates(time, column, dialect):
            return clock
    if clock := _of_two(time, _known(time), dialect):
        return clock
    if time.untimed and not named:
        return Rate(says="rows without a time", absolute=False, rate_hz=1.0, origin_ns=0)
    if asked := _asked(dialect):
        raise UnreadableLogError(f"{log}: {asked}")
    for column in [*named, *dialect.names]:
        if clock := _of_day(time, column, dialect):
            return clock
    if clock := _rated(time, dialect) or _first_in_seconds(time, dialect):
        return clock
    texts = [name for name in named if dialect.numeric[dialect.names.index(name)] is False]
    seen = next((cell for name in texts for cell in _cells(dialect, name) if cell not in MISSING), None)
    holds = f' ("{texts[0]}" holds "{seen[:40]}", which is no whole stamp)' if seen is not None else ""
    instead = f"{way} Or under" if (way := way_out(dialect)) else "Under"
    days = next((name for name in dialect.names if _are_days(time, name, dialect)), None)
    column = f'column = "{days}" (its days)' if days else 'column = "..." with format or unit'
    if texts and _most(seconds_of_minutes, _cells(dialect, texts[0])):
        column = 'format = "%H:%M" or format = "%M:%S"'
    raise UnreadableLogError(
        f"{log}: no column is recognised as its time{holds}. {instead} [time] of the bench file say rate_hz = 1.0 "
        f"(rows at a fixed rate), or {column}."
    )


def _are_days(time: TimeSpec, column: str, dialect: Dialect) -> bool:
    """Whether a column holds days alone: 08.00.00 has their form, and is none."""
    clock = _of_cells(time, _known(time, DAYS), (column,), dialect)
    return clock is not None and not deepcopy(clock).t_ns(_time_cells(clock, dialect), NO_RECORD)[1].all()


def _is_rounded(said: Sequence[str]) -> bool:
    """Whether times are all written as powers of ten, and come again as they have too few digits for their size."""
    return len(set(said)) < len(said) and all(POWER_OF_TEN.fullmatch(cell) for cell in said)


def _first_in_seconds(time: TimeSpec, dialect: Dialect) -> Clock | None:
    """The clock of the first column, whatever it is called, where it says a unit of time and goes on as time does."""
    first = dialect.names[0]
    unit = unit_of_time(dialect.units.get(first))
    if unit is None or not _is_number(dialect, first) or not rises(np.array(_numbers(dialect, first))):
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
    counts = np.array(_numbers(dialect, column)) if _is_number(dialect, column) else None
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
    (since, bad), (t_ns, none) = (replace(one).t_ns(_time_cells(one, dialect), NO_RECORD) for one in (counted, dated))
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


def times_of(clock: Clock, dialect: Dialect) -> NDArray[np.int64]:
    """The stamps of the first rows (N,); 0 where there is none."""
    return deepcopy(clock).t_ns(_time_cells(clock, dialect), NO_RECORD)[0]


def _time_cells(clock: Clock, dialect: Dialect) -> NDArray[Any]:
    """The cells of a clock's column in the sample, as it wants them."""
    if clock.is_text:
        return clock.cells([np.array(_cells(dialect, name), object) for name in clock.columns])
    values = ([dialect.numerals.value(cell) for cell in _cells(dialect, name)] for name in clock.columns)
    return clock.cells([np.array([np.nan if one is None else one for one in column]) for column in values])


def _by_content(time: TimeSpec, column: str, dialect: Dialect) -> Clock | None:
    """Numbers counted from the start or from 1970, or stamps of a known form; None for anything else."""
    if not _is_number(dialect, column) or (time.unit is None and _fits(DIGITS_ALONE, dialect, column)):
        return None if time.unit else _stamped(time, column, dialect)
    unit = time.unit or base_and_unit(column)[1] or dialect.units.get(column)
    candidates = [known] if (known := unit_of_time(unit)) else ["s", "ms", "us", "ns"]
    for candidate in candidates:
        middle = median(_numbers(dialect, column)) * UNITS_NS[candidate]  # one absurd stamp takes nothing from the rest
        if EPOCH_NS[0] <= middle <= EPOCH_NS[1]:
            says, unit_ns = f"{candidate} since 1970", UNITS_NS[candidate]
            since_1970 = Counted(says=says, absolute=True, columns=(column,), unit_ns=unit_ns, step_ns=1000)
            return _with_part_counted(since_1970, dialect)
    if candidates[0] == "s" and SINCE_1904_S[0] <= median(_numbers(dialect, column)) <= SINCE_1904_S[1]:
        says = "s since 1904"
        return Counted(
            says=says, absolute=True, columns=(column,), unit_ns=SECOND_NS, step_ns=1000, origin_ns=ORIGIN_1904_NS
        )
    for says, (of_1970, first, last) in TICKS.items() if unit is None else ():
        if first <= median(_numbers(dialect, column)) < last:
            return Counted(says=says, absolute=True, columns=(column,), unit_ns=100, step_ns=1000, zero=of_1970)
    if unit is None and (serial := _serial(time, column, dialect)):
        return serial
    says, start, unit_ns = f"{candidates[0]} from the start", time.start_ns, UNITS_NS[candidates[0]]
    clock = Counted(says=says, absolute=start is not None, columns=(column,), unit_ns=unit_ns, origin_ns=start or 0)
    return _with_part_counted(clock, dialect)


def _with_part_counted(clock: Counted, dialect: Dialect) -> Counted:
    """The clock of whole seconds, several rows in each, with the part of the second that a column of its own holds."""
    seconds, column = np.array(_numbers(dialect, clock.columns[0])), _part_of_second(clock.columns, dialect)
    often = np.ptp(seconds) > 0 and (np.diff(seconds) == 0).any() and not (seconds % 1).any()
    if column is None or not often or clock.unit_ns != SECOND_NS:
        return clock
    return replace(clock, columns=(*clock.columns, column), parts=10.0 ** digits_of(column))


def _part_of_second(beside: Sequence[str], dialect: Dialect) -> str | None:
    """The column that is called as parts of a second are, and holds such in all rows."""
    column = next((name for name in dialect.names if digits_of(name) and name not in beside), None)
    most = 10 ** digits_of(column or "")
    parts = _numbers(dialect, column) if column else []
    return column if all(0 <= part < most and part == int(part) for part in parts) else None


def _stamped(time: TimeSpec, column: str, dialect: Dialect) -> Clock | None:
    if time.column is None and "utc" in words(column):  # its name says the zone
        time = replace(time, zone="UTC")
    return _of_cells(time, _known(time), (column,), dialect)


def _is_number(dialect: Dialect, column: str) -> bool:
    return dialect.numeric[dialect.names.index(column)] is True


def _serial(time: TimeSpec, column: str, dialect: Dialect) -> Clock | None:
    """The clock of dates as spreadsheets store them; None where numbers are none, or may be seconds as well."""
    days = np.array(_numbers(dialect, column)) if _is_number(dialect, column) else np.empty(0)
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
    dates = [name for name in dialect.names if is_date_name(name) and _is_number(dialect, name)]
    for date in dates:
        for part in (name for name in named if name not in dates and _is_number(dialect, name)):
            days, parts = np.array(_numbers(dialect, date)), np.array(_numbers(dialect, part))
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
    said = [cell for cell in _cells(dialect, column) if cell not in MISSING]
    kind = _kind_of_day(time.format, column, said, in_digits(column, dialect))
    start = time.start_ns
    return kind(says=kind.called, absolute=start is not None, columns=(column,), origin_ns=start or 0) if kind else None


def _kind_of_day(form: str | None, column: str, said: Sequence[str], digits: bool) -> type[OfDay] | None:
    """What the cells of a column are of the day; None where they are none, or nothing tells: `02:07` is what `form`
    says, or the column's name; minutes and seconds where it has parts of a second, or as no hour is so late; hours and
    minutes by `PM`, or as what counts from a start begins below one."""
    if _most(seconds_of_day, said):
        return OfDay
    if digits:
        return OfDigits
    if not _most(seconds_of_hour, said) and not _most(seconds_of_minutes, said):
        return None
    name = words(column)
    if form in WITHIN_DAY or "ss" in name or "hh" in name:
        return WITHIN_DAY.get(form or "") or (OfMinutes if "hh" in name else OfHour)
    matches = [OF_HOUR.fullmatch(cell.strip()) for cell in said]
    if any(match and (int(match["minutes"]) > 23 or not match["seconds"].isdecimal()) for match in matches):
        return OfHour
    return OfMinutes if None in matches or seconds_of_minutes(said[0]) >= OfHour.turn_s else None


def _most(seconds: Callable[[str], float], said: Sequence[str]) -> bool:
    return 2 * sum(not isnan(seconds(cell)) for cell in said) > len(said)


def _of_parts(time: TimeSpec, dialect: Dialect) -> Clock | None:
    """The clock of a table with a column each of year, month, day, hour and minute, and most often of the second."""
    found = [next((name for name in dialect.names if name.casefold() in own), None) for own in PARTS_OF_STAMP]
    columns = tuple(name for name in found if name is not None)
    if None in found[:-1] or not fits(OF_PARTS, [*_said(dialect.sample, columns, dialect)]):
        return None
    says = f"parts of date and time of day in {time.zone}"
    clock = Stamped(says=says, absolute=True, columns=columns, pattern=OF_PARTS, local=LocalClock(time.local))
    return _with_part(clock, dialect)


def _asked(dialect: Dialect) -> str | None:
    """What to say in the bench file where dates may begin with the day or with the month; None without such dates."""
    columns: list[tuple[str, ...]] = [(name,) for name in dialect.names if _fits(KNOWN[DAY_FIRST], dialect, name)]
    for names in [*columns, *_pairs(dialect)]:
        cell = next(_said(dialect.sample, names, dialect), "")
        if re.match(KNOWN[DAY_FIRST], cell):
            day, other = both_formats(cell)
            tells = "year" if other.startswith("%y") else "month, and no row has a day above 12"
            return (
                f'"{" + ".join(names)}" holds "{cell}", which may begin with the day or with the {tells}. '
                f'Under [time] of the bench file say format = "{day}" or format = "{other}".'
            )
    for names in digit_pairs(dialect):
        cell = next(_said(dialect.sample, names, dialect))
        clock = "%H%M" + "%S" * says_seconds(names[1], dialect) + ".%f" * ("." in cell)
        return (
            f'"{" + ".join(names)}" holds "{cell}", which may begin with the day, the month or the year. Under [time] '
            f'of the bench file say format = "%d%m%y {clock}", "%m%d%y {clock}" or "%y%m%d {clock}".'
        )
    return None


def _known(time: TimeSpec, forms: Mapping[str, str] = KNOWN) -> dict[str, str]:
    """The forms of stamps, those that are recognised unasked unless others are given: in words -> pattern."""
    return {f"{says} in {time.zone}": pattern for says, pattern in forms.items()}


def _of_two(time: TimeSpec, patterns: Mapping[str, str], dialect: Dialect) -> Clock | None:
    """The clock of a table with a column of dates and one of times of day; None where there are no such two."""
    for pair in _pairs(dialect):
        filled = _filled(dialect, pair[0])
        found = _of_cells(time, patterns, pair, filled or dialect)
        if found and filled:
            return replace(found, sparse_dates=True)
        if found and not found.t_ns(_time_cells(found, dialect), NO_RECORD)[1].all():
            return found  # 24.12.25 has the form of a time of day, and 08.00.00 that of a date
    forms = patterns if time.format else _known(time, DIGITS)
    return next((found for pair in digit_pairs(dialect) if (found := _of_cells(time, forms, pair, dialect))), None)


def _filled(dialect: Dialect, column: str) -> Dialect | None:
    """The first rows with the date that was said last in each; None where most rows say theirs."""
    dates = _cells(dialect, column)
    if dates[0] in MISSING or 2 * sum(date in MISSING for date in dates) <= len(dates):
        return None
    place, filled = dialect.names.index(column), carried(dates)
    rows = ((*row[:place], date, *row[place + 1 :]) for row, date in zip(dialect.sample, filled, strict=True))
    return replace(dialect, sample=tuple(rows))


def _pairs(dialect: Dialect) -> list[tuple[str, str]]:
    """Columns of dates, each with a column of times of day."""
    days = [name for name in dialect.names if _fits(DATE_ALONE, dialect, name)]
    clocks = [name for name in dialect.names if _fits(CLOCK_ALONE, dialect, name)]
    return [(day, clock) for day in days for clock in clocks if day != clock]


def _of_cells(
    time: TimeSpec, patterns: Mapping[str, str], columns: tuple[str, ...], dialect: Dialect
) -> Stamped | None:
    """The first of `patterns` that fits the cells of a column, or of two joined."""
    said = [*_said(dialect.sample, columns, dialect)]
    says, pattern = next(((says, one) for says, one in patterns.items() if said and fits(one, said)), ("", ""))
    if pattern in (KNOWN[DAY_FIRST], DAYS[DAY_FIRST]):
        order = _is_day_first(said, columns, dialect)
        if order is None:
            return None
        if not order:
            says, pattern = says.replace(DAY_FIRST, MONTH_FIRST), month_first(pattern)
    if not pattern:
        return None
    clock = Stamped(says=says, absolute=True, columns=columns, pattern=pattern, local=LocalClock(time.local))
    return _with_zone(_with_part(clock, dialect), dialect)


def _with_zone(clock: Stamped, dialect: Dialect) -> Stamped:
    """The clock with the zone that a column of its own says of each stamp, where the stamps say none."""
    if _says_zone(clock, dialect):
        return clock
    others = (name for name in dialect.names if name not in clock.columns and not _is_number(dialect, name))
    column = next((name for name in others if _fits(f"^{ZONE}$", dialect, name)), None)
    return clock if column is None else replace(clock, columns=(*clock.columns, column), zoned=True)


def _says_zone(clock: Stamped, dialect: Dialect) -> bool:
    """Whether the stamps themselves say their zone, or cannot have one."""
    if "(?P<z>" not in clock.pattern or clock.zoned or any("utc" in words(name) for name in clock.columns):
        return True
    return any(re.search(f"{ZONE}$", cell.strip()) for cell in _time_cells(clock, dialect))


def _in_named_zone(clock: Stamped, dialect: Dialect, log: str) -> Stamped:
    """The clock in the IANA zone that every cell of a column says which is called a zone. Where it says another thing,
    the bench file has to say the zone. Raises UnreadableLogError."""
    own, column = clock.local.zone, next((x for x in dialect.names if x not in clock.columns and is_zone_name(x)), None)
    if column is None or _says_zone(clock, dialect):
        return clock
    said = {cell.strip() for cell in _cells(dialect, column)} - MISSING
    if len(said) == 1 and said <= available_timezones():
        says, zone = clock.says.removesuffix(f" in {own.key}"), ZoneInfo(said.pop())
        return replace(clock, says=f"{says} in {zone.key}", local=LocalClock(zone))
    if not said or own.key != "UTC":
        return clock
    raise UnreadableLogError(
        f'{log}: column "{column}" says a zone otherwise than +01:00, CET or Europe/Rome. Say it as '
        '`zone = "Europe/Rome"` under [time] of the bench file.'
    )


def _with_part(clock: Stamped, dialect: Dialect) -> Stamped:
    """The clock with the part of the second that a column of its own holds, where its stamps say whole seconds."""
    column = _part_of_second(clock.columns, dialect)
    if column is None:
        return clock
    said = [match for cell in _time_cells(clock, dialect) if (match := re.match(clock.pattern, cell))]
    if not all({"S", "f"} <= match.groupdict().keys() and match["S"] and not match["f"] for match in said):
        return clock
    return replace(clock, columns=(*clock.columns, column), digits=digits_of(column))


def _is_day_first(said: list[str], columns: tuple[str, ...], dialect: Dialect) -> bool | None:
    """Whether dates begin with the day: 24/12 does wherever it stands in the table, 05/06 where its column's name says
    so, and in a table with decimal commas or semicolons. None where nothing tells; 25/03/17 may begin with the year in
    any other table, 25-03-17 in any."""
    told = day_first(said)
    if told is None and (named := ORDER_IN_NAME.search(" ".join(columns))):
        told = named[1].lower() == "dd"
    if told is None:
        told = day_first(_said(dialect.rows(), columns, dialect))
    european = (dialect.numerals.decimal == "," or dialect.delimiter == ";") and not said[0].upper().endswith("M")
    if year_may_be_first(said) and told is not False and ("-" in said[0] or (told and not european)):
        return None
    return told is not False if european else told


def _said(rows: Iterable[Sequence[str]], columns: tuple[str, ...], dialect: Dialect) -> Iterator[str]:
    """The cells of a column, or of two as one stamp each, that are not missing."""
    places = [dialect.names.index(name) for name in columns]
    for row in rows:
        if len(row) == len(dialect.names) and (cell := " ".join(row[i].strip() for i in places)).strip() not in MISSING:
            yield cell


def _cells(dialect: Dialect, column: str) -> list[str]:
    place = dialect.names.index(column)
    return [row[place] for row in dialect.sample]


def _numbers(dialect: Dialect, column: str) -> list[float]:
    values = (dialect.numerals.value(cell) for cell in _cells(dialect, column))
    return [value for value in values if value is not None and not isnan(value)]


def _fits(pattern: str, dialect: Dialect, column: str) -> bool:
    said = [cell for cell in _cells(dialect, column) if cell not in MISSING]
    return bool(said) and fits(pattern, said)


def rises(values: NDArray[Any]) -> bool:
    """Whether numbers (N,) go on as time does: at most one step in ten back, most forward or the second half later than
    the first: a clock may have been started anew between both."""
    if len(values) < 2:
        return len(values) == 1
    steps, half = np.diff(values), len(values) // 2
    later = np.median(values[half:]) > np.median(values[:half])
    return 10 * int((steps < 0).sum()) <= len(values) and bool(later or 2 * int((steps > 0).sum()) > len(steps))
