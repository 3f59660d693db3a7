"""Times of day as one number, 140507 for 14:05:07, and dates in digits beside them: told from seconds that count."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ingest.formats._csv_clocks import seconds_of_digits
from ingest.formats._csv_dialect import Dialect
from ingest.formats._csv_stamps import CLOCK_DIGITS, DATE_DIGITS, SHORT_DATE
from ingest.formats._csv_time_names import base_and_unit, is_date_name, is_time_name, unit_of_time

DATES, CLOCKS = (*DATE_DIGITS.values(), SHORT_DATE), tuple(CLOCK_DIGITS.values())
LEFT_OUT = 40.0  # of each 100: what digits of minutes and seconds jump over
LEAST = 10_000.0  # 1:00:00


def in_digits(column: str, dialect: Dialect) -> bool:
    """Whether a column that is called as times are holds times of day in digits: beside a date in digits; or where they
    begin with 0, or go over a minute in short steps, and none says a minute or second above 59."""
    if any(clock == column for _, clock in digit_pairs(dialect)):
        return True
    unit = unit_of_time(base_and_unit(column)[1] or dialect.units.get(column))
    said = dialect.said(column)
    seconds = np.array([seconds_of_digits(cell) for cell in said])
    if unit or not is_time_name(column) or len(said) < 2 or np.isnan(seconds).any():
        return False
    if not dialect.is_number(column):
        return True
    counts = np.array([float(cell.replace(",", ".")) for cell in said])
    short = counts[0] >= LEAST and 0 < np.median(np.diff(counts)) < LEFT_OUT
    return bool(short and np.ptp(counts // 100) > 0)


def digit_pairs(dialect: Dialect) -> list[tuple[str, str]]:
    """Columns of dates in digits, each with a column of times of day in digits."""
    days = [name for name in dialect.names if is_date_name(name) and _have_one_of(DATES, name, dialect)]
    clocks = [name for name in dialect.names if is_time_name(name) and _have_one_of(CLOCKS, name, dialect)]
    return [(day, clock) for day in days for clock in clocks if day != clock]


def says_seconds(column: str, dialect: Dialect) -> bool:
    """Whether times of day in digits say their seconds."""
    return _have_one_of(CLOCKS[:1], column, dialect)


def _have_one_of(forms: Sequence[str], column: str, dialect: Dialect) -> bool:
    """Whether the cells of a column all have one of these forms."""
    said = dialect.said(column)
    return bool(said) and any(all(re.fullmatch(form, cell) for cell in said) for form in forms)
