"""The resistance from winding to iron from the whole curve over the ambient, where no iron and no minute after a
switch is measured.

    C_w dT_w/dt = P - (T_w - T_i) / R - s q(T_w),      C_i dT_i/dt = (T_w - T_i) / R - q(T_i),
    q(T) = a |T - T_a|^(1/4) (T - T_a) + b sigma (T^4 - T_a^4)

with a free convection a [W/K^1.25], a radiating surface times emissivity b [m2] and the winding's share s of them all
free under wide priors, so the level of the curve says nothing about R: what does is how the winding runs ahead of the
rest, and how it falls back. Both lumps begin at one temperature. When exactly the load was switched between two
samples is free too.

Two lumps with one film are not a stator. `MODEL_SHARE` is what that does to the course over checks of a bare stator
of 24 lumps whose surfaces darken from 0.80 to 0.90; the level itself is twice the iron sensor's there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from scipy.optimize import least_squares

from analytics.insulation.arrays import Floats
from analytics.insulation.checks.estimate import ResistanceEstimate
from analytics.insulation.dose.arrhenius import ZERO_DEGC_IN_K

STEFAN_BOLTZMANN = 5.670374419e-8  # W/(m2 K4), CODATA 2018
PRIOR = np.log([0.03, 2500.0, 9000.0, 0.4, 0.25, 0.3])  # R K/W, C_w, C_i J/K, a, b, s: of a traction motor's stator
PRIOR_SD = np.array([1.5, 1.0, 1.0, 1.0, 1.0, 0.5])  # of the logarithms
MODEL_K = 0.3  # scale of what two lumps leave over
MODEL_SHARE = 0.02
STEP_S = 30.0  # of the solver, at most
THIN_S = 30.0  # samples nearer than this are not all used
LEAST_SAMPLES = 40
SLOPE_STEP = 1e-4  # of the logarithms, for the columns
EVALUATIONS = 20


@dataclass(frozen=True)
class Curve:
    """One check from rest: `t_s` (N,) [s], `copper` (N,) mean [degC], `power` (N,) [W], `air` (N,) [degC], all
    without NaN. `on`: the first sample under load; `off`: the first after it, N where the log ends under load."""

    t_s: Floats
    copper: Floats
    power: Floats
    air: Floats
    on: int
    off: int


def fit(curve: Curve) -> ResistanceEstimate | None:
    """R of one curve; None where it has fewer than 40 samples."""
    curve = _fewer_samples(curve)
    size = curve.t_s.size
    if size < LEAST_SAMPLES:
        return None

    def left(vector: Floats) -> Floats:
        return np.asarray(_left_over(curve, vector[None, :])[0])

    def columns(vector: Floats) -> Floats:
        moved = vector + SLOPE_STEP * np.eye(vector.size)
        moved[:, -2:] -= 2.0 * SLOPE_STEP * (moved[:, -2:] > 1.0)
        found = _left_over(curve, np.vstack([vector, moved]))
        return np.asarray(((found[1:] - found[0]) / np.diag(moved - vector)[:, None]).T)

    start = np.concatenate([PRIOR, [curve.copper[0], 0.5, 0.5]])
    bounds = np.concatenate([np.full(7, np.inf), [1.0, 1.0]])
    found = least_squares(
        left, start, columns, (np.where(np.isinf(bounds), -np.inf, 0.0), bounds), x_scale="jac", max_nfev=EVALUATIONS
    )
    residual = found.fun[:size]
    lag = float(np.clip(residual[1:] @ residual[:-1] / (residual @ residual), 0.0, 0.98))
    noise = float(residual @ residual) / max(size - start.size, 1) * (1.0 + lag) / (1.0 - lag)
    curvature = found.jac[:size].T @ found.jac[:size] / noise + found.jac[size:].T @ found.jac[size:]
    resistance = float(np.exp(found.x[0]))
    relative = float(np.sqrt(np.linalg.pinv(curvature)[0, 0]))
    return ResistanceEstimate(resistance, resistance * float(np.hypot(relative, MODEL_SHARE)))


def _fewer_samples(curve: Curve) -> Curve:
    every = max(1, int(THIN_S / float(np.median(np.diff(curve.t_s))))) if curve.t_s.size > 1 else 1
    t_s, copper, power, air = (values[::every] for values in (curve.t_s, curve.copper, curve.power, curve.air))
    return Curve(t_s, copper, power, air, -(-curve.on // every), -(-curve.off // every))


def _left_over(curve: Curve, vectors: Floats) -> Floats:
    """What the curve and the priors leave over (vectors, N + priors), in units of their sds."""
    over = (_simulated(curve, vectors) - curve.copper) / MODEL_K
    return np.concatenate([over, (vectors[:, : PRIOR.size] - PRIOR) / PRIOR_SD], axis=1)


def _simulated(curve: Curve, vectors: Floats) -> Floats:
    """T_w (vectors, N) [degC] by the implicit midpoint rule, with the film of the step before."""
    values = np.ascontiguousarray(np.exp(vectors[:, : PRIOR.size]))
    power = np.repeat(curve.power[None, 1:] + curve.power[None, :-1], len(vectors), axis=0) / 2.0
    for place, elapsed in ((curve.on, vectors[:, -2]), (curve.off, vectors[:, -1])):
        if 0 < place < curve.t_s.size:
            power[:, place - 1] = elapsed * curve.power[place - 1] + (1.0 - elapsed) * curve.power[place]
    air = (curve.air[1:] + curve.air[:-1]) / 2.0
    start = np.ascontiguousarray(vectors[:, PRIOR.size])
    return np.asarray(_marched(values, start, power, air, np.diff(curve.t_s)), np.float64)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _marched(values: Floats, start: Floats, power: Floats, air: Floats, seconds: Floats) -> Floats:
    """T_w (vectors, N) [degC]: `values` (vectors, 6) as `PRIOR` has them, `start` (vectors,) [degC], `power`
    (vectors, N - 1) [W] and `air` (N - 1,) [degC] between the samples, `seconds` (N - 1,) from one to the next."""
    course = np.empty((len(values), seconds.size + 1))
    for i in range(len(values)):
        resistance, winding, iron, convects, radiates, share = values[i]
        g = 1.0 / resistance
        now, body = start[i], start[i]
        course[i, 0] = now
        for k in range(seconds.size):
            parts = max(1, int(np.ceil(seconds[k] / STEP_S)))
            h = seconds[k] / parts / 2.0  # to the middle of a step
            for _ in range(parts):
                of_winding = share * _film(now, air[k], convects, radiates)
                of_body = _film(body, air[k], convects, radiates)
                a, d = winding / h + g + of_winding, iron / h + g + of_body
                right_w = winding / h * now + power[i, k] + of_winding * air[k]
                right_i = iron / h * body + of_body * air[k]
                determinant = a * d - g * g
                now = 2.0 * (right_w * d + g * right_i) / determinant - now
                body = 2.0 * (a * right_i + g * right_w) / determinant - body
            course[i, k + 1] = now
    return course


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _film(degC: float, around: float, convects: float, radiates: float) -> float:
    """Conductance to the room [W/K]."""
    hot, cold = degC + ZERO_DEGC_IN_K, around + ZERO_DEGC_IN_K
    radiation = radiates * STEFAN_BOLTZMANN * (hot**2 + cold**2) * (hot + cold)
    return float(convects * abs(degC - around) ** 0.25 + radiation)
