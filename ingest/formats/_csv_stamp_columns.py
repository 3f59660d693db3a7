"""Stamps in the cells of a table: in one column or in several, with the zone and the part of a second beside them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from itertools import chain
from typing import Any
from zoneinfo import ZoneInfo, available_timezones

import numpy as np
from numpy.typing import NDArray

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec
from ingest.formats._csv_clocks import OF_FRACTION, Clock, Stamped, carried
from ingest.formats._csv_dialect import Dialect
from ingest.formats._csv_digits import digit_pairs, says_seconds
from ingest.formats._csv_numbers import MISSING
from ingest.formats._csv_stamps import (
    CLOCK_ALONE,
    DATE_ALONE,
    DAY_FIRST,
    DAYS,
    DIGITS,
    KNOWN,
    MONTH_FIRST,
    OF_PARTS,
    ZONE,
    LocalClock,
    both_formats,
    day_first,
    either_way,
    fits,
    month_first,
    year_may_be_first,
)
from ingest.formats._csv_time_names import (
    PARTS_OF_STAMP,
    digits_of,
    is_part_of_second,
    is_zone_name,
    words,
    zone_in_name,
)

ORDER_IN_NAME = re.compile(r"\b(dd|mm)[-./](?:dd|mm)[-./]yy", re.IGNORECASE)  # `Date (MM/DD/YYYY)`
NO_RECORD = np.empty(0, np.int64)  # stamps need none


def times_of(clock: Clock, dialect: Dialect) -> NDArray[np.int64]:
    """The stamps of the first rows (N,); 0 where there is none."""
    return deepcopy(clock).t_ns(time_cells(clock, dialect), NO_RECORD)[0]


def time_cells(clock: Clock, dialect: Dialect) -> NDArray[Any]:
    """The cells of a clock's column in the sample, as it wants them."""
    if clock.is_text:
        return clock.cells([np.array(dialect.cells_of(name), object) for name in clock.columns])
    values = ([dialect.numerals.value(cell) for cell in dialect.cells_of(name)] for name in clock.columns)
    return clock.cells([np.array([np.nan if one is None else one for one in column]) for column in values])


def of_parts(time: TimeSpec, dialect: Dialect) -> Clock | None:
    """The clock of a table with a column each of year, month, day, hour and minute, and most often of the second."""
    found = [next((name for name in dialect.names if name.casefold() in own), None) for own in PARTS_OF_STAMP]
    columns = tuple(name for name in found if name is not None)
    if None in found[:-1] or not fits(OF_PARTS, [*_said(dialect.sample, columns, dialect)]):
        return None
    says = f"parts of date and time of day in {time.zone}"
    clock = Stamped(says=says, absolute=True, columns=columns, pattern=OF_PARTS, local=LocalClock(time.local))
    return _with_part(clock, dialect)


def asked(dialect: Dialect) -> str | None:
    """What to say in the bench file where dates may begin with the day or with the month; None without such dates."""
    columns: list[tuple[str, ...]] = [(name,) for name in dialect.names if column_fits(KNOWN[DAY_FIRST], dialect, name)]
    for names in [*columns, *pairs(dialect)]:
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


def known_forms(time: TimeSpec, forms: Mapping[str, str] = KNOWN) -> dict[str, str]:
    """The forms of stamps, those that are recognised unasked unless others are given: in words -> pattern."""
    return {f"{says} in {time.zone}": pattern for says, pattern in forms.items()}


def of_two(time: TimeSpec, patterns: Mapping[str, str], dialect: Dialect) -> Clock | None:
    """The clock of a table with a column of dates and one of times of day; None where there are no such two."""
    for pair in pairs(dialect):
        filled = _filled(dialect, pair[0])
        found = of_cells(time, patterns, pair, filled or dialect)
        if found and filled:
            return replace(found, sparse_dates=True)
        if found and not found.t_ns(time_cells(found, dialect), NO_RECORD)[1].all():
            return found  # 24.12.25 has the form of a time of day, and 08.00.00 that of a date
    forms = patterns if time.format else known_forms(time, DIGITS)
    return next((found for pair in digit_pairs(dialect) if (found := of_cells(time, forms, pair, dialect))), None)


def _filled(dialect: Dialect, column: str) -> Dialect | None:
    """The first rows with the date that was said last in each; None where most rows say theirs."""
    dates = dialect.cells_of(column)
    if dates[0] in MISSING or 2 * sum(date in MISSING for date in dates) <= len(dates):
        return None
    place, filled = dialect.names.index(column), carried(dates)
    rows = ((*row[:place], date, *row[place + 1 :]) for row, date in zip(dialect.sample, filled, strict=True))
    return replace(dialect, sample=tuple(rows))


