"""The form of one specimen's deterioration over dose, against what repeatability alone would show.

Four forms are compared by their marginal likelihoods: none (ln R is constant) and the three of `courses.py`. The start
of ln R has a flat prior, the same in all forms; amplitudes have half-normal priors of stated widths, and each course's
likelihood is their integral in closed form (a Gaussian times the probability that both are positive: `orthant.py`);
places of turns and curvatures are summed over a grid. Before looking none has probability 1/2, the others 1/6 each.

Errors are normal, but for one check at most: each may, 1 in 50, be off by five times as much (a plug, a clamp, a door
left open). Else a first check that is off would be a course that levels off at once. Under them lies what evaluation
does slowly: surfaces darken and thermocouples age, so that ln R of insulation to which nothing happens wanders, as
Brownian motion over dose, by half a percent from the first check to the last.

Whether anything is there at all is asked apart from that: the summed evidence for a change is compared with the same
number of series that are constant but for such errors of the same standard deviations at the same doses (the odd
check's larger where there is one). A form is named where fewer than 1 in 100 of those show as much, and none is not
the more probable even so. (BIC over four forms calls healthy series of 17 checks a trend in 10 of 24 cases.)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import log_ndtr, logsumexp, ndtri_exp

from analytics.insulation.courses import CHANGEPOINT, CHANGING, DIP_THEN_RISE, Courses, courses
from analytics.insulation.orthant import log_both_positive

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NONE = "none"
PRIOR_NONE = 0.5
SIGNIFICANCE = 0.01
NULL_SERIES = 999
ODD_SHARE, ODD_TIMES, ODD_LIKELY = 0.02, 5.0, 0.02
SLOW_SD = 0.005  # of ln R, from the first check to the last
COARSE_TURNS, FINE_TURNS = 5, 63
DRAWS, SWEEPS = 1000, 8
FINE = np.linspace(0.0, 1.0, 101)
PERCENT_PER_100_H = 1e4  # of a slope of ln R in 1/h
LEAST_DOSES = 3


@dataclass(frozen=True)
class Form:
    """`name`: none, monotone, dip_then_rise or changepoint, with its `probability`; `probabilities` are those of all
    four.

    `change_at_dose_h`: where a changepoint or the lowest point of a dip lies [h], with the interval of 95 %; else None.
    `slope_percent_per_100h`: mean change of R over `branch_dose_h` [%/100 h; positive: worse], with the interval of 95
    %: the whole course where the form is none (a straight line) or monotone, from the change to the last check
    otherwise, or to where a rise has become level. `level_from_dose_h`: that place, where `level_probability` of a
    level is above one half. `p_value`: share of series without any change that show as much. `why`: what kept this from
    being assessed, or empty."""

    name: str
    probability: float
    probabilities: Mapping[str, float]
    significant: bool
    p_value: float
    change_at_dose_h: float | None
    change_ci95_dose_h: tuple[float, float] | None
    slope_percent_per_100h: float | None
    ci95: tuple[float, float] | None
    branch_dose_h: tuple[float, float] | None
    level_from_dose_h: float | None
    level_probability: float
    why: str


def assess(
    dose_h: ArrayLike,
    ln_resistance: ArrayLike,
    sd: ArrayLike,
    seed: int = 0,
    degrees_of_freedom: float = math.inf,
) -> Form:
    """The form of one specimen's checks in any order: dose (n,) [h], ln R (n,), and the standard deviation of ln R
    between repeats (n,) or one for all, known with `degrees_of_freedom` (series of the null have another true one
    each). Rows that are not finite are left out; below three different doses nothing is said."""
    dose, y, s = _clean(dose_h, ln_resistance, sd)
    distinct = np.unique(dose)
    if len(distinct) < LEAST_DOSES:
        return _unknown(f"{len(distinct)} different doses: {LEAST_DOSES} are needed at least")
    span = float(distinct[-1] - distinct[0])
    places, x = (distinct - distinct[0]) / span, (dose - dose[0]) / span
    fine = {f: c for f in CHANGING if (c := courses(f, places, np.concatenate([x, FINE]), FINE_TURNS)) is not None}
    odd = _OddCheck.of(_Errors.of(x, s), y).likely(
        [c for f in CHANGING if (c := courses(f, places, x, COARSE_TURNS)) is not None]
    )
    ln_weights = {f: odd.ln_weights(c) for f, c in fine.items()}
    probabilities = _probabilities(
        {NONE: float(logsumexp(odd.ln_none)), **{f: float(logsumexp(w)) for f, w in ln_weights.items()}}
    )
    name = max(ln_weights, key=lambda f: probabilities[f]) if probabilities[NONE] < 0.5 else NONE
    by_check = odd.ln_none if name == NONE else logsumexp(ln_weights[name], axis=0)
    case = int(np.argmax(by_check))
    errors = odd.errors_of(case)
    p_value = _p_value(errors, y, seed, degrees_of_freedom)
    if name == NONE or p_value > SIGNIFICANCE:
        return _constant(probabilities, p_value, dose, y, errors)
    drawn = _draw(name, fine[name], ln_weights[name][:, case], errors, y, np.random.default_rng([seed, 1]))
    return _changing(name, probabilities, p_value, float(dose[0]), span, drawn)


def _clean(dose_h: ArrayLike, ln_resistance: ArrayLike, sd: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Finite rows in the order of dose."""
    dose, y = np.asarray(dose_h, np.float64), np.asarray(ln_resistance, np.float64)
    s = np.broadcast_to(np.asarray(sd, np.float64), dose.shape)
    good = np.isfinite(dose) & np.isfinite(y) & np.isfinite(s) & (s > 0.0)
    order = np.argsort(dose[good], kind="stable")
    return dose[good][order], y[good][order], s[good][order]


