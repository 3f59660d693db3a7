"""How a bench file says what the stamps of logs mean: the keys of `[time]`, and those of a `[[logger]]`."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from fnmatch import fnmatchcase
from zoneinfo import ZoneInfo, available_timezones

from ingest.bench.changes import moment_ns
from ingest.bench.channel_tables import exclusive, refusal
from ingest.bench.signals import BUS
from ingest.formats import FORMATS, TimeSpec
from ingest.texts.nearest import hint
from ingest.texts.toml_file import NAME, NOT_NEGATIVE, POSITIVE, TEXT, TomlTable

TIME_UNITS = ("s", "ms", "us", "ns", "min", "h")
TIME_KEYS = ("column", "format", "unit", "zone", "rate_hz", "start", "skip_rows", "sheet")
OF_FORMAT = tuple(form.name for form in FORMATS)  # [time.csv]: of logs of that format
LOGGER_KEYS = ("name", "files")


@dataclass(frozen=True)
class Logger:
    """A device with one clock, known by how its files are called."""

    name: str  # of its clock: clock.<name>.offset
    files: str  # what the names of its logs fit, such as "thermo_*"; case does not count
    time: TimeSpec | None  # None: as [time] says

    def wrote(self, log: str) -> bool:
        """Whether a log of this name is one of its; of a log from an archive, "a.csv in b.zip", the log's own name."""
        name, pattern = log.casefold(), self.files.casefold()
        return fnmatchcase(name, pattern) or fnmatchcase(name, f"{pattern} in *")


def read_loggers(tables: Sequence[TomlTable], elsewhere: Mapping[str, str], untimed: bool) -> tuple[Logger, ...]:
    """The `[[logger]]` tables of a bench file. Raises TomlError, BenchFileError."""
    return tuple(_logger(table, elsewhere, untimed) for table in tables)


def _logger(table: TomlTable, elsewhere: Mapping[str, str], untimed: bool) -> Logger:
    time = read_time(table, LOGGER_KEYS, elsewhere, untimed)
    name = table.need("name", NAME)
    if re.fullmatch(BUS, name):
        raise refusal(table, "name", f'name "{name}" is what a bus is called: choose another.')
    return Logger(name, table.need("files", TEXT), time if set(TIME_KEYS) & set(table.values) else None)


def read_time(table: TomlTable | None, beside: Sequence[str], elsewhere: Mapping[str, str], untimed: bool) -> TimeSpec:
    """What `[time]`, that of one format or a logger says; keys `beside` it are read by others. Raises TomlError,
    BenchFileError."""
    if table is None:
        return TimeSpec(untimed=untimed)
    table.only((*TIME_KEYS, *beside), elsewhere)
    exclusive(table, "column", "rate_hz")
    exclusive(table, "format", "unit", "rate_hz")
    zone = zone_of(table)
    return TimeSpec(
        column=table.get("column", TEXT),
        format=_format(table),
        unit=table.one_of("unit", TIME_UNITS),
        zone=zone,
        rate_hz=table.get("rate_hz", POSITIVE),
        start_ns=moment_ns(table, "start", ZoneInfo(zone)),
        untimed=untimed,
        skip_rows=_skip_rows(table),
        sheet=table.get("sheet", TEXT),
    )


def _skip_rows(table: TomlTable) -> int:
    count = table.get("skip_rows", NOT_NEGATIVE) or 0.0
    if count != int(count):
        raise refusal(table, "skip_rows", f"skip_rows is a count of lines above the header, not {count:g}.")
    return int(count)


def zone_of(table: TomlTable) -> str:
    """The zone of stamps without one. Raises BenchFileError for a name that the IANA list does not have."""
    zone = table.get("zone", TEXT) or TimeSpec.zone
    try:
        ZoneInfo(zone)
    except (KeyError, ValueError, OSError):  # OSError: the name of a folder, "Europe"
        advice = hint(zone, available_timezones()) or " Write it as Europe/Rome."
        raise refusal(table, "zone", f'zone "{zone}" is no time zone of the IANA list.{advice}') from None
    return zone


def _format(table: TomlTable) -> str | None:
    text = table.get("format", TEXT)
    if text is None:
        return None
    sample = datetime(2024, 3, 1, 8, 5, 7)
    try:
        datetime.strptime(sample.strftime(text), text)
        holds = "%" in text
    except ValueError:
        holds = False
    if not holds:
        raise refusal(table, "format", f'format "{text}" is no strptime format. Write it as "%d.%m.%Y %H:%M:%S".')
    return text
