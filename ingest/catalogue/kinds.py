"""What kind of test a session was, told from its channels, with one sentence why.

The test kinds: `wltp` follows the WLTC trace; `s1` holds speed and load towards thermal equilibrium; `s2` is short
pulses of load; `drive` any other changing speed; `dc_check` current at standstill; `insulation_check` electrical
values of the insulation; `ageing` heat without either; `other` all else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData, current, each_second, find
from ingest.catalogue.quality import seconds

INSULATION = ("insulation_resistance", "polarisation_index", "tan_delta", "capacitance", "inception_voltage")
STANDSTILL_rpm = 5.0
SPREAD_rpm = 50.0  # less is noise of a motor that creeps
OVEN_degC = 100.0  # no bench room is as warm
CURRENT_A = 1.0  # less is offset of a probe
S1_s = 900  # constant for this long; the time constants of stator and winding are 60 to 850 s
YEAR_s = 365 * 86_400  # no log goes on for longer second by second
LONGEST_s = 4_000_000  # of a drive: what a session was is told from its first 46 days; memory holds no more
SMOOTH_s = 10  # constancy is looked at in means of this
SPEED_CONSTANT, LOAD_CONSTANT, LOADED = 0.03, 0.10, 0.20  # shares of the largest speed, load, load
PULSE_s, PULSES = (5, 120), 3  # length of a pulse, and how many make an S2
SECOND_NS = 1_000_000_000
WLTC_MATCH = 0.90  # correlation from which a speed is the trace; an FTP-75 reaches 0.4
WLTC_TAIL_s = 100  # of the trace's end that a log may lack

NO_DRIVE = ("dc_check", "insulation_check", "ageing")  # of a session that does not run the whole motor
EVALUATED = ("dc_check", "holds thermal resistances that were evaluated elsewhere")

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class _Trace:
    """|speed| [rpm] and |load| each second (N,) from `begin_ns` on; `load` in `unit`. `measured` (N,): False in a gap,
    which holds the values before it."""

    speed: Array
    load: Array
    unit: str
    measured: Bools
    begin_ns: int

    @property
    def top_speed(self) -> float:
        return max(float(np.quantile(self.speed, 0.995)), 1e-9)

    @property
    def top_load(self) -> float:
        return max(float(np.quantile(self.load, 0.995)), 1e-9)


def recognise(channels: Sequence[ChannelData]) -> tuple[str, str]:
    """(kind, why) of the session that holds these channels. The first rule that fits decides."""
    quantities = {channel.spec.quantity for channel in channels}
    if checked := [name for name in INSULATION if name in quantities]:
        return "insulation_check", f"holds {', '.join(name.replace('_', ' ') for name in checked)}"
    if "thermal_resistance" in quantities:
        return EVALUATED
    if not any(quantities):
        return "other", "nothing says what its signals mean: give it a bench file that does"
    if (years := _span_s(channels) / YEAR_s) > 1:
        return "other", f"its stamps span {years:,.0f} years: a clock was set within it, or several logs are one file"
    speed = find(channels, "speed")
    if speed is None or float(np.abs(speed.value).max()) < STANDSTILL_rpm:
        return _at_standstill(channels, "no speed is recorded" if speed is None else "nothing turns")
    trace = _traced(channels, speed)
    return _wltp(trace) or _s2(trace) or _s1(trace) or _drive(trace)


def repeats(channels: Sequence[ChannelData]) -> list[tuple[int, int]]:
    """(begin, end) [ns] of what a session repeats: each pass of the WLTC, else each pulse of load at constant speed
    with the rest behind it, where there are three and more; none of a session that repeats neither."""
    speed = find(channels, "speed")
    if speed is None:
        return []
    trace = _traced(channels, speed)
    begins = wltc_passes(trace.speed)[0]
    most = len(wltc()) if begins else len(trace.speed)
    if not begins and len(pulses := _pulses(trace)) >= PULSES:
        begins = [begin for begin, _ in pulses]
    spans = [(a, min(a + most, b)) for a, b in pairwise([*begins, len(trace.speed)])]
    return [(trace.begin_ns + a * SECOND_NS, trace.begin_ns + b * SECOND_NS) for a, b in spans]


def _traced(channels: Sequence[ChannelData], speed: ChannelData) -> _Trace:
    load = find(channels, "torque") or current(channels)
    used = _begun([speed, load] if load else [speed])
    (n, *m), measured = each_second(used)
    amount, unit = np.abs(m[0]) if load else np.zeros_like(n), "Nm" if find(channels, "torque") else "A"
    return _Trace(np.abs(n), amount, unit, measured, min(int(one.t_ns[0]) for one in used))


def _span_s(channels: Sequence[ChannelData]) -> float:
    there = [channel.t_ns for channel in channels if len(channel.t_ns)]
    return (max(int(t[-1]) for t in there) - min(int(t[0]) for t in there)) / 1e9 if there else 0.0


def _block_s(channels: Sequence[ChannelData]) -> int:
    """Seconds, of which there are few enough for memory."""
    return 1 + int(_span_s(channels) / LONGEST_s)


def _begun(channels: Sequence[ChannelData]) -> list[ChannelData]:
    """The channels up to LONGEST_s after the last of them began."""
    end_ns = max(int(one.t_ns[0]) for one in channels) + LONGEST_s * SECOND_NS
    return [one.samples(slice(int(np.searchsorted(one.t_ns, end_ns)))) for one in channels]


@lru_cache(maxsize=1)
def wltc() -> Array:
    """Speed of the WLTC class 3b [km/h], 1 Hz, (1801,). Source: UN GTR 15, Annex 1."""
    text = (files("ingest.catalogue") / "wltc_class3b.txt").read_text("ascii")
    return np.array([float(word) for line in text.splitlines() if not line.startswith("#") for word in line.split()])


def _at_standstill(channels: Sequence[ChannelData], why: str) -> tuple[str, str]:
    flows = current(channels) or find(channels, "current_dc")
    if flows is not None:
        block_s = _block_s([flows])
        (amps,), measured = each_second([flows], block_s)
        on = measured & (np.abs(amps) > max(CURRENT_A, 0.5 * float(np.quantile(np.abs(amps), 0.995))))
        if on.any():
            return "dc_check", f"{np.median(np.abs(amps[on])):.0f} A for {seconds(on.sum() * block_s)}, and {why}"
    temperatures = [channel for channel in channels if channel.spec.quantity == "temperature"]
    if not temperatures:
        return "other", f"{why}, and neither current nor temperature is recorded"
    hottest = max(temperatures, key=lambda channel: float(channel.value.max()))
    peak = float(hottest.value.max())
    oven = [channel for channel in temperatures if (channel.spec.node or channel.spec.name).startswith("oven")]
    if oven or peak >= OVEN_degC:
        block_s = _block_s([hottest])
        (hot,), measured = each_second([hottest], block_s)
        return (
            "ageing",
            f"{seconds((measured & (hot > peak - 10)).sum() * block_s)} within 10 K of {peak:.0f} °C, and {why}",
        )
    return "other", f"temperatures only, none above {peak:.0f} °C, and {why}"


def _wltp(trace: _Trace) -> tuple[str, str] | None:
    passes, share = wltc_passes(trace.speed)
    times = f"{len(passes)} times" if len(passes) > 1 else "once"
    return ("wltp", f"speed follows {100 * share:.0f} % of the WLTC class 3b trace, {times}") if passes else None


def wltc_passes(speed: Array) -> tuple[list[int], float]:
    """At which seconds of a speed (N,) each second passes of the WLTC begin, whole but for its tail, and which share of
    the trace's seconds it follows in them: normalised cross-correlation of speed and trace, at every second."""
    cycle = wltc()
    if len(speed) < len(cycle) - WLTC_TAIL_s:
        return [], 0.0
    match = _correlation(speed, cycle[:-WLTC_TAIL_s])
    passes: list[int] = []
    while (best := int(match.argmax())) >= 0 and match[best] >= WLTC_MATCH:
        passes.append(best)
        match[max(best - len(cycle) + 60, 0) : best + len(cycle) - 60] = -1.0
    shares = [_followed(speed[start : start + len(cycle)], cycle) for start in passes]
    return sorted(passes), float(np.mean(shares)) if shares else 0.0


