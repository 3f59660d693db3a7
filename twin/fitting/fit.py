"""The mode of a model's posterior: Levenberg-Marquardt on whitened block means, bounds held and the rest solved again.

K. Levenberg, Quart. Appl. Math. 2 (1944); D. W. Marquardt, J. SIAM 11 (1963), doi:10.1137/0111030; damping in the
metric of J. J. More, LNM 630 (1978), doi:10.1007/BFb0067700. Columns are dear and runs are cheap, so a linearisation
serves several steps (Shamanskii's method: C. T. Kelley, Iterative Methods for Linear and Nonlinear Equations, SIAM
1995, 5.4.3).

A motor that is far from its file lies at the end of a bent valley, where straight steps swing from side to side. So a
step is a piece of a parabola (geodesic acceleration: M. K. Transtrum, J. P. Sethna, arXiv:1201.5885): with v the damped
step and a what the curvature of the readings along it adds, the search moves to beta + t v + t^2 a, as far (t up to 1)
as a stays a correction of v. And there is more than one valley: which one a search ends in is decided by its first
steps, which under narrow noise follow a few readings far from the file. So where a search from the file does not end
soon, another looks first under wide noise, where the priors hold it near the file, and goes on from there
(continuation: E. L. Allgower, K. Georg, Introduction to Numerical Continuation Methods, SIAM 2003,
doi:10.1137/1.9780898719154).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from twin.errors import DivergedError
from twin.fitting.model import Columns, Model
from twin.fitting.noise import Series, log_det

Floats = NDArray[np.float64]

NEAR_ENOUGH = 0.5  # of ln posterior, where evidences are compared
SOON = 16  # linearisations, in which a motor near its file is fitted from there
WIDE, NEAR_THE_FILE = 10.0, 5.0  # times the noise, and what is enough there
ON_THE_WAY = 4  # linearisations of a fit that another follows under other noise or priors
ENOUGH = 0.05  # what is left to gain in ln posterior, by the quadratic model, when the search ends
LINEARISATIONS = 40
STEPS = 4  # with one linearisation
PROBE = 0.1  # of a step, for the curvature along it
MOST_BEND = 0.8  # of the step, in the metric of the damped Hessian
FARTHER = 2.0  # than the last point on the parabola of a step
STRAIGHT = 0.9  # share of a step: after one that the bend made shorter another linearisation is due
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-4, 1e-9, 1e6
TOO_LITTLE, MUCH = 0.05, 0.5  # of what the quadratic model promises: no step is made, the damping falls
WORTH = 0.5  # of the last step's gain: below, a new linearisation is due


@dataclass(frozen=True)
class Fit:
    """`beta` the mode (or where the search ended), `hessian` of - ln posterior there (Gauss-Newton), `cost` = - ln
    posterior up to a constant of the noise; `series`: residuals there, not whitened, without the columns, which are a
    hundred times as large; `left`: what the quadratic model still promises in ln posterior, under what was enough where
    the search converged."""

    model: Model
    beta: Floats
    cost: float
    hessian: Floats
    series: Sequence[Series]
    left: float
    converged: bool
    linearisations: int

    @property
    def log_evidence(self) -> float:
        """ln p(data) by Laplace's approximation, without -N ln(2 pi) / 2."""
        log_r = sum(log_det(series, self.model.noise_of(series.channel)) for series in self.series)
        volume = np.linalg.slogdet(self.hessian)[1] + 2 * np.log(self.model.sd).sum()
        return -(self.cost + (float(volume) + float(log_r)) / 2)

    def linearised(self) -> Sequence[Columns]:
        """Residuals and columns, not whitened: worked out anew."""
        return self.model.linearise(self.beta)

    @property
    def to_gain(self) -> float:
        """What a search that was cut short may still gain in ln posterior, by the quadratic model."""
        return 0.0 if self.converged else self.left

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which entries of the vector are not at a bound."""
        return (self.beta > self.model.low) & (self.beta < self.model.high)

    @property
    def covariance_diagonal(self) -> Floats:
        return np.diag(np.linalg.inv(self.hessian))


def fit_from_file(model: Model) -> Fit:
    """The mode that a search from the file's own numbers ends in, or, where it does not end soon, one from there by way
    of wide noise, if that is better; to what is enough to compare evidences. Raises as `fit` does from there."""
    straight = fit(model, np.zeros(len(model.parameters)), NEAR_ENOUGH, SOON)
    if straight.converged:
        return straight
    try:
        around = fit(model, _under_wide_noise(model).beta, NEAR_ENOUGH)
    except DivergedError:
        around = straight
    if around.converged and around.cost < straight.cost:
        return around
    return max(around, fit(model, straight.beta, NEAR_ENOUGH), key=lambda found: found.log_evidence)


def _under_wide_noise(model: Model) -> Fit:
    names = {one.name for test in model.tests for one in (*test.channels, *test.meters, *test.supposed)}
    own = {name: model.noise_of(name) for name in names}
    wide = {name: replace(one, ar_sd=WIDE * one.ar_sd, ou_sd=WIDE * one.ou_sd) for name, one in own.items()}
    return fit(model.with_noise(wide), np.zeros(len(model.parameters)), NEAR_THE_FILE, ON_THE_WAY)


def fit(model: Model, start: Floats, enough: float = ENOUGH, linearisations: int = LINEARISATIONS) -> Fit:
    """Search from `start`. Raises `DivergedError` where the run from there leaves the finite numbers, or is so near it
    that a reading moves without measure with a parameter."""
    here, used, damping = _about(model, start.copy()), 1, FIRST_DAMPING
    while True:
        left = here.promised(here.step(0.0))
        if left < enough or used >= linearisations or damping > MOST_DAMPING:
            series = [part.series for part in here.parts]
            return Fit(model, here.beta, here.cost, here.hessian, series, left, left < enough, used)
        there, damping = _stepped(here, damping, enough)
        if there is not here:
            here, used = _about(model, there.beta), used + 1


def _stepped(start: _About, damping: float, enough: float) -> tuple[_About, float]:
    """Where the steps lead that are worth making with one linearisation, and the damping of the next."""
    here, gained_before = start, math.inf
    for _ in range(STEPS):
        step = here.step(damping)
        share, found = _along(here, step, here.bend(step, damping), damping)
        promised = here.promised(share * step)
        if found is None or here.cost - found.cost < TOO_LITTLE * promised:
            damping = max(damping * 10, FIRST_DAMPING)
            if here is not start or damping > MOST_DAMPING:
                break
            continue
        gained, here = here.cost - found.cost, found
        if share > STRAIGHT and gained > MUCH * promised:
            damping = max(damping / 10, LEAST_DAMPING)
        if share < STRAIGHT or gained < max(WORTH * gained_before, enough):
            break
        gained_before = gained
    return here, damping


def _along(here: _About, step: Floats, bend: Floats | None, damping: float) -> tuple[float, _About | None]:
    """The share of a step, and the lowest point tried there: on its parabola, as far as the bend stays a correction and
    on while it pays; and where that is not the whole step, the straight one. None where all run away."""
    tried: list[tuple[float, _About | None]] = []
    if bend is not None:
        share = here.straight(step, bend, damping)
        tried.append((share, here.moved(here.beta + share * step + share**2 * bend)))
        while share < 1.0 and _cost(tried[-1]) == min(map(_cost, tried)) < here.cost:
            share = min(1.0, FARTHER * share)
            tried.append((share, here.moved(here.beta + share * step + share**2 * bend)))
    if not tried or tried[0][0] < STRAIGHT:
        tried.append((1.0, here.moved(here.beta + step)))
    return min(tried, key=_cost)


def _cost(tried: tuple[float, _About | None]) -> float:
    return math.inf if tried[1] is None else tried[1].cost


@dataclass(frozen=True)
class _About:
    """- ln posterior about a vector `beta` (p,): its value `cost`, the downhill `slope` (p,) and the whitened residuals
    there, a channel of a test each; Gauss-Newton `hessian` (p, p), `parts` and `white`ned columns where it was last
    linearised."""

    model: Model
    beta: Floats
    cost: float
    slope: Floats
    residuals: Sequence[Floats]
    hessian: Floats
    parts: Sequence[Columns]
    white: Sequence[Floats]

    def promised(self, step: Floats) -> float:
        """What a step gains in ln posterior, by the quadratic model."""
        return float(self.slope @ step - step @ self.hessian @ step / 2)

    def damped(self, damping: float) -> Floats:
        damped: Floats = self.hessian + damping * np.diag(np.diag(self.hessian))
        return damped

    def step(self, damping: float) -> Floats:
        """The damped step; entries that would leave their bounds are held there and the others solved again."""
        model, beta, damped = self.model, self.beta, self.damped(damping)
        step = np.zeros(beta.size)
        held = np.zeros(beta.size, dtype=np.bool_)
        while True:
            free = ~held
            right = self.slope[free] - damped[np.ix_(free, held)] @ step[held]
            step[free] = cho_solve(_factor(damped[np.ix_(free, free)]), right)
            over, under = free & (beta + step > model.high), free & (beta + step < model.low)
            if not (over.any() or under.any()):
                return step
            step[over] = model.high[over] - beta[over]
            step[under] = model.low[under] - beta[under]
            held |= over | under

    def bend(self, step: Floats, damping: float) -> Floats | None:
        """What the curvature of the readings along a step adds to it; None where a small part of the step already
        leaves the finite numbers."""
        try:
            ahead = self.model.residuals(self.beta + PROBE * step)
        except DivergedError:
            return None
        right = np.zeros_like(step)
        for part, own, before, series in zip(self.parts, self.white, self.residuals, ahead, strict=True):
            after = self.model.whitened(series, series.y[:, None])[:, 0]
            right[part.at] += own.T @ (2 / PROBE * ((after - before) / PROBE + own @ step[part.at]))
        bend: Floats = cho_solve(_factor(self.damped(damping)), right) / 2
        return bend

    def straight(self, step: Floats, bend: Floats, damping: float) -> float:
        """The share of a step up to which the bend stays a correction of it."""
        damped = self.damped(damping)
        size, most = (float(np.sqrt(x @ damped @ x)) for x in (bend, step))
        return min(1.0, MOST_BEND * most / size) if size > 0.0 else 1.0

    def moved(self, beta: Floats) -> _About | None:
        """The same linearisation about another vector, brought within the bounds; None where the run leaves the finite
        numbers there."""
        beta = np.clip(beta, self.model.low, self.model.high)
        try:
            series = self.model.residuals(beta)
        except DivergedError:
            return None
        residuals = [self.model.whitened(s, s.y[:, None])[:, 0] for s in series]
        sd = self.model.sd
        cost = float(sum(r @ r for r in residuals) + np.sum((beta / sd) ** 2)) / 2
        slope = -beta / sd**2
        for part, own, residual in zip(self.parts, self.white, residuals, strict=True):
            slope[part.at] += own.T @ residual
        return replace(self, beta=beta, cost=cost, slope=slope, residuals=residuals)


def _factor(hessian: Floats) -> tuple[Floats, bool]:
    """The Cholesky factor, for `cho_solve`. A Hessian holds every prior, and so has one, but where columns are so large
    that the priors are lost in their rounding."""
    try:
        factor: tuple[Floats, bool] = cho_factor(hessian)
    except LinAlgError as error:
        raise DivergedError(
            f"the twin all but runs away: {len(hessian)} parameters move its readings so much that no step can be"
            " worked out from there"
        ) from error
    return factor


def _about(model: Model, beta: Floats) -> _About:
    sd = model.sd
    hessian = np.diag(1.0 / sd**2)
    slope = -beta / sd**2
    cost = float(np.sum((beta / sd) ** 2)) / 2
    parts = model.linearise(beta)
    columns, residuals = [], []
    for _, group in groupby(parts, key=lambda part: part.series.session):  # of one test: the same places, one product
        of_test = list(group)
        at = of_test[0].at
        white = [model.whitened(p.series, np.column_stack([p.series.y, p.columns])) for p in of_test]
        stack = np.concatenate(white)
        residual, own = stack[:, 0], stack[:, 1:]
        hessian[np.ix_(at, at)] += own.T @ own
        slope[at] += own.T @ residual
        cost += float(residual @ residual) / 2
        columns += [w[:, 1:] for w in white]
        residuals += [w[:, 0] for w in white]
    return _About(model, beta, cost, slope, residuals, hessian, parts, columns)
