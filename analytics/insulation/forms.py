"""The form of one specimen's deterioration over dose, against what repeatability alone would show.

Four forms are compared by their marginal likelihoods: none (ln R is constant) and the three of `courses.py`. The start
of ln R has a flat prior, the same in all forms; amplitudes have half-normal priors of stated widths, and each course's
likelihood is their integral in closed form (a Gaussian times the probability that both are positive: `orthant.py`);
places of turns and curvatures are summed over a grid. Before looking none has probability 1/2, the others 1/6 each.

Whether anything is there at all is asked apart from that: the summed evidence for a change is compared with the same
number of series that are constant but for normal errors of the same standard deviations at the same doses. A form is
named where fewer than 1 in 100 of those show as much, and none is not the more probable even so. (BIC over four forms
calls healthy series of 17 checks a trend in 10 of 24 cases.)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import log_ndtr, logsumexp, ndtri_exp

from analytics.insulation.courses import CHANGEPOINT, CHANGING, DIP_THEN_RISE, Courses, courses
from analytics.insulation.orthant import log_both_positive

Floats = NDArray[np.float64]

NONE = "none"
PRIOR_NONE = 0.5
SIGNIFICANCE = 0.01
NULL_SERIES = 999
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
    ln_weights = {f: _ln_weights(_Posterior.of(c, s), c, s, y) for f, c in fine.items()}
    probabilities = _probabilities({f: float(logsumexp(w)) for f, w in ln_weights.items()})
    p_value = _p_value(x, y, s, seed, degrees_of_freedom)
    significant = p_value <= SIGNIFICANCE and probabilities[NONE] < 0.5
    name = max(ln_weights, key=lambda f: probabilities[f]) if significant else NONE
    if name == NONE:
        return _constant(probabilities, p_value, dose, y, s)
    drawn = _draw(name, fine[name], ln_weights[name], s, y, np.random.default_rng([seed, 1]))
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
class _Posterior:
    """Both amplitudes of each course, in units of their priors' standard deviations, before the constraint: covariance
    (a, 2, 2), and `rows` (a, 2, n) that make what the data say of them."""

    covariance: Floats
    ln_det: Floats
    rows: Floats

    @classmethod
    def of(cls, given: Courses, sd: Floats) -> _Posterior:
        white = _without_start(given.columns[:, : len(sd)] * given.sds[:, None, :], sd)
        gram = np.einsum("ani,anj->aij", white, white) + np.eye(2)
        determinant = gram[:, 0, 0] * gram[:, 1, 1] - gram[:, 0, 1] ** 2
        swapped = np.stack([gram[:, 1, 1], -gram[:, 0, 1], -gram[:, 0, 1], gram[:, 0, 0]], axis=1).reshape(-1, 2, 2)
        return cls(swapped / determinant[:, None, None], np.log(determinant), white.transpose(0, 2, 1))

    def means(self, white: Floats) -> tuple[Floats, Floats]:
        """For whitened series (n, m): posterior means (a, 2, m) and twice the logarithm of what they gain (a, m)."""
        h = self.rows @ white
        mean = self.covariance @ h
        return mean, np.asarray((h * mean).sum(axis=1), np.float64)

    def ln_factors(self, white: Floats) -> Floats:
        """(a, m): ln of the marginal likelihood of each course over that of a constant."""
        mean, gained = self.means(white)
        sd = np.sqrt(self.covariance[:, [0, 1], [0, 1]])
        correlation = self.covariance[:, 0, 1] / sd.prod(axis=1)
        z = mean / sd[:, :, None]
        positive = log_both_positive(z[:, 0], z[:, 1], np.broadcast_to(correlation[:, None], gained.shape))
        return np.asarray((gained - self.ln_det[:, None]) / 2 + positive + math.log(4.0), np.float64)


def _without_start(values: Floats, sd: Floats) -> Floats:
    """Whitened, with the start's flat prior integrated out: (..., n, k) with n the checks."""
    white = values / sd[:, None]
    start = (1.0 / sd) / np.linalg.norm(1.0 / sd)
    return np.asarray(white - start[:, None] * (start @ white)[..., None, :], np.float64)


