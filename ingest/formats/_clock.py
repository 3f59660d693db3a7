"""From the stamps of a log to int64 nanoseconds UTC: the parts that all formats share."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def to_ns(stamp: datetime) -> int:
    """Nanoseconds since 1970 UTC of an aware `stamp`."""
    return (stamp - EPOCH) // timedelta(microseconds=1) * 1000


def start_ns(time: TimeSpec, log: str) -> int | None:
    """`[time] start` of the bench file [ns UTC], None where it says none. Raises UnreadableLogError."""
    if time.start is None:
        return None
    try:
        stamp = datetime.fromisoformat(time.start)
    except ValueError:
        raise UnreadableLogError(
            f'{log}: start = "{time.start}" under [time] of the bench file is no ISO 8601 stamp. Write it as '
            "2024-03-01T08:00:00Z."
        ) from None
    return to_ns(stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC))


def zone_of(time: TimeSpec, log: str) -> ZoneInfo:
    """The zone of local stamps. Raises UnreadableLogError for a name that is not in the IANA data base."""
    try:
        return ZoneInfo(time.zone)
    except (OSError, ValueError, KeyError):
        raise UnreadableLogError(
            f'{log}: zone = "{time.zone}" under [time] of the bench file is no IANA time zone. Write it as Europe/Rome.'
        ) from None