def _correlation(speed: Array, cycle: Array) -> Array:
    """Pearson's r of `cycle` (M,) with every window of `speed` (N,): (N - M + 1,); 0 where the speed is constant."""
    size = len(cycle)
    sums = [np.cumsum(np.r_[0.0, power]) for power in (speed, speed**2)]
    mean, square = ((total[size:] - total[:-size]) / size for total in sums)
    spread = np.sqrt(np.maximum(square - mean**2, 0.0))
    product = np.correlate(speed, cycle - cycle.mean(), mode="valid")
    return np.where(spread > 1e-6, product / (size * cycle.std() * np.maximum(spread, 1e-6)), 0.0)


def _followed(speed: Array, cycle: Array) -> float:
    """Share of the trace's seconds that the speed, by one gear ratio, follows within 5 % of the trace's top speed."""
    there = cycle[: len(speed)]
    scaled = speed * float(speed @ there) / float(speed @ speed)
    return float(np.sum(np.abs(scaled - there) <= 0.05 * cycle.max())) / len(cycle)


def _s2(trace: _Trace) -> tuple[str, str] | None:
    """At least 3 flat pulses of load at constant speed, that make up most of the loaded time."""
    high, flat = _high(trace), _pulses(trace)
    if len(flat) < PULSES or sum(b - a for a, b in flat) < 0.7 * high.sum() or high.sum() > 0.6 * trace.measured.sum():
        return None
    lengths = [b - a for a, b in flat]
    level, speed = (np.median([np.median(values[a:b]) for a, b in flat]) for values in (trace.load, trace.speed))
    between = f"{min(lengths)} to {max(lengths)} s" if min(lengths) < max(lengths) else f"{lengths[0]} s"
    return (
        "s2",
        f"{len(flat)} pulses of {between} at about {level:.0f} {trace.unit} and {speed:,.0f} rpm, with rests between",
    )


