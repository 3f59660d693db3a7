"""Oven logs: a stator on its way to 230 degC, the soak, and the way back. Copper and iron as two lumps in the oven's
air."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import timedelta

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from plant.deterioration import acceleration
from plant.tables import Column, Style

Floats = NDArray[np.float64]

COPPER_J_per_K, IRON_J_per_K = 2600.0, 6700.0
BETWEEN_W_per_K, COPPER_AIR_W_per_K, IRON_AIR_W_per_K = 25.0, 3.2, 4.5
RAMP_K_per_s = 6.0 / 60.0
DOOR_s = 2400.0  # time constant of the oven's air once it is off and ajar
LIMIT_degC = 180.0
NOISE_K, STEP_K = 0.1, 0.1


@dataclass(frozen=True)
class Soak:
    """One cycle. `offset_K`: what the stator's place is hotter than the controller's own sensor says; `break_h`: the
    oven fails that long after its start and is switched on again after `break_for_h`."""

    oven_degC: float = 230.0
    soak_h: float = 12.0
    cooling_h: float = 4.0
    offset_K: float = 0.0
    room_degC: float = 22.0
    break_h: float | None = None
    break_for_h: float = 1.5


@dataclass(frozen=True)
class Trace:
    """`t_s` (N,) from the start of the first cycle; [degC] of the oven's sensor, and of copper and iron as they are."""

    t_s: Floats
    oven: Floats
    copper: Floats
    iron: Floats

    def hours_above(self, limit_degC: float = LIMIT_degC) -> float:
        """Hours of the copper above a temperature; crossings by straight lines between samples."""
        before, after = self.copper[:-1] - limit_degC, self.copper[1:] - limit_degC
        low, high = np.minimum(before, after), np.maximum(before, after)
        share = np.where(low >= 0.0, 1.0, np.where(high <= 0.0, 0.0, high / np.maximum(high - low, 1e-12)))
        return float((share * np.diff(self.t_s)).sum() / 3600.0)

    def damage_h(self, activation_eV: float, at_degC: float) -> float:
        """Equivalent hours of the insulation, as hot as the mean of copper and iron."""
        rate = acceleration((self.copper + self.iron) / 2.0, activation_eV, at_degC)
        return float(np.trapezoid(rate, self.t_s) / 3600.0)


def run(
    random: np.random.Generator,
    soaks: Sequence[Soak],
    period_s: float = 60.0,
    stator: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> Trace:
    """The trace of one cycle after the other. `stator`: factors of the three conductances: between copper and iron,
    from the oven's air to copper, to iron."""
    air, oven = [], []
    for soak in soaks:
        course = _air(soak, period_s)
        ripple = 0.6 * np.sin(2.0 * np.pi * np.arange(len(course)) * period_s / 900.0 + random.uniform(0.0, 6.0))
        course = course + np.where(course > soak.oven_degC - 20.0, ripple, 0.0)
        oven.append(course)
        hot = np.clip((course - soak.room_degC) / (soak.oven_degC - soak.room_degC), 0.0, 1.0)
        air.append(course + soak.offset_K * hot)
    around = np.concatenate(air)
    copper, iron = _lumps(around, soaks[0].room_degC, period_s, stator)
    return Trace(np.arange(len(around), dtype=np.float64) * period_s, np.concatenate(oven), copper, iron)


def _air(soak: Soak, period_s: float) -> Floats:
    """The oven's air [degC]: ramp, hold for the soak, then off. The soak counts from the end of the ramp."""
    ramp_s = (soak.oven_degC - soak.room_degC) / RAMP_K_per_s
    on_s = ramp_s + soak.soak_h * 3600.0
    t = period_s * np.arange(round((on_s + soak.cooling_h * 3600.0) / period_s))
    target = soak.oven_degC
    if soak.break_h is None:
        off = np.clip(t - on_s, 0.0, None)
        falling = soak.room_degC + (target - soak.room_degC) * np.exp(-off / DOOR_s)
        return np.asarray(np.where(t < on_s, np.minimum(soak.room_degC + RAMP_K_per_s * t, target), falling))
    fails, back = soak.break_h * 3600.0, (soak.break_h + soak.break_for_h) * 3600.0
    whole = _air(replace(soak, break_h=None), period_s)
    fallen = soak.room_degC + (np.interp(fails, t, whole) - soak.room_degC) * np.exp(
        -np.clip(t - fails, 0.0, None) / DOOR_s
    )
    again = np.interp(back, t, fallen) + RAMP_K_per_s * (t - back)
    return np.asarray(np.where(t < fails, whole, np.where(t < back, fallen, np.minimum(again, whole))))


def _lumps(air: Floats, start_degC: float, step_s: float, stator: tuple[float, float, float]) -> tuple[Floats, Floats]:
    """Copper and iron, exactly, in air that changes in straight lines between samples: two first-order lags."""
    between, to_copper, to_iron = np.array([BETWEEN_W_per_K, COPPER_AIR_W_per_K, IRON_AIR_W_per_K]) * stator
    capacity = np.array([COPPER_J_per_K, IRON_J_per_K])
    matrix = np.array([[-(between + to_copper), between], [between, -(between + to_iron)]]) / capacity[:, None]
    rates, modes = np.linalg.eig(matrix)
    drive = np.linalg.solve(modes, np.array([to_copper, to_iron]) / capacity)
    courses = []
    for rate, gain in zip(rates, drive, strict=True):
        decay = np.exp(rate * step_s)
        late = (decay - 1.0 - rate * step_s) / (rate**2 * step_s)  # weight of the sample at the end of a step
        early = (decay - 1.0) / rate - late
        excess = air - start_degC
        lagged, _ = lfilter([late, early], [1.0, -decay], excess, zi=[-late * excess[0]])
        courses.append(gain * np.asarray(lagged))
    copper, iron = modes @ np.array(courses)
    return start_degC + copper, start_degC + iron


def joined(traces: Sequence[Trace], starts: Sequence[timedelta]) -> Trace:
    """The cycles of one log as one trace: nothing is recorded between them."""
    times = [trace.t_s + start.total_seconds() for trace, start in zip(traces, starts, strict=True)]
    oven, copper, iron = (
        np.concatenate([getattr(trace, name) for trace in traces]) for name in ("oven", "copper", "iron")
    )
    return Trace(np.concatenate(times), oven, copper, iron)


def columns(random: np.random.Generator, trace: Trace, sensors: bool = True) -> list[Column]:
    """The log's columns: oven, two thermocouples in the winding, one in the iron; without `sensors` the oven alone."""
    placed = [("T_oven", trace.oven)]
    if sensors:
        placed += [("T_winding", trace.copper), ("T_endwinding", trace.copper), ("T_yoke", trace.iron)]
    found = []
    for name, course in placed:
        noise = 0.3 * random.standard_normal() + NOISE_K * random.standard_normal(len(course))
        found.append(Column(name, "°C", np.round((course + noise) / STEP_K) * STEP_K, 1))
    return found


NODES = {"T_oven": "oven", "T_winding": "winding", "T_endwinding": "endwinding_a", "T_yoke": "yoke"}


def bench_toml(style: Style, sensors: bool = True) -> str:
    """The bench file of oven logs."""
    text = f'schema = "whyhot.bench/1"\nkind = "ageing"\n\n{style.toml}'
    for signal, node in NODES.items():
        if sensors or node == "oven":
            text += f'\n[[channel]]\nsignal = "{signal}"\nquantity = "temperature"\nunit = "degC"\nnode = "{node}"\n'
            text += f"noise = {NOISE_K}\nresolution = {STEP_K}\n"
    return text
