"""DC checks as the sessions hold them: logs as arrays on common stamps, and tables of checks that were evaluated
elsewhere."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ingest.bench.bench_file import read_bench
from ingest.catalogue.channels import ChannelData
from ingest.catalogue.quality import assess
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.specimen.heat_history import HoursByTemperature

if TYPE_CHECKING:
    from duckdb import DuckDBPyConnection

    from analytics.insulation.checks.resistance import CheckTrace

Floats = NDArray[np.float64]

LEAST_STEP_S = 1.0
AMBIENT = "ambient"
AT_ONCE = 10_000  # rows of a table
NO_COUNTERS: Mapping[str, float] = MappingProxyType({})
CURRENTS, VOLTAGES = ("current", "current_dc"), ("voltage", "voltage_dc")


@dataclass(frozen=True, slots=True)
class Evaluated:
    """A row of a table: thermal resistance [K/W], dose [h] and ageing temperature [degC], None where it has none.
    `counted`: hours since the motor was made, by temperature, where a vehicle's counters give them; `counters`: what
    else was counted until then, by channel. `t_ns` is None without absolute time."""

    session: str
    t_ns: int | None
    resistance_K_per_W: float | None
    dose_h: float | None
    degC: float | None
    counted: HoursByTemperature | None
    counters: Mapping[str, float] = field(default_factory=lambda: NO_COUNTERS)


def evaluated(store: Store, facts: Facts, as_of: str | None) -> list[Evaluated]:
    """Every row that holds a thermal resistance, a dose or counted hours, in the order of its file."""
    from analytics import warehouse

    bins = {session.session: session.bench for session in facts.sessions}
    of_bench = {sha: _bins(store, facts, sha) for sha in set(bins.values()) if sha}
    ids = sorted(bins)  # numbers stand for them: of the rows of a fleet each would hold its own copy of a text
    found = []
    with warehouse.refresh(store, as_of) as opened:
        opened.needs("samples")
        rows = opened.connection.execute(
            """
            WITH named AS (SELECT session, start, row_number() OVER (ORDER BY session) - 1 AS place FROM sessions),
            filed AS (SELECT file_id, row_number() OVER (ORDER BY file_id) AS place FROM files)
            SELECT s.place, CASE WHEN s.start IS NOT NULL THEN any_value(v.t_ns) END,
                any_value(v.value) FILTER (WHERE v.quantity = 'thermal_resistance') AS resistance,
                max(v.value) FILTER (WHERE v.quantity = 'temperature'),
                list(v.channel) FILTER (WHERE v.quantity = 'dose'),
                list(v.value) FILTER (WHERE v.quantity = 'dose'),
                list(v.channel) FILTER (WHERE v.quantity = 'counter'),
                list(v.value) FILTER (WHERE v.quantity = 'counter')
            FROM samples AS v
            JOIN named AS s ON s.session = v.session
            JOIN filed AS f ON f.file_id = v.file_id
            WHERE v.quantity IN ('thermal_resistance', 'dose', 'temperature', 'counter') AND v.session IN (
                SELECT session FROM channels WHERE quantity IN ('thermal_resistance', 'dose') AND role <> 'ignored'
            ) AND (v.session, v.channel) NOT IN (
                SELECT (session, channel) FROM channels WHERE quantity = 'counter' AND role = 'ignored'
            )
            GROUP BY s.place, f.place, v.record, s.start
            ORDER BY f.place, v.record
            """
        )
        for place, t_ns, resistance, degC, channels, values, counters, counts in _each(rows):
            session = ids[place]
            binned = of_bench.get(bins[session] or "", {})
            hours = dict(zip(channels or (), values or (), strict=True))
            dose = next((value for name, value in hours.items() if name not in binned), None)
            counted = _heat({binned[name]: value for name, value in hours.items() if name in binned})
            if resistance is not None or dose is not None or counted is not None:
                others = dict(zip(counters, counts, strict=True)) if counters else NO_COUNTERS
                found.append(Evaluated(session, t_ns, resistance, dose, degC, counted, others))
    return found


def _each(rows: DuckDBPyConnection) -> Iterator[tuple[Any, ...]]:
    """The rows of an answer, of which only so many are in memory."""
    while some := rows.fetchmany(AT_ONCE):
        yield from some


def _bins(store: Store, facts: Facts, bench: str) -> Mapping[str, tuple[float, float]]:
    """Channel -> between which temperatures [degC] it counts hours."""
    read = read_bench(store.archive.read(bench), facts.benches[bench].name)
    return {channel.name: channel.bin_degC for channel in read.channels if channel.bin_degC}


def _heat(bins: Mapping[tuple[float, float], float]) -> HoursByTemperature | None:
    """Hours spread evenly over each bin, in parts of 1 K at most: an hour at its upper end is worth more than one at
    its lower."""
    if not bins:
        return None
    degC, hours = [], []
    for (low, high), total in bins.items():
        parts = math.ceil(high - low)
        degC.append(low + (np.arange(parts) + 0.5) * (high - low) / parts)
        hours.append(np.full(parts, total / parts))
    return HoursByTemperature(np.concatenate(degC), np.concatenate(hours))


def trace_of(channels: Sequence[ChannelData]) -> CheckTrace:
    """The log of a DC check on common stamps: means over steps of the slowest temperature channel's interval, at
    least 1 s.

    Held, stuck and saturated samples are left out; NaN where a step has no sample. Power is its own channel, else
    voltage times current; of several of a quantity the one with the largest mean.
    """
    from analytics.insulation.checks.resistance import CheckTrace

    used = [channel for channel in channels if channel.spec.role != "ignored" and len(channel.t_ns)]
    good = {id(channel): quality.good for channel, quality in zip(used, assess(used), strict=True)}
    temperatures = [channel for channel in used if channel.spec.quantity == "temperature"]
    copper = [channel for channel in temperatures if channel.spec.region == "copper"]
    iron = [channel for channel in temperatures if channel.spec.region == "iron"]
    ambient = [channel for channel in temperatures if channel.spec.node == AMBIENT]
    power, current = _largest(used, ("power",)), _largest(used, CURRENTS)
    voltage = _largest(used, VOLTAGES)
    load = [channel for channel in (power, current, voltage) if channel]
    every = [*temperatures, *load]
    start = min((int(channel.t_ns[0]) for channel in every), default=0)
    end = max((int(channel.t_ns[-1]) for channel in every), default=0)
    step_s = max([LEAST_STEP_S, *(channel.median_ns / 1e9 for channel in [*copper, *iron])])
    steps = int((end - start) / 1e9 // step_s) + 1

    def means(channel: ChannelData) -> Floats:
        at = ((channel.t_ns - start) / 1e9 // step_s).astype(np.int64)
        kept = good[id(channel)]
        count = np.bincount(at[kept], minlength=steps)
        total = np.bincount(at[kept], channel.value[kept], minlength=steps)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    def side_by_side(some: Iterable[ChannelData]) -> Floats:
        columns = [means(channel) for channel in some]
        return np.stack(columns, axis=1) if columns else np.empty((steps, 0))

    nothing = np.full(steps, np.nan)
    amperes = np.abs(means(current)) if current else nothing
    watts = means(power) if power else amperes * np.abs(means(voltage)) if voltage else nothing
    return CheckTrace(
        t_s=np.asarray((np.arange(steps) + 0.5) * step_s, np.float64),
        copper_degC=side_by_side(copper),
        copper_names=tuple(channel.spec.name for channel in copper),
        iron_degC=side_by_side(iron),
        iron_names=tuple(channel.spec.name for channel in iron),
        ambient_degC=side_by_side(ambient),
        power_W=watts,
        current_A=amperes if current else None,
    )


def _largest(channels: Iterable[ChannelData], quantities: Sequence[str]) -> ChannelData | None:
    found = [channel for channel in channels if channel.spec.quantity in quantities]
    return max(found, key=lambda channel: float(np.abs(channel.value).mean()), default=None)
