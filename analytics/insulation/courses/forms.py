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
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import log_ndtr, ndtri_exp

from analytics.insulation.arrays import PERCENT_PER_100_H, Floats, Ints, usable
from analytics.insulation.courses.courses import CHANGEPOINT, CHANGING, DIP_THEN_RISE, Courses, courses, courses_of_all
from analytics.insulation.courses.orthant import log_both_positive

NONE = "none"
PRIOR_NONE = 0.5
SIGNIFICANCE = 0.01
NULL_SERIES = 999
LOOKS = (0, 40, 200, NULL_SERIES)  # at the null: most constant series are told from the first few
ODD_SHARE, ODD_TIMES, ODD_LIKELY = 0.02, 5.0, 0.02
SLOW_SD = 0.005  # of ln R, from the first check to the last
COARSE_TURNS, FINE_TURNS = 5, 63
DRAWS, SWEEPS = 1000, 8
FINE = np.linspace(0.0, 1.0, 101)
COURSE_STEP = 4  # of FINE, from one place of a fitted course to the next
LEAST_DOSES = 3


@dataclass(frozen=True)
class FittedCourse:
    """R by a form over the dose: `dose_h` (m,) [h]; `ln_middle`, `ln_low`, `ln_high` (m,) of ln R in K/W, the last two
    the ends of 95 %, of the course and not of a single check."""

    dose_h: tuple[float, ...]
    ln_middle: tuple[float, ...]
    ln_low: tuple[float, ...]
    ln_high: tuple[float, ...]

    @classmethod
    def of(cls, dose_h: Floats, middle: Floats, low: Floats, high: Floats) -> FittedCourse:
        return cls(*(tuple(values.tolist()) for values in (dose_h, middle, low, high)))


@dataclass(frozen=True)
class Form:
    """The form of one specimen's course: `name` is none, monotone, dip_then_rise or changepoint; `probabilities` are
    those of all four.

    `change_at_dose_h` [h]: where a changepoint or the lowest point of a dip lies, with the interval of 95 %; else
    None. `slope_percent_per_100h` [%/100 h; positive: worse]: mean change of R over `branch_dose_h`, with the
    interval of 95 %. That branch is the whole course where the form is none (a straight line) or monotone, else from
    the change to the last check or to where a rise has become level. `level_from_dose_h`: that place, where
    `level_probability` of a level is above one half. `p_value`: share of series without any change that show as much,
    of those drawn until ten do. `why`: what kept this from being assessed, or empty.
    """

    name: str
    probabilities: Mapping[str, float]
    p_value: float = 1.0
    change_at_dose_h: float | None = None
    change_ci95_dose_h: tuple[float, float] | None = None
    slope_percent_per_100h: float | None = None
    ci95: tuple[float, float] | None = None
    branch_dose_h: tuple[float, float] | None = None
    level_from_dose_h: float | None = None
    level_probability: float = 0.0
    why: str = ""
    course: FittedCourse | None = None

    @property
    def probability(self) -> float:
        """That of the form `name`."""
        return self.probabilities[self.name]

    @property
    def significant(self) -> bool:
        """Whether anything changes."""
        return self.name != NONE


