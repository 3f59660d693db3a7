"""Quantities, their stored units, and the way to these from any unit text of a log: once, at the door."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.errors import UnitError
from ingest.texts.nearest import hint
from ingest.texts.units import factor, normal_unit, tidy, without_mark

STORED_UNIT: Mapping[str, str] = {
    "temperature": "degC",
    "speed": "rpm",
    "speed_command": "rpm",
    "torque": "Nm",
    "torque_command": "Nm",
    "current": "A",  # rms of a phase, as current_d and current_q
    "current_d": "A",
    "current_q": "A",
    "current_dc": "A",
    "voltage": "V",
    "voltage_d": "V",
    "voltage_q": "V",
    "voltage_dc": "V",
    "power": "W",  # electrical, in
    "flow": "lpm",
    "heat": "W",  # taken out by the coolant
    "resistance": "ohm",
    "flux": "Wb",
    "acceleration": "m/s2",
    "insulation_resistance": "ohm",
    "polarisation_index": "1",
    "tan_delta": "1",
    "capacitance": "F",
    "inception_voltage": "V",
    "counter": "1",
    "histogram": "1",
    "state": "1",
    "thermal_resistance": "K/W",
    "dose": "h",
}
PEAK = ("current", "current_d", "current_q", "voltage", "voltage_d", "voltage_q")  # may be given as peak values
CONVENTIONS = ("rms", "peak")

_ONLY_FOR: Mapping[str, Mapping[str, str]] = {  # texts that mean something else elsewhere
    "temperature": {"F": "degF", "k": "K", "c": "degC", "f": "degF"},
    "speed": {"1/s": "rps", "s-1": "rps", "s^-1": "rps"},
    "speed_command": {"1/s": "rps", "s-1": "rps", "s^-1": "rps"},
    "acceleration": {"g": "g_0", "G": "g_0"},
}
_DEGREES = {"degC": (1.0, 0.0), "K": (1.0, -273.15), "degF": (5 / 9, -160 / 9)}  # -> degC
_EXAMPLES: Mapping[str, str] = {  # by stored unit, for messages
    "degC": "degC, K, degF",
    "rpm": "rpm, 1/min, U/min, rad/s",
    "Nm": "Nm, kNm, mNm, lbf ft",
    "A": "A, mA, kA",
    "V": "V, mV, kV",
    "W": "W, kW, mW, hp",
    "lpm": "lpm, l/min, l/h, m3/h, gpm",
    "ohm": "ohm, mOhm, kOhm, MOhm, GOhm, TOhm",
    "Wb": "Wb, mWb, Vs",
    "m/s2": "m/s2, g",
    "1": "1, -, %",
    "F": "F, uF, nF, pF",
    "K/W": "K/W, degC/W",
    "h": "h, min, s",
}


@dataclass(frozen=True)
class Conversion:
    """`scale * x + offset`: from a unit of a file to the stored one."""

    scale: float = 1.0
    offset: float = 0.0

    def __call__(self, values: NDArray[Any]) -> NDArray[np.float64]:
        """Values (N,) in the file's unit -> float64 (N,) in the stored unit, always a new array."""
        return np.asarray(values, dtype=np.float64) * self.scale + self.offset


def converter(unit: str, quantity: str, convention: str = "rms") -> Conversion:
    """The conversion of `unit` (any text of a file) to `STORED_UNIT[quantity]`. Raises UnitError (without file, line).

    `convention = "peak"`: amplitudes of phase currents and voltages, divided by sqrt 2 (sine: rms = peak / sqrt 2).
    """
    bare, marked = without_mark(tidy(unit)) if quantity in PEAK else (tidy(unit), None)
    if convention == "peak" and quantity not in PEAK:
        raise UnitError(f'convention = "peak" means nothing for {quantity}: only for {", ".join(PEAK)}. Take it out.')
    if marked and marked != convention:
        raise UnitError(f'unit "{unit}" says {marked}, convention says {convention}. Write convention = "{marked}".')
    scale, offset = _linear(bare, quantity)
    return Conversion(scale / math.sqrt(2) if convention == "peak" else scale, offset)


def known_quantity(quantity: str) -> None:
    """Raise UnitError where `quantity` is none of those known."""
    if quantity not in STORED_UNIT:
        advice = hint(quantity, STORED_UNIT) or f" Known: {', '.join(STORED_UNIT)}."
        raise UnitError(f'quantity "{quantity}" is not known.{advice}')


def column_suffix(quantity_or_unit: str | None) -> str:
    """The end of a column's name: "temperature" or "°C" -> "_degC"; "" for pure numbers and unknown units."""
    unit = normal_unit(STORED_UNIT.get(quantity_or_unit or "", quantity_or_unit))
    if unit is None or unit == "1":
        return ""
    return "_" + re.sub(r"\W+", "_", unit.replace("/", "_per_").replace("%", "percent")).strip("_")


def other_unit(found: str, unit: str, quantity: str, convention: str = "rms") -> bool:
    """Whether the unit `found` in a log contradicts the `unit` and convention of the bench file, known to be sound.

    A unit that nobody knows, and "-", contradict nothing.
    """
    bare, marked = without_mark(tidy(found))
    if normal_unit(bare) in (None, "1") and bare not in _ONLY_FOR.get(quantity, {}):
        return False
    if marked and quantity in PEAK and marked != convention:
        return True
    try:
        return _linear(bare, quantity) != _linear(without_mark(tidy(unit))[0], quantity)
    except UnitError:
        return True


@lru_cache(maxsize=1024)
def _linear(text: str, quantity: str) -> tuple[float, float]:
    """(scale, offset) of a tidy unit text."""
    known_quantity(quantity)
    stored = STORED_UNIT[quantity]
    unit = _ONLY_FOR.get(quantity, {}).get(text) or normal_unit(text) or ("1" if text == "" else text)
    if unit == stored:
        return 1.0, 0.0
    if stored == "degC" and unit in _DEGREES:
        return _DEGREES[unit]
    scale = None if stored == "degC" else factor(unit, stored)
    if scale is None:
        raise UnitError(f'unit "{text[:40]}" is not known for {quantity}; use one of {_EXAMPLES[stored]}.')
    return scale, 0.0