def _unknown(why: str) -> Form:
    probabilities = {NONE: PRIOR_NONE, **{form: (1.0 - PRIOR_NONE) / len(CHANGING) for form in CHANGING}}
    return Form(NONE, PRIOR_NONE, probabilities, False, 1.0, None, None, None, None, None, None, 0.0, why)


# ---- marginal likelihoods ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Errors:
    """Of checks at `x` (n,), 0 at the first and 1 at the last, with standard deviations `sd` (n,). `root` (n, n):
    whitens, with the start's flat prior integrated out; root' root is the precision that is left."""

    x: Floats
    sd: Floats
    root: Floats

    @classmethod
    def of(cls, x: Floats, sd: Floats) -> _Errors:
        covariance = np.diag(sd**2) + SLOW_SD**2 * np.minimum(x[:, None], x)
        white = np.linalg.inv(np.linalg.cholesky(covariance))
        start = white.sum(axis=1)
        return cls(x, sd, np.asarray(white - np.outer(start, start @ white) / (start @ start), np.float64))

    def whitened(self, given: Courses) -> Floats:
        """The courses at the checks, in units of their amplitudes' priors: (a, n, 2)."""
        return np.asarray(self.root @ (given.columns[:, : len(self.sd)] * given.sds[:, None, :]), np.float64)


@dataclass(frozen=True)
class _Posterior:
    """Both amplitudes of each course, in units of their priors' standard deviations, before the constraint: covariance
    (a, 2, 2), and `rows` (a, 2, n) that make what the data say of them."""

    covariance: Floats
    ln_det: Floats
    rows: Floats

    @classmethod
    def of(cls, given: Courses, errors: _Errors) -> _Posterior:
        white = errors.whitened(given)
        covariance, determinant = _inverse(np.einsum("ani,anj->aij", white, white) + np.eye(2))
        return cls(covariance, np.log(determinant), white.transpose(0, 2, 1))

    def means(self, white: Floats) -> tuple[Floats, Floats]:
        """For whitened series (n, m): posterior means (a, 2, m) and twice the logarithm of what they gain (a, m)."""
        h = self.rows @ white
        mean = self.covariance @ h
        return mean, np.asarray((h * mean).sum(axis=1), np.float64)

    def ln_factors(self, white: Floats) -> Floats:
        """(a, m): ln of the marginal likelihood of each course over that of a constant."""
        mean, gained = self.means(white)
        return _ln_factor(mean.transpose(0, 2, 1), gained, self.covariance[:, None], self.ln_det[:, None])


