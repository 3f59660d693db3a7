"""Quality of each channel of a session: rate, range, noise, gaps, and stretches in which the sensor told nothing new.

Held and stuck (the rule is fixed): a run of m equal samples is held when m ln(1/p) > 25, p = share of equal
neighbours of that channel within 10 minutes on either side outside the run (kept within 0.02 to 0.98), the run is
longer than 5 s, and another channel of the same file moves by more than 10 of its resolutions meanwhile; an input at
exactly 0 is never held. What a channel resolves is its step, or its noise where that is larger: ten sigma are
movement, the last digit of a noisy channel is not. A run beside a stretch that is as calm is no fault either: where
the calmer side alone explains it (other such runs apart) it is the beginning or the end of a rest, and on a real
bench at rest temperatures of 0.1 K steps repeat for five minutes while a draught moves the ambient.

Of the held runs one is

- saturated, where its value is the largest or smallest that the channel shows and is reached and left gently, as a
  clipped signal does, or where the channel is held at that very value three times or more (a limit or a code of the
  converter at which it sticks),
- stuck, where it lasts to the end of the file or for 10 minutes and more,
- held otherwise: the last value before a dropout, repeated.

Where three channels and more of a file, and two thirds of those whose noise is well above their step, are held from
the same stamp to the same stamp, the record repeats and no sensor does: a logger writes its first row until it is
triggered, or its last one once it has lost its source. Nothing else need move meanwhile, and it is said once for all.

An input is never called saturated, and nothing of it is masked: a set point that is kept and a sensor that is stuck
look the same, and the bench really ran at one of them. It is said all the same, for a person to judge.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.at_once import GAP_MEDIANS
from ingest.catalogue.channels import ChannelData, step_of
from ingest.facts.events import QualityFlagged

EVIDENCE = 25.0  # nats that a run must have against chance
LEAST_EQUAL, MOST_EQUAL = 0.02, 0.98
WINDOW_NS = 600_000_000_000  # on either side, for the share of equal neighbours
SHORTEST_NS = 5_000_000_000
STUCK_NS = 600_000_000_000
RESOLUTIONS = 10.0  # that another channel must move
GENTLY = 10.0  # typical steps between neighbours, with which a signal is clipped or its last value held
STICKS = 3  # times held at one value
SET_BY_HAND = ("state", "histogram", "speed_command", "torque_command")  # repeat by their nature: no sensor behind them
WITH = 3  # channels that are held together, at least
MOST = 2 / 3  # of those that are fine enough to tell
FINE = 2.0  # steps in a channel's noise: it never repeats for long
NO_SAMPLES = "has no samples"  # so begins what is said of a channel's gaps
OF_NO_SENSOR = ("gap", "record_repeated")  # flags of what no sensor is to blame for
GAP_NS = 1_000_000_000  # a shorter one is jitter of the bus: no motor warms within it


@dataclass(frozen=True)
class Lapse:
    """A time in which a channel told nothing new."""

    start_ns: int
    end_ns: int

    @property
    def duration_s(self) -> float:
        return (self.end_ns - self.start_ns) / 1e9


@dataclass(frozen=True)
class RepeatedSamples(Lapse):
    """Samples `first` to `last` (both included), all of one value."""

    kind: str  # held, stuck, saturated
    first: int
    last: int
    value: float  # stored unit
    together: bool = False  # with most others of its file: the record repeats, not the sensor


@dataclass(frozen=True)
class _Run:
    """Samples `first` to `last` of a channel that are equal, which chance does not explain; from the file `raw`."""

    raw: str
    start_ns: int
    end_ns: int
    first: int
    last: int
    kind: str
    value: float

    @property
    def span(self) -> tuple[str, int, int]:
        """Where it lies: equal for runs that begin and end with the same records."""
        return self.raw, self.start_ns, self.end_ns


@dataclass(frozen=True)
class ChannelQuality:
    """What one channel's samples look like; numbers in its stored unit, None where there are too few samples.

    `rate_Hz` 1 / median interval; `noise` one sigma, from second differences; `resolution` the smallest step seen;
    `good` bool (N,): False for the samples of a stretch, but for the first of a held or stuck one that is reached
    gently: that was measured; all True for an input, which is used as it stands.
    """

    name: str
    role: str  # observed | input | ignored
    samples: int
    rate_Hz: float | None
    low: float | None
    high: float | None
    noise: float | None
    resolution: float | None
    gaps: tuple[Lapse, ...]  # without a sample, over 5 median intervals and over 1 s
    stretches: tuple[RepeatedSamples, ...]
    good: NDArray[np.bool_]


def assess(channels: Sequence[ChannelData]) -> list[ChannelQuality]:
    """The quality of every channel, in the order given; the others of its file tell whether a repeat is healthy."""
    least = [_least_movement(channel) for channel in channels]
    runs = [_runs(channel) for channel in channels]
    together = _together(channels, runs)
    return [_assess(one, own, together, channels, least) for one, own in zip(channels, runs, strict=True)]


def findings(qualities: Sequence[ChannelQuality]) -> list[QualityFlagged]:
    """What a person should look at: one flag a channel and kind of stretch (of an input one for all), one for its gaps;
    one for all channels that are held together.

    Ignored channels have none.
    """
    found = [*_records_repeated(qualities)]
    for quality in (one for one in qualities if one.role != "ignored"):
        found += _constant(quality) if quality.role == "input" else _masked(quality)
        if quality.gaps:
            found.append(_flag(quality.name, "gap", f"{NO_SAMPLES} for {_times(quality.gaps)}", quality.gaps))
    return found


def without_value(name: str) -> str:
    """What is said of a channel that a session's logs know of and hold no value of."""
    return f"{name} has no value at all"


