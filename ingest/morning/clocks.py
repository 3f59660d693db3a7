"""By how much the clock of one logger is late against another's: offset and drift, from what both recorded.

Both loggers saw one thing: the same quantity, or two that go with each other at once, as torque with current. It is
looked at where the slower one has samples, and what is slower than a minute is taken off. A cross-correlation of all of
it finds the lag, in each of many segments a least-squares fit finds it to a part of an interval,

    y(t) = b x(t - lag) + noise,   lag <- lag + g / b   of   y = b x(t - lag) + g dx(t - lag)/dlag,

and a weighted line through these lags is offset and drift. What they are known to comes from how the segments scatter
about the line (with Student's t of so few), and from what nobody knows of an interval: whether its value is one of its
beginning, end or mean. Where the lag is not unmistakable there is no answer, and a reason instead.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.optimize import brentq
from scipy.signal import correlate, correlation_lags
from scipy.stats import t as student

from ingest.catalogue.channels import ChannelData

LOADS = ("torque", "current", "current_q", "current_dc", "power")  # these go with each other within milliseconds
LEAST_s = 300.0  # that both must have run at once
FASTEST_s = 0.05  # the interval that lags are looked for in; CAN loggers are no faster than jitter allows
MOST_STEPS = 100_000
SLOW_s = 60.0  # what changes more slowly says nothing of the lag
FURTHEST_s = 600.0  # of a lag, and a quarter of the common time
CLEAR = 0.6  # correlation from which two channels show one thing
STILL = 1e-6  # of all that a channel moves: by less it does not move where both lie over one another
RIVAL = 0.8  # of the correlation at the lag, that one elsewhere may reach
APART_s = 10.0  # from the lag, that a segment may be: 100 ppm in a day
SEGMENTS, FEWEST = (8, 40), 6  # that the time is cut into, and that must tell
OF_ONE = 20  # samples of the slower logger in a segment at least
ROUNDS = 6
FAR = 4.0  # standard deviations beyond which a segment is left out
LEFT_OUT = 0.25  # of the segments, at most
INTERPOLATED = 0.03  # of an interval of the faster logger: by so much what lies between its samples may move a lag

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ClockOffset:
    """The stamps of `clock` are late by `offset_s` against those of `reference`, at `at_ns` of the reference, and by
    `drift_ppm` more as time goes by; `sd` are standard deviations. `by`: the channels, of the reference first."""

    reference: str
    clock: str
    by: tuple[str, str]
    at_ns: int
    offset_s: float
    offset_sd_s: float
    drift_ppm: float
    drift_sd_ppm: float
    correlation: float


class CannotTellError(Exception):
    """Why two channels do not tell a lag."""


def align(x: ChannelData, y: ChannelData, names: tuple[str, str] = ("", "")) -> ClockOffset:
    """The clock that stamped `y` against that of `x`. Raises CannotTellError with the reason."""
    start, end = max(int(x.t_ns[0]), int(y.t_ns[0])), min(int(x.t_ns[-1]), int(y.t_ns[-1]))
    span = (end - start) / 1e9
    if span < LEAST_s:
        raise CannotTellError(f"both ran at once for {max(span, 0.0):.0f} s only")
    fast, slow = sorted((x, y), key=lambda one: one.median_ns)
    step = max(slow.median_ns / 1e9, FASTEST_s, span / MOST_STEPS)
    of_fast, of_slow = _course(fast, start, step), _course(slow, start, step)
    t = np.arange(0.0, span, step)
    coarse, clear = _coarse(_moving(of_fast(t)[0], step), _moving(of_slow(t)[0], step), step)
    common = t[(t >= max(coarse, 0.0)) & (t <= span + min(coarse, 0.0))]
    middles, lags, sds = _segments(of_fast, of_slow, common, coarse, step)
    offset, drift, covariance = _line(middles - span / 2, lags, sds, step)
    turned = 1 if slow is y else -1
    interval = slow.median_ns / 1e9 / np.sqrt(12.0), INTERPOLATED * fast.median_ns / 1e9 / span
    return ClockOffset(
        reference=names[0],
        clock=names[1],
        by=(x.spec.name, y.spec.name),
        at_ns=start + int(span / 2 * 1e9),
        offset_s=turned * offset,
        offset_sd_s=float(np.hypot(np.sqrt(covariance[0, 0]), interval[0])),
        drift_ppm=1e6 * turned * drift,
        drift_sd_ppm=float(1e6 * np.hypot(np.sqrt(covariance[1, 1]), interval[1])),
        correlation=clear,
    )


@dataclass(frozen=True, eq=False)
class _Course:
    """A channel over time: samples `value` (K,) at `t` (K,) [s], their integral `area`, and the `step` [s] of means."""

    t: Array
    value: Array
    area: Array
    step: float

    def __call__(self, at: Array) -> tuple[Array, Array]:
        """Means over a step about these times (N,), and how they change as the lag grows (N,)."""
        after, before = at + self.step / 2, at - self.step / 2
        slope = -(np.interp(after, self.t, self.value) - np.interp(before, self.t, self.value)) / self.step
        return (self._integral(after) - self._integral(before)) / self.step, slope

    def _integral(self, at: Array) -> Array:
        """Up to `at`, of the straight lines between samples; beyond the ends they go on as they are there."""
        k = np.clip(np.searchsorted(self.t, at, side="right") - 1, 0, len(self.t) - 2)
        here = np.interp(at, self.t, self.value)
        return np.asarray(self.area[k] + (at - self.t[k]) * (self.value[k] + here) / 2)

    def samples(self, first: float, last: float) -> tuple[Array, Array]:
        """Times and values: as they were recorded, or means where there are more than a sample a step."""
        inside = slice(*np.searchsorted(self.t, [first, last]).tolist())
        t = self.t[inside]
        if len(t) <= 1.2 * (last - first) / self.step:
            return t, self.value[inside]
        t = np.arange(first, last, self.step)
        return t, self(t)[0]


def _course(one: ChannelData, start_ns: int, step: float) -> _Course:
    """A channel from its stamps since `start_ns`, about its median; loads without their sign."""
    t, first = np.unique((one.t_ns - start_ns) / 1e9, return_index=True)
    value = np.abs(one.value[first]) if one.spec.quantity in LOADS else one.value[first]
    value = value - np.median(value)
    area = np.concatenate([[0.0], np.cumsum(np.diff(t) * (value[1:] + value[:-1]) / 2)])
    return _Course(t, value, area, step)


def _moving(value: Array, step: float) -> Array:
    return np.asarray(value - uniform_filter1d(value, 2 * int(SLOW_s / step / 2) + 1, mode="nearest"))


def _coarse(x: Array, y: Array, step: float) -> tuple[float, float]:
    """The lag of `y` behind `x` (N,) [s] to a step, and the correlation there, of what then lies over one another: a
    run-up that only one of them has seen would hide it."""
    norm = float(np.sqrt((x**2).sum() * (y**2).sum()))
    if norm == 0.0 or not np.isfinite(norm):
        raise CannotTellError("one of both channels does not move")
    steps = correlation_lags(len(y), len(x))
    near = np.abs(steps) <= min(FURTHEST_s / step, len(x) / 4)
    steps, r = steps[near], correlate(y, x)[near]
    of_y, of_x = _energy(y, steps), _energy(x, -steps)
    still = np.minimum(of_x / (x**2).sum(), of_y / (y**2).sum()) < STILL
    lag, r = steps * step, np.where(still, 0.0, r / np.sqrt(np.where(still, 1.0, of_x * of_y)))
    own = correlate(x, x)[near] / (x**2).sum()
    best = int(r.argmax())
    if r[best] < CLEAR:
        raise CannotTellError(f"they do not show one thing (correlation {r[best]:.2f} at best)")
    aside = int(np.argmax(own[len(own) // 2 :] < 0.5)) or 1  # steps in which the course itself forgets
    others = np.abs(np.arange(len(r)) - best) > 2 * aside
    if others.any() and r[others].max() > RIVAL * r[best]:
        other = lag[others][int(r[others].argmax())]
        raise CannotTellError(f"what they show repeats: {lag[best]:.1f} s and {other:.1f} s fit nearly alike")
    return float(lag[best]), float(r[best])


def _energy(value: Array, after: NDArray[np.int64]) -> Array:
    """(K,) sum of squares of `value` (N,) without its first so many steps, or its last where these are negative."""
    upto = np.concatenate([[0.0], np.cumsum(value**2)])
    return np.asarray(upto[len(value) + np.minimum(after, 0)] - upto[np.maximum(after, 0)])


def _segments(of_x: _Course, of_y: _Course, t: Array, coarse: float, step: float) -> tuple[Array, Array, Array]:
    """Middle, lag and its sd [s] of each segment that tells one."""
    count = int(np.clip(t[-1] / max(SLOW_s, OF_ONE * step), *SEGMENTS))
    found = []
    for part in np.array_split(t, count):
        lag = _nearest(of_x, of_y, part, coarse, step)
        one = None if lag is None else _refined(of_x, of_y, part, lag, step)
        if one:
            found.append((part.mean(), *one))
    if len(found) < FEWEST:
        raise CannotTellError(f"too little moves: {len(found)} of {count} segments tell a lag, {FEWEST} must")
    middles, lags, sds = np.array(found).T
    return middles, lags, sds


def _nearest(of_x: _Course, of_y: _Course, part: Array, coarse: float, step: float) -> float | None:
    """The lag of a segment to a step, near that of the whole; None where it does not show one."""
    y = _moving(of_y(part)[0], step)
    most = int(APART_s / step)
    wide = np.arange(part[0] - coarse - most * step, part[-1] - coarse + (most + 0.5) * step, step)
    x = _moving(of_x(wide)[0], step)
    r = correlate(x, y, mode="valid")  # later in `wide` is a smaller lag
    energy = np.convolve(x**2, np.ones(len(y)), "valid")
    norm = np.sqrt(np.maximum(energy, 0.0) * float((y**2).sum()))
    r = np.divide(r, norm, out=np.zeros_like(r), where=norm > 0.0)  # where one of both stands still, nothing is told
    best = int(r.argmax())
    if r[best] < CLEAR or best in (0, len(r) - 1):
        return None
    return coarse + (most - best) * step


def _refined(of_x: _Course, of_y: _Course, part: Array, lag: float, step: float) -> tuple[float, float] | None:
    """The lag of a segment by least squares, and its sd [s]; None where it does not settle."""
    at, y = of_y.samples(part[0], part[-1])
    if len(at) < 10:
        return None
    y, begun = _moving(y, step), lag
    change = sd = np.inf
    for _ in range(ROUNDS):
        value, slope = (_moving(one, step) for one in of_x(at - lag))
        design = np.column_stack([value, slope])
        (gain, turn), *_ = np.linalg.lstsq(design, y, rcond=None)
        if gain <= 0.0:
            return None
        change = turn / gain
        lag += float(np.clip(change, -step, step))
        rest = y - design @ (gain, turn)
        precision = np.linalg.pinv(design.T @ design)
        sd = float(np.sqrt((rest**2).sum() / max(len(y) - 2, 1) * precision[1, 1])) / gain
    settled = abs(change) < 0.1 * step and abs(lag - begun) < 3 * step and 0.0 < sd < step
    return (lag, sd) if settled else None


def _line(t: Array, lag: Array, sd: Array, step: float) -> tuple[float, float, Array]:
    """Offset at `t` = 0 [s], drift [s/s] and their covariance (2, 2), from the lags (K,) of segments.

    What these scatter by beyond their sd is a variance that all have, as an edge lies anywhere between two samples (R.
    C. Paule, J. Mandel, J. Res. NBS 87 (1982) 377, doi:10.6028/jres.087.022); widened to Student's t of so few.
    """
    used = np.ones(len(t), np.bool_)
    alike = step / np.sqrt(12.0)
    for _ in range(ROUNDS):
        line, _ = _weighted(t[used], lag[used], np.hypot(sd[used], alike))
        off = np.abs(lag - line[0] - line[1] * t)
        alike = 1.4826 * float(np.median(off[used]))
        now = off <= FAR * np.hypot(sd, alike)
        if (now == used).all() or now.sum() < FEWEST:
            break
        used = now
    if now.sum() < max(FEWEST, (1 - LEFT_OUT) * len(t)) or np.sqrt((off[used] ** 2).mean()) > step:
        raise CannotTellError("the lag is no straight line over time: a clock was set, or records are missing")
    t, lag, sd, free = t[used], lag[used], sd[used], int(used.sum()) - 2

    def beyond(variance: float) -> float:
        """How much more the lags scatter than with this variance of all."""
        all_sd = np.sqrt(sd**2 + variance)
        line, _ = _weighted(t, lag, all_sd)
        return float((((lag - line[0] - line[1] * t) / all_sd) ** 2).sum()) - free

    of_all = brentq(beyond, 0.0, np.ptp(lag) ** 2) if beyond(0.0) > 0.0 else 0.0
    (offset, drift), covariance = _weighted(t, lag, np.sqrt(sd**2 + of_all))
    return float(offset), float(drift), covariance * (float(student.ppf(0.975, free)) / 1.96) ** 2


def _weighted(t: Array, lag: Array, sd: Array) -> tuple[Array, Array]:
    """The line through lags of these sd (K,), its height at `t` = 0 and its slope, and their covariance (2, 2)."""
    design = np.column_stack([np.ones(len(t)), t]) / sd[:, None]
    covariance = np.asarray(np.linalg.inv(design.T @ design), np.float64)
    return covariance @ design.T @ (lag / sd), covariance


def pairs(first: Sequence[ChannelData], second: Sequence[ChannelData]) -> Iterator[tuple[ChannelData, ChannelData]]:
    """The channels of two loggers that show one thing: those of one quantity first."""
    told = [(x, y, _kinship(x, y)) for x in first for y in second]
    for x, y, near in sorted(told, key=lambda one: one[2]):
        if near < 2:
            yield x, y


def of_one_sensor(first: Sequence[ChannelData], second: Sequence[ChannelData]) -> list[tuple[ChannelData, ChannelData]]:
    """The channels that two loggers have of one sensor, temperatures last: they tell little at once."""
    both = [(x, y) for x in first for y in second if x.spec.name == y.spec.name]
    return sorted(both, key=lambda pair: pair[0].spec.quantity == "temperature")


def _kinship(x: ChannelData, y: ChannelData) -> int:
    """0 of one quantity, 1 of two that go with each other, 2 else: a temperature goes with nothing at once."""
    one, other = x.spec.quantity, y.spec.quantity
    if one == other and one not in ("", "temperature"):
        return 0
    return 1 if one in LOADS and other in LOADS else 2
