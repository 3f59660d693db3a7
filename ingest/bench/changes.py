"""What holds from a date on, or for a time: the `[[change]]` tables of a bench file, and the dates of its corrections.

A change says of one channel which of its keys are others from then on: a sensor at another place, another unit, a
signal with another name. The channel keeps its name, so its samples before and after are those of one channel.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, time
from typing import Any
from zoneinfo import ZoneInfo

from ingest.bench.channel import Channel
from ingest.bench.channel_tables import COMMON_KEYS, exclusive, read_channel, read_derived, refusal
from ingest.errors import BenchFileError
from ingest.formats import YEARS, utc_ns
from ingest.texts.nearest import hint
from ingest.texts.toml_file import DAY, MOMENT, TEXT, Kind, TomlTable

ABOUT = ("from", "channel", "reason")
CHANGED = ("signal", "expression", "value", *(key for key in COMMON_KEYS if key != "quantity"))
CHANGE_KEYS = (*ABOUT, *CHANGED)
_SCALED = ("noise", "bias_sd", "resolution", "reference")  # in the channel's unit
_PLACE = ("node", "weights", "region")
_OTHER = ("node", "weights", "sensor", "card", "role", "value", "expression")


@dataclass(frozen=True)
class BenchChange:
    """From `from_ns` [ns UTC] on the channel at position `at` of the bench file is `after`."""

    from_ns: int
    at: int
    after: Channel
    says: str  # "T3: node yoke (was winding)"
    reason: str | None = None
    other: bool = False  # from then on it reads another thing, or with another sensor: what was learnt ends there
    line: int = 0

    @property
    def since(self) -> str:
        """When, as people read it."""
        return told(self.from_ns)


def told(t_ns: int) -> str:
    """A moment as people read it, UTC, without the time of day at midnight."""
    stamp = datetime.fromtimestamp(t_ns // 1_000_000_000, UTC)
    return stamp.strftime("%Y-%m-%d" if stamp.time() == time() else "%Y-%m-%d %H:%M:%S UTC")


def moment_ns(table: TomlTable, key: str, zone: ZoneInfo) -> int | None:
    """A date, or date and time, in nanoseconds UTC; without an offset it is local time of `zone`, a date its midnight.

    Raises TomlError where it is none, BenchFileError for a year that no log is from.
    """
    kind: Kind[Any] = MOMENT if key == "start" else DAY
    said = table.get(key, kind)
    if said is None:
        return None
    moment = said if isinstance(said, datetime) else datetime.combine(said, time())
    if not YEARS[0] <= moment.year <= YEARS[1]:
        says = f"{key} {said} is out of range: it must lie between {YEARS[0]} and {YEARS[1]}."
        raise refusal(table, key, says)
    return utc_ns(moment if moment.tzinfo else moment.replace(tzinfo=zone))


def read_changes(
    tables: Sequence[TomlTable], entries: Sequence[TomlTable], channels: Sequence[Channel], zone: ZoneInfo
) -> tuple[BenchChange, ...]:
    """The changes of a bench file in the order of time; `entries`: the tables of its `channels`, in the same order.

    Raises TomlError and BenchFileError for a change without a date, of a channel that is not there, of nothing, and of
    one channel at one moment twice; and what a `[[channel]]` that says the same would raise.
    """
    dated = [(_from(table, zone), table) for table in tables]
    now, said = list(channels), [entry.values for entry in entries]
    found: list[BenchChange] = []
    for from_ns, table in sorted(dated, key=lambda one: one[0]):
        at = _concerned(table, channels, now)
        if twice := next((one for one in found if (one.from_ns, one.at) == (from_ns, at)), None):
            raise refusal(table, "channel", f"line {twice.line} changes it at the same moment: put both together.")
        before, said[at] = now[at], _merged(said[at], table)
        now[at] = _after(replace(table, values=said[at]), table, before, channels[at])
        says = f"{before.name}: {differing(before, now[at])}"
        other = any(getattr(before, key) != getattr(now[at], key) for key in _OTHER)
        found.append(BenchChange(from_ns, at, now[at], says, table.get("reason", TEXT), other, table.line()))
    return tuple(found)


def differing(old: Channel, new: Channel) -> str:
    """What differs between two states of a channel: "unit degC (was degF), sensor TC-7 (was TC-1)"."""
    told = {key: (getattr(old, key), getattr(new, key)) for key in CHANGED}
    return ", ".join(f"{key} {_written(b)} (was {_written(a)})" for key, (a, b) in told.items() if a != b)


def _written(value: object) -> str:
    if isinstance(value, Mapping):
        return " + ".join(f"{share:g} {name}" for name, share in value.items()) or "not given"
    return "not given" if value in (None, "") else f"{value:g}" if isinstance(value, float) else str(value)


def _from(table: TomlTable, zone: ZoneInfo) -> int:
    table.only(CHANGE_KEYS, {"quantity": "in the [[channel]]: of another quantity it is another channel"})
    if not any(key in table for key in CHANGED):
        raise refusal(table, "channel", "changes nothing: say what is other from then on, such as node or sensor.")
    from_ns = moment_ns(table, "from", zone)
    if from_ns is None:
        table.need("from", DAY)  # says what is missing
    return from_ns or 0


def _concerned(table: TomlTable, channels: Sequence[Channel], now: Sequence[Channel]) -> int:
    """Position of the channel that a change is of: by its name, or the signal that it has or had."""
    called = table.need("channel", TEXT)
    names = [{one.name, one.signal, later.signal} - {None} for one, later in zip(channels, now, strict=True)]
    found = [i for i, one in enumerate(names) if called in one]
    if not found:
        known = [one.signal or one.name for one in channels]
        advice = hint(called, known) or f" There are: {', '.join(known)[:300]}."
        raise refusal(table, "channel", f'channel "{called}" is none of this file.{advice}')
    if len(found) > 1:
        several = ", ".join(channels[i].signal or channels[i].name for i in found)
        raise refusal(table, "channel", f'channel "{called}" may be several: write one of {several}.')
    return found[0]


def _merged(said: Mapping[str, object], table: TomlTable) -> dict[str, object]:
    """The keys of a channel's table as they are from a change on: of another place, nothing of the old one is left."""
    exclusive(table, "node", "weights")
    gone = _PLACE if "node" in table or "weights" in table else ()
    new = {key: value for key, value in table.values.items() if key in CHANGED}
    return {key: value for key, value in said.items() if key not in gone} | new


def _after(merged: TomlTable, table: TomlTable, before: Channel, first: Channel) -> Channel:
    """The channel from a change on; numbers that the change does not say stay what they are, whatever its unit."""
    after = read_derived(merged, {}) if before.expression else read_channel(merged, {})
    kept = {key: getattr(before, key) for key in _SCALED if key not in table}
    renamed = first.signal if after.signal != first.signal else None
    return replace(after, **kept, name=first.name, was=renamed)


def refuse_within(changes: Sequence[BenchChange], file: str, log: str, span: tuple[int, int]) -> None:
    """Raises BenchFileError where a change falls within a log with these stamps [ns]: it has one meaning throughout."""
    for one in changes:
        if span[0] < one.from_ns <= span[1]:
            raise BenchFileError(
                f"{file}:{one.line}: the change of {one.since} falls within {log} ({told(span[0])} to "
                f"{told(span[1])}), and a log has one meaning throughout: move `from` before or behind it."
            )