@dataclass(frozen=True)
class _OddCheck:
    """A series `y` (n,), and which of its checks may be odd: `place` (m,), n for none of them. `ln_none` (m,): of a
    constant, with the prior of each case and over a constant without odd checks.

    With P the precision of the series without its start, a variance larger by v at check i takes P e_i e_i' P /
    (1 / v + P_ii) from it (Sherman and Morrison): what is summed over the checks is made once, and one term taken off
    for each case: `row` (m, n) is e_i' P, `pull` (m,) its factor."""

    errors: _Errors
    y: Floats
    place: Ints
    row: Floats
    pull: Floats
    ln_none: Floats

    @classmethod
    def of(cls, errors: _Errors, y: Floats) -> _OddCheck:
        n, precision = len(y), errors.root.T @ errors.root
        more, own = (ODD_TIMES**2 - 1.0) * errors.sd**2, np.diag(precision)
        row, pull = np.vstack([precision, np.zeros(n)]), np.append(1.0 / (1.0 / more + own), 0.0)
        ln_prior = math.log1p(-ODD_SHARE) * n + np.append(np.full(n, math.log(ODD_SHARE / (1.0 - ODD_SHARE))), 0.0)
        gained = pull * (row @ y) ** 2 - np.append(np.log1p(more * own), 0.0)
        return cls(errors, y, np.arange(n + 1), row, pull, np.asarray(ln_prior + gained / 2, np.float64))

    def likely(self, given: Sequence[Courses]) -> _OddCheck:
        """Without the cases that a coarse grid of courses finds improbable."""
        ln = logsumexp([self.ln_none, *(logsumexp(self.ln_weights(c), axis=0) for c in given)], axis=0)
        keep = (ln > ln.max() + math.log(ODD_LIKELY)) | (self.place == len(self.y))
        return replace(
            self, place=self.place[keep], row=self.row[keep], pull=self.pull[keep], ln_none=self.ln_none[keep]
        )

    def ln_weights(self, given: Courses) -> Floats:
        """(a, m): ln of the marginal likelihood of each course with its weight, likewise."""
        white = self.errors.whitened(given)
        gram = np.einsum("ani,anj->aij", white, white) + np.eye(2)
        at = self.row @ (given.columns[:, : len(self.y)] * given.sds[:, None, :])
        pulled = self.pull[:, None] * at
        covariance, determinant = _inverse(gram[:, None] - pulled[..., :, None] * at[..., None, :])
        h = ((self.errors.root @ self.y) @ white)[:, None] - (self.row @ self.y)[:, None] * pulled
        mean = np.einsum("amkl,aml->amk", covariance, h)
        ln = _ln_factor(mean, (h * mean).sum(axis=-1), covariance, np.log(determinant))
        return np.asarray(np.log(given.weight)[:, None] + self.ln_none + ln, np.float64)

    def errors_of(self, case: int) -> _Errors:
        odd = np.arange(len(self.y)) == self.place[case]
        return _Errors.of(self.errors.x, np.where(odd, ODD_TIMES, 1.0) * self.errors.sd)


def _ln_factor(mean: Floats, gained: Floats, covariance: Floats, ln_det: Floats) -> Floats:
    """ln of the marginal likelihood over that of a constant, from the amplitudes' posterior without the constraint:
    mean (..., 2), covariance (..., 2, 2)."""
    sd = np.sqrt(covariance[..., [0, 1], [0, 1]])
    z = mean / sd
    correlation = np.broadcast_to(covariance[..., 0, 1] / sd.prod(axis=-1), gained.shape)
    positive = log_both_positive(z[..., 0], z[..., 1], correlation)
    return np.asarray((gained - ln_det) / 2 + positive + math.log(4.0), np.float64)


