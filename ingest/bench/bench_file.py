"""The bench file: what each signal of a log means.

bench = read_bench(path.read_bytes(), "bench.toml")
channels = resolve(bench, signals)  # of one log
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from zoneinfo import ZoneInfo

from ingest.bench.changes import BenchChange, read_changes, told
from ingest.bench.channel import Channel
from ingest.bench.channel_tables import exclusive, read_channel, read_derived
from ingest.bench.corrections import Correction, check_corrections, read_corrections
from ingest.bench.derating import DeratingRule, read_deratings
from ingest.bench.time_tables import OF_FORMAT, TIME_KEYS, Logger, read_loggers, read_time, zone_of
from ingest.errors import BenchFileError
from ingest.formats import TimeSpec
from ingest.texts.toml_file import NAMED_TEXTS, NOT_NEGATIVE, TEXT, read

SCHEMA = "whyhot.bench/1"
KINDS = ("wltp", "s1", "s2", "ageing", "dc_check", "insulation_check", "drive", "other")
EVALUATED = ("thermal_resistance", "dose")  # of a table with a row a check

ROOT_KEYS = (
    *("motor", "specimen", "specimen_column", "batch", "batch_column", "kind", "configuration", "attributes"),
    *("time", "logger", "channel", "derived", "change", "correction", "derating"),
)

_ABOVE = dict.fromkeys(ROOT_KEYS, "above the first [table] of the file")
_UNDER_TIME = dict.fromkeys((*TIME_KEYS, "join_gap_s"), "under [time]")
_ELSEWHERE = {**_ABOVE, **_UNDER_TIME}


@dataclass(frozen=True)
class Bench:
    """A bench file, read and checked. `sha256` of its bytes is its identity."""

    sha256: str
    name: str  # file name
    motor: str | None = None  # as written, relative to the bench file's folder
    specimen: str | None = None
    specimen_column: str | None = None
    batch: str | None = None
    batch_column: str | None = None
    kind: str | None = None
    configuration: str | None = None
    attributes: Mapping[str, str] = field(default_factory=dict)
    time: TimeSpec = field(default_factory=TimeSpec)
    time_of: Mapping[str, TimeSpec] = field(default_factory=dict)  # format -> what holds for its logs instead
    loggers: tuple[Logger, ...] = ()
    join_gap_s: float = 60.0
    channels: tuple[Channel, ...] = ()
    corrections: tuple[Correction, ...] = ()
    deratings: tuple[DeratingRule, ...] = ()
    changes: tuple[BenchChange, ...] = ()  # in the order of time

    def at(self, t_ns: int | None) -> Bench:
        """The bench file as it holds for a log that begins at `t_ns` [ns UTC], None without a date: then as it was
        before all dates. What it says of other times is left out."""
        begin = self._moments[0] - 1 if t_ns is None and self._moments else t_ns or 0
        channels = list(self.channels)
        for one in self.changes_at(begin):
            channels[one.at] = one.after
        renamed = {one.was: str(one.signal) for one in channels if one.was}
        channels = [replace(one, renamed=renamed) if one.expression and renamed else one for one in channels]
        held = tuple(one for one in self.corrections if one.holds_at(begin))
        return replace(self, channels=tuple(channels), corrections=held, changes=())

    def logger_of(self, log: str) -> Logger | None:
        """The logger that wrote a log of this name: the first that its name fits."""
        return next((one for one in self.loggers if one.wrote(log)), None)

    def time_for(self, form: str, log: str) -> TimeSpec:
        """How the stamps of a log of this format and name are to be understood."""
        logger = self.logger_of(log)
        return logger.time if logger and logger.time else self.time_of.get(form, self.time)

    @property
    def of_checks(self) -> bool:
        """Whether its tables hold evaluated checks with what was counted until then, and nothing else: each row says
        all of one check of a specimen."""
        used = {one.quantity for one in self.channels if one.role != "ignored"}
        return self.specimen_column is not None and {*EVALUATED} <= used <= {*EVALUATED, "counter"}

    def changes_at(self, t_ns: int) -> tuple[BenchChange, ...]:
        """The changes that hold at a moment [ns UTC]."""
        return tuple(one for one in self.changes if one.from_ns <= t_ns)

    def unchanged(self, t_ns: int | None) -> tuple[int | None, int | None]:
        """From when until when [ns UTC] its channels read what they read at a moment, by the same sensors; None where
        they always did, or always will."""
        dates = [one.from_ns for one in self.changes if one.other]
        before = [one for one in dates if t_ns is not None and one <= t_ns]
        return max(before, default=None), min((one for one in dates if one not in before), default=None)

    def states(self) -> Iterator[tuple[int, Bench]]:
        """Each state of the file with the moment that it holds from [ns UTC], the one before all dates first."""
        for t_ns in (min(self._moments, default=0) - 1, *self._moments):
            yield t_ns, self.at(t_ns)

    @property
    def _moments(self) -> list[int]:
        dates = [t_ns for one in self.corrections for t_ns in (one.from_ns, one.until_ns) if t_ns is not None]
        return sorted({one.from_ns for one in self.changes} | set(dates))


@lru_cache(maxsize=32)  # a campaign asks again for each of its sessions
def read_bench(data: bytes, name: str) -> Bench:
    """Read and check a bench file; `name` as messages shall call it. Needs no log and no motor file.

    Raises TomlError (structure, types, unknown keys), UnitError, ExpressionError, BenchFileError, all with the line.
    """
    root = read(data, name, SCHEMA)
    root.only(ROOT_KEYS, _UNDER_TIME)
    for key in ("specimen", "batch"):
        exclusive(root, key, f"{key}_column")
    entries = [*root.tables("channel"), *root.tables("derived")]
    channels = [read_channel(table, _ABOVE) for table in root.tables("channel")]
    channels += [read_derived(table, _ABOVE) for table in root.tables("derived")]
    stamps = root.table("time")
    zone = ZoneInfo(zone_of(stamps) if stamps else TimeSpec.zone)
    untimed = "specimen_column" in root and any(channel.quantity in EVALUATED for channel in channels)
    gap = stamps.get("join_gap_s", NOT_NEGATIVE) if stamps else None
    bench = Bench(
        sha256=hashlib.sha256(data).hexdigest(),
        name=name,
        motor=root.get("motor", TEXT),
        specimen=root.get("specimen", TEXT),
        specimen_column=root.get("specimen_column", TEXT),
        batch=root.get("batch", TEXT),
        batch_column=root.get("batch_column", TEXT),
        kind=root.one_of("kind", KINDS),
        configuration=root.get("configuration", TEXT),
        attributes=root.get("attributes", NAMED_TEXTS) or {},
        time=read_time(stamps, ("join_gap_s", *OF_FORMAT), _ELSEWHERE, untimed),
        time_of={
            name: read_time(own, (), _ELSEWHERE, untimed)
            for name in OF_FORMAT
            if stamps and (own := stamps.table(name))
        },
        loggers=read_loggers(root.tables("logger"), _ABOVE, untimed),
        join_gap_s=Bench.join_gap_s if gap is None else gap,
        channels=tuple(channels),
        corrections=read_corrections(root.tables("correction"), zone),
        deratings=read_deratings(root.tables("derating"), channels),
        changes=read_changes(root.tables("change"), entries, channels, zone),
    )
    _check_states(bench)
    return bench


def _check_states(bench: Bench) -> None:
    """Raises BenchFileError where the file contradicts itself, at whatever time."""
    for number, (since, state) in enumerate(bench.states()):
        try:
            _refuse_twice(bench.name, state.channels)
            check_corrections(bench.name, state.channels, state.corrections)
        except BenchFileError as error:
            if not number:
                raise
            raise BenchFileError(f"{error} So it is from {told(since)} on.") from None


def _refuse_twice(name: str, channels: Sequence[Channel]) -> None:
    seen: dict[str, Channel] = {}
    for channel in channels:
        first = seen.setdefault(channel.signal or channel.name, channel)
        if first is not channel:
            key = "name" if channel.expression else "signal"
            raise BenchFileError(
                f"{name}:{channel.at(key)}: {channel.called} stands here twice, first in line {first.line}. Keep one."
            )
