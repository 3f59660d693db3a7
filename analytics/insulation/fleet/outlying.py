"""Which specimens, and which batches, age faster than the rest of the fleet does.

Each specimen has a slope of its own (`slopes.py`), less what all specimens have in common where the fleet's course is
bent. Slopes scatter about the centre of their batch beside their own errors, as `healthy_slopes.py` learns from them;
centres of batches scatter about the fleet's. Centres are Huber's, and spreads come from squares cut at (2.5 sd)^2, so
that what stands out does not hide itself. Where few specimens or batches are there to learn a spread from, it leans on
what is usual: specimens differ by a fifth, batches by an eighth of the common slope, with the weight of two specimens
and four batches.

A batch is tested first, by its centre against those of the others; then each specimen against the centre of its
batch: its own where the batch is outlying, so that the members of a bad batch are not listed one by one unless they
stand out of it too, and else one that leans on the fleet's; where batches have but a few specimens, that of all
healthy ones. In a batch that ages n times as fast specimens differ n times as much, as rates multiply. What is tested
takes no part in what it is tested against, and of few specimens none in the spread that it is judged by. Scores are
one-sided (outlying means worse) and compared with Student's t: each spread has as many degrees of freedom as it was
learnt from, what is usual counted with its weight, but at most sixteen for what specimens truly are, as tails are
heavier than any model's; a specimen's own error has four more than its checks. Where two spreads count their freedom
is by Welch (Biometrika 34 (1947) 28, DOI 10.1093/biomet/34.1-2.28); twenty at most for batches. Of few specimens a
batch has to stand out by Student's own test as well. Lists keep the false-discovery rate of Benjamini and Hochberg
(J. R. Stat. Soc. B 57 (1995) 289, DOI 10.1111/j.2517-6161.1995.tb02031.x): of two batches either could be the worse
one, so each is tested at half of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import false_discovery_control
from scipy.stats import t as student

from analytics.insulation.arrays import PERCENT_PER_100_H, Floats, Ints, usable
from analytics.insulation.fleet import mixed
from analytics.insulation.fleet.healthy_slopes import HealthySlopes, healthy_slopes
from analytics.insulation.fleet.slopes import Slopes, Step, slopes, step_or_slope
from analytics.insulation.fleet.spread import Spread, spread

USUAL_SHARE, USUAL_WEIGHT = 0.2, 2.0  # of the common slope: spread of specimens
USUAL_BATCH_SHARE, USUAL_BATCH_WEIGHT = 0.12, 4.0
TAILS, BATCH_TAILS = 16.0, 20.0  # degrees of freedom
ERROR_TAILS = 4.0  # the same of an error's slope, and one more a check: near to errors with six
LEAST_SPREAD = 1e-5  # 1/h: 0.1 % in 100 h
LEAST_SPECIMENS, LEAST_IN_BATCH = 3, 2
ASKED_FOR_A_STEP = 0.02  # one-sided p-value from which a specimen's checks are searched for a step
UNUSUAL = 3.0  # times the common slope or the spread, whichever is larger: how far off outlying slopes are
RETESTED = 40  # specimens with the highest scores, compared once more with all but themselves
LEAST_BY_BATCH = 5  # specimens in a batch, on average: below that specimens are compared whatever their batch
FEW = 30  # specimens: up to here what healthy slopes are like is learnt anew for that, as one of them can change it


@dataclass(frozen=True)
class SpecimenHealth:
    """How a specimen compares with its batch. `slope_percent_per_100h` by its own checks with the interval of 95 %
    [%/100 h; positive: worse], None where it has no two different doses; `score`: by how many standard deviations it
    is above its batch, with its `p_value`; `step_at_dose_h`: from where on a step was taken out that no insulation
    makes. `why`: what kept it from being compared, or empty."""

    specimen: str
    batch: str | None
    checks: int
    slope_percent_per_100h: float | None
    ci95: tuple[float, float] | None
    score: float | None
    p_value: float | None
    outlying: bool
    step_at_dose_h: float | None
    why: str


@dataclass(frozen=True)
class BatchHealth:
    """How a batch compares with the others, by the centre of its specimens' slopes [%/100 h]; the rest as of a
    specimen."""

    batch: str
    specimens: int
    slope_percent_per_100h: float | None
    score: float | None
    p_value: float | None
    outlying: bool
    why: str


@dataclass(frozen=True)
class FleetAssessment:
    """All specimens and batches, each in the order of names. `slope_percent_per_100h`: of the fleet;
    `specimen_spread`: standard deviation of healthy slopes [%/100 h]."""

    specimens: tuple[SpecimenHealth, ...]
    batches: tuple[BatchHealth, ...]
    slope_percent_per_100h: float | None
    specimen_spread: float | None
    false_discovery_rate: float


def assess(
    specimen: Sequence[str],
    batch: Sequence[str | None],
    dose_h: ArrayLike,
    ln_resistance: ArrayLike,
    sd: ArrayLike,
    false_discovery_rate: float = 0.05,
) -> FleetAssessment:
    """How the specimens and batches of a fleet compare. Arguments have one entry for each check, in any order:
    specimen and batch (n,), dose (n,) [h], ln R (n,), its standard deviation between repeats (n,) or one for all. A
    specimen's batch is the last that its checks name. Rows that are not finite are left out."""
    every, who = np.unique(np.asarray(specimen, np.str_), return_inverse=True)
    names = every.tolist()
    batch_of = dict(zip(specimen, batch, strict=True))
    batches = sorted({b for b in batch_of.values() if b is not None})
    group = np.array([len(batches) if (b := batch_of[name]) is None else batches.index(b) for name in names], np.int64)
    rows = _Rows.of(who, dose_h, ln_resistance, sd)
    own = rows.slopes(len(names))
    known = np.flatnonzero(np.isfinite(own.sd))
    if len(known) < LEAST_SPECIMENS:
        few = _Test(why=f"fewer than {LEAST_SPECIMENS} specimens have a slope")
        return FleetAssessment(
            specimens=tuple(_specimen(name, batch_of[name], own, k, None, few) for k, name in enumerate(names)),
            batches=tuple(BatchHealth(name, 0, None, **vars(few)) for name in batches),
            slope_percent_per_100h=None,
            specimen_spread=None,
            false_discovery_rate=false_discovery_rate,
        )
    fleet = _Fleet(own.slope[known], own.sd[known] ** 2, own.checks[known], group[known], len(batches))
    fleet, steps = _without_steps(fleet, known, rows, own, false_discovery_rate)
    by_batch = _test_batches(fleet, false_discovery_rate)
    bad = np.array([k for k, test in by_batch.items() if test.outlying], np.int64)
    scores, freedom = _scores(fleet, bad)
    tests = _listed(scores, student.sf(scores, freedom), false_discovery_rate)
    by_specimen = dict(zip(known.tolist(), tests, strict=True))
    return FleetAssessment(
        specimens=tuple(
            _specimen(name, batch_of[name], own, k, steps.get(k), by_specimen.get(k, NO_SLOPE))
            for k, name in enumerate(names)
        ),
        batches=tuple(_batch(name, fleet, k, by_batch.get(k)) for k, name in enumerate(batches)),
        slope_percent_per_100h=PERCENT_PER_100_H * float(fleet.among_batches(bad).centre[0]),
        specimen_spread=PERCENT_PER_100_H * math.sqrt(fleet.within.tau_square),
        false_discovery_rate=false_discovery_rate,
    )


