"""Which thermocouples of a check can be believed: they are there, possible, and move when the others do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from analytics.insulation.arrays import Floats

POSSIBLE_DEGC = (-40.0, 400.0)  # an open thermocouple reads outside
PRESENT_SHARE = 0.9  # of the samples
MOVED_K = 10.0  # how far the others may move while a sensor repeats itself
MOVED_STEPS = 5.0  # and how many of the sensor's own steps
SPAN_SHARE = 0.03  # of the others' span, below which a sensor does not take part
LEAST_SENSORS = 3  # of a kind, for their median to be a measure


def unusable(names: Sequence[str], value_degC: Floats) -> dict[str, str]:
    """Columns of `value_degC` (N, k) that cannot be believed: name -> why. They are sensors of one kind, copper or
    iron, as the two may move differently. The measure is their median, so more than half of three or more have to be
    right; of fewer only missing samples are seen."""
    possible = possible_only(value_degC)
    there = np.isfinite(possible)
    present = there.mean(axis=0) if len(possible) else np.zeros(len(names))
    good = present >= PRESENT_SHARE
    found = {
        name: f"{100.0 * (1.0 - share):.0f} % of its samples are missing or impossible"
        for name, share, is_good in zip(names, present, good, strict=True)
        if not is_good
    }
    if good.sum() < LEAST_SENSORS:
        return found
    some = there[:, good].any(axis=1)
    possible, there = possible[some], there[some]
    course = np.nanmedian(possible[:, good], axis=1)
    for k in np.flatnonzero(good):
        why = _does_not_move(possible[there[:, k], k], course[there[:, k]])
        if why is not None:
            found[names[int(k)]] = why
    return found


def possible_only(value_degC: Floats) -> Floats:
    """The readings [degC] with NaN for what no winding or iron can have."""
    lowest, highest = POSSIBLE_DEGC
    with np.errstate(invalid="ignore"):
        return np.where((value_degC > lowest) & (value_degC < highest), value_degC, np.nan)


def _does_not_move(value: Floats, course: Floats) -> str | None:
    if np.ptp(course) > MOVED_K and np.ptp(value) < SPAN_SHARE * np.ptp(course):
        return f"moves by {np.ptp(value):.1f} K while the others move by {np.ptp(course):.1f} K"
    changes = np.flatnonzero(np.diff(value))
    begins, ends = np.concatenate([[0], changes + 1]), np.concatenate([changes, [value.size - 1]])
    moved = np.abs(course[ends] - course[begins])
    steps = np.abs(np.diff(value))
    step = float(np.min(steps[steps > 1e-9], initial=np.inf))
    worst = int(np.argmax(moved))
    if moved[worst] > max(MOVED_K, MOVED_STEPS * step):
        return f"stuck at {value[begins[worst]]:.1f} degC while the others move by {moved[worst]:.1f} K"
    return None
