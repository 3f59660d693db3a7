"""The mode of a model's posterior: Levenberg-Marquardt on whitened block means, bounds held and the rest solved again.

K. Levenberg, Quart. Appl. Math. 2 (1944); D. W. Marquardt, J. SIAM 11 (1963), doi:10.1137/0111030; damping in the
metric of J. J. More, LNM 630 (1978), doi:10.1007/BFb0067700; the curvature along a step is followed (geodesic
acceleration: M. K. Transtrum, J. P. Sethna, arXiv:1201.5885). Columns are dear and runs are cheap, so a linearisation
serves several steps (Shamanskii's method: C. T. Kelley, Iterative Methods for Linear and Nonlinear Equations, SIAM
1995, 5.4.3).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from twin.errors import DivergedError
from twin.fitting.model import Columns, Model
from twin.fitting.noise import log_det

Floats = NDArray[np.float64]
Tried = tuple[float, list[Floats]]  # cost and whitened residuals

NEAR_ENOUGH = 0.5  # of ln posterior, where evidences are compared
ENOUGH = 0.05  # what is left to gain in ln posterior, by the quadratic model, when the search ends
LINEARISATIONS = 25
STEPS = 4  # with one linearisation
PROBE = 0.1  # of a step, for the curvature along it
MOST_BEND = 0.5  # of the step, in the metric of the Hessian
SHORTEST, WORTH_SHORTENING = 0.05, 0.8  # of a step
WORTH = 0.5  # of the last step's gain: below, a new linearisation is due


@dataclass(frozen=True)
class Fit:
    """`beta` the mode (or where the search ended), `hessian` of - ln posterior there (Gauss-Newton), `cost` = - ln
    posterior up to a constant of the noise; `parts`: residuals and columns there, not whitened; `left`: what the
    quadratic model still promises in ln posterior, under what was enough where the search converged."""

    model: Model
    beta: Floats
    cost: float
    hessian: Floats
    parts: Sequence[Columns]
    left: float
    converged: bool
    linearisations: int

    @property
    def log_evidence(self) -> float:
        """ln p(data) by Laplace's approximation, without -N ln(2 pi) / 2."""
        log_r = sum(log_det(p.series, self.model.noise_of(p.series.channel)) for p in self.parts)
        volume = np.linalg.slogdet(self.hessian)[1] + 2 * np.log(self.model.sd).sum()
        return -(self.cost + (float(volume) + float(log_r)) / 2)

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which entries of the vector are not at a bound."""
        return (self.beta > self.model.low) & (self.beta < self.model.high)

    @property
    def covariance_diagonal(self) -> Floats:
        return np.diag(np.linalg.inv(self.hessian))


def fit(model: Model, start: Floats, enough: float = ENOUGH, linearisations: int = LINEARISATIONS) -> Fit:
    """Search from `start`. Raises `DivergedError` where the run from there leaves the finite numbers."""
    beta = start.copy()
    damping, left, used = 1e-4, math.inf, 0
    parts = model.linearise(beta)
    cost, hessian, slope, white, residual = _quadratic(model, parts, beta)
    used = 1
    while True:
        full = _step(hessian, slope, 0.0, beta, model)
        left = float(slope @ full - full @ hessian @ full / 2)
        if left < enough or used >= linearisations or damping > 1e6:
            break
        moved, gained_before = False, math.inf
        for _ in range(STEPS):
            step = _step(hessian, slope, damping, beta, model)
            trial = np.clip(
                beta + step + _bend(model, parts, white, hessian, damping, beta, residual, step), model.low, model.high
            )
            found = _try(model, trial)
            if found is not None:
                trial, found = _along(model, beta, cost, slope, trial, found)
            if found is None or found[0] >= cost:
                damping = damping * 10
                if moved or damping > 1e6:
                    break
                continue
            gained = cost - found[0]
            beta, cost, moved = trial, found[0], True
            damping = max(damping / 10, 1e-9)
            if gained < max(WORTH * gained_before, enough / 4) or gained < enough:
                break
            gained_before = gained
            residual = found[1]
            slope = _slope(model, parts, white, residual, beta)
        if not moved:
            continue
        parts = model.linearise(beta)
        cost, hessian, slope, white, residual = _quadratic(model, parts, beta)
        used += 1
    return Fit(model, beta, cost, hessian, parts, left, left < enough, used)


def _bend(
    model: Model,
    parts: Sequence[Columns],
    white: Sequence[Floats],
    hessian: Floats,
    damping: float,
    beta: Floats,
    residual: Sequence[Floats],
    step: Floats,
) -> Floats:
    """What the curvature along a step adds to it; nothing where it is no correction any more."""
    try:
        ahead = model.residuals(beta + PROBE * step)
    except DivergedError:
        return np.zeros_like(step)
    right = np.zeros_like(step)
    for part, own, before, series in zip(parts, white, residual, ahead, strict=True):
        after = model.whitened(series, series.y[:, None])[:, 0]
        curved = 2 / PROBE * ((after - before) / PROBE + own @ step[part.at])
        right[part.at] += own.T @ curved
    damped = hessian + damping * np.diag(np.diag(hessian))
    bend: Floats = cho_solve(cho_factor(damped), right) / 2
    size, most = (float(np.sqrt(x @ damped @ x)) for x in (bend, step))
    return bend if size < MOST_BEND * most else np.zeros_like(step)


def _try(model: Model, beta: Floats) -> Tried | None:
    try:
        series = model.residuals(beta)
    except DivergedError:
        return None
    white = [model.whitened(s, s.y[:, None])[:, 0] for s in series]
    return float(sum(w @ w for w in white) + np.sum((beta / model.sd) ** 2)) / 2, white


def _along(model: Model, beta: Floats, cost: float, slope: Floats, trial: Floats, found: Tried) -> tuple[Floats, Tried]:
    """The step, or a shorter one to the lowest point of the parabola through its ends where that is lower: a model that
    misfits bends more than its Gauss-Newton Hessian says, and full steps only swing from side to side of a valley."""
    downhill = float(slope @ (trial - beta))
    bent = found[0] - cost + downhill
    share = downhill / (2 * bent) if bent > 0 else 1.0
    if not SHORTEST < share < WORTH_SHORTENING:
        return trial, found
    shorter = beta + share * (trial - beta)
    again = _try(model, shorter)
    return (shorter, again) if again is not None and again[0] < found[0] else (trial, found)


def _quadratic(
    model: Model, parts: Sequence[Columns], beta: Floats
) -> tuple[float, Floats, Floats, list[Floats], list[Floats]]:
    """- ln posterior, its Gauss-Newton Hessian, the downhill slope, and the whitened columns and residuals."""
    sd = model.sd
    hessian = np.diag(1.0 / sd**2)
    slope = -beta / sd**2
    cost = float(np.sum((beta / sd) ** 2)) / 2
    kept, left = [], []
    for _, group in groupby(parts, key=lambda part: part.series.session):  # of one test: the same places, one product
        of_test = list(group)
        at = of_test[0].at
        white = [model.whitened(p.series, np.column_stack([p.series.y, p.columns])) for p in of_test]
        stack = np.concatenate(white)
        residual, own = stack[:, 0], stack[:, 1:]
        hessian[np.ix_(at, at)] += own.T @ own
        slope[at] += own.T @ residual
        cost += float(residual @ residual) / 2
        kept += [w[:, 1:] for w in white]
        left += [w[:, 0] for w in white]
    return cost, hessian, slope, kept, left


def _slope(
    model: Model, parts: Sequence[Columns], white: Sequence[Floats], residual: Sequence[Floats], beta: Floats
) -> Floats:
    slope: Floats = -beta / model.sd**2
    for part, own, left in zip(parts, white, residual, strict=True):
        slope[part.at] += own.T @ left
    return slope


def _step(hessian: Floats, slope: Floats, damping: float, beta: Floats, model: Model) -> Floats:
    """The damped step; entries that would leave their bounds are held there and the others solved again."""
    damped = hessian + damping * np.diag(np.diag(hessian))
    step = np.zeros(beta.size)
    held = np.zeros(beta.size, dtype=np.bool_)
    while True:
        free = ~held
        right = slope[free] - damped[np.ix_(free, held)] @ step[held]
        step[free] = cho_solve(cho_factor(damped[np.ix_(free, free)]), right)
        over, under = free & (beta + step > model.high), free & (beta + step < model.low)
        if not (over.any() or under.any()):
            return step
        step[over] = model.high[over] - beta[over]
        step[under] = model.low[under] - beta[under]
        held |= over | under
