"""Clocks that are late by far more than any fit may move a stamp: found before anything is calibrated.

A logger of thermometers whose clock is half a minute off fits no motor at all in pulses, and whatever bends most is
named in its place: exchanged sensors, capacities, another unit. So the uncalibrated simulation of a test is laid beside
what each bus recorded, by the changes from one block of 10 s to the next, all channels of the bus together,

    r(L) = sum x(t + L) m(t) / sqrt(sum x(t + L)^2 sum m(t)^2),

x recorded, m simulated. Changes tell when heat came and hardly how much the motor holds, so that r is near 1 at the
right L for a file that is far off too, and tells nothing where the load is switched once. Only a clock that fits well
somewhere, badly as it is, and at no other lag as near as well is called late.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twin.diagnosis.next_tests import read_throughout
from twin.fitting.model import Floats, Model, Test
from twin.motor.causes import spelt
from twin.motor.outputs import BLOCK_S

MOST_S = 300.0  # that a clock is sought to be off by, and a third of its test at most
LEAST = 2  # blocks: less is left to the fit
FITS, FITS_NOT = 0.9, 0.5  # correlation where the clock is right, and as it is, at most
ELSEWHERE = 0.8  # of the best correlation: what another lag may reach, as pulses that repeat do, ...
BESIDE, FURTHER = 3, 2  # ... that is more than 3 blocks away, and at most twice as far from no lag at all


def late_clocks(model: Model) -> list[str]:
    """A line for each bus of a test whose thermometers follow the motor at another time than the inputs say: where, by
    how much and what to do. Raises `DivergedError` where the model runs away."""
    tests = [replace(one, channels=read_throughout(one.channels, len(one.frame.features))) for one in model.tests]
    whole = Model(model.network, tests, model.parameters)
    shown = {(one.session, one.channel): -one.y for one in whole.residuals(np.zeros(len(model.parameters)))}
    lines = []
    for number, test in enumerate(model.tests):
        for bus in dict.fromkeys(channel.sensor.bus for channel in test.channels):
            late_s = _late_s(*_changes(test, bus, {name: y for (of, name), y in shown.items() if of == number}))
            if late_s is not None:
                lines.append(_says(test.name, bus, late_s))
    return lines


def _says(test: str, bus: str, late_s: float) -> str:
    which = "late" if late_s > 0 else "early"
    return (
        f'session {test}: the thermometers of "{bus}" follow the motor about {abs(late_s):.0f} s too {which} by the '
        "stamps of the inputs. Put that clock right in the bench file: "
        f'[[correction]] cause = "clock.{spelt(bus)}.offset", amount = {late_s:.0f}; '
        "or the clock of the inputs, with the other sign"
    )


def _changes(test: Test, bus: str, shown: dict[str, Floats]) -> tuple[Floats, Floats]:
    """The changes from block to block of what the channels of a bus recorded, nan where a block is not there, and of
    what the model shows: each (channels, B) [K]."""
    recorded, modelled = [], []
    for channel in (one for one in test.channels if one.sensor.bus == bus):
        cut = channel.blocks(test.frame.step_s)
        values = np.full(cut.there.size, np.nan)
        values[cut.there] = cut.measured(channel.measured)
        recorded.append(np.diff(values))
        modelled.append(np.diff(shown[channel.name]))
    return np.array(recorded), np.array(modelled)


def _late_s(recorded: Floats, modelled: Floats) -> float | None:
    """By how much what was recorded is late [s]; None where it is not, or nothing tells."""
    most = int(min(MOST_S / BLOCK_S, recorded.shape[1] / 3))
    lags = np.arange(-most, most + 1)
    r = np.array([_correlation(recorded, modelled, lag) for lag in lags.tolist()])
    best = int(r.argmax())
    elsewhere = (np.abs(lags - lags[best]) > BESIDE) & (np.abs(lags) <= FURTHER * abs(lags[best]))
    away = r[elsewhere].max(initial=0.0)
    if r[best] < FITS or r[most] > FITS_NOT or abs(lags[best]) < LEAST or away > ELSEWHERE * r[best]:
        return None
    return BLOCK_S * (float(lags[best]) + _peak(r[max(best - 1, 0) : best + 2]))


def _correlation(recorded: Floats, modelled: Floats, lag: int) -> float:
    """r where what was recorded `lag` blocks later belongs to what the model shows."""
    there = recorded.shape[1] - abs(lag)
    x, m = recorded[:, max(lag, 0) :][:, :there], modelled[:, max(-lag, 0) :][:, :there]
    both = np.isfinite(x)
    square = float((x[both] ** 2).sum() * (m[both] ** 2).sum())
    return float((x[both] * m[both]).sum()) / np.sqrt(square) if square > 0 else 0.0


def _peak(r: Sequence[float] | Floats) -> float:
    """Where between its neighbours a parabola through three values has its maximum, from the middle one."""
    if len(r) < 3:
        return 0.0
    return float(0.5 * (r[0] - r[2]) / (r[0] - 2 * r[1] + r[2]))
