"""The log of a DC check: what the thermocouples, the shunt and the voltmeter of the rig say while a bare stator heats
and cools.

Twelve thermocouples in the winding heads, six each; `3v` of the upper head is the hottest. The iron may have four.
What a check cannot repeat is one factor of all its winding thermocouples: how far each reads above the iron.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plant.bare_stator import INDEX, LUMPS, Rig, Run
from plant.tables import Column, Style

Floats = NDArray[np.float64]

IRON = ("teeth_a", "teeth_b", "yoke_a", "yoke_b")
NOISE_K, STEP_K = 0.05, 0.1
OFFSET_K, DRIFT_K = 0.1, 0.02  # an offset stays with its thermocouple, a drift is one check's
CURRENT_NOISE_A, VOLTAGE_NOISE_V = 0.05, 0.002
ROOM_NOISE_K = 0.1


@dataclass(frozen=True)
class Thermocouple:
    """`crown`: share of the far part of the winding head in what it reads, the rest is the near part."""

    signal: str
    node: str
    phase: str
    end: str
    crown: float


def _thermocouples() -> tuple[Thermocouple, ...]:
    found = []
    for end, numbers in (("a", (1, 3)), ("b", (2, 4))):
        for number in numbers:
            for phase in "uvw":
                deep = 1.0 if (number, phase) == (3, "v") else 0.4 + 0.1 * number
                found.append(Thermocouple(f"EW_{end.upper()}_{number}{phase}", f"endwinding_{end}", phase, end, deep))
    return tuple(found)


THERMOCOUPLES = _thermocouples()
HOTTEST = "EW_A_3v"


def weights() -> Floats:
    """Share of each lump in what each winding thermocouple reads (12, lumps)."""
    found = np.zeros((len(THERMOCOUPLES), len(LUMPS)))
    for row, sensor in zip(found, THERMOCOUPLES, strict=True):
        row[INDEX[f"crown_{sensor.phase}{sensor.end}"]] = sensor.crown
        row[INDEX[f"near_{sensor.phase}{sensor.end}"]] = 1.0 - sensor.crown
    return found


def iron_mean(temperature: Floats) -> Floats:
    """Mean of the four places in the iron [degC]; `temperature` (..., lumps) [degC]."""
    return np.asarray(temperature[..., [INDEX[name] for name in IRON]].mean(axis=-1))


def resistance_K_per_W(temperature: Floats, heat_W: Floats) -> Floats:
    """The resistance [K/W] that perfect thermocouples at all places give: mean of the winding heads minus mean of the
    iron, over the heat in the copper."""
    heads = (temperature @ weights().T).mean(axis=-1)
    return np.asarray((heads - iron_mean(temperature)) / heat_W)


def room(random: np.random.Generator, t_s: Floats, hour: float, mean_degC: float, swing_K: float) -> Floats:
    """Temperature of the room around the rig [degC]: over the day, from `hour` (local) on, and as it comes, with a
    memory of half an hour."""
    step = float(t_s[1] - t_s[0])
    keeps = np.exp(-step / 1800.0)
    kicks = 0.3 * np.sqrt(1.0 - keeps**2) * random.standard_normal(len(t_s))
    wanders = np.empty_like(t_s)
    wanders[0] = 0.3 * random.standard_normal()
    for k in range(1, len(t_s)):
        wanders[k] = keeps * wanders[k - 1] + kicks[k]
    course = np.sin(2.0 * np.pi * (hour + t_s / 3600.0 - 9.0) / 24.0)
    return np.asarray(mean_degC + swing_K * course + wanders)


@dataclass(frozen=True)
class Reading:
    """How one check was recorded. `factor`: its error in ln R; `dead`: signals without a value from `dead_from_s` on;
    `stops_s`: where the log ends."""

    factor: float = 0.0
    dead: tuple[str, ...] = ()
    dead_from_s: float = 0.0
    stops_s: float | None = None
    period_s: float = 10.0
    iron: bool = True


def columns(
    random: np.random.Generator, rig: Rig, run: Run, place: int, room_degC: Floats, offset_K: Floats, reading: Reading
) -> tuple[Floats, list[Column]]:
    """(t_s, columns) of the check at `place` of a run, in the room (N,) [degC]; `offset_K` (16,) of the
    thermocouples."""
    every = round(reading.period_s / rig.step_s)
    rows = np.arange(0, len(run.t_s), every)
    if reading.stops_s is not None:
        rows = rows[run.t_s[rows] <= reading.stops_s]
    t_s, truth = run.t_s[rows], run.temperature[rows, place]
    current = run.current[rows]
    heat = run.heat[rows, place]
    voltage = np.divide(heat, current, out=np.zeros_like(heat), where=current > 0.0) + current * rig.leads_ohm
    is_on = current > 0.0
    current = current + CURRENT_NOISE_A * random.standard_normal(len(rows))
    voltage = voltage + VOLTAGE_NOISE_V * random.standard_normal(len(rows))
    voltage[~is_on] = VOLTAGE_NOISE_V * random.standard_normal(int((~is_on).sum()))
    found = [Column("I_DC", "A", current, 2), Column("V_DC", "V", voltage, 4)]
    iron = iron_mean(truth)
    heads = truth @ weights().T
    heads = iron[:, None] + (heads - iron[:, None]) * np.exp(reading.factor)
    offsets = offset_K.tolist()
    for sensor, offset, course in zip(THERMOCOUPLES, offsets[: len(THERMOCOUPLES)], heads.T, strict=True):
        values = _read(random, course + offset)
        if sensor.signal in reading.dead:
            values[t_s >= reading.dead_from_s] = np.nan
        found.append(Column(sensor.signal, "degC", values, 1))
    # drawn with and without, so that all else is equal
    of_iron = zip(IRON, offsets[len(THERMOCOUPLES) :], strict=True)
    iron_values = [_read(random, truth[:, INDEX[name]] + offset) for name, offset in of_iron]
    if reading.iron:
        found += [Column(f"FE_{name}", "degC", values, 1) for name, values in zip(IRON, iron_values, strict=True)]
    here = room_degC[rows] + ROOM_NOISE_K * random.standard_normal(len(rows)) + 0.2 * random.standard_normal()
    found.append(Column("T_room", "degC", here, 1))
    return t_s, found


def _read(random: np.random.Generator, course: Floats) -> Floats:
    noise = DRIFT_K * random.standard_normal() + NOISE_K * random.standard_normal(len(course))
    return np.asarray(np.round((course + noise) / STEP_K) * STEP_K)


def bench_toml(style: Style, iron: bool = True, configuration: str | None = None) -> str:
    """The bench file of the rig. `configuration`: of a motor file that lies beside it as `motor.toml`."""
    motor = f'motor = "motor.toml"\nconfiguration = "{configuration}"\n' if configuration else ""
    text = f'schema = "whyhot.bench/1"\n{motor}kind = "dc_check"\n\n{style.toml}'
    text += '\n[[channel]]\nsignal = "I_DC"\nquantity = "current_dc"\nunit = "A"\n'
    text += '\n[[channel]]\nsignal = "V_DC"\nquantity = "voltage_dc"\nunit = "V"\n'
    places = [(sensor.signal, sensor.node) for sensor in THERMOCOUPLES]
    places += [(f"FE_{name}", name.split("_")[0]) for name in IRON if iron]
    for signal, node in (*places, ("T_room", "ambient")):
        text += f'\n[[channel]]\nsignal = "{signal}"\nquantity = "temperature"\nunit = "degC"\nnode = "{node}"\n'
        text += f"noise = {ROOM_NOISE_K if node == 'ambient' else NOISE_K}\nresolution = {STEP_K}\n"
        text += f"bias_sd = {OFFSET_K}\n" if node != "ambient" else ""
    return text
