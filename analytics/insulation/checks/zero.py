"""What the sensors of a check are off by against those of the specimen's other checks, read before the load.

A card, a reference junction or a plug makes the difference of copper and iron sensors another one each day, by tenths
of a kelvin, where the drop over the insulation is a few kelvins. Before the load a stator that was left overnight has
one temperature, so what copper and iron differ by then is the sensors'. The resistance is defined by the plain drop:
a difference that all checks share stays in it, only what a check differs by from their mean is taken out, as far as
that is more than noise and rounding make (shrunk by 1 - their variance / the variance between checks).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from analytics.insulation.arrays import Floats
from analytics.insulation.checks.trace import CheckTrace, loaded

LEAST_SAMPLES = 3  # before the load
LATEST_S = 600.0  # before the load, what counts
MOST_LEAD_K = 1.5  # of copper and iron over the ambient: both sensors' and the channel's own bias are in it
MOST_CHANGE_K = 0.5  # of their mean while it is looked at
LEAST_CHECKS = 3


def of_one_zero(traces: Sequence[CheckTrace], left_out: Sequence[Mapping[str, str]]) -> list[CheckTrace]:
    """The checks of one specimen with their iron moved by what their own sensors are off by [K]. Checks that do not
    begin at rest stay as they are, and all do where fewer than three begin so. `left_out`: sensors not used, of each
    check."""
    seen = [_resting(trace, out) for trace, out in zip(traces, left_out, strict=True)]
    offset, variance = np.array([found or (np.nan, np.nan) for found in seen]).reshape(-1, 2).T
    known = np.isfinite(offset)
    if known.sum() < LEAST_CHECKS:
        return list(traces)
    spread = float(np.var(offset[known], ddof=1))
    share = max(1.0 - float(variance[known].mean()) / spread, 0.0) if spread > 0.0 else 0.0
    shift = np.where(known, share * (offset - offset[known].mean()), 0.0)
    return [
        replace(trace, iron_degC=trace.iron_degC + by) if by else trace
        for trace, by in zip(traces, shift.tolist(), strict=True)
    ]


def _resting(trace: CheckTrace, left_out: Mapping[str, str]) -> tuple[float, float] | None:
    """Mean copper less mean iron before the load [K], and its variance; None where the specimen is not at rest."""
    check = loaded(trace, left_out)
    if isinstance(check, str) or check.iron is None:
        return None
    t = check.t_s[: check.first]
    used = np.flatnonzero(t > check.t_s[check.first] - LATEST_S)
    if used.size < LEAST_SAMPLES:
        return None
    middle = (check.copper[used] + check.iron[used]) / 2
    lead_K = 0.0 if check.air is None else abs(float((middle - check.air[used]).mean()))
    if np.ptp(middle) > MOST_CHANGE_K or lead_K >= MOST_LEAD_K:
        return None
    difference = check.copper[used] - check.iron[used]
    iron = [k for k, name in enumerate(trace.iron_names) if name not in left_out]
    rounding = _rounding(check.sensors) + _rounding(trace.iron_degC[:, iron])
    return float(difference.mean()), float(np.var(difference, ddof=1)) / used.size + rounding


def _rounding(sensors: Floats) -> float:
    """Variance [K^2] that rounding gives the mean of sensors (N, k): a twelfth of the square of the smallest step."""
    steps = np.abs(np.diff(sensors, axis=0))
    step = float(np.min(steps[steps > 1e-6], initial=np.inf))
    return step**2 / 12.0 / sensors.shape[1] if np.isfinite(step) else 0.0
