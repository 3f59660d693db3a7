"""Thermal cycles cut from a temperature trace itself, and its hours by temperature.

Between two samples the temperature is a straight line, so that a step that crosses a temperature counts in part on
either side. Steps of more than `GAP_MEDIANS` median steps are gaps: what happened in them is not known, they count
nowhere and are said. Samples that are NaN are as if they were not there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analytics.insulation.arrays import Flags, Floats
from analytics.insulation.dose.arrhenius import THRESHOLD_DEGC

GAP_MEDIANS = 10.0
RISEN_K = 2.0  # a cycle has to exceed the threshold by this: noise at the threshold is no cycle
FALLEN_K = 20.0  # and ends where the trace is this far below: an opened door is no new cycle
SOAK_SHARE, SOAK_LEAST_K = 0.02, 2.0  # of the rise: how near the soak's level the soak is
FOOT_SHARE = 0.02  # of the rise from the lowest before or after: above it heating has begun, below it cooling is over
PAUSE_SHARE = 0.1  # of the rise: a log that begins again below it has not missed the heating
LEVEL_K = 1e-6  # a step smaller than this is level
HOUR_S = 3600.0
RATE_S = 300.0  # over which a rate is a mean: IEC 60068-2-14, test Nb, and noise of a sample is no shock


@dataclass(frozen=True)
class Cycle:
    """One stay above the threshold, times [s] as in the trace.

    `heating_from_s`: when the trace leaves its lowest since the cycle before or the log's begin (None: it begins above
    the threshold); `soak_from_s`, `soak_to_s`: first and last moment near the soak's level, which is the median over
    the time above the threshold; `cooling_to_s`: when the trace is at its lowest before the next cycle or the log's end
    (None: it ends above the threshold). `soak_degC`: mean over the soak; `hours_above` the threshold [h], as far as
    known; of these
    times `unknown_h` [h] are in gaps. `swing_K`: highest minus the lowest about it [K]; `heating_K_per_min` and
    `cooling_K_per_min`: the fastest mean over 5 min of each [K/min], None where the trace does not hold it.
    """

    heating_from_s: float | None
    soak_from_s: float
    soak_to_s: float
    cooling_to_s: float | None
    highest_degC: float
    soak_degC: float
    hours_above: float
    unknown_h: float
    swing_K: float
    heating_K_per_min: float | None
    cooling_K_per_min: float | None


@dataclass(frozen=True)
class Histogram:
    """Hours by temperature, gaps left out: `hours` (B,) [h] between neighbours of `edges_degC` (B + 1,) [degC]."""

    edges_degC: Floats
    hours: Floats

    @property
    def centres_degC(self) -> Floats:
        """Middles of the bins (B,) [degC]; with `hours` the arguments of `arrhenius.equivalent_hours`."""
        return (self.edges_degC[1:] + self.edges_degC[:-1]) / 2.0


@dataclass(frozen=True)
class _Trace:
    """Finite samples, time rising; `known` (N - 1,) which steps are no gaps."""

    t_s: Floats
    value: Floats
    known: Flags

    def between(self, first: int, last: int) -> _Trace:
        return _Trace(self.t_s[first : last + 1], self.value[first : last + 1], self.known[first:last])

    @property
    def unknown_h(self) -> float:
        """Hours in gaps."""
        return float(np.diff(self.t_s)[~self.known].sum() / HOUR_S)


def cycles(t_s: Floats, value_degC: Floats, threshold_degC: float = THRESHOLD_DEGC) -> tuple[Cycle, ...]:
    """The cycles of a trace, in order: `t_s` (N,) [s] not falling, `value_degC` (N,) [degC], NaN where missing.

    A cycle exceeds the threshold by 2 K and ends 20 K below it, so hours of a trace that stays within these belong to
    none: the dose of a log is `hours_above` of the whole trace. ValueError where the time falls or the shapes differ.
    """
    trace = _clean(t_s, value_degC)
    stays = _stays(trace.value, threshold_degC)
    after = [0, *(last for _, last in stays)]
    before = [*(first for first, _ in stays[1:]), trace.value.size - 1]
    return tuple(_cycle(trace, *stay, after[k], before[k], threshold_degC) for k, stay in enumerate(stays))


def hours_above(t_s: Floats, value_degC: Floats, degC: float = THRESHOLD_DEGC) -> float:
    """Hours [h] of a trace above `degC`, gaps left out; arguments as in `cycles`."""
    return _hours_above(_clean(t_s, value_degC), degC)


def histogram(t_s: Floats, value_degC: Floats, width_K: float = 0.1) -> Histogram:
    """Hours of a trace by temperature, each within half of `width_K` [K] of a multiple of it; arguments as in `cycles`.

    Equivalent hours under any rule are one sum over it, `arrhenius.equivalent_hours(h.centres_degC, h.hours, ...)`.
    The centres, not the edges, are the multiples, as a logger's rounded samples then lie at the centres.
    """
    trace = _clean(t_s, value_degC)
    if not trace.value.size:
        return Histogram(np.zeros(1), np.zeros(0))
    lowest, highest = np.round(trace.value.min() / width_K), np.round(trace.value.max() / width_K)
    edges = (np.arange(lowest - 1.0, highest + 0.5) + 0.5) * width_K
    return Histogram(edges, np.maximum(np.diff(_hours_below(trace, edges)), 0.0))


def _clean(t_s: Floats, value: Floats) -> _Trace:
    t, v = np.asarray(t_s, np.float64), np.asarray(value, np.float64)
    if t.shape != v.shape or t.ndim != 1:
        raise ValueError(f"a trace of {t.shape} times has {v.shape} temperatures: give one temperature a time")
    there = np.isfinite(t) & np.isfinite(v)
    t, v = t[there], v[there]
    steps = np.diff(t)
    if np.any(steps < 0.0):
        raise ValueError(f"time falls after {t[int(np.argmax(steps < 0.0))]:g} s: sort the samples by time")
    longest = GAP_MEDIANS * float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    return _Trace(t, v, steps <= longest)


def _hours_below(trace: _Trace, degC: Floats) -> Floats:
    """Hours below each of `degC` (B,), rising: the sum over steps of dt clip((degC - low) / (high - low), 0, 1), as
    sums over the steps that are wholly below and those that are partly, sorted once."""
    seconds = np.diff(trace.t_s)[trace.known]
    low = np.minimum(trace.value[:-1], trace.value[1:])[trace.known]
    high = np.maximum(trace.value[:-1], trace.value[1:])[trace.known]
    level = high - low < LEVEL_K
    rate = np.where(level, 0.0, seconds / np.where(level, 1.0, high - low))

    def up_to(knots: Floats, amounts: Floats) -> Floats:
        order = np.argsort(knots)
        summed = np.concatenate([[0.0], np.cumsum(amounts[order])])
        return np.asarray(summed[np.searchsorted(knots[order], degC, side="right")])

    whole = up_to(high, seconds)
    slope = up_to(low, rate) - up_to(high, rate)
    offset = up_to(low, rate * low) - up_to(high, rate * low)
    partly = np.where(np.isfinite(degC), slope * np.where(np.isfinite(degC), degC, 0.0) - offset, 0.0)
    return (whole + partly) / HOUR_S


def _hours_above(trace: _Trace, degC: float) -> float:
    if trace.value.max(initial=-np.inf) <= degC:
        return 0.0  # exactly: what a difference of sums leaves is no dose
    whole, below = _hours_below(trace, np.array([np.inf, degC]))
    return max(0.0, float(whole - below))


def _stays(value: Floats, threshold: float) -> list[tuple[int, int]]:
    """First and last sample above the threshold of every stay; Schmitt trigger."""
    state = np.where(value > threshold + RISEN_K, 1, np.where(value < threshold - FALLEN_K, -1, 0))
    told = np.flatnonzero(state)
    if not told.size:
        return []
    changes = told[np.concatenate([[True], np.diff(state[told]) != 0])]
    above = np.flatnonzero(value > threshold)
    stays = []
    for begin, end in zip(changes, [*changes[1:], value.size], strict=True):
        if state[begin] > 0:
            since = int(np.max(np.flatnonzero(value[:begin] <= threshold), initial=-1)) + 1
            stays.append((since, int(above[np.searchsorted(above, end) - 1])))
    return stays


def _cycle(trace: _Trace, first: int, last: int, after: int, before: int, threshold: float) -> Cycle:
    """The cycle of the stay from sample `first` to `last`; the stay before it ends at `after`, the one behind it
    begins at `before`."""
    t, value = trace.t_s, trace.value
    level = _median_over_time(t[first : last + 1], value[first : last + 1])
    heating, cooling = value[after:first], value[last + 1 : before + 1]
    left = after + int(np.flatnonzero(_at_foot(heating, level))[-1]) if heating.size else None
    if left is not None:
        left = _after_a_pause(trace, left, first, level)
    cooled = last + 1 + int(np.flatnonzero(_at_foot(cooling, level))[0]) if cooling.size else None
    if cooled is not None:
        cooled = _before_a_pause(trace, last, cooled, level)
    lowest = min(value[0 if left is None else left], value[-1 if cooled is None else cooled], threshold)
    near = first + np.flatnonzero(value[first : last + 1] >= level - max(SOAK_SHARE * (level - lowest), SOAK_LEAST_K))
    part = trace.between(first if left is None else left, last if cooled is None else cooled)
    rates = _rates(part)
    return Cycle(
        heating_from_s=None if left is None else float(t[left]),
        soak_from_s=float(t[near[0]]),
        soak_to_s=float(t[near[-1]]),
        cooling_to_s=None if cooled is None else float(t[cooled]),
        highest_degC=float(value[first : last + 1].max()),
        soak_degC=_mean_over_time(trace.between(int(near[0]), int(near[-1]))),
        hours_above=_hours_above(part, threshold),
        unknown_h=part.unknown_h,
        swing_K=float(value[first : last + 1].max() - value[after : before + 1].min()),
        heating_K_per_min=None if left is None or not rates.size else float(rates.max()),
        cooling_K_per_min=None if cooled is None or not rates.size else float(-rates.min()),
    )


def _rates(trace: _Trace) -> Floats:
    """Mean rates [K/min] from each sample on over `RATE_S`: over one step where that is longer, over the whole trace
    where that is shorter. Those across a gap are left out."""
    t = trace.t_s
    if t.size < 2:
        return np.empty(0)
    span = min(max(RATE_S, float(np.median(np.diff(t)))), float(t[-1] - t[0]))
    begins = t[t + span <= t[-1]]
    gaps = np.concatenate([[0], np.cumsum(~trace.known)])
    whole = gaps[np.searchsorted(t, begins + span)] == gaps[: begins.size]
    change = np.interp(begins + span, t, trace.value) - trace.value[: begins.size]
    return np.asarray(change[whole] / span * 60.0)


def _after_a_pause(trace: _Trace, left: int, first: int, level: float) -> int:
    """Where heating begins if the log paused at the foot: the first sample after the gap, where that is still near
    the foot."""
    gaps = left + 1 + np.flatnonzero(~trace.known[left:first])
    foot = trace.value[left]
    near = gaps[trace.value[gaps] < foot + PAUSE_SHARE * (level - foot)]
    return int(near[-1]) if near.size else left


def _before_a_pause(trace: _Trace, last: int, cooled: int, level: float) -> int:
    """Where cooling ends if the log paused at the foot: the last sample before the gap, where that is near the foot."""
    gaps = last + np.flatnonzero(~trace.known[last:cooled])
    foot = trace.value[cooled]
    near = gaps[trace.value[gaps] < foot + PAUSE_SHARE * (level - foot)]
    return int(near[0]) if near.size else cooled


def _at_foot(value: Floats, level: float) -> Flags:
    """Which samples are as low as this stretch gets, to a share of its rise to `level`."""
    lowest = value.min()
    return np.asarray(value <= lowest + FOOT_SHARE * (level - lowest))


def _median_over_time(t_s: Floats, value: Floats) -> float:
    """Median of the samples, each weighed by the time around it, at most that of a gap."""
    if value.size < 2:
        return float(value[0])
    step = np.minimum(np.diff(t_s), GAP_MEDIANS * float(np.median(np.diff(t_s))))
    weight = np.concatenate([step[:1], step[:-1] + step[1:], step[-1:]])
    return float(np.quantile(value, 0.5, weights=weight, method="inverted_cdf"))


def _mean_over_time(trace: _Trace) -> float:
    seconds = np.diff(trace.t_s)[trace.known]
    if not seconds.sum() > 0.0:
        return float(trace.value.mean())
    middle = ((trace.value[1:] + trace.value[:-1]) / 2.0)[trace.known]
    return float(np.average(middle, weights=seconds))
