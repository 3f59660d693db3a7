"""The state of a specimen's insulation: a Kalman filter over its checks, from session to session as its dose grows.

The state is g, the logarithm of the conductance over that of the new specimen; its rate r per 100 h; and m = ln R of
the new specimen, of which nothing is known before the first check. A check reads ln R = m - g. Between doses g grows by
r times the dose that counts (`Ageing.counting_100h`), and wanders besides, as no specimen keeps to its rate.

R. E. Kalman, J. Basic Eng. 82 (1960) 35, doi:10.1115/1.3662552; the smoother: H. E. Rauch, F. Tung, C. T. Striebel,
AIAA J. 3 (1965) 1445, doi:10.2514/3.3166.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.powers import exp
from twin.motor.ageing_law import HUNDRED_H, Ageing

Floats = NDArray[np.float64]

WALK = 0.02  # sd of how far g wanders from its rate in 100 h: as much as one check is uncertain by
M, G, R = range(3)
READS = np.array([1.0, -1.0, 0.0])  # m, g, r -> ln R


@dataclass(frozen=True)
class Check:
    """An evaluated check: the dose before it [h], and the logarithm of its thermal resistance with its sd, in which
    repeatability is included."""

    dose_h: float
    ln_resistance: float
    sd: float


@dataclass(frozen=True)
class State:
    """What a check leaves: `ln_factor` of the conductance over that of the new specimen, and its rate per 100 h, at a
    dose [h], with their sds and correlation."""

    dose_h: float
    ln_factor: float
    ln_factor_sd: float
    rate_per_100h: float
    rate_sd: float
    correlation: float

    @property
    def factor(self) -> float:
        """The conductance, 1 when new."""
        return float(exp(np.array([self.ln_factor]))[0])


def filtered(checks: Sequence[Check], law: Ageing) -> tuple[State, ...]:
    """The state after each check, from this and the earlier ones. `checks` in the order of their doses; `law`: what is
    known of the rate beforehand. ValueError where a dose falls, or an sd is not above 0."""
    found = list[State]()
    mean, covariance = np.array([0.0, 0.0, law.rate]), np.diag([0.0, 0.0, law.rate_sd**2])
    dose_h = 0.0
    for number, check in enumerate(checks):
        if check.dose_h < dose_h or not check.sd > 0.0:
            raise ValueError(
                f"check {number + 1}: dose {check.dose_h:g} h after {dose_h:g} h, sd {check.sd:g}: doses rise, sd > 0"
            )
        mean, covariance = _predicted(mean, covariance, dose_h, check.dose_h, law)
        if number == 0:
            # nothing was known of m: the limit of a wide prior, without its rounding
            into = np.array([[0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
            mean, covariance = into @ mean, into @ covariance @ into.T
            mean[M] += check.ln_resistance
            covariance[M, M] += check.sd**2
        else:
            spread = covariance @ READS
            gain = spread / (READS @ spread + check.sd**2)
            keep = np.eye(3) - np.outer(gain, READS)
            mean = mean + gain * (check.ln_resistance - READS @ mean)
            covariance = keep @ covariance @ keep.T + check.sd**2 * np.outer(gain, gain)
        found.append(_state(check.dose_h, mean, covariance))
        dose_h = check.dose_h
    return tuple(found)


def onwards(state: State, dose_h: float, law: Ageing) -> State:
    """The state at a later dose, without a check: what a session between two checks has. Up to the state's own dose it
    is the same."""
    to_h = max(dose_h, state.dose_h)
    covariance = np.zeros((3, 3))
    covariance[G, G], covariance[R, R] = state.ln_factor_sd**2, state.rate_sd**2
    covariance[G, R] = covariance[R, G] = state.correlation * state.ln_factor_sd * state.rate_sd
    mean = np.array([0.0, state.ln_factor, state.rate_per_100h])
    return _state(to_h, *_predicted(mean, covariance, state.dose_h, to_h, law))


def by_law(dose_h: float, law: Ageing) -> State:
    """The state at a dose by the law alone."""
    return onwards(State(0.0, 0.0, 0.0, law.rate, law.rate_sd, 0.0), dose_h, law)


def _predicted(mean: Floats, covariance: Floats, from_h: float, to_h: float, law: Ageing) -> tuple[Floats, Floats]:
    step = np.eye(3)
    step[G, R] = law.counting_100h(from_h, to_h)
    grown = step @ covariance @ step.T
    grown[G, G] += WALK**2 * (to_h - from_h) / HUNDRED_H
    return step @ mean, grown


def _state(dose_h: float, mean: Floats, covariance: Floats) -> State:
    g_sd, r_sd = (math.sqrt(max(covariance[i, i], 0.0)) for i in (G, R))
    return State(
        dose_h=dose_h,
        ln_factor=float(mean[G]),
        ln_factor_sd=g_sd,
        rate_per_100h=float(mean[R]),
        rate_sd=r_sd,
        correlation=float(covariance[G, R]) / (g_sd * r_sd) if g_sd > 0.0 and r_sd > 0.0 else 0.0,
    )