def _inverse(matrix: Floats) -> tuple[Floats, Floats]:
    """Of symmetric (..., 2, 2), with the determinants."""
    a, b, d = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 1]
    determinant = a * d - b**2
    swapped = np.stack([np.stack([d, -b], axis=-1), np.stack([-b, a], axis=-1)], axis=-2)
    return np.asarray(swapped / determinant[..., None, None], np.float64), np.asarray(determinant, np.float64)


def _probabilities(ln_likelihood: Mapping[str, float]) -> dict[str, float]:
    """Of all forms, from their marginal likelihoods; forms that cannot be assessed have 0."""
    each = math.log((1.0 - PRIOR_NONE) / len(CHANGING))
    priors = {NONE: math.log(PRIOR_NONE), **dict.fromkeys(CHANGING, each)}
    ln = np.array([prior + ln_likelihood.get(form, -math.inf) for form, prior in priors.items()])
    shares = np.exp(ln - logsumexp(ln))
    return dict(zip(priors, shares.tolist(), strict=True))


# ---- the null ------------------------------------------------------------------------------------------------------


def _p_value(errors: _Errors, y: Floats, seed: int, degrees_of_freedom: float) -> float:
    x, sd = np.ascontiguousarray(errors.x), np.ascontiguousarray(errors.sd)
    coarse, null = _null(x.tobytes(), sd.tobytes(), seed, degrees_of_freedom)
    seen = _evidence(coarse, errors.root @ y[:, None])[0]
    return float((1 + np.count_nonzero(null >= seen)) / (1 + NULL_SERIES))


@lru_cache(maxsize=64)
def _null(
    x_bytes: bytes, sd_bytes: bytes, seed: int, degrees_of_freedom: float
) -> tuple[Sequence[tuple[Floats, _Posterior]], Floats]:
    """The courses of a coarse grid, and the evidence for a change that series show in which there is none."""
    x, sd = np.frombuffer(x_bytes), np.frombuffer(sd_bytes)
    errors = _Errors.of(x, sd)
    found = [courses(form, np.unique(x), x, COARSE_TURNS) for form in CHANGING]
    coarse = [(np.log(c.weight), _Posterior.of(c, errors)) for c in found if c is not None]
    random = np.random.default_rng([seed, 0])
    series = sd[:, None] * random.standard_normal((len(x), NULL_SERIES))
    if math.isfinite(degrees_of_freedom):
        series *= np.sqrt(degrees_of_freedom / random.chisquare(degrees_of_freedom, NULL_SERIES))
    steps = np.sqrt(np.diff(x, prepend=0.0))[:, None] * random.standard_normal(series.shape)
    return coarse, _evidence(coarse, errors.root @ (series + SLOW_SD * np.cumsum(steps, axis=0)))


def _evidence(coarse: Sequence[tuple[Floats, _Posterior]], white: Floats) -> Floats:
    """(m,): ln of the mean factor of the forms."""
    each = [logsumexp(ln_weight[:, None] + posterior.ln_factors(white), axis=0) for ln_weight, posterior in coarse]
    return np.asarray(logsumexp(np.array(each), axis=0), np.float64)


# ---- the answer ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Drawn:
    """Courses drawn from the posterior, in x: where each turns, the mean slope after it, and where the rise ends
    (m,)."""

    turn: Floats
    slope: Floats
    end: Floats
    level_probability: float