def assess(
    dose_h: ArrayLike, ln_resistance: ArrayLike, sd: ArrayLike, seed: int = 0, degrees_of_freedom: float = math.inf
) -> Form:
    """The form of one specimen's checks in any order: dose (n,) [h], ln R (n,), and the standard deviation of ln R
    between repeats (n,) or one for all, known with `degrees_of_freedom` (series of the null have another true one
    each). Rows that are not finite are left out; below three different doses nothing is said."""
    _, dose, y, s = usable(dose_h, ln_resistance, sd)
    order = np.argsort(dose, kind="stable")
    dose, y, s = dose[order], y[order], s[order]
    distinct = np.unique(dose)
    if len(distinct) < LEAST_DOSES:
        return unknown(
            f"checks at {len(distinct)} different dose{'s' * (len(distinct) != 1)}: at least {LEAST_DOSES} are needed"
        )
    span = float(distinct[-1] - distinct[0])
    places, x = (distinct - distinct[0]) / span, (dose - dose[0]) / span
    coarse = courses_of_all(places, x, COARSE_TURNS).wider(y)
    odd = _OddCheck.of(_Errors.of(x, s), y).likely(coarse)
    fine = {f: c.wider(y) for f in CHANGING if (c := courses(f, places, x, FINE_TURNS)) is not None}
    ln_weights = {f: odd.ln_weights(c) for f, c in fine.items()}
    probabilities = _probabilities(
        {NONE: float(_ln_sum(odd.ln_none)), **{f: float(_ln_sum(w.ravel())) for f, w in ln_weights.items()}}
    )
    name = max(ln_weights, key=lambda f: probabilities[f]) if probabilities[NONE] < 0.5 else NONE
    by_check = odd.ln_none if name == NONE else _ln_sum(ln_weights[name])
    case = int(np.argmax(by_check))
    errors = odd.errors_of(case)
    p_value = _p_value(coarse, errors, y, seed, degrees_of_freedom)
    if name == NONE or p_value > SIGNIFICANCE:
        return _constant(probabilities, p_value, dose, y, errors)
    drawn = _draw(name, places, ln_weights[name][:, case], errors, y, np.random.default_rng([seed, 1]))
    return _changing(name, probabilities, p_value, float(dose[0]), span, drawn)


def unknown(why: str) -> Form:
    """The form of checks of which nothing is said, and why: as probable as before looking."""
    probabilities = {NONE: PRIOR_NONE, **{form: (1.0 - PRIOR_NONE) / len(CHANGING) for form in CHANGING}}
    return Form(NONE, probabilities, why=why)


# ---- marginal likelihoods ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Errors:
    """Errors of checks at `x` (n,), 0 at the first and 1 at the last, with standard deviations `sd` (n,). `root` (n,
    n) makes them independent with variance 1 (it whitens a series), with the start's flat prior integrated out: root'
    root is the precision that is left. `start` (n,) takes the start out of a series, with the standard deviation
    `start_sd`."""

    x: Floats
    sd: Floats
    root: Floats
    start: Floats
    start_sd: float

    @classmethod
    def of(cls, x: Floats, sd: Floats) -> _Errors:
        covariance = np.diag(sd**2) + SLOW_SD**2 * np.minimum(x[:, None], x)
        white = np.linalg.inv(np.linalg.cholesky(covariance))
        ones = white.sum(axis=1)
        start = np.asarray(ones @ white / (ones @ ones), np.float64)
        root = np.asarray(white - np.outer(ones, start), np.float64)
        return cls(x, sd, root, start, float(1.0 / np.linalg.norm(ones)))

    def whitened(self, given: Courses) -> Floats:
        """The courses at the checks, whitened, in units of their amplitudes' priors: (2, a, n)."""
        return np.asarray(_scaled(given, len(self.sd)) @ self.root.T, np.float64)


@dataclass(frozen=True)
class _Amplitudes:
    """The normal distribution of both amplitudes, in units of their priors' standard deviations, before they are cut
    to positive values: their precision (2, 2, ...), and `pull` (2, ...), the precision times their means."""

    precision: Floats
    pull: Floats

    @property
    def mean(self) -> Floats:
        (a, b), (_, d), (first, second) = *self.precision, self.pull
        return np.stack([d * first - b * second, a * second - b * first]) / _determinant(self.precision)

    @property
    def gained(self) -> Floats:
        """Twice the logarithm of what amplitudes at their means add to the likelihood."""
        return np.asarray((self.pull * self.mean).sum(axis=0), np.float64)

    @property
    def ln_factor(self) -> Floats:
        """ln of the marginal likelihood over that of a constant."""
        (a, b), (_, d) = self.precision
        determinant, mean = _determinant(self.precision), self.mean
        gained = (self.pull * mean).sum(axis=0) - np.log(determinant)
        first, second = mean[0] * np.sqrt(determinant / d), mean[1] * np.sqrt(determinant / a)
        both = log_both_positive(first, second, -b / np.sqrt(a * d))
        return np.asarray(gained / 2 + both + math.log(4.0), np.float64)


