"""The state of a specimen's insulation: a Kalman filter over its checks, from session to session as its dose grows.

The state is g, the logarithm of the conductance over that of the new specimen; its rate r per 100 h; and m = ln R of
the new specimen, of which nothing is known before the first check. A check reads ln R = m - g. Between doses g grows by
r times the dose that counts (`Ageing.counting_100h`), and wanders besides, as no specimen keeps to its rate.

R. E. Kalman, J. Basic Eng. 82 (1960) 35, doi:10.1115/1.3662552; the smoother: H. E. Rauch, F. Tung, C. T. Striebel,
AIAA J. 3 (1965) 1445, doi:10.2514/3.3166.
"""

from __future__ import annotations

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


def filtered(specimens: Sequence[Sequence[Check]], law: Ageing) -> list[tuple[State, ...]]:
    """The state after each check of each specimen, from this and its earlier ones, all specimens side by side. Checks
    in the order of their doses; `law`: what is known of the rates beforehand. ValueError where a dose falls, or an sd
    is not above 0."""
    _refuse(specimens)
    order = sorted(range(len(specimens)), key=lambda i: -len(specimens[i]))  # those with a next check are the first
    found: list[list[State]] = [[] for _ in specimens]
    mean = np.tile([0.0, 0.0, law.rate], (len(specimens), 1))
    covariance = np.tile(np.diag([0.0, 0.0, law.rate_sd**2]), (len(specimens), 1, 1))
    dose_h = np.zeros(len(specimens))
    for number in range(max(map(len, specimens), default=0)):
        order = [i for i in order if len(specimens[i]) > number]
        checks = [specimens[i][number] for i in order]
        to_h, y, sd = np.array([[one.dose_h, one.ln_resistance, one.sd] for one in checks]).T
        going = slice(len(order))
        mean, covariance = _predicted(mean[going], covariance[going], dose_h[going], to_h, law)
        mean, covariance = (_read if number else _read_first)(mean, covariance, y, sd)
        for i, state in zip(order, _states(to_h, mean, covariance), strict=True):
            found[i].append(state)
        dose_h = to_h
    return [tuple(states) for states in found]


def _refuse(specimens: Sequence[Sequence[Check]]) -> None:
    for checks in specimens:
        dose_h = 0.0
        for number, check in enumerate(checks, 1):
            if check.dose_h < dose_h or not check.sd > 0.0:
                raise ValueError(
                    f"check {number}: dose {check.dose_h:g} h after {dose_h:g} h, sd {check.sd:g}: doses rise, sd > 0"
                )
            dose_h = check.dose_h


def _read_first(mean: Floats, covariance: Floats, y: Floats, sd: Floats) -> tuple[Floats, Floats]:
    """Mean (k, 3) and covariance (k, 3, 3) with the first check of each, ln R `y` (k,) with its `sd` (k,): nothing was
    known of m, the limit of a wide prior, without its rounding."""
    into = np.array([[0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    mean, covariance = mean @ into.T, into @ covariance @ into.T
    mean[:, M] += y
    covariance[:, M, M] += sd**2
    return mean, covariance


def _read(mean: Floats, covariance: Floats, y: Floats, sd: Floats) -> tuple[Floats, Floats]:
    """Mean and covariance of the state with one more check."""
    spread = covariance @ READS
    gain = spread / (spread @ READS + sd**2)[:, None]
    keep = np.eye(3) - gain[:, :, None] * READS
    mean = mean + gain * (y - mean @ READS)[:, None]
    variance = (sd**2)[:, None, None] * (gain[:, :, None] * gain[:, None, :])
    return mean, keep @ covariance @ keep.swapaxes(1, 2) + variance


def onwards(state: State, dose_h: float, law: Ageing) -> State:
    """The state at a later dose, without a check: what a session between two checks has. Up to the state's own dose it
    is the same."""
    to_h = max(dose_h, state.dose_h)
    covariance = np.zeros((3, 3))
    covariance[G, G], covariance[R, R] = state.ln_factor_sd**2, state.rate_sd**2
    covariance[G, R] = covariance[R, G] = state.correlation * state.ln_factor_sd * state.rate_sd
    mean = np.array([0.0, state.ln_factor, state.rate_per_100h])
    from_h, dose = np.array([state.dose_h]), np.array([to_h])
    return _states(dose, *_predicted(mean[None], covariance[None], from_h, dose, law))[0]


def by_law(dose_h: float, law: Ageing) -> State:
    """The state at a dose by the law alone."""
    return onwards(State(0.0, 0.0, 0.0, law.rate, law.rate_sd, 0.0), dose_h, law)


def _predicted(mean: Floats, covariance: Floats, from_h: Floats, to_h: Floats, law: Ageing) -> tuple[Floats, Floats]:
    """Means (k, 3) and covariances (k, 3, 3) at later doses (k,)."""
    step = np.tile(np.eye(3), (len(mean), 1, 1))
    step[:, G, R] = list(map(law.counting_100h, from_h.tolist(), to_h.tolist()))
    grown = step @ covariance @ step.swapaxes(1, 2)
    grown[:, G, G] += WALK**2 * (to_h - from_h) / HUNDRED_H
    return (step @ mean[..., None])[..., 0], grown


def _states(dose_h: Floats, mean: Floats, covariance: Floats) -> list[State]:
    g_sd, r_sd = (np.sqrt(np.maximum(covariance[:, i, i], 0.0)) for i in (G, R))
    both = g_sd * r_sd
    correlation = np.divide(covariance[:, G, R], both, out=np.zeros_like(both), where=both > 0.0)
    columns = (dose_h, mean[:, G], g_sd, mean[:, R], r_sd, correlation)
    return [State(*row) for row in np.stack(columns, axis=1).tolist()]