def seconds(value: float) -> str:
    """A duration as a person says it: `0.8 s`, `240 s`, `12 min`, `3.5 h`."""
    if value < 10:
        return f"{value:.1f} s"
    if value < 600:
        return f"{value:.0f} s"
    return f"{value / 60:.0f} min" if value < 7200 else f"{value / 3600:.1f} h"


def noise_of(value: NDArray[np.float64]) -> float | None:
    """One sigma of white noise in `value` (N,), from second differences; blind to steps in a tenth of the samples.

    The second difference of white noise has 6 times its variance; of |d| the largest tenth is left out, and the mean of
    the rest is 0.65735 sigma for a normal distribution. A straight rise, however steep, counts as no noise.
    """
    if len(value) < 20:
        return None
    bend = np.sort(np.abs(np.diff(value, 2)))
    return float(bend[: int(0.9 * len(bend))].mean() / (0.65735 * np.sqrt(6.0)))


def _assess(
    channel: ChannelData,
    runs: Sequence[_Run],
    together: Collection[tuple[str, int, int]],
    channels: Sequence[ChannelData],
    least: Sequence[float | None],
) -> ChannelQuality:
    t_ns, value = channel.t_ns, channel.value
    median = channel.median_ns
    held = sticking(
        [
            RepeatedSamples(one.start_ns, one.end_ns, one.kind, one.first, one.last, one.value, one.span in together)
            for one in runs
            if one.span in together or _others_move(channel, one, channels, least)
        ],
        channel.spec.role,
    )
    good = np.ones(len(value), dtype=np.bool_)
    for stretch in held if channel.spec.role != "input" else ():
        measured = stretch.kind != "saturated" and (stretch.first == 0 or _gently(value, stretch.first - 1))
        good[stretch.first + measured : stretch.last + 1] = False
    return ChannelQuality(
        name=channel.spec.name,
        role=channel.spec.role,
        samples=len(value),
        rate_Hz=1e9 / median if median > 0 else None,
        low=float(value.min()) if len(value) else None,
        high=float(value.max()) if len(value) else None,
        noise=noise_of(value),
        resolution=step_of(channel.recorded),
        gaps=gaps_of(t_ns, median),
        stretches=tuple(held),
        good=good,
    )


def gaps_of(t_ns: NDArray[np.int64], median_ns: float) -> tuple[Lapse, ...]:
    """Where stamps (N,) [ns] in the order of time are wide apart, for a channel of this median interval [ns]."""
    wide = np.flatnonzero(np.diff(t_ns) > max(GAP_MEDIANS * median_ns, GAP_NS))
    return tuple(Lapse(int(t_ns[i]), int(t_ns[i + 1])) for i in wide)