def pairs(dialect: Dialect) -> list[tuple[str, str]]:
    """Columns of dates, each with a column of times of day."""
    days = [name for name in dialect.names if column_fits(DATE_ALONE, dialect, name)]
    clocks = [name for name in dialect.names if column_fits(CLOCK_ALONE, dialect, name)]
    return [(day, clock) for day in days for clock in clocks if day != clock]


def of_cells(time: TimeSpec, patterns: Mapping[str, str], columns: tuple[str, ...], dialect: Dialect) -> Stamped | None:
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
    others = (name for name in dialect.names if name not in clock.columns and not dialect.is_number(name))
    column = next((name for name in others if column_fits(f"^{ZONE}$", dialect, name)), None)
    return clock if column is None else replace(clock, columns=(*clock.columns, column), zoned=True)


def _says_zone(clock: Stamped, dialect: Dialect) -> bool:
    """Whether the stamps themselves say their zone, or cannot have one."""
    return any("utc" in words(name) for name in clock.columns) or _cells_say_zone(clock, dialect)


def _cells_say_zone(clock: Stamped, dialect: Dialect) -> bool:
    """Whether cells do, of the stamps or of a column for it, or the stamps cannot have one."""
    if "(?P<z>" not in clock.pattern or clock.zoned or clock.zone_said:
        return True
    return any(re.search(f"{ZONE}$", cell.strip()) for cell in time_cells(clock, dialect))


def in_headed_zone(clock: Stamped, dialect: Dialect) -> Stamped:
    """The clock in the zone that the name of its column ends in, where its stamps say none."""
    zone = next(filter(None, map(zone_in_name, clock.columns)), None)
    if zone is None or _cells_say_zone(clock, dialect):
        return clock
    says = f"{clock.says.removesuffix(f' in {clock.local.zone.key}')} in {zone}"
    if re.fullmatch(ZONE, zone):
        return replace(clock, says=says, zone_said=zone)
    return replace(clock, says=says, local=LocalClock(ZoneInfo(zone))) if zone in available_timezones() else clock


def in_named_zone(clock: Stamped, dialect: Dialect, log: str) -> Stamped:
    """The clock in the IANA zone that every cell of a column says which is called a zone. Where it says another thing,
    the bench file has to say the zone. Raises UnreadableLogError."""
    own, column = clock.local.zone, next((x for x in dialect.names if x not in clock.columns and is_zone_name(x)), None)
    if column is None or _says_zone(clock, dialect):
        return clock
    said = {cell.strip() for cell in dialect.said(column)}
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
    column = part_of_second(clock.columns, dialect)
    if column is None:
        return clock
    said = [match for cell in time_cells(clock, dialect) if (match := re.match(clock.pattern, cell))]
    if not all({"S", "f"} <= match.groupdict().keys() and match["S"] and not match["f"] for match in said):
        return clock
    return replace(clock, columns=(*clock.columns, column), digits=digits_of(column) or OF_FRACTION)


def part_of_second(beside: Sequence[str], dialect: Dialect) -> str | None:
    """The column that is called as parts of a second are, and holds such in all rows."""
    column = next((name for name in dialect.names if is_part_of_second(name) and name not in beside), None)
    digits = digits_of(column or "")
    parts = dialect.numbers(column) if column else []
    return column if all(0 <= part < 10**digits and (part == int(part) or not digits) for part in parts) else None


def _is_day_first(said: list[str], columns: tuple[str, ...], dialect: Dialect) -> bool | None:
    """Whether dates begin with the day: 24/12 does wherever it stands in the table, 05/06 where its column's name says
    so, in a table with decimal commas or semicolons, and where all are the same either way (3/3). None where nothing
    tells; 25/03/17 may begin with the year in
    any other table, 25-03-17 in any."""
    told = day_first(said)
    if told is None and (named := ORDER_IN_NAME.search(" ".join(columns))):
        told = named[1].lower() == "dd"
    if told is None:
        told = day_first(_said(dialect.rows(), columns, dialect))
    if told is None and either_way(chain(said, _said(dialect.rows(), columns, dialect))):
        told = True
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


def column_fits(pattern: str, dialect: Dialect, column: str) -> bool:
    """Whether the cells of a column are stamps of a form."""
    said = dialect.said(column)
    return bool(said) and fits(pattern, said)