# ---- slopes --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Rows:
    """The finite checks, with the place of their specimen; `y` is ln R without the bends that all courses share."""

    who: Ints
    dose: Floats
    y: Floats
    sd: Floats

    @classmethod
    def of(cls, who: Ints, dose_h: ArrayLike, ln_resistance: ArrayLike, sd: ArrayLike) -> _Rows:
        good, dose, y, s = usable(dose_h, ln_resistance, sd)
        who = who[good]
        return cls(who, dose, _without_bends(who, dose, y, s), s)

    def slopes(self, specimens: int) -> Slopes:
        """The slopes of all specimens; of one without a check 0 with an infinite sd."""
        present, code = np.unique(self.who, return_inverse=True)
        found = slopes(code, self.dose, self.y, self.sd)
        slope, error, factor = np.zeros(specimens), np.full(specimens, np.inf), np.ones(specimens)
        checks = np.zeros(specimens, np.int64)
        slope[present], error[present], checks[present] = found.slope, found.sd, found.checks
        factor[present] = found.factor
        return Slopes(slope, error, checks, factor, found.scale)


def _without_bends(who: Ints, dose: Floats, y: Floats, sd: Floats) -> Floats:
    """ln R less the bends that the courses of all specimens share, so that a specimen seen early compares with one
    seen late."""
    present, code = np.unique(who, return_inverse=True)
    bent = mixed.fit_bends(code, dose, y, sd) if len(present) else None
    if bent is None:
        return y
    found, knots = bent
    columns = mixed.bent_line(dose, knots)
    line, course = columns[:, :2], columns @ found.fixed
    return np.asarray(y - course + line @ np.linalg.lstsq(line, course, rcond=None)[0], np.float64)


