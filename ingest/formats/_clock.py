"""From the stamps of a log to int64 nanoseconds UTC: the parts that all formats share."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
YEARS = (1971, 2200)  # of a log: in 1970 no clock was set, and int64 nanoseconds end in 2262


def wall_ns(stamp: datetime, time: TimeSpec) -> int | None:
    """Nanoseconds UTC of the wall clock `stamp` of a file; None for a year that no log is from.

    A zone that explains the column of a table says nothing of files with a date of their own: they are UTC then.
    """
    zone = time.local if time.column is None else UTC
    return _ns(stamp.replace(tzinfo=zone)) if YEARS[0] <= stamp.year <= YEARS[1] else None


def start_ns(time: TimeSpec, log: str) -> int | None:
    """`[time] start` of the bench file [ns UTC], None where it says none. Raises UnreadableLogError."""
    if time.start is None:
        return None
    try:
        stamp = datetime.fromisoformat(time.start)
    except ValueError:
        stamp = None
    if stamp is None or not YEARS[0] <= stamp.year <= YEARS[1]:
        raise UnreadableLogError(
            f'{log}: start = "{time.start}" under [time] of the bench file is no ISO 8601 stamp of a log. Write it as '
            "2024-03-01T08:00:00Z."
        )
    return _ns(stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC))


def _ns(stamp: datetime) -> int:
    return (stamp - EPOCH) // timedelta(microseconds=1) * 1000