def _ln_weights(posterior: _Posterior, given: Courses, sd: Floats, y: Floats) -> Floats:
    return np.asarray(np.log(given.weight) + posterior.ln_factors(_without_start(y[:, None], sd))[:, 0], np.float64)


def _probabilities(ln_factors: Mapping[str, float]) -> dict[str, float]:
    """Of all forms, from each one's marginal likelihood over that of none; forms that cannot be assessed have 0."""
    each = math.log((1.0 - PRIOR_NONE) / len(CHANGING))
    ln = np.array([math.log(PRIOR_NONE), *(each + ln_factors.get(form, -math.inf) for form in CHANGING)])
    shares = np.exp(ln - logsumexp(ln))
    return dict(zip((NONE, *CHANGING), shares.tolist(), strict=True))


# ---- the null ------------------------------------------------------------------------------------------------------


def _p_value(x: Floats, y: Floats, sd: Floats, seed: int, degrees_of_freedom: float) -> float:
    x, sd = np.ascontiguousarray(x), np.ascontiguousarray(sd)
    coarse, null = _null(x.tobytes(), sd.tobytes(), seed, degrees_of_freedom)
    seen = _evidence(coarse, _without_start(y[:, None], sd))[0]
    return float((1 + np.count_nonzero(null >= seen)) / (1 + NULL_SERIES))


@lru_cache(maxsize=64)
def _null(
    x_bytes: bytes, sd_bytes: bytes, seed: int, degrees_of_freedom: float
) -> tuple[Sequence[tuple[Floats, _Posterior]], Floats]:
    """The courses of a coarse grid, and the evidence for a change that series show in which there is none."""
    x, sd = np.frombuffer(x_bytes), np.frombuffer(sd_bytes)
    found = [courses(form, np.unique(x), x, COARSE_TURNS) for form in CHANGING]
    coarse = [(np.log(c.weight), _Posterior.of(c, sd)) for c in found if c is not None]
    random = np.random.default_rng([seed, 0])
    series = random.standard_normal((len(x), NULL_SERIES))
    if math.isfinite(degrees_of_freedom):
        series *= np.sqrt(degrees_of_freedom / random.chisquare(degrees_of_freedom, NULL_SERIES))
    return coarse, _evidence(coarse, _without_start(series * sd[:, None], sd))


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


def _draw(name: str, given: Courses, ln_weights: Floats, sd: Floats, y: Floats, random: np.random.Generator) -> _Drawn:
    shares = np.exp(ln_weights - logsumexp(ln_weights))
    few = given.some(random.choice(len(shares), DRAWS, p=shares / shares.sum()))
    posterior = _Posterior.of(few, sd)
    mean, _ = posterior.means(_without_start(y[:, None], sd))
    amplitudes = few.sds * _positive_pairs(mean[:, :, 0], posterior.covariance, random)
    end = np.where(np.isfinite(few.level), few.level, 1.0)
    level_probability = float(shares[np.isfinite(given.level)].sum())
    blur = few.cell * (random.random(DRAWS) - 0.5)
    if name == CHANGEPOINT:
        slope = few.columns[:, -1, 0] * amplitudes[:, 0] / (1.0 - few.turn)
        return _Drawn(few.turn + blur, slope, end, level_probability)
    curve = np.einsum("afi,ai->af", few.columns[:, len(sd) :], amplitudes)
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


def _constant(probabilities: Mapping[str, float], p_value: float, dose: Floats, y: Floats, sd: Floats) -> Form:
    """None, with the straight line that the checks allow."""
    white = _without_start(np.column_stack([dose - dose.mean(), y]), sd)
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