def sticking(found: Sequence[RepeatedSamples], role: str) -> list[RepeatedSamples]:
    """The stretches of a channel; those at a value that it is held at three times or more are saturated."""
    if role == "input":
        return list(found)
    often = {value for value, times in Counter(one.value for one in found).items() if times >= STICKS}
    return [replace(one, kind="saturated") if one.value in often else one for one in found]


def _least_movement(channel: ChannelData) -> float | None:
    """10 times what the channel resolves; None for one that never moves."""
    step = channel.spec.resolution or step_of(channel.recorded)
    return RESOLUTIONS * max(step, noise_of(channel.value) or 0.0) if step else None


def _runs(channel: ChannelData) -> list[_Run]:
    """The runs of equal samples of a channel that chance does not explain, file by file."""
    if channel.spec.quantity in SET_BY_HAND:
        return []
    found = []
    for raw in np.unique(channel.raw).tolist():
        index = np.flatnonzero(channel.raw == raw)
        t_ns, value = channel.t_ns[index], channel.recorded[index]
        for first, last in _improbable(t_ns, value):
            if value[first] == 0.0 and channel.spec.role != "observed":
                continue
            clipped = channel.spec.role != "input" and _clipped(value, first, last)
            lasting = last == len(t_ns) - 1 or t_ns[last] - t_ns[first] >= STUCK_NS
            kind = "saturated" if clipped else "stuck" if lasting else "held"
            begin, end = int(t_ns[first]), int(t_ns[last])
            ends = int(index[first]), int(index[last])
            found.append(_Run(channel.raws[raw], begin, end, *ends, kind, float(value[first])))
    return found


def _together(channels: Sequence[ChannelData], runs: Sequence[Sequence[_Run]]) -> set[tuple[str, int, int]]:
    """Where runs lie that most channels of a file share, of those that are fine enough to tell."""
    fine = [_is_fine(channel) for channel in channels]
    often = Counter(run.span for own, told in zip(runs, fine, strict=True) if told for run in own if run.value != 0.0)
    telling = Counter(raw for one, told in zip(channels, fine, strict=True) if told for raw in one.raws)
    return {span for span, count in often.items() if count >= max(WITH, MOST * telling[span[0]])}


def _is_fine(channel: ChannelData) -> bool:
    """Whether the noise of a channel is well above its step."""
    step, own = step_of(channel.recorded), noise_of(channel.recorded)
    return bool(step and own and own >= FINE * step)


