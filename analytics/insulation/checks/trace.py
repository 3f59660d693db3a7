"""A DC check as arrays, and what of it can be evaluated: whole rows of good sensors, the last load without a break."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from analytics.insulation.arrays import Floats
from analytics.insulation.checks.sensors import possible_only, unusable

ON_QUANTILE, ON_SHARE = 0.995, 0.5  # the load is on above this share of this quantile of current, else of power


@dataclass(frozen=True)
class CheckTrace:
    """One check: `t_s` (N,) [s] rising; temperatures [degC] (N, k), of copper and iron with their names; `power_W`
    (N,) V I; `current_A` (N,) or None. NaN where a sample is missing."""

    t_s: Floats
    copper_degC: Floats
    copper_names: tuple[str, ...]
    iron_degC: Floats
    iron_names: tuple[str, ...]
    ambient_degC: Floats
    power_W: Floats
    current_A: Floats | None = None


@dataclass(frozen=True)
class Loaded:
    """A trace without unusable sensors and incomplete rows: `t_s` (N,) [s], `sensors` (N, k) of the copper [degC]
    with their `names`, means (N,) of the `iron` sensors and of the `air` [degC], None where there are none, and
    `power` (N,) [W]. Its last load without a break is from sample `first` to `last`."""

    t_s: Floats
    sensors: Floats
    names: tuple[str, ...]
    iron: Floats | None
    air: Floats | None
    power: Floats
    first: int
    last: int

    @property
    def on(self) -> slice:
        """The samples under that load."""
        return slice(self.first, self.last + 1)

    @property
    def copper(self) -> Floats:
        """Mean of the copper sensors (N,) [degC]."""
        return np.asarray(self.sensors.mean(axis=1))

    @property
    def load_s(self) -> float:
        """How long the load was on [s], from the last sample before it, as it was switched on in between."""
        return float(self.t_s[self.last] - self.t_s[max(self.first - 1, 0)])


def unusable_sensors(trace: CheckTrace) -> dict[str, str]:
    """Name -> why, of the copper and iron sensors that cannot be believed."""
    return unusable(trace.copper_names, trace.copper_degC) | unusable(trace.iron_names, trace.iron_degC)


def loaded(trace: CheckTrace, left_out: Collection[str]) -> Loaded | str:
    """The trace without the sensors of the names `left_out`, or why there is nothing to evaluate."""
    copper = [k for k, name in enumerate(trace.copper_names) if name not in left_out]
    iron = [k for k, name in enumerate(trace.iron_names) if name not in left_out]
    if not trace.copper_names:
        return "no copper temperature: no channel of region copper has one"
    if not copper:
        return "no copper temperature can be believed: look at the thermocouples that are left out"
    sensors = possible_only(trace.copper_degC[:, copper])
    irons = possible_only(trace.iron_degC[:, iron])
    power = np.abs(trace.power_W)
    drive = power if trace.current_A is None else np.abs(trace.current_A)
    whole = np.isfinite(np.column_stack([trace.t_s, power, drive, sensors, irons])).all(axis=1)
    whole[whole] = np.diff(trace.t_s[whole], prepend=-np.inf) > 0.0
    if whole.sum() < 3:
        return "power and temperatures are never there together"
    t, drive = trace.t_s[whole], drive[whole]
    on = drive > ON_SHARE * np.quantile(drive, ON_QUANTILE)
    if not on.any():
        return "no load: neither current nor power"
    power = power[whole]
    if not power[on].mean() > 0.0:
        return "power is not above zero"
    last = int(np.flatnonzero(on)[-1])
    first = int(np.max(np.flatnonzero(~on[:last]), initial=-1)) + 1
    return Loaded(
        t_s=t,
        sensors=sensors[whole],
        names=tuple(trace.copper_names[k] for k in copper),
        iron=irons[whole].mean(axis=1) if iron else None,
        air=_ambient(trace.ambient_degC[whole], t),
        power=power,
        first=first,
        last=last,
    )


def _ambient(degC: Floats, t_s: Floats) -> Floats | None:
    """Mean of the ambient channels (N,) [degC], a straight line over missing samples; a channel with gaps counts only
    while it is there."""
    if not degC.shape[1]:
        return None
    there = np.isfinite(degC)
    level = np.where(there, degC, 0.0).sum(axis=1) / np.maximum(there.sum(axis=1), 1)
    known = there.any(axis=1)
    return np.asarray(np.interp(t_s, t_s[known], level[known])) if known.any() else None