def _draw(
    name: str, given: Courses, ln_weights: Floats, errors: _Errors, y: Floats, random: np.random.Generator
) -> _Drawn:
    shares = np.exp(ln_weights - logsumexp(ln_weights))
    few = given.some(random.choice(len(shares), DRAWS, p=shares / shares.sum()))
    posterior = _Posterior.of(few, errors)
    mean, _ = posterior.means(errors.root @ y[:, None])
    amplitudes = few.sds * _positive_pairs(mean[:, :, 0], posterior.covariance, random)
    end = np.where(np.isfinite(few.level), few.level, 1.0)
    level_probability = float(shares[np.isfinite(given.level)].sum())
    blur = few.cell * (random.random(DRAWS) - 0.5)
    if name == CHANGEPOINT:
        slope = few.columns[:, -1, 0] * amplitudes[:, 0] / (1.0 - few.turn)
        return _Drawn(few.turn + blur, slope, end, level_probability)
    curve = np.einsum("afi,ai->af", few.columns[:, len(y) :], amplitudes)
    low = np.argmin(curve, axis=1) if name == DIP_THEN_RISE else np.zeros(DRAWS, np.int64)
    low = np.minimum(low, len(FINE) - 2)
    rise = curve[:, -1] - np.take_along_axis(curve, low[:, None], axis=1)[:, 0]
    return _Drawn(FINE[low] + blur, rise / (np.maximum(end, FINE[low + 1]) - FINE[low]), end, level_probability)


def _positive_pairs(mean: Floats, covariance: Floats, random: np.random.Generator) -> Floats:
    """One pair (m, 2) from each normal distribution cut to positive values, by Gibbs sampling."""
    spread = np.sqrt(np.linalg.det(covariance)[:, None] / covariance[:, [1, 0], [1, 0]])  # of each given the other
    weight = covariance[:, [0, 1], [1, 0]] / covariance[:, [1, 0], [1, 0]]
    drawn = np.maximum(mean, spread)
    for _ in range(SWEEPS):
        for k in (0, 1):
            centre = mean[:, k] + weight[:, k] * (drawn[:, 1 - k] - mean[:, 1 - k])
            above = np.log(random.random(len(mean))) + log_ndtr(centre / spread[:, k])
            drawn[:, k] = np.maximum(centre - spread[:, k] * ndtri_exp(above), 0.0)
    return np.asarray(drawn, np.float64)


def _changing(
    name: str, probabilities: Mapping[str, float], p_value: float, first_h: float, span_h: float, drawn: _Drawn
) -> Form:
    def dose(x: Floats) -> tuple[float, tuple[float, float]]:
        low, middle, high = np.quantile(first_h + span_h * x, [0.025, 0.5, 0.975])
        return float(middle), (float(low), float(high))

    per_100h = PERCENT_PER_100_H / span_h * drawn.slope
    low, middle, high = np.quantile(per_100h, [0.025, 0.5, 0.975])
    turn, turn_band = dose(drawn.turn)
    turns = name in (DIP_THEN_RISE, CHANGEPOINT)
    level = dose(drawn.end[drawn.end < 1.0])[0] if drawn.level_probability > 0.5 else None
    return Form(
        name=name,
        probability=probabilities[name],
        probabilities=probabilities,
        significant=True,
        p_value=p_value,
        change_at_dose_h=turn if turns else None,
        change_ci95_dose_h=turn_band if turns else None,
        slope_percent_per_100h=float(middle),
        ci95=(float(low), float(high)),
        branch_dose_h=(turn if turns else first_h, first_h + span_h if level is None else level),
        level_from_dose_h=level,
        level_probability=drawn.level_probability,
        why="",
    )


def _constant(probabilities: Mapping[str, float], p_value: float, dose: Floats, y: Floats, errors: _Errors) -> Form:
    """None, with the straight line that the checks allow."""
    white = errors.root @ np.column_stack([dose - dose.mean(), y])
    information = float(white[:, 0] @ white[:, 0])
    slope = PERCENT_PER_100_H * float(white[:, 0] @ white[:, 1]) / information
    reach = 1.96 * PERCENT_PER_100_H / math.sqrt(information)
    return Form(
        name=NONE,
        probability=probabilities[NONE],
        probabilities=probabilities,
        significant=False,
        p_value=p_value,
        change_at_dose_h=None,
        change_ci95_dose_h=None,
        slope_percent_per_100h=slope,
        ci95=(slope - reach, slope + reach),
        branch_dose_h=(float(dose[0]), float(dose[-1])),
        level_from_dose_h=None,
        level_probability=0.0,
        why="",
    )