def _improbable(t_ns: NDArray[np.int64], value: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Runs (first, last) of equal samples, longer than 5 s, that neither both sides nor one of them explains."""
    if len(value) < 2:
        return []
    equal = np.diff(value) == 0.0
    edges = np.flatnonzero(~equal) + 1
    first, last = np.r_[0, edges], np.r_[edges, len(value)] - 1
    long = (t_ns[last] - t_ns[first] > SHORTEST_NS) & _rare(last - first + 1, np.full(len(first), LEAST_EQUAL))
    first, last = first[long], last[long]
    same, pairs = _on_sides(t_ns, first, last, equal), _on_sides(t_ns, first, last, np.ones_like(equal))
    together, known = same.sum(axis=0), pairs.sum(axis=0)
    share = np.where(known > 0, together / np.maximum(known, 1), MOST_EQUAL)
    rare = _rare(last - first + 1, np.clip(share, LEAST_EQUAL, MOST_EQUAL))
    first, last = first[rare], last[rare]
    usual = np.ones_like(equal)
    for a, b in zip(first, last, strict=True):
        usual[a:b] = False
    same, pairs = _on_sides(t_ns, first, last, equal & usual), _on_sides(t_ns, first, last, usual)
    calmer = ((same + 1) / (pairs + 2)).max(axis=0)  # rule of succession: two equal samples make no calm side
    rare = _rare(last - first + 1, np.maximum(calmer, LEAST_EQUAL))
    return list(zip(first[rare].tolist(), last[rare].tolist(), strict=True))


def _rare(length: NDArray[np.int64], share: NDArray[np.float64]) -> NDArray[np.bool_]:
    """m ln(1/p) > 25, (N,)."""
    rare: NDArray[np.bool_] = length * np.log(1.0 / share) > EVIDENCE
    return rare


def _on_sides(
    t_ns: NDArray[np.int64], first: NDArray[np.int64], last: NDArray[np.int64], pair: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """How many pairs of neighbours are True within 10 minutes before and after each run, its edges left out: (2, N)."""
    total = np.r_[0, np.cumsum(pair)]  # total[j] - total[i]: pairs among samples i..j
    left = np.searchsorted(t_ns, t_ns[first] - WINDOW_NS)
    right = np.searchsorted(t_ns, t_ns[last] + WINDOW_NS, side="right") - 1
    before, after = np.maximum(first - 1, left), np.minimum(last + 1, right)
    return np.array([total[before] - total[left], total[right] - total[after]])


def _others_move(
    channel: ChannelData, run: _Run, channels: Sequence[ChannelData], least: Sequence[float | None]
) -> bool:
    """Whether another channel of its file moves by more than its least movement within the stamps of a run."""
    for other, movement in zip(channels, least, strict=True):
        if other is channel or movement is None or run.raw not in other.raws:
            continue
        a, b = np.searchsorted(other.t_ns, run.start_ns), np.searchsorted(other.t_ns, run.end_ns, side="right")
        value = other.value[a:b][other.raw[a:b] == other.raws.index(run.raw)]
        if len(value) and np.ptp(value) > movement:
            return True
    return False


def _clipped(value: NDArray[np.float64], first: int, last: int) -> bool:
    """Whether a run is at a limit of the channel and is reached and left gently."""
    if value[first] not in (value.min(), value.max()) or first == 0 or last + 1 == len(value):
        return False
    return _gently(value, first - 1) and _gently(value, last)


def _gently(value: NDArray[np.float64], at: int) -> bool:
    """Whether a channel goes from the sample `at` to the next one as between others: an open thermocouple jumps."""
    step = np.abs(np.diff(value))
    return bool(step[at] <= GENTLY * np.median(step[step > 0.0]))


def _records_repeated(qualities: Sequence[ChannelQuality]) -> Iterator[QualityFlagged]:
    """A flag for the channels that are held together."""
    of = {one.name: [x for x in one.stretches if x.together] for one in qualities if one.role != "ignored"}
    names = [name for name, some in of.items() if some]
    if names:
        spans = {(x.start_ns, x.end_ns): x for some in of.values() for x in some}
        how = "as a logger does that waits for its trigger or has lost its source: temperatures masked"
        what = f"{', '.join(names[:2])} and {len(names) - 2} more" if names[2:] else " and ".join(names)
        says = f"one record is repeated for {_times([*spans.values()])} ({what}), {how}"
        yield replace(_flag(", ".join(names), "record_repeated", "", [*spans.values()]), says=says)


def _masked(quality: ChannelQuality) -> Iterator[QualityFlagged]:
    for kind in ("saturated", "stuck", "held"):
        if some := [stretch for stretch in quality.stretches if stretch.kind == kind and not stretch.together]:
            at = f" at {some[0].value:,.6g}" if len({one.value for one in some}) == 1 else ""
            yield _flag(quality.name, kind, f"is {kind}{at} for {_times(some)}: masked", some)


def _constant(quality: ChannelQuality) -> Iterator[QualityFlagged]:
    if some := [stretch for stretch in quality.stretches if not stretch.together]:
        kind = "stuck" if "stuck" in {one.kind for one in some} else "held"
        at = f" at {some[0].value:,.6g}" if len({one.value for one in some}) == 1 else ""
        yield _flag(quality.name, kind, f"is constant{at} for {_times(some)} (used as it stands)", some)


def _times(some: Sequence[Lapse]) -> str:
    """How long, and how often: "3.0 s", "up to 3.0 s, 2 times"."""
    longest = seconds(max(one.duration_s for one in some))
    return f"up to {longest}, {len(some)} times" if len(some) > 1 else longest


def _flag(name: str, kind: str, says: str, some: Sequence[Lapse]) -> QualityFlagged:
    spans = [{"start_ns": one.start_ns, "end_ns": one.end_ns} for one in some]
    return QualityFlagged(flag=kind, says=f"{name} {says}", detail={"channel": name, "spans": spans})