# ---- what stands out -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Test:
    """How one specimen or batch compares; fields as `SpecimenHealth` has them."""

    score: float | None = None
    p_value: float | None = None
    outlying: bool = False
    why: str = ""


@dataclass(frozen=True)
class _Fleet:
    """Slopes [1/h] of m specimens, variances of their errors, numbers of checks, and places of their batches;
    `batches` is the place of those without one."""

    slope: Floats
    variance: Floats
    checks: Ints
    group: Ints
    batches: int

    @cached_property
    def within(self) -> Spread:
        """Centres of batches (batches + 1,) and the spread of specimens about them."""
        return spread(self.slope, self.variance, self.group, self.batches + 1, USUAL_SHARE, LEAST_SPREAD, USUAL_WEIGHT)

    def among_batches(self, but: Ints) -> Spread:
        """The fleet's centre and the spread of batches about it, without the batches `but` unless nothing else is
        left."""
        rest = np.setdiff1d(self.group, but)
        if not len(rest):
            rest = np.unique(self.group)
        centre, variance, one = self.within.centre[rest], self.within.variance[rest], np.zeros(len(rest), np.int64)
        return spread(centre, variance, one, 1, USUAL_BATCH_SHARE, LEAST_SPREAD, USUAL_BATCH_WEIGHT)

    def against_others(self, k: int) -> tuple[float, float]:
        """Score and one-sided p-value of a batch's centre against those of the others."""
        rest = np.setdiff1d(self.group, [k])
        others, own = self.among_batches(np.array([k])), self.within.variance
        weight = others.variance[0] / (others.tau_square + own[rest])
        of_batches = others.tau_square * (1.0 + float(weight @ weight))
        of_specimens = float(own[k] + weight**2 @ own[rest])
        score = float(self.within.centre[k] - others.centre[0]) / math.sqrt(of_batches + of_specimens)
        freedom = _welch((of_batches, USUAL_BATCH_WEIGHT + len(rest) - 1), (of_specimens, self.freedom))
        p = float(student.sf(score, min(float(freedom), BATCH_TAILS)))
        return score, p if len(self.slope) > FEW else max(p, self.by_student(k))

    def by_student(self, k: int) -> float:
        """One-sided p-value of Student's test of a batch's mean against that of the others, with the variance within
        batches as it is seen; 0 where no batch has two. What is usual and what a robust spread leaves out as odd is an
        assumption about few specimens: where some change and some do not, it is wrong."""
        sizes = np.bincount(self.group)
        freedom, own = len(self.slope) - np.count_nonzero(sizes), self.group == k
        if freedom == 0:
            return 0.0
        means = np.bincount(self.group, self.slope) / np.maximum(sizes, 1)
        within = float(((self.slope - means[self.group]) ** 2).sum()) / freedom
        sd = math.sqrt(max(within, LEAST_SPREAD**2) * (1.0 / own.sum() + 1.0 / (~own).sum()))
        return float(student.sf((self.slope[own].mean() - self.slope[~own].mean()) / sd, freedom))

    def pooled(self, but: Ints) -> _Fleet:
        """The fleet with all batches but `but` as one, where batches are small: neither their centres nor the spread
        about these are known then, and pairs that happen to be alike would make everybody else stand out."""
        if len(self.slope) >= LEAST_BY_BATCH * len(np.unique(self.group)):
            return self
        return replace(self, group=np.where(np.isin(self.group, but), self.group, self.batches))

    def without(self, place: int) -> _Fleet:
        keep = np.arange(len(self.slope)) != place
        return _Fleet(self.slope[keep], self.variance[keep], self.checks[keep], self.group[keep], self.batches)

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the specimens' spread, what is usual counted in, as far as heavy tails let it count."""
        return min(USUAL_WEIGHT + len(self.slope) - len(np.unique(self.group)), TAILS)


