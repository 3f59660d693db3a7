"""The bench file: what each signal of a log means.

bench = read_bench(path.read_bytes(), "bench.toml")
channels = resolve(bench, signals)  # of one log
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import lru_cache
from zoneinfo import ZoneInfo, available_timezones

from ingest.bench.channel import Channel
from ingest.bench.corrections import Correction, read_corrections
from ingest.bench.derating import DeratingRule, read_deratings
from ingest.bench.signals import TABLE
from ingest.errors import BenchFileError, ExpressionError, UnitError
from ingest.formats import FORMATS, YEARS, TimeSpec, utc_ns
from ingest.texts.expressions import parse
from ingest.texts.nearest import hint
from ingest.texts.quantities import CONVENTIONS, STORED_UNIT, converter, known_quantity
from ingest.texts.toml_file import (
    MOMENT,
    NAME,
    NAMED_NUMBERS,
    NAMED_TEXTS,
    NOT_NEGATIVE,
    NUMBER,
    POSITIVE,
    RANGE,
    TEXT,
    TomlTable,
    read,
)

SCHEMA = "whyhot.bench/1"
KINDS = ("wltp", "s1", "s2", "ageing", "dc_check", "insulation_check", "drive", "other")
LEVELS = ("testing", "production")
EVALUATED = ("thermal_resistance", "dose")  # of a table with a row a check
ROLES = ("observed", "input", "ignored")
REGIONS = ("copper", "iron", "magnet", "rotor", "housing", "fluid", "bearing", "other", "boundary")
OBSERVABLE = ("temperature", "power", "heat", "resistance", "flux")
THERMOMETRIC = ("resistance", "flux")  # they go with the temperature of nodes
_PLACED = {"temperature": "what it measures", **dict.fromkeys(THERMOMETRIC, "whose temperature it goes with")}
TIME_UNITS = ("s", "ms", "us", "ns", "min", "h")

ROOT_KEYS = (
    *("motor", "specimen", "specimen_column", "batch", "batch_column", "kind", "configuration", "attributes"),
    *("time", "channel", "derived", "correction", "derating"),
)
TIME_KEYS = ("column", "format", "unit", "zone", "rate_hz", "start", "skip_rows", "sheet")
OF_FORMAT = tuple(form.name for form in FORMATS)  # [time.csv]: of logs of that format
COMMON_KEYS = (
    *("quantity", "unit", "node", "weights", "region", "level", "noise", "bias_sd", "resolution", "time_constant_s"),
    *("sensor", "card", "convention", "role", "gain_sd", "reference", "reference_degC", "slope_per_K", "bin_degC"),
)
CHANNEL_KEYS = ("signal", "value", *COMMON_KEYS)
VALUE_KEYS = ("value", "quantity", "unit", "node")
DERIVED_KEYS = ("name", "expression", *COMMON_KEYS)

_ABOVE = dict.fromkeys(ROOT_KEYS, "above the first [table] of the file")
_UNDER_TIME = dict.fromkeys((*TIME_KEYS, "join_gap_s"), "under [time]")


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
    join_gap_s: float = 60.0
    channels: tuple[Channel, ...] = ()
    corrections: tuple[Correction, ...] = ()
    deratings: tuple[DeratingRule, ...] = ()


@lru_cache(maxsize=32)  # a campaign asks again for each of its sessions
def read_bench(data: bytes, name: str) -> Bench:
    """Read and check a bench file; `name` as messages shall call it. Needs no log and no motor file.

    Raises TomlError (structure, types, unknown keys), UnitError, ExpressionError, BenchFileError, all with the line.
    """
    root = read(data, name, SCHEMA)
    root.only(ROOT_KEYS, _UNDER_TIME)
    for key in ("specimen", "batch"):
        _exclusive(root, key, f"{key}_column")
    channels = [_channel(table) for table in root.tables("channel")]
    channels += [_derived(table) for table in root.tables("derived")]
    _refuse_twice(name, channels)
    stamps = root.table("time")
    untimed = "specimen_column" in root and any(channel.quantity in EVALUATED for channel in channels)
    gap = stamps.get("join_gap_s", NOT_NEGATIVE) if stamps else None
    return Bench(
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
        time=_time(stamps, ("join_gap_s", *OF_FORMAT), untimed),
        time_of={name: _time(own, (), untimed) for name in OF_FORMAT if stamps and (own := stamps.table(name))},
        join_gap_s=Bench.join_gap_s if gap is None else gap,
        channels=tuple(channels),
        corrections=read_corrections(root.tables("correction"), channels),
        deratings=read_deratings(root.tables("derating"), channels),
    )


def _refusal(table: TomlTable, key: str, says: str) -> BenchFileError:
    return BenchFileError(f"{table.where(key)} {says}")


def _exclusive(table: TomlTable, *keys: str) -> None:
    given = [key for key in keys if key in table]
    if len(given) > 1:
        raise _refusal(table, given[1], f"{' and '.join(given)} exclude each other: keep one.")


def _refuse_twice(name: str, channels: list[Channel]) -> None:
    seen: dict[str, Channel] = {}
    for channel in channels:
        first = seen.setdefault(channel.signal or channel.name, channel)
        if first is not channel:
            key = "name" if channel.expression else "signal"
            raise BenchFileError(
                f"{name}:{channel.at(key)}: {channel.called} stands here twice, first in line {first.line}. Keep one."
            )


def _channel(table: TomlTable) -> Channel:
    table.only(CHANNEL_KEYS, {"name": "in [[derived]]", "expression": "in [[derived]]", **_ABOVE})
    if "value" in table:
        return _valued(table)
    signal = table.need("signal", TEXT)
    qualified = re.fullmatch(r"(?:can\d+:)?\w+\.(\w+)", signal)
    name = qualified[1] if qualified else signal.removeprefix(f"{TABLE}.")
    return _common(table, name=name, signal=signal, expression=None)


def _valued(table: TomlTable) -> Channel:
    """A boundary that no log holds: its temperature as a number."""
    table.only(VALUE_KEYS, dict.fromkeys(CHANNEL_KEYS, "beside a signal, not a value"))
    quantity, unit, convention = _measure(table, None)
    if quantity != "temperature":
        raise _refusal(table, "value", f"value is the temperature of a boundary that is not measured, no {quantity}.")
    node = table.need("node", NAME)
    conversion = converter(unit, quantity, convention)
    degC = conversion.scale * table.need("value", NUMBER) + conversion.offset
    lines = {key: table.line(key) for key in table.values}
    return Channel(node, quantity, unit, value=degC, node=node, role="input", line=table.line(), lines=lines)


def _derived(table: TomlTable) -> Channel:
    table.only(DERIVED_KEYS, {"signal": "in [[channel]]; a derived channel has name and expression", **_ABOVE})
    name, expression = table.need("name", TEXT), table.need("expression", TEXT)
    try:
        parse(expression)
    except ExpressionError as error:
        raise ExpressionError(f"{table.file}:{table.line('expression')}: {error}") from None
    return _common(table, name=name, signal=None, expression=expression)


def _common(table: TomlTable, *, name: str, signal: str | None, expression: str | None) -> Channel:
    role = table.one_of("role", ROLES)
    quantity, unit, convention = _measure(table, role)
    scale = converter(unit, quantity, convention).scale if quantity else 1.0
    node, weights = _place(table)
    if role == "observed":
        _observable(table, quantity, node, weights)
    _refuse_keys_of_others(table, quantity, role)
    return Channel(
        name=name,
        quantity=quantity,
        unit=unit,
        signal=signal,
        expression=expression,
        node=node,
        weights=weights,
        region=table.one_of("region", REGIONS),
        level=table.one_of("level", LEVELS) or "testing",
        noise=_scaled(table.get("noise", NOT_NEGATIVE), scale),
        bias_sd=_scaled(table.get("bias_sd", NOT_NEGATIVE), scale),
        resolution=_scaled(table.get("resolution", POSITIVE), scale),
        time_constant_s=table.get("time_constant_s", NOT_NEGATIVE) or 0.0,
        sensor=table.get("sensor", TEXT),
        card=table.get("card", TEXT),
        convention=convention,
        role=role,
        gain_sd=table.get("gain_sd", NOT_NEGATIVE),
        reference=_scaled(table.get("reference", POSITIVE), scale),
        reference_degC=_reference_degC(table),
        slope_per_K=_slope(table),
        bin_degC=table.get("bin_degC", RANGE),
        line=table.line(),
        lines={key: table.line(key) for key in table.values},
    )


def _scaled(value: float | None, scale: float) -> float | None:
    return None if value is None else value * scale


def _measure(table: TomlTable, role: str | None) -> tuple[str, str, str]:
    """Quantity, unit and convention; an ignored channel may say none of them."""
    convention = table.one_of("convention", CONVENTIONS) or "rms"
    if role == "ignored" and "quantity" not in table:
        return "", table.get("unit", TEXT) or "", convention
    quantity = table.need("quantity", TEXT)
    at = "quantity"
    try:
        known_quantity(quantity)
        at = "unit"
        unit = _unit(table, quantity)
        converter(unit, quantity, convention)
    except UnitError as error:
        raise UnitError(f"{table.file}:{table.line(at)}: {error}") from None
    return quantity, unit, convention


def _unit(table: TomlTable, quantity: str) -> str:
    """Pure numbers need no unit."""
    if STORED_UNIT[quantity] == "1" and not table.values.get("unit"):
        return "1"
    return table.need("unit", TEXT)


def _place(table: TomlTable) -> tuple[str | None, Mapping[str, float]]:
    """The node, or the weights of several (`node = {a = 0.7, b = 0.3}` is the same as `weights`)."""
    _exclusive(table, "node", "weights")
    key = "node" if isinstance(table.values.get("node"), dict) else "weights"
    weights = table.get(key, NAMED_NUMBERS)
    if weights is None:
        return table.get("node", NAME), {}
    total = sum(weights.values())
    if not weights or min(weights.values()) <= 0:
        raise _refusal(table, key, f"{key} must be numbers above 0, such as {{winding = 0.7, air = 0.3}}.")
    if abs(total - 1) > 1e-6:
        raise _refusal(
            table, key, f"{key} add up to {total:.6g}, but are shares of one channel: make them add up to 1."
        )
    for place in weights:
        TomlTable(table.file, {"node": place}, (*table.path, key), table.lines, table.label).need("node", NAME)
    return None, weights


def _observable(table: TomlTable, quantity: str, node: str | None, weights: Mapping[str, float]) -> None:
    """Refuse an observed channel that says too little, or too much, of what it measures."""
    key = "role"
    if quantity not in OBSERVABLE:
        says = f'{quantity} cannot be observed, only {", ".join(OBSERVABLE)}: write role = "input".'
    elif quantity in _PLACED and not (node or weights):
        says = f"an observed {quantity} needs a node or weights: say {_PLACED[quantity]}."
    elif quantity == "flux" and "slope_per_K" not in table:
        says = "an observed flux needs slope_per_K, such as -0.001: say how it falls as the magnets warm."
    elif quantity == "heat" and not node:
        says = 'an observed heat needs the boundary that takes it, such as node = "coolant".'
    elif quantity == "power" and (node or weights):
        key = "node" if "node" in table else "weights"
        says = "an observed power is that of the whole motor: take it out."
    else:
        return
    raise _refusal(table, key, says)


def _refuse_keys_of_others(table: TomlTable, quantity: str, role: str | None) -> None:
    """Keys of some quantities where they would mean nothing."""
    if "bin_degC" in table and quantity != "dose":
        says = 'bin_degC is of hours that a counter counts: write quantity = "dose", or take it out.'
        raise _refusal(table, "bin_degC", says)
    for key in ("gain_sd", "reference", "reference_degC", "slope_per_K"):
        meters = ("power", "heat", *THERMOMETRIC) if key == "gain_sd" else THERMOMETRIC
        if key in table and not (role == "observed" and quantity in meters):
            of = f"{', '.join(meters[:-1])} or {meters[-1]}"
            raise _refusal(table, key, f'{key} is of an observed {of}: add role = "observed", or take it out.')


def _reference_degC(table: TomlTable) -> float:
    degC = table.get("reference_degC", NUMBER)
    return Channel.reference_degC if degC is None else degC


def _slope(table: TomlTable) -> float | None:
    slope = table.get("slope_per_K", NUMBER)
    if slope == 0.0:
        raise _refusal(table, "slope_per_K", "slope_per_K is 0: then the reading says nothing of a temperature.")
    return slope


def _time(table: TomlTable | None, beside: Sequence[str], untimed: bool) -> TimeSpec:
    """What `[time]`, or that of one format, says; keys `beside` it are read elsewhere."""
    if table is None:
        return TimeSpec(untimed=untimed)
    table.only((*TIME_KEYS, *beside), {**_ABOVE, **_UNDER_TIME})
    _exclusive(table, "column", "rate_hz")
    _exclusive(table, "format", "unit", "rate_hz")
    zone = _zone(table)
    return TimeSpec(
        column=table.get("column", TEXT),
        format=_format(table),
        unit=table.one_of("unit", TIME_UNITS),
        zone=zone,
        rate_hz=table.get("rate_hz", POSITIVE),
        start_ns=_start_ns(table, ZoneInfo(zone)),
        untimed=untimed,
        skip_rows=_skip_rows(table),
        sheet=table.get("sheet", TEXT),
    )


def _skip_rows(table: TomlTable) -> int:
    count = table.get("skip_rows", NOT_NEGATIVE) or 0.0
    if count != int(count):
        raise _refusal(table, "skip_rows", f"skip_rows is a count of lines above the header, not {count:g}.")
    return int(count)


def _zone(table: TomlTable) -> str:
    zone = table.get("zone", TEXT) or TimeSpec.zone
    try:
        ZoneInfo(zone)
    except (KeyError, ValueError, OSError):  # OSError: the name of a folder, "Europe"
        advice = hint(zone, available_timezones()) or " Write it as Europe/Rome."
        raise _refusal(table, "zone", f'zone "{zone}" is no time zone of the IANA list.{advice}') from None
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
        raise _refusal(table, "format", f'format "{text}" is no strptime format. Write it as "%d.%m.%Y %H:%M:%S".')
    return text


def _start_ns(table: TomlTable, zone: ZoneInfo) -> int | None:
    """`start` in nanoseconds UTC; without an offset it is local time of `zone`."""
    start = table.get("start", MOMENT)
    if start is None:
        return None
    if not YEARS[0] <= start.year <= YEARS[1]:
        says = f"start {start} is out of range: it must lie between {YEARS[0]} and {YEARS[1]}."
        raise _refusal(table, "start", says)
    return utc_ns(start if start.tzinfo else start.replace(tzinfo=zone))
