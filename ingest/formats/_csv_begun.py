"""When a table was begun whose times count from a start, as a line above it says: `Start time: 27.11.2025 22:14:05`."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ingest.formats import TimeSpec
from ingest.formats._csv_clocks import Clock, OfDay
from ingest.formats._csv_dialect import Dialect, cells
from ingest.formats._csv_stamp_columns import NO_RECORD, asked, known_forms, of_cells, times_of
from ingest.formats._csv_stamps import CLOCK_ALONE, DATE_ALONE, DAY_NS, SECOND_NS

_OF = (  # what was begun
    r"(?:(?:of|der|des|della?|the|measurement|recording|acquisition|logging|log|test|run|data|mess(?:ung|ungs)?"
    r"|aufzeichnungs?|versuchs?|prüf(?:ung|ungs)?|misura|prova|acquisizione|mesure|essai)[ _-]*)"
)
_WHEN = r"(?:(?:time|date|zeit|datum|zeitpunkt|at|on|am|um|data|ora|heure|utc|local)[ _&/()-]*)"
_START = r"(?:t0|trigger|start(?:ed)?|gestartet|beg[iu]nn?|inizio|d[ée]but)"
BEGUN = re.compile(rf"(?i)\W*{_WHEN}*{_OF}?{_START}[ _(-]*{_OF}*{_WHEN}*[\s:=;,]+(?P<stamp>.*\d.*)")
LONGEST = 200  # characters of such a line
CLOSE_NS = 60 * SECOND_NS  # from the start to the first row, at most


@dataclass(frozen=True)
class Begun:
    """What the times of a table without dates count from: `start_ns` UTC; and the line that says it."""

    start_ns: int
    line: str


def begun(time: TimeSpec, clock: Clock, dialect: Dialect) -> Begun | None:
    """The start that the lines above the header say; None where they say none, several, or one that the first row is
    not near. Times of day count from the midnight before it."""
    starts = {wall: (stamp, line) for stamp, line in _said(dialect) if (wall := _ns(time, "UTC", stamp, dialect))}
    if len(starts) != 1:
        return None
    ((wall, (stamp, line)),) = starts.items()
    start = _ns(time, "UTC" if "utc" in line.casefold() else time.zone, stamp, dialect)
    first = int(times_of(clock, dialect)[0]) if clock.columns and dialect.sample else 0
    of_day = wall % DAY_NS
    if start is not None and isinstance(clock, OfDay) and abs(first - of_day) <= CLOSE_NS:
        return Begun(start - of_day, line)
    return Begun(start, line) if start is not None and abs(first) <= CLOSE_NS else None


def in_doubt(dialect: Dialect) -> str | None:
    """The start above the header that may begin with the day or with the month; None where there is none."""
    return next((stamp for stamp, _ in _said(dialect) if asked(_alone(stamp, dialect))), None)


def says_start(line: str, delimiter: str) -> bool:
    """Whether a line says a start: below rows a logger wrote it that was started anew."""
    return _matched(line, delimiter) is not None


def _matched(line: str, delimiter: str) -> re.Match[str] | None:
    said = " ".join(cell.strip() for cell in cells(line, delimiter)).strip()
    return BEGUN.fullmatch(said) if len(said) <= LONGEST else None


def _said(dialect: Dialect) -> Iterator[tuple[str, str]]:
    """(stamp, line) of the lines above the header that say a start: of two, the date in one and the time in the other,
    both together."""
    matched = (_matched(line, dialect.delimiter) for line in dialect.lines_above)
    said = {found["stamp"]: found[0] for found in matched if found}
    yield from said.items()
    for day in (one for one in said if re.match(DATE_ALONE, one)):
        for clock in (one for one in said if re.match(CLOCK_ALONE, one) and one != day):
            yield f"{day} {clock}", f"{said[day]}, {said[clock]}"


def _ns(time: TimeSpec, zone: str, stamp: str, dialect: Dialect) -> int | None:
    """A stamp in nanoseconds UTC, read as one in a cell of the table would be; None where it is none, or may be two."""
    stamped = of_cells(replace(time, zone=zone), known_forms(time), ("start",), _alone(stamp, dialect))
    if stamped is None:
        return None
    t_ns, bad = stamped.t_ns(np.array([stamp], object), NO_RECORD)
    return None if bad[0] else int(t_ns[0])


def _alone(stamp: str, dialect: Dialect) -> Dialect:
    """A table with a stamp alone, written as this one."""
    return replace(dialect, names=("start",), numeric=(False,), sample=((stamp,),), rows=tuple, units={}, in_cells={})
