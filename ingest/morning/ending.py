"""Why a session ended: it was steady, at a limit, its cycle was through, it was broken off, or the log ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ingest.bench.derating import DeratingRule
from ingest.catalogue.channels import ChannelData, current, each_second, find, step_of
from ingest.catalogue.kinds import LOADED, wltc_passes
from ingest.catalogue.quality import seconds
from ingest.morning.differences import is_around
from ingest.morning.repeat import Comparison

STEADY_K_per_h = 2.0  # IEC 60034-1:2022, 3.25: thermal equilibrium; 1 K in half an hour
LOOKED_s = 600.0  # before the load went off, over which temperatures are looked at
TAIL_s = 5.0  # of the log: load that is on within it was on when the log ended
ALIKE_K = 2.0  # within which the peaks of pulses are one limit
PULSES = 3
FOLLOWED = 0.95  # share of the WLTC's trace: a log may lack its tail
LIMIT_K = 1.0  # below a limit
AS_BEFORE, BROKEN_OFF = 0.9, 0.85  # shares: so much of a run as the one before, and so little of that one at most


@dataclass(frozen=True)
class SessionEnd:
    """`reason`: steady, not steady, limit, whole, aborted, log ends, or unknown; `says` one line why."""

    reason: str
    says: str


def ended(channels: Sequence[ChannelData], kind: str, limits: Sequence[DeratingRule] = ()) -> SessionEnd:
    """How a session of this kind ended. `limits`: those that its bench file names.

    A load is on where it is over a fifth of its largest. Whoever recorded a log alone knows why it was stopped: what
    neither load nor temperatures tell is unknown.
    """
    load = find(channels, "torque") or current(channels) or find(channels, "current_dc")
    warm = [one for one in channels if one.spec.quantity == "temperature" and not is_around(one)]
    warm = [one for one in warm if one.spec.role != "ignored" and len(one.t_ns)]
    if load is None or not len(load.t_ns):
        return SessionEnd("unknown", "neither torque nor current is recorded")
    amount = np.abs(load.value)
    top = float(np.quantile(amount, 0.995))
    on = np.flatnonzero(amount > LOADED * top)
    if top <= 0 or not len(on):
        return SessionEnd("unknown", "nothing was loaded")
    off_ns, end_ns = int(load.t_ns[on[-1]]), int(load.t_ns[-1])
    if kind == "wltp":
        return _of_cycle(channels)
    if reached := _limit(warm, limits, off_ns):
        return reached
    if kind == "s2" and (alike := _pulses(warm, load, amount > 0.5 * top)):
        return alike
    return _of_load(warm, off_ns, end_ns, kind)


def broken_off(before: str, comparison: Comparison) -> SessionEnd | None:
    """Whether a run did as the run `before` did, and no more, while that one went on."""
    theirs, own = comparison.driven
    if own < AS_BEFORE or theirs > BROKEN_OFF:
        return None
    rest = seconds(comparison.matched_s * (1 / theirs - 1))
    return SessionEnd(
        "aborted", f"driven as {before} for {seconds(comparison.matched_s)}, which went on for {rest} more"
    )


def _of_cycle(channels: Sequence[ChannelData]) -> SessionEnd:
    speed = find(channels, "speed")
    passes, share = wltc_passes(np.abs(each_second([speed])[0][0])) if speed else ([], 0.0)
    if not passes:
        return SessionEnd("unknown", "no pass of the WLTC class 3b trace is found in its speed")
    if share >= FOLLOWED:
        return SessionEnd("whole", "the whole trace was driven")
    return SessionEnd("aborted", f"only {100 * share:.0f} % of the trace was followed")


def _limit(warm: Sequence[ChannelData], limits: Sequence[DeratingRule], off_ns: int) -> SessionEnd | None:
    for rule in limits:
        for one in warm:
            before = one.value[(one.t_ns <= off_ns) & (one.t_ns > off_ns - LOOKED_s * 1e9)]
            if one.spec.name == rule.channel and len(before) and before[-1] >= rule.begin_degC - LIMIT_K:
                says = f"{one.spec.name} was at {before[-1]:.1f} °C, and derating begins at {rule.begin_degC:g} °C"
                return SessionEnd("limit", says)
    return None


def _pulses(warm: Sequence[ChannelData], load: ChannelData, high: NDArray[np.bool_]) -> SessionEnd | None:
    """Whether the pulses of load ended at one temperature of one sensor: that was their limit."""
    ends = load.t_ns[np.flatnonzero(np.diff(high.astype(np.int8)) < 0)]
    if len(ends) < PULSES:
        return None
    found = []
    for one in warm:
        at = np.searchsorted(one.t_ns, ends, side="right") - 1
        peaks = one.value[at[at >= 0]]
        if len(peaks) >= PULSES and np.ptp(peaks) <= ALIKE_K < 0.1 * np.ptp(one.value):
            found.append((float(np.ptp(peaks)), one.spec.name, float(np.median(peaks)), len(peaks)))
    if not found:
        return None
    spread, name, level, count = min(found)
    return SessionEnd("limit", f"{count} pulses ended with {name} at {level:.0f} °C (within {spread:.1f} K)")


def _of_load(warm: Sequence[ChannelData], off_ns: int, end_ns: int, kind: str) -> SessionEnd:
    found = {one.spec.name: _rate(one, off_ns) for one in warm}
    rates = {name: rate for name, rate in found.items() if rate is not None}
    if not rates:
        return SessionEnd("unknown", "no temperature of the motor is recorded up to the end of the load")
    name, (rate, sd) = max(rates.items(), key=lambda pair: abs(pair[1][0]))
    if abs(rate) + 2 * sd <= STEADY_K_per_h:
        return SessionEnd(
            "steady", f"no temperature changed by more than {STEADY_K_per_h:g} K/h when the load went off"
        )
    way = "warmed" if rate > 0 else "cooled"
    went = f"{way} by {abs(rate):.1f} K/h in the last {seconds(LOOKED_s)} of load"
    if end_ns - off_ns <= TAIL_s * 1e9:
        return SessionEnd("log ends", f"under load; {name} {went}")
    if kind == "s1" and rate - 2 * sd > STEADY_K_per_h:
        return SessionEnd("not steady", f"{name} still {went}")
    return SessionEnd("unknown", f"the load went off {seconds((end_ns - off_ns) / 1e9)} before the log's end")


def _rate(one: ChannelData, off_ns: int) -> tuple[float, float] | None:
    """Slope up to the end of the load and its sd [K/h], of means of a tenth of LOOKED_s; None with too little.

    A reading that stays on one step of its resolution may have moved by that step unseen.
    """
    inside = (one.t_ns <= off_ns) & (one.t_ns > off_ns - LOOKED_s * 1e9)
    t, value = (one.t_ns[inside] - off_ns) / 3.6e12, one.value[inside]
    number = np.floor(t * 3600 / (LOOKED_s / 10)).astype(np.int64)
    parts = np.unique(number)
    if len(parts) < 8:
        return None
    x, y = (np.array([values[number == part].mean() for part in parts]) for values in (t, value))
    slope, start = np.polyfit(x, y, 1)
    spread = float(np.sqrt(((y - start - slope * x) ** 2).sum() / (len(x) - 2)))
    sd = spread / float(np.sqrt(((x - x.mean()) ** 2).sum()))
    step = one.spec.resolution or step_of(one.recorded) or 0.0
    if float(np.std(value - start - slope * t)) < step / 2:
        sd = float(np.hypot(sd, step / (LOOKED_s / 3600) / np.sqrt(3.0)))
    return float(slope), sd