def _without_steps(fleet: _Fleet, known: Ints, rows: _Rows, own: Slopes, rate: float) -> tuple[_Fleet, dict[int, Step]]:
    """The fleet with the slopes beside a step where a step explains better what would else stand out, and those
    steps."""
    bad = np.array([k for k, test in _test_batches(fleet, rate).items() if test.outlying], np.int64)
    centre, variance = _centres(fleet, bad)
    scores, freedom = _scores(fleet, bad)
    usual_sd = np.sqrt(variance + fleet.within.tau_square)
    common = abs(float(np.median(centre[np.unique(fleet.group)])))
    unusual_sd = UNUSUAL * max(common, math.sqrt(fleet.within.tau_square))
    steps: dict[int, Step] = {}
    slope, error = fleet.slope.copy(), fleet.variance.copy()
    for k in np.flatnonzero(student.sf(scores, freedom) < ASKED_FOR_A_STEP):
        of, group = rows.who == known[k], fleet.group[k]
        sd = rows.sd[of] * own.factor[known[k]]
        step = step_or_slope(rows.dose[of], rows.y[of], sd, centre[group], usual_sd[group], unusual_sd)
        if step:
            steps[int(known[k])] = step
            slope[k], error[k] = step.slope, step.sd**2
    return replace(fleet, slope=slope, variance=error), steps


def _test_batches(fleet: _Fleet, rate: float) -> dict[int, _Test]:
    sizes = np.bincount(fleet.group, minlength=fleet.batches + 1)
    groups = len(np.unique(fleet.group))
    large = [k for k in range(fleet.batches) if sizes[k] >= LEAST_IN_BATCH]
    if groups < 2 or not large:
        return {}
    scores, p_values = np.array([fleet.against_others(k) for k in large]).T
    return dict(zip(large, _listed(scores, p_values, rate), strict=True))


def _listed(scores: Floats, p_values: Floats, rate: float) -> list[_Test]:
    """The tests (n,), those listed as outlying that keep the false-discovery rate."""
    outlying = false_discovery_control(p_values) <= rate
    return [_Test(*of_one) for of_one in zip(scores.tolist(), p_values.tolist(), outlying.tolist(), strict=True)]


def _scores(fleet: _Fleet, bad: Ints) -> tuple[Floats, Floats]:
    """Score of each specimen (m,), and its degrees of freedom (m,)."""
    fleet = fleet.pooled(bad)
    healthy = _healthy(fleet, bad)
    scores, freedom = healthy.scores(*_off_centre(fleet, fleet, bad)), _freedom(fleet, fleet)
    for place in np.argsort(-scores)[:RETESTED].tolist():
        others = fleet.without(place)
        alone = _off_centre(fleet, others, bad)
        of_others = _healthy(others, bad) if len(fleet.slope) <= FEW else healthy.without(place)
        scores[place] = of_others.scores_of_newcomers(alone[0][[place]], alone[1][[place]])[0]
        freedom[place] = _freedom(fleet, others)[place]
    return scores, freedom


def _freedom(fleet: _Fleet, others: _Fleet) -> Floats:
    """Degrees of freedom of each specimen's score (m,), with the spread that `others` tell."""
    own = fleet.variance / (fleet.variance + others.within.tau_square)
    freedom = _welch((1.0 - own, others.freedom), (own, ERROR_TAILS + fleet.checks))
    return np.asarray(freedom, np.float64)