@dataclass(frozen=True)
class _OddCheck:
    """A series `y` (n,) of which one check at most is odd, by cases: `place` (m,) of the odd check, n for none.
    `ln_none` (m,): ln of the marginal likelihood of a constant in each case, with the case's prior, over that of a
    constant without odd checks.

    With P the precision of the series without its start, a variance larger by v at check i takes P e_i e_i' P / (1 /
    v + P_ii) from it (Sherman and Morrison): what is summed over the checks is made once, and one term taken off for
    each case: `row` (m, n) is e_i' P, `pull` (m,) its factor.
    """

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

    def likely(self, given: Courses) -> _OddCheck:
        """Only the cases that are probable with the courses `given`, a coarse grid."""
        ln = _ln_sum(np.vstack([self.ln_none, self.ln_weights(given)]))
        keep = (ln > ln.max() + math.log(ODD_LIKELY)) | (self.place == len(self.y))
        return replace(
            self, place=self.place[keep], row=self.row[keep], pull=self.pull[keep], ln_none=self.ln_none[keep]
        )

    def ln_weights(self, given: Courses) -> Floats:
        """ln of the marginal likelihood of each course in each case (a, m), with the course's weight and the case's
        prior, over that of a constant without odd checks."""
        white, at = self.errors.whitened(given), _scaled(given, len(self.y)) @ self.row.T
        pulled = self.pull * at
        precision = _precision(white)[..., None] - pulled[:, None] * at
        pull = (white @ (self.errors.root @ self.y))[..., None] - (self.row @ self.y) * pulled
        ln = _Amplitudes(precision, pull).ln_factor
        return np.asarray(np.log(given.weight)[:, None] + self.ln_none + ln, np.float64)

    def errors_of(self, case: int) -> _Errors:
        odd = np.arange(len(self.y)) == self.place[case]
        return _Errors.of(self.errors.x, np.where(odd, ODD_TIMES, 1.0) * self.errors.sd)


def _ln_sum(ln: Floats) -> Floats:
    """ln of the sum of exp(ln) over the first axis."""
    top = ln.max(axis=0)
    return np.asarray(top + np.log(np.exp(ln - top).sum(axis=0)), np.float64)


def _determinant(precision: Floats) -> Floats:
    return np.asarray(precision[0, 0] * precision[1, 1] - precision[0, 1] ** 2, np.float64)


def _scaled(given: Courses, checks: int) -> Floats:
    """(2, a, n): the courses at the checks, in units of their amplitudes' priors."""
    return np.ascontiguousarray(np.moveaxis(given.columns[:, :checks] * given.sds[:, None, :], -1, 0))


def _precision(white: Floats) -> Floats:
    """(2, 2, a) of the amplitudes of whitened courses (2, a, n) with their priors."""
    return np.asarray(np.einsum("ian,jan->ija", white, white) + np.eye(2)[..., None], np.float64)


def _probabilities(ln_likelihood: Mapping[str, float]) -> dict[str, float]:
    """Probability of every form from their marginal likelihoods; 0 for forms that cannot be assessed."""
    each = math.log((1.0 - PRIOR_NONE) / len(CHANGING))
    priors = {NONE: math.log(PRIOR_NONE), **dict.fromkeys(CHANGING, each)}
    ln = np.array([prior + ln_likelihood.get(form, -math.inf) for form, prior in priors.items()])
    shares = np.exp(ln - _ln_sum(ln))
    return dict(zip(priors, shares.tolist(), strict=True))


# ---- the null ------------------------------------------------------------------------------------------------------