def _high(trace: _Trace) -> Bools:
    """The seconds (N,) with more than half of the highest load."""
    return trace.measured & (trace.load > 0.5 * trace.top_load)


def _pulses(trace: _Trace) -> list[tuple[int, int]]:
    """(first second, one past the last) of each pulse of load at constant speed."""
    return [(a, b) for a, b in _runs(_high(trace)) if PULSE_s[0] <= b - a <= PULSE_s[1] and _flat(trace, a, b)]


def _flat(trace: _Trace, start: int, end: int) -> bool:
    """Whether speed and load are constant inside a pulse, its first and last second apart."""
    inner = slice(start + 1, end - 1)
    return bool(
        np.ptp(trace.speed[inner]) <= 2 * SPEED_CONSTANT * trace.top_speed
        and np.ptp(trace.load[inner]) <= 2 * LOAD_CONSTANT * trace.top_load
    )


def _s1(trace: _Trace) -> tuple[str, str] | None:
    """Speed and load constant for 15 min and more at a time, for most of the time that the motor is loaded.

    No hold goes on over a gap: nobody knows what the motor did meanwhile.
    """
    if len(trace.speed) < S1_s + SMOOTH_s:
        return None
    speed, load = (
        np.convolve(values, np.full(SMOOTH_s, 1 / SMOOTH_s), "valid") for values in (trace.speed, trace.load)
    )
    measured = sliding_window_view(trace.measured, SMOOTH_s).all(axis=1)
    n, m = sliding_window_view(speed, S1_s), sliding_window_view(load, S1_s)
    constant = (
        (np.ptp(n, axis=1) <= SPEED_CONSTANT * trace.top_speed)
        & (np.ptp(m, axis=1) <= LOAD_CONSTANT * trace.top_load)
        & (n.min(axis=1) > STANDSTILL_rpm)
        & (m.min(axis=1) > LOADED * trace.top_load)
        & sliding_window_view(measured, S1_s).all(axis=1)
    )
    held = np.convolve(constant, np.ones(S1_s)) > 0.5  # every second of a window that is constant
    loaded = measured & (load > LOADED * trace.top_load)
    if not held.any() or held.sum() < 0.5 * loaded.sum():
        return None
    runs = _runs(held)
    a, b = max(runs, key=lambda run: run[1] - run[0])
    more = f"; {len(runs)} such points" if len(runs) > 1 else ""
    where = f"{np.median(speed[a:b]):,.0f} rpm and {np.median(load[a:b]):.0f} {trace.unit}"
    return "s1", f"{where} held for {seconds(b - a)}{more}"


def _drive(trace: _Trace) -> tuple[str, str]:
    turning = trace.speed[trace.measured & (trace.speed > STANDSTILL_rpm)]
    if not turning.size:
        return "other", "speed and load are at no time recorded together while the motor turns"
    low, high = np.quantile(turning, (0.05, 0.95))
    if high - low > max(2 * SPEED_CONSTANT * trace.top_speed, SPREAD_rpm):
        return "drive", f"speed varies, {low:,.0f} to {high:,.0f} rpm for 90 % of {seconds(len(turning))} turning"
    held = f"held for {S1_s // 60} min while it turns nor in pulses of {PULSE_s[0]} to {PULSE_s[1]} s"
    return "other", f"constant speed ({np.median(turning):,.0f} rpm), most of the load neither {held}"


def _runs(flags: Bools) -> list[tuple[int, int]]:
    """(first index, one past the last) of each run of True."""
    edges = np.flatnonzero(np.diff(np.r_[False, flags, False])).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))