def _welch(*parts: tuple[ArrayLike, ArrayLike]) -> Floats:
    """Degrees of freedom of a sum of variances, each with its own."""
    variances, freedoms = (np.array(np.broadcast_arrays(*each), np.float64) for each in zip(*parts, strict=True))
    return np.asarray(variances.sum(axis=0) ** 2 / (variances**2 / freedoms).sum(axis=0), np.float64)


def _healthy(fleet: _Fleet, bad: Ints) -> HealthySlopes:
    off, variance = _off_centre(fleet, fleet, bad)
    takes_part = ~np.isin(fleet.group, bad)
    centre = _middle(fleet, bad)
    usual = math.hypot(USUAL_SHARE * centre, LEAST_SPREAD)
    tau = math.sqrt(fleet.within.tau_square)
    return healthy_slopes(off, variance, takes_part, centre, tau, usual, USUAL_WEIGHT)


def _middle(fleet: _Fleet, bad: Ints) -> float:
    """The median of the slopes, without bad batches unless nothing else is left."""
    healthy = fleet.slope[~np.isin(fleet.group, bad)]
    return float(np.median(healthy if len(healthy) else fleet.slope))


def _off_centre(fleet: _Fleet, others: _Fleet, bad: Ints) -> tuple[Floats, Floats]:
    """Each specimen's slope less the centre of its batch, as `others` tell it (m,), and the variance of both (m,). In
    bad batches, which age n times as fast, differences are divided by n."""
    centre, variance = _centres(others, bad)
    times, middle = np.ones(len(centre)), _middle(others, bad)
    if middle > 0.0:
        times[bad] = np.maximum(centre[bad] / middle, 1.0)
    times, group = times[fleet.group], fleet.group
    return (fleet.slope - centre[group]) / times, (fleet.variance + variance[group]) / times**2


def _centres(fleet: _Fleet, bad: Ints) -> tuple[Floats, Floats]:
    """What the slopes of each batch's specimens are compared with (batches + 1,), and its variance."""
    whole = fleet.among_batches(bad)
    own_weight = 1.0 / fleet.within.variance
    fleet_weight = np.full(len(own_weight), 1.0 / float(whole.tau_square + whole.variance[0]))
    fleet_weight[bad] = np.where(own_weight[bad] > 0.0, 0.0, fleet_weight[bad])
    sum_of_both = own_weight + fleet_weight
    centre = (own_weight * np.nan_to_num(fleet.within.centre) + fleet_weight * whole.centre[0]) / sum_of_both
    return np.asarray(centre, np.float64), np.asarray(1.0 / sum_of_both, np.float64)


# ---- the answer ----------------------------------------------------------------------------------------------------

NO_SLOPE = _Test(why="it has no two different doses")


def _specimen(name: str, batch: str | None, own: Slopes, k: int, step: Step | None, test: _Test) -> SpecimenHealth:
    slope, sd = (step.slope, step.sd) if step else (float(own.slope[k]), float(own.sd[k]))
    known, middle, reach = math.isfinite(sd), PERCENT_PER_100_H * slope, PERCENT_PER_100_H * 1.96 * sd
    return SpecimenHealth(
        specimen=name,
        batch=batch,
        checks=int(own.checks[k]),
        slope_percent_per_100h=middle if known else None,
        ci95=(middle - reach, middle + reach) if known else None,
        step_at_dose_h=step.at_dose_h if step else None,
        **vars(test),
    )


def _batch(name: str, fleet: _Fleet, k: int, test: _Test | None) -> BatchHealth:
    size = int(np.count_nonzero(fleet.group == k))
    few = f"fewer than {LEAST_IN_BATCH} of its specimens have a slope"
    return BatchHealth(
        batch=name,
        specimens=size,
        slope_percent_per_100h=PERCENT_PER_100_H * float(fleet.within.centre[k]) if size else None,
        **vars(test or _Test(why=few if size < LEAST_IN_BATCH else "it is the only one")),
    )