def _p_value(coarse: Courses, errors: _Errors, y: Floats, seed: int, degrees_of_freedom: float) -> float:
    """The share of the null's series that show as much as this one; of those up to the tenth that does, where there are
    ten (Besag and Clifford, Biometrika 78 (1991) 301, DOI 10.1093/biomet/78.2.301): more would make no form of it."""
    evidence = _Evidence(np.log(coarse.weight), errors.whitened(coarse))
    seen, enough, found = evidence.of(errors.root @ y[:, None])[0], round(SIGNIFICANCE * (1 + NULL_SERIES)), 0
    null = errors.root @ _unchanged(errors, seed, degrees_of_freedom)
    for first, last in pairwise(LOOKS):
        at = first + evidence.reached(null[:, first:last], seen)
        if found + len(at) >= enough:
            return float(enough / (1 + at[enough - found - 1]))
        found += len(at)
    return (1 + found) / (1 + NULL_SERIES)


def _unchanged(errors: _Errors, seed: int, degrees_of_freedom: float) -> Floats:
    """Series without any change (n, m), drawn from the errors."""
    random = np.random.default_rng([seed, 0])
    series = errors.sd[:, None] * random.standard_normal((len(errors.sd), NULL_SERIES))
    if math.isfinite(degrees_of_freedom):
        series *= np.sqrt(degrees_of_freedom / random.chisquare(degrees_of_freedom, NULL_SERIES))
    steps = np.sqrt(np.diff(errors.x, prepend=0.0))[:, None] * random.standard_normal(series.shape)
    return np.asarray(series + SLOW_SD * np.cumsum(steps, axis=0), np.float64)


@dataclass(frozen=True)
class _Evidence:
    """The evidence for a change of any form, by the courses of a coarse grid with their `ln_weight` (a,), `rows` (2, a,
    n) of them whitened."""

    ln_weight: Floats
    rows: Floats

    @cached_property
    def precision(self) -> Floats:
        """Inverse covariance of each course's amplitudes (2, 2, a, 1), the same for every series."""
        return _precision(self.rows)[..., None]

    def amplitudes(self, white: Floats) -> _Amplitudes:
        """The amplitudes (..., a, m) for whitened series (n, m)."""
        return _Amplitudes(self.precision, self.rows @ white)

    def of(self, white: Floats) -> Floats:
        """ln of the sum of the forms' factors (m,) for whitened series (n, m)."""
        return _ln_sum(self.ln_weight[:, None] + self.amplitudes(white).ln_factor)

    def reached(self, white: Floats, least: float) -> Ints:
        """Which of whitened series (n, m) have at least so much evidence. Most are refused by what it cannot exceed:
        a course gains the square of the whole series at most, and both amplitudes are positive with probability 1 at
        most."""
        ln_most = self.ln_weight - np.log(_determinant(self.precision)[:, 0]) / 2 + math.log(4.0)
        at = np.flatnonzero(_ln_sum(ln_most) + (white**2).sum(axis=0) / 2 >= least)
        at = at[_ln_sum(ln_most[:, None] + self.amplitudes(white[:, at]).gained / 2) >= least]
        return np.asarray(at[self.of(white[:, at]) >= least], np.int64)


# ---- the answer ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Drawn:
    """Courses drawn from the posterior (m,), in x: where each turns, its mean slope after that, and where its rise
    ends; `ln_resistance` (m, COURSE places) of each."""

    turn: Floats
    slope: Floats
    end: Floats
    level_probability: float
    ln_resistance: Floats


