"""Derating: how a controller takes current back as what it watches becomes hot, and how it would have with better
eyes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Derating:
    """The share of its current that a motor may have: 1 up to `begin_degC`, 0 from `end_degC` on, linear between."""

    begin_degC: float
    end_degC: float

    def factor(self, degC: Floats) -> Floats:
        """The share at temperatures (N,) [degC]; NaN where there is none."""
        return np.clip((self.end_degC - degC) / (self.end_degC - self.begin_degC), 0.0, 1.0)


@dataclass(frozen=True)
class Derated:
    """A strategy over a run. `seconds`, `mean`, `lowest`: how long its factor was below 1, its mean and its lowest;
    with `_hot` the same had it watched the hot spot. `late_s`: how long the hot spot asked for less current while the
    sensor asked for none; `hottest_free_degC`: the hottest that the hot spot became while the sensor took no current
    back, None where it always did."""

    seconds: float
    mean: float
    lowest: float
    seconds_hot: float
    mean_hot: float
    lowest_hot: float
    late_s: float
    hottest_free_degC: float | None


def derated(strategy: Derating, watched_degC: Floats, hot_spot_degC: Floats, step_s: float) -> Derated | None:
    """How a strategy would have acted in a run of steps: by what its sensor showed (N,) and the hottest place that it
    protects (N,) [degC]. Steps without a sample are left out; None where none has one."""
    there = np.isfinite(watched_degC)
    if not there.any():
        return None
    hot = hot_spot_degC[there]
    own, best = strategy.factor(watched_degC[there]), strategy.factor(hot)
    free = own >= 1.0
    return Derated(
        seconds=step_s * float((own < 1.0).sum()),
        mean=float(own.mean()),
        lowest=float(own.min()),
        seconds_hot=step_s * float((best < 1.0).sum()),
        mean_hot=float(best.mean()),
        lowest_hot=float(best.min()),
        late_s=step_s * float((free & (best < 1.0)).sum()),
        hottest_free_degC=float(hot[free].max()) if free.any() else None,
    )
