"""Many specimens at once: each has a start and a slope of its own, drawn from what specimens are like.

    y_ij = x_ij' beta + b_i + (s_i + u_batch(i)) D_ij + sd_ij e_ij

with (b_i, s_i) normal with any covariance, u and e normal and independent, var e = scale^2. The variances are by
restricted maximum likelihood (Patterson and Thompson, Biometrika 58 (1971) 545, DOI 10.1093/biomet/58.3.545), profiled
over beta and the scale as Bates, Maechler, Bolker and Walker do (J. Stat. Softw. 67 (2015) 1, DOI
10.18637/jss.v067.i01): the covariance of a specimen's pair is scale^2 L L' with L lower triangular and its diagonal not
negative, so that a variance of exactly 0 is an ordinary point of the search and the rest stays right there.

Rows enter through sums for each specimen (2 x 2, and its products with the columns that specimens share), made once;
one evaluation eliminates every specimen's pair at once and solves for what specimens share.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cho_solve, solve_triangular
from scipy.optimize import minimize
from scipy.stats import chi2

from analytics.insulation.arrays import Floats, Ints

SMALL = 0.1  # relative standard deviation: a search that ends below it is done once more from there
STEP = 1e-4  # of the differences that the search takes its slopes from
MOST, ZERO = 1e3, 1e-4  # relative standard deviations: the highest, and what counts as none (as in lme4)
LEAST_FOR_BENDS = 20  # specimens
BENDS = (0.25, 0.5, 0.75)  # quantiles of the checks' doses
TOLD = 5e-3  # share of a bent line's columns that is their own
CHANCE = 0.01
STRAIGHT: Floats = np.empty(0)  # no dose at which the common course bends


def bends(dose_h: ArrayLike, specimens: int) -> Floats:
    """Doses [h] at which the course that all specimens share may bend: quartiles of the checks' doses, fewer of them
    where checks at the same few doses do not tell so many, none for few specimens."""
    dose = np.asarray(dose_h, np.float64)
    knots = np.unique(np.quantile(dose, BENDS)) if specimens >= LEAST_FOR_BENDS else np.empty(0)
    knots = knots[(knots > dose.min()) & (knots < dose.max())]
    while len(knots) and not _told(bent_line(dose, knots)):
        knots = np.delete(knots, len(knots) // 2)
    return np.asarray(knots, np.float64)


def _told(line: Floats) -> bool:
    """Whether no column (n, k) follows from the others, but for what doses scatter by."""
    sizes = np.linalg.svd(line / np.linalg.norm(line, axis=0), compute_uv=False)
    return bool(sizes[-1] > TOLD * sizes[0])


def bent_line(dose_h: ArrayLike, knots: Floats) -> Floats:
    """Columns (n, 2 + knots) at doses (n,): a constant, the dose, and what it is beyond each knot [h]."""
    dose = np.asarray(dose_h, np.float64)
    return np.column_stack([np.ones_like(dose), dose, np.maximum(dose[:, None] - knots, 0.0)])


def fit_course(
    specimen: ArrayLike, dose_h: ArrayLike, y: ArrayLike, sd: ArrayLike, batch: ArrayLike | None = None
) -> tuple[MixedFit, Floats]:
    """The fit that is not degenerate, with the bends that all specimens share where `fit_bends` finds them, and the
    doses of these (k,) [h]; else without any."""
    bent = fit_bends(specimen, dose_h, y, sd, batch)
    return bent or (fit(specimen, dose_h, y, sd, STRAIGHT, batch, nondegenerate=True), STRAIGHT)


def fit_bends(
    specimen: ArrayLike, dose_h: ArrayLike, y: ArrayLike, sd: ArrayLike, batch: ArrayLike | None = None
) -> tuple[MixedFit, Floats] | None:
    """The fit that is not degenerate, with the bends that all specimens share, and the doses of these (k,) [h]; None
    where their Wald statistic is one that chance makes in more than 1 of 100 fleets."""
    knots = bends(dose_h, int(np.max(specimen)) + 1)
    if not len(knots):
        return None
    bent = fit(specimen, dose_h, y, sd, knots, batch, nondegenerate=True)
    off = bent.fixed[2:]
    wald = float(off @ np.linalg.solve(bent.fixed_covariance[2:, 2:], off))
    return (bent, knots) if wald > chi2.isf(CHANCE, len(off)) else None


@dataclass(frozen=True)
class MixedFit:
    """`fixed` (p,) with covariance (p, p). Standard deviations: of the start (of y), of the specimens' slopes, of the
    batches' slopes (y / h), 0 where the data show none; `correlation` of start and slope (0 where either is 0);
    `scale`: what the given sds are to be multiplied by. `deviance`: minus twice the restricted log-likelihood.

    `effect` (m, 2): b_i and s_i + u_batch(i), the best linear unbiased predictions; `joint` (m, p + 2, p + 2):
    covariance of (beta, effect) with the variances held at their estimates."""

    fixed: Floats
    fixed_covariance: Floats
    start_sd: float
    slope_sd: float
    correlation: float
    batch_slope_sd: float
    scale: float
    deviance: float
    effect: Floats
    joint: Floats


def fit(
    specimen: ArrayLike,
    dose_h: ArrayLike,
    y: ArrayLike,
    sd: ArrayLike,
    knots: Floats = STRAIGHT,
    batch: ArrayLike | None = None,
    nondegenerate: bool = False,
) -> MixedFit:
    """The mixed model of rows in any order: place of the specimen (n,) from 0 to m - 1, dose (n,) [h], y (n,),
    standard deviation (n,) but for one common factor. x is the `bent_line` with `knots`. `batch` (m,): place of each
    specimen's batch, -1 for none. Needs more rows than columns of x, p.

    `nondegenerate`: with the weak prior of Chung et al. (Psychometrika 78 (2013) 685, DOI 10.1007/s11336-013-9328-2)
    on the standard deviations of slopes, proportional to them. A few specimens often make them exactly 0 by chance,
    and bands too narrow.
    """
    sums = _Sums.of(specimen, dose_h, y, sd, knots, batch)
    best = _search(sums, 1.0, nondegenerate)
    free = [0, 2] + [3] * (sums.batches > 1)
    if best[0][free].min() < SMALL:
        best = min(best, _search(sums, SMALL, nondegenerate), key=lambda found: found[1])
    return _fit_of(sums, np.where(np.abs(best[0]) < ZERO, 0.0, best[0]))


@dataclass(frozen=True)
class _Sums:
    """Weighted sums over rows, in units in which doses, columns and weights are about 1. A specimen has two columns,
    constant and dose; q columns are shared: batch slopes, then the fixed ones, and it meets 1 + p of them: its own
    batch's (0 where it has none) and the fixed ones. Products of a specimen's with themselves `zz` (m, 2, 2), with the
    shared ones that it meets `zs` (m, 2, 1 + p) and with y `zy` (m, 2); of the shared ones `ss` (q, q) and `sy` (q,);
    `yy`."""

    zz: Floats
    zs: Floats
    zy: Floats
    ss: Floats
    sy: Floats
    yy: float
    of_batch: Ints
    batches: int
    p: int
    rows: int
    ln_weights: float
    dose_scale: float
    column_scale: Floats
    sd_scale: float
    first_fixed: Floats

    @classmethod
    def of(
        cls, specimen: ArrayLike, dose_h: ArrayLike, y: ArrayLike, sd: ArrayLike, knots: Floats, batch: ArrayLike | None
    ) -> _Sums:
        who, dose = np.asarray(specimen, np.int64), np.asarray(dose_h, np.float64)
        sd = np.broadcast_to(np.asarray(sd, np.float64), dose.shape)
        columns = bent_line(dose, knots)
        m, n, p = int(who.max()) + 1, len(who), columns.shape[1]
        of_batch = np.full(m, -1) if batch is None else np.asarray(batch, np.int64)
        sd_scale = math.exp(float(np.log(sd).mean()))
        root = sd_scale / sd
        dose_scale = float(np.abs(dose).max()) or 1.0
        column_scale = np.sqrt((columns**2).mean(axis=0))
        run = root * dose / dose_scale
        x = columns / column_scale * root[:, None]
        first, *_ = np.linalg.lstsq(x, root * np.asarray(y, np.float64), rcond=None)
        rest = root * np.asarray(y, np.float64) - x @ first  # small numbers: sums of their squares lose nothing
        own, shared = (root, run), (np.where(of_batch[who] >= 0, run, 0.0), *x.T)

        def products(some: Sequence[Floats], others: Sequence[Floats]) -> Floats:
            return np.stack([np.bincount(who, a * b, m) for a in some for b in others], axis=1)

        return cls(
            zz=products(own, own).reshape(m, 2, 2),
            zs=products(own, shared).reshape(m, 2, 1 + p),
            zy=products(own, [rest]),
            ss=_of_all(of_batch, products(shared, shared).reshape(m, 1 + p, 1 + p)),
            sy=_of_all(of_batch, products(shared, [rest])),
            yy=float(rest @ rest),
            of_batch=of_batch,
            batches=int(of_batch.max()) + 1,
            p=p,
            rows=n,
            ln_weights=float(2.0 * np.log(root).sum()),
            dose_scale=dose_scale,
            column_scale=column_scale,
            sd_scale=sd_scale,
            first_fixed=first,
        )


def _of_all(of_batch: Ints, each: Floats) -> Floats:
    """What each specimen brings to the shared columns that it meets, (m, 1 + p) or (m, 1 + p, 1 + p), summed over
    specimens at all shared columns: (q,) or (q, q)."""
    batches = int(of_batch.max()) + 1
    sums = [np.bincount(of_batch + 1, one, batches + 1) for one in each.reshape(len(each), -1).T]
    by_batch = np.stack(sums, axis=1).reshape(batches + 1, *each.shape[1:])  # the first of those without one
    fixed, own = by_batch.sum(axis=0)[1:], by_batch[1:, 0]
    if each.ndim == 2:
        return np.concatenate([own, fixed])
    return np.block([[np.diag(own[:, 0]), own[:, 1:]], [own[:, 1:].T, fixed[:, 1:]]])


@dataclass(frozen=True)
class _Solved:
    """The fit at one set of variances: L (2, 2), the inverse of I + L' zz L (m, 2, 2), the shared columns' relative
    standard deviations (q,), 1 for fixed ones, the Cholesky factor of what is left for them, its solution, scale^2
    and the deviance."""

    lower: Floats
    inverse: Floats
    relative: Floats
    factor: Floats
    shared: Floats
    variance: float
    deviance: float


def _solve(sums: _Sums, theta: Floats) -> _Solved:
    lower = np.array([[theta[0], 0.0], [theta[1], theta[2]]])
    inner = np.eye(2) + lower.T @ sums.zz @ lower
    determinant = inner[:, 0, 0] * inner[:, 1, 1] - inner[:, 0, 1] ** 2
    inverse = np.empty_like(inner)
    inverse[:, 0, 0], inverse[:, 1, 1] = inner[:, 1, 1] / determinant, inner[:, 0, 0] / determinant
    inverse[:, 0, 1] = inverse[:, 1, 0] = -inner[:, 0, 1] / determinant
    h, g = lower.T @ sums.zs, sums.zy @ lower
    weighted = (inverse @ h).transpose(0, 2, 1)
    relative = np.ones(sums.batches + sums.p)
    relative[: sums.batches] = theta[3]
    left = (sums.ss - _of_all(sums.of_batch, weighted @ h)) * relative[:, None] * relative
    left[np.arange(sums.batches), np.arange(sums.batches)] += 1.0
    right = (sums.sy - _of_all(sums.of_batch, (weighted @ g[:, :, None])[:, :, 0])) * relative
    factor = np.asarray(np.linalg.cholesky(left), np.float64)
    half = solve_triangular(factor, right, lower=True)
    square = sums.yy - float(np.einsum("mi,mij,mj->", g, inverse, g)) - float(half @ half)
    degrees = sums.rows - sums.p
    variance = square / degrees
    ln_det = float(np.log(determinant).sum()) + 2.0 * float(np.log(np.diag(factor)).sum())
    units = 2.0 * float(np.log(sums.column_scale).sum()) - sums.ln_weights
    deviance = ln_det + units + degrees * (1.0 + math.log(2.0 * math.pi * variance))
    shared = solve_triangular(factor, half, lower=True, trans="T") * relative
    return _Solved(lower, inverse, relative, factor, shared, variance, deviance)


def _search(sums: _Sums, start: float, nondegenerate: bool) -> tuple[Floats, float]:
    """The relative L (3) and standard deviation of batches that minimise the deviance, and the least deviance."""
    bounds = [(0.0, MOST), (-MOST, MOST), (0.0, MOST), (0.0, MOST if sums.batches > 1 else 0.0)]
    first = np.array([start, 0.0, start, start * (sums.batches > 1)])
    kept_off_zero = [k for k in (2, 3) if nondegenerate and bounds[k][1] > 0.0]

    def cost(theta: Floats) -> float:
        return _solve(sums, theta).deviance - 2.0 * float(np.log(theta[kept_off_zero].clip(1e-12)).sum())

    found = minimize(
        cost,
        first,
        jac="3-point",
        method="L-BFGS-B",
        bounds=bounds,
        options={"finite_diff_rel_step": STEP, "ftol": 1e-13, "gtol": 1e-7, "maxiter": 300},
    )
    return found.x, float(found.fun)


def _fit_of(sums: _Sums, theta: Floats) -> MixedFit:
    solved = _solve(sums, theta)
    batches, p, m = sums.batches, sums.p, len(sums.zz)
    covariance = cho_solve((solved.factor, True), np.diag(solved.relative)) * solved.relative[:, None] * solved.variance
    own = solved.lower @ solved.inverse @ solved.lower.T  # of a specimen's pair given the shared columns, over scale^2
    met = np.column_stack([np.arange(batches + 1) - 1, *np.tile(np.arange(batches, batches + p), (batches + 1, 1)).T])
    met[0, 0] = batches  # whatever it is: those without a batch have 0 of it
    shared = solved.shared[met][sums.of_batch + 1]
    pair = (own @ (sums.zy - (sums.zs @ shared[:, :, None])[:, :, 0])[:, :, None])[:, :, 0]
    reach = -own @ sums.zs
    members = sums.of_batch >= 0
    reach[members, 1, 0] += 1.0
    pair[members, 1] += shared[members, 0]
    both = np.concatenate([np.broadcast_to(np.eye(1 + p)[1:], (m, p, 1 + p)), reach], axis=1)
    of_met = covariance[met[:, :, None], met[:, None, :]][sums.of_batch + 1]
    joint = both @ of_met @ both.transpose(0, 2, 1)
    joint[:, p:, p:] += solved.variance * own
    units = np.concatenate([1.0 / sums.column_scale, [1.0, 1.0 / sums.dose_scale]])
    scale = math.sqrt(solved.variance)
    slope = float(np.hypot(*solved.lower[1]))
    start_sd = scale * float(solved.lower[0, 0])
    return MixedFit(
        fixed=(solved.shared[batches:] + sums.first_fixed) * units[:p],
        fixed_covariance=covariance[batches:, batches:] * units[:p, None] * units[:p],
        start_sd=start_sd,
        slope_sd=scale * slope / sums.dose_scale,
        correlation=float(solved.lower[1, 0]) / slope if slope and start_sd else 0.0,
        batch_slope_sd=scale * float(theta[3]) / sums.dose_scale,
        scale=scale / sums.sd_scale,
        deviance=solved.deviance,
        effect=pair * units[p:],
        joint=joint * units[:, None] * units,
    )