def _draw(
    name: str, places: Floats, ln_weights: Floats, errors: _Errors, y: Floats, random: np.random.Generator
) -> _Drawn:
    given = courses(name, places, np.concatenate([errors.x, FINE]), FINE_TURNS)
    assert given is not None
    given = given.wider(y)
    shares = np.exp(ln_weights - _ln_sum(ln_weights))
    few = given.some(random.choice(len(shares), DRAWS, p=shares / shares.sum()))
    white = errors.whitened(few)
    amplitudes = few.sds * _positive_pairs(_Amplitudes(_precision(white), white @ (errors.root @ y)), random)
    end = np.where(np.isfinite(few.level), few.level, 1.0)
    level_probability = float(shares[np.isfinite(given.level)].sum())
    blur = few.cell * (random.random(DRAWS) - 0.5)
    whole = np.einsum("afi,ai->af", few.columns, amplitudes)
    at_checks, curve = whole[:, : len(y)], whole[:, len(y) :]
    start = (y - at_checks) @ errors.start + errors.start_sd * random.standard_normal(DRAWS)
    ln_resistance = start[:, None] + curve[:, ::COURSE_STEP]
    if name == CHANGEPOINT:
        slope = few.columns[:, -1, 0] * amplitudes[:, 0] / (1.0 - few.turn)
        return _Drawn(few.turn + blur, slope, end, level_probability, ln_resistance)
    low = np.argmin(curve, axis=1) if name == DIP_THEN_RISE else np.zeros(DRAWS, np.int64)
    low = np.minimum(low, len(FINE) - 2)
    rise = curve[:, -1] - np.take_along_axis(curve, low[:, None], axis=1)[:, 0]
    return _Drawn(
        FINE[low] + blur, rise / (np.maximum(end, FINE[low + 1]) - FINE[low]), end, level_probability, ln_resistance
    )


def _positive_pairs(given: _Amplitudes, random: np.random.Generator) -> Floats:
    """One pair (m, 2) from each normal distribution cut to positive values, by Gibbs sampling."""
    (a, b), (_, d) = given.precision
    mean = given.mean.T
    spread, weight = 1.0 / np.sqrt(np.stack([a, d], axis=-1)), -np.stack([b / a, b / d], axis=-1)  # given the other
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
    turns = name in (DIP_THEN_RISE, CHANGEPOINT)
    turn, turn_band = _middle_and_band(first_h + span_h * drawn.turn)
    slope, slope_band = _middle_and_band(PERCENT_PER_100_H / span_h * drawn.slope)
    levelled = first_h + span_h * drawn.end[drawn.end < 1.0]
    level = _middle_and_band(levelled)[0] if drawn.level_probability > 0.5 else None
    return Form(
        name=name,
        probabilities=probabilities,
        p_value=p_value,
        change_at_dose_h=turn if turns else None,
        change_ci95_dose_h=turn_band if turns else None,
        slope_percent_per_100h=slope,
        ci95=slope_band,
        branch_dose_h=(turn if turns else first_h, first_h + span_h if level is None else level),
        level_from_dose_h=level,
        level_probability=drawn.level_probability,
        course=_course(first_h, span_h, drawn.ln_resistance),
    )


def _course(first_h: float, span_h: float, ln_resistance: Floats) -> FittedCourse:
    low, middle, high = np.quantile(ln_resistance, [0.025, 0.5, 0.975], axis=0)
    return FittedCourse.of(first_h + span_h * FINE[::COURSE_STEP], middle, low, high)


def _middle_and_band(drawn: Floats) -> tuple[float, tuple[float, float]]:
    low, middle, high = np.quantile(drawn, [0.025, 0.5, 0.975]).tolist()
    return middle, (low, high)


def _constant(probabilities: Mapping[str, float], p_value: float, dose: Floats, y: Floats, errors: _Errors) -> Form:
    """The form none, with the straight line that the checks allow."""
    white = errors.root @ np.column_stack([dose - dose.mean(), y])
    information = float(white[:, 0] @ white[:, 0])
    slope = PERCENT_PER_100_H * float(white[:, 0] @ white[:, 1]) / information
    reach = 1.96 * PERCENT_PER_100_H / math.sqrt(information)
    level, off = errors.start @ y, 1.96 * errors.start_sd
    return Form(
        name=NONE,
        probabilities=probabilities,
        p_value=p_value,
        slope_percent_per_100h=slope,
        ci95=(slope - reach, slope + reach),
        branch_dose_h=(float(dose[0]), float(dose[-1])),
        course=FittedCourse.of(dose[[0, -1]], *(np.full(2, level + reached) for reached in (0.0, -off, off))),
    )
