"""The laws by which what a bench records differs from the truth: what each takes off, and which amounts it can have.

Amounts are reading minus truth. A new law of a sensor is one entry of `SENSOR` and its formula;
`twin.motor.sensor_laws` says what it puts on, and a test holds the two against each other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from operator import add

import numpy as np
from numpy.typing import NDArray

AMBIENT = "ambient"  # the node whose temperature pulls at a sensor's leads
SPEED, CURRENT = "speed", "current"  # quantities that a reading may go with
MASKED = ("hold", "dropout", "stuck", "saturation")
SWAP = "swap_"
# Turns: a reading is gain times truth plus bias, so the bias is taken off first.
EXCHANGES, ADDED, OTHERS, FACTORS = range(4)

Array = NDArray[np.float64]
Times = NDArray[np.int64]


@dataclass(frozen=True)
class Surroundings:
    """What is known beside every sample of a channel (N,): `hours` since the start of the session, and of what it
    knows the `AMBIENT` [degC] and the magnitudes of `SPEED` [rpm] and `CURRENT` [A]."""

    hours: Array
    known: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class CorrectionLaw:
    """One law: what it takes off readings and stamps, None where it takes off nothing.

    `off`: (readings in the stored unit, amount, what is beside them) -> truth; `true_stamps`: (stamps [ns], amount,
    start of the session [ns]) -> truth.
    """

    off: Callable[[Array, float, Surroundings], Array] | None = None
    true_stamps: Callable[[Times, float, int], Times] | None = None
    both: Callable[[float, float], float] = add  # the one amount that does what a first and then a second do
    turn: int = OTHERS  # when it is taken off, of several
    unit: str = ""  # of its amount: "" for a share, and for what is in a quantity's own
    needs: str = ""  # what has to be known beside a reading: AMBIENT, SPEED, CURRENT
    fits: Callable[[float], bool] = lambda amount: True  # whether an amount can be, else `refusal`
    refusal: str = ""


def _without_drift(t_ns: Times, ppm: float, start_ns: int) -> Times:
    share = ppm * 1e-6
    late: Times = np.rint((t_ns - start_ns) * (share / (1.0 + share))).astype(np.int64)
    return t_ns - late


def _without_stem(reading: Array, share: float, beside: Surroundings) -> Array:
    return (reading - share * beside.known[AMBIENT]) / (1.0 - share)


def _without_input(name: str, per: float, unit: str) -> CorrectionLaw:
    """T + a u / per, u the magnitude of an input."""
    return CorrectionLaw(
        off=lambda reading, a, beside: reading - a * beside.known[name] / per, turn=ADDED, needs=name, unit=unit
    )


BIAS = CorrectionLaw(off=lambda reading, a, _: reading - a, turn=ADDED)  # T + a [stored unit]
BIAS_K = replace(BIAS, unit="K")
GAIN = CorrectionLaw(  # T (1 + a), temperatures in degC
    off=lambda reading, a, _: reading / (1.0 + a),
    both=lambda first, then: (1.0 + first) * (1.0 + then) - 1.0,
    turn=FACTORS,
    fits=lambda a: a > -1.0,
    refusal="leaves nothing to read: its amount must be above -1",
)
THERE_OR_NOT = CorrectionLaw(
    both=lambda first, then: 1.0,
    turn=EXCHANGES,
    fits=lambda a: a == 1.0,
    refusal="is there or not: its amount must be 1",
)
SENSOR: Mapping[str, CorrectionLaw] = {
    "bias": BIAS_K,
    "gain": GAIN,
    "lag": CorrectionLaw(unit="s"),  # follows T more slowly, by a first-order lag [s]: added to `time_constant_s`
    "drift": CorrectionLaw(  # T + a t
        off=lambda reading, a, beside: reading - a * beside.hours, turn=ADDED, unit="K/h"
    ),
    "stem": CorrectionLaw(  # T + a (T_ambient - T)
        off=_without_stem,
        both=lambda first, then: 1.0 - (1.0 - first) * (1.0 - then),
        turn=FACTORS,
        needs=AMBIENT,
        fits=lambda a: a < 1.0,
        refusal="leaves only the ambient: its amount must be below 1",
    ),
    "speed": _without_input(SPEED, 1000.0, "K/1000 rpm"),
    "current": _without_input(CURRENT, 100.0, "K/100 A"),
    **dict.fromkeys(MASKED, THERE_OR_NOT),  # not T: such samples are masked where they are found
}
LAWS: Mapping[str, Mapping[str, CorrectionLaw]] = {
    "sensor": SENSOR,
    "clock": {
        "offset": CorrectionLaw(true_stamps=lambda t_ns, a, _: t_ns - round(a * 1e9), unit="s"),  # stamps late by a
        # Stamps late by a t [ppm], t since the start of the session.
        "drift": CorrectionLaw(true_stamps=_without_drift, turn=ADDED, unit="ppm"),
        # All that it records follows more slowly, by a first-order lag [s]: added to `time_constant_s` (`slowed`).
        "lag": CorrectionLaw(fits=lambda a: a >= 0.0, refusal="is no lag: its amount must be 0 or more", unit="s"),
    },
    "input": {"gain": GAIN, "bias": BIAS},
    "boundary": {"bias": BIAS_K},
}
