"""One round of the search for causes: every candidate scored, the leading ones refitted in full, the best of them.

Evidence judges, or where the file's form is wrong sessions left out do (`twin.diagnosis.naming`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from twin.diagnosis.evidence import Projector, Scores, null_quantile, score
from twin.diagnosis.evidence_split import EvidenceSplit, split
from twin.diagnosis.left_out import LeftOut, left_out
from twin.diagnosis.posterior_mode import linearised, stacked
from twin.diagnosis.refined import Tell
from twin.diagnosis.taking_over import taken_over
from twin.differences.candidates import Candidate
from twin.errors import DivergedError
from twin.fitting.actions import Parameter
from twin.fitting.fit import NEAR_ENOUGH, Fit, fit
from twin.fitting.model import Floats
from twin.motor.sensor_laws import Misreading

THRESHOLD = 12.0  # ln BF that a term must exceed by evidence alone: healthy motors of another form come up to it
# ln BF of what else is looked for: a heat beside what is named, a term that sessions left out ask for too
EVIDENT = 6.0
REFITTED, WORTH_REFITTING = 5, 4.0  # how many candidates of a round are refitted, and from which linear ln BF on
ASKED_ABOUT = 8  # candidates that are refitted in place of these where sessions left out judge
FAR_BEHIND = 10.0  # behind the leading one in linear ln BF: not refitted
FIRST_LINEARISATIONS, REFIT_LINEARISATIONS = 4, 15  # of every refit, and of those that may still come near the best
LEAST_MOVED = 2.0  # sd of what a lumped model is off by anyway: what moves every reading by less is of the file's form
OUT_OF_REACH = 6.0  # a search stops that promises to stay so far behind the best: twice what tells two apart


def is_possible(parameter: Parameter, amplitude: float) -> bool:
    """Whether a cause can have this amplitude: it takes no more away than is there. One that is larger than usual stays
    a cause: the evidence has paid for that."""
    return not (parameter.low < 0.0 and amplitude <= parameter.low)


@dataclass(frozen=True)
class Refit:
    """A candidate after a full fit: ln BF against the model without it by Laplace and where that comes from, amplitude
    and its sd; `moved`: how far it moves a reading at most, in sd of the slow discrepancy that lumps have there anyway.
    `left_out`: what it says of sessions left out, where these judge and evidence would let it in."""

    candidate: Candidate
    parameter: Parameter
    fit: Fit
    log_bayes_factor: float
    amplitude: float
    sd: float
    evidence: EvidenceSplit
    moved: float
    left_out: LeftOut | None = None

    @property
    def possible(self) -> bool:
        """Whether such a cause can have the amplitude that the data want."""
        return is_possible(self.parameter, self.amplitude)

    @property
    def of_form(self) -> bool:
        """Whether it is no more than the file's own form may do. Quiet readings know tenths of a kelvin at each step of
        an input well, which no lump gets right."""
        return self.moved <= LEAST_MOVED

    @property
    def nameable(self) -> bool:
        """Whether it can be a cause."""
        return self.possible and not self.of_form

    @property
    def ended(self) -> bool:
        """Whether its search is over, at the mode or not."""
        return self.fit.converged or self.fit.linearisations >= REFIT_LINEARISATIONS

    @property
    def left_out_K(self) -> float:
        """Mean error of sessions left out, where these judge."""
        assert self.left_out is not None, "sessions left out do not judge this refit"
        return self.left_out.mean_K()

    @property
    def promised(self) -> float:
        """ln BF, plus what a search that is not over may still gain by its quadratic model."""
        return self.log_bayes_factor + (0.0 if self.ended else self.fit.left)


class Against(Enum):
    """What sessions left out have against a term."""

    NO_NEARER = auto()
    TOO_LITTLE = auto()


def against(before: LeftOut, after: LeftOut) -> Against | None:
    """What sessions left out have against what was learnt between the two: they are not nearer with it by more than the
    standard error of that, or together they ask for it by less than evidence must. None where they let it in."""
    if before.is_as_near_as(after):
        return Against.NO_NEARER
    return None if after.gained(before).sum() > EVIDENT else Against.TOO_LITTLE


@dataclass(frozen=True)
class Round:
    """One search for one more term at the fit `base` without it: all `candidates` with their `parameters`, `scores`,
    and `gram` (m, m) V'P V; `moved` (m,), as of a refit, by the linear amplitude; `null`, the 95 % quantile of the best
    ln BF by chance; `refits` of the leading ones; ids of those that are `dropped` as the model runs away with them;
    what the base says of sessions left out (`left_out`), where these judge."""

    base: Fit
    candidates: tuple[Candidate, ...]
    parameters: tuple[Parameter, ...]
    scores: Scores
    gram: Floats
    moved: Floats
    null: float
    refits: tuple[Refit, ...]
    dropped: tuple[str, ...]
    left_out: LeftOut | None = None

    @property
    def best(self) -> Refit | None:
        """The best of the refits that can be named: by evidence, or of those that hold by sessions left out the one
        with which these are nearest."""
        nameable = [r for r in self.refits if r.nameable]
        if self.left_out is None:
            return max(nameable, key=lambda r: r.log_bayes_factor, default=None)
        return min(filter(self.holds, nameable), key=lambda r: r.left_out_K, default=None)

    def gained(self, refit: Refit) -> Floats:
        """(s,) by how much ln density each session left out gains by a refit that evidence would let in."""
        assert self.left_out is not None and refit.left_out is not None, "sessions left out do not judge this refit"
        return refit.left_out.gained(self.left_out)

    def holds(self, refit: Refit) -> bool:
        """Whether evidence would let a refit in, and sessions left out do."""
        return refit.left_out is not None and self.against(refit) is None

    def against(self, refit: Refit) -> Against | None:
        """What sessions left out have against a refit that evidence would let in; None where they let it in."""
        assert self.left_out is not None and refit.left_out is not None, "sessions left out do not judge this refit"
        return against(self.left_out, refit.left_out)

    def asked_again(self, refit: Refit, with_it: Fit) -> Round:
        """The round after sessions left out were asked for the errors of one refit once more, of the fit `with_it`
        under noise and priors that were learnt anew: only what they are nearer with then too stays let in."""
        assert refit.left_out is not None, "sessions left out judged it"
        said = replace(refit.left_out, errors_K=left_out(with_it, _misread(refit)).errors_K)
        return replace(self, refits=tuple(replace(r, left_out=said) if r is refit else r for r in self.refits))

    def alone(self, candidate: Candidate) -> float:
        """ln BF of a candidate as the only term more: of its refit, or the linear one where it was not refitted; 0
        where it has no column."""
        scores = {c.cause: float(x) for c, x in zip(self.candidates, self.scores.log_bayes_factor, strict=True)}
        scores |= {r.candidate.cause: r.log_bayes_factor for r in self.refits}
        return scores.get(candidate.cause, 0.0)

    def order(self) -> list[int]:
        """Candidates, best linear score first."""
        return _order(self.scores)

    @property
    def of_form(self) -> NDArray[np.bool_]:
        """(m,) which candidates are no more than the file's own form may do, by their linear amplitude."""
        return self.moved <= LEAST_MOVED

    @property
    def form(self) -> float:
        """The highest ln BF of what is no more than the file's own form may do; 0 without any."""
        linear = self.scores.log_bayes_factor[self.of_form].max(initial=0.0)
        return max([float(linear), *(r.log_bayes_factor for r in self.refits if r.of_form)])

    def nameable(self) -> list[int]:
        """Candidates that can be named by their linear amplitude, best linear score first."""
        return _nameable(self.parameters, self.scores, self.moved)


def _order(scores: Scores) -> list[int]:
    return [int(i) for i in np.argsort(-scores.log_bayes_factor, kind="stable")]


def _nameable(parameters: Sequence[Parameter], scores: Scores, moved: Floats) -> list[int]:
    possible = [is_possible(one, float(a)) for one, a in zip(parameters, scores.amplitude, strict=True)]
    return [i for i in _order(scores) if possible[i] and moved[i] > LEAST_MOVED]


def scored(current: Fit, candidates: Sequence[Candidate]) -> Round:
    """The score of every candidate at a fit, none refitted yet."""
    found = weighed(current, candidates)
    gram = found.projector.inner(found.columns, found.columns)
    null = null_quantile(gram, found.scores.sigma, found.scores.sign)
    of_round = found.candidates, found.parameters, found.scores
    return Round(current, *of_round, gram, found.moved, null, (), found.dropped)


@dataclass(frozen=True)
class Weighed:
    """Candidates that move a reading, their parameters and scores at a fit; `moved` as of a round; their whitened
    `columns` (N, m) beside its projector; and ids of those that are `dropped` as the model runs away with them."""

    candidates: tuple[Candidate, ...]
    parameters: tuple[Parameter, ...]
    scores: Scores
    moved: Floats
    projector: Projector
    columns: Floats
    dropped: tuple[str, ...]


def weighed(current: Fit, candidates: Sequence[Candidate]) -> Weighed:
    """The scores alone, where nobody asks what chance would make of them."""
    chosen, parameters, parts, dropped = linearised(current, candidates)
    projector, columns, e0 = stacked(current, parts)
    sigma = np.array([p.sd for p in parameters])
    sign = np.array([c.sign for c in chosen], dtype=np.float64)
    scores = score(columns, e0, projector, sigma, sign)
    moves = [
        np.abs(part.extra).max(axis=0, initial=0.0) / current.model.noise_of(part.series.channel).ou_sd
        for part in parts
        if part.series.measured
    ]
    moved = np.abs(scores.amplitude) * np.max(moves, axis=0)
    return Weighed(tuple(chosen), tuple(parameters), scores, moved, projector, columns, tuple(dropped))


def uncalibrated(current: Fit, healthy: int) -> Floats:
    """The vector of a fit with the first `healthy` differences as the files say."""
    return np.append(np.zeros(healthy), current.beta[healthy:])


def with_refits(found: Round, tell: Tell, other_start: Floats | None = None, judging: bool = False) -> Round:
    """The round with its leading candidates refitted, without those that would take away more than there is, and the
    one that leads at the vector `other_start`, from there: calibration goes so far to stand in for a large cause that
    its score says little where that ends; it goes again where it is given up on the way. All begin, those that may
    still come near the best go on. Where sessions left out are `judging`, evidence says only which candidates they are
    asked about: none is far behind or out of reach."""
    leading = _leading(found, judging) + ([] if other_start is None else _leading_at(found, other_start))

    def begun(number: int, one: _Leading) -> Refit | None:
        tell(f"refit {number} of {len(leading)}: {one[0].cause}")
        refit = refitted(found.base, *one)
        return _left_out_asked(found.base, refit) if judging and refit else refit

    with ThreadPoolExecutor(2) as pool:
        first = list(pool.map(begun, range(1, len(leading) + 1), leading))
        starts = [start for (*_, start), refit in zip(leading, first, strict=True) if refit]
        refits = [r for r in first if r is not None]
        while True:
            best = max((r.promised for r in refits if r.nameable), default=0.0)
            further = [not r.ended and r.promised > best - OUT_OF_REACH for r in refits]
            if not any(further):
                break
            tell(f"going on with {sum(further)} refits")
            refits = list(pool.map(lambda r, on: _went_on(found.base, r) if on else r, refits, further))
    lost = [str(candidate.cause) for (candidate, *_), refit in zip(leading, first, strict=True) if refit is None]
    # far from the fit ln BF says nothing of a candidate before the search is over
    said = [r for r, start in zip(refits, starts, strict=True) if r.ended or start is None]
    found = replace(found, refits=_each_once(said), dropped=(*found.dropped, *lost))
    if judging:
        return replace(found, left_out=left_out(found.base))
    for refit in found.refits:
        if refit is not found.best:
            refit.fit.model.forget()  # what follows begins at the best
    return found


def _left_out_asked(base: Fit, begun: Refit) -> Refit:
    """The refit at its end, with what sessions left out say of it if evidence would let it in. Its columns go: those of
    so many refits are more than a small machine holds."""
    refit = begun if begun.ended else _went_on(base, begun)
    if refit.log_bayes_factor > EVIDENT:
        refit = replace(refit, left_out=left_out(refit.fit, _misread(refit)))
    refit.fit.model.forget()
    return refit


def _misread(refit: Refit) -> int | None:
    """The place in the vector of what a sensor is said to get wrong, if that is what the refit adds."""
    return len(refit.fit.beta) - 1 if isinstance(refit.parameter.action, Misreading) else None


def _each_once(refits: Sequence[Refit]) -> tuple[Refit, ...]:
    """The refits, of a candidate that was refitted from two places the better one."""
    better = {one.candidate.cause: one for one in sorted(refits, key=lambda refit: refit.log_bayes_factor)}
    return tuple(one for one in refits if better[one.candidate.cause] is one)


_Leading = tuple[Candidate, Parameter, Floats | None]  # and where its refit starts, as in `refitted`


def _leading(found: Round, judging: bool) -> list[_Leading]:
    linear, leading = found.scores.log_bayes_factor, found.nameable()[: ASKED_ABOUT if judging else REFITTED]
    least = WORTH_REFITTING if judging else max([WORTH_REFITTING, *linear[leading[:1]] - FAR_BEHIND])
    return [(found.candidates[i], found.parameters[i], None) for i in leading if linear[i] >= least]


def _leading_at(found: Round, beta: Floats) -> list[_Leading]:
    """The candidate that leads at a vector; none where the model runs away there."""
    try:
        there = weighed(fit(found.base.model, beta, linearisations=1), found.candidates)
    except DivergedError:
        return []
    nameable = _nameable(there.parameters, there.scores, there.moved)
    leading = [i for i in nameable[:1] if there.scores.log_bayes_factor[i] >= WORTH_REFITTING]
    amounts = there.scores.amplitude
    return [(there.candidates[i], there.parameters[i], np.append(beta, amounts[i])) for i in leading]


def refitted(current: Fit, candidate: Candidate, parameter: Parameter, start: Floats | None = None) -> Refit | None:
    """The first linearisations of the fit with one more term, from the vector `start` (p + 1,), its amplitude last, or
    else from where the term does what healthy differences did in its place (`twin.diagnosis.taking_over`). None where
    it runs away."""
    try:
        if start is None:
            beta, amplitude = taken_over(current, candidate, parameter)
            inside = 1e-3 * parameter.sd if parameter.low == 0.0 else 0.0
            start = np.append(beta, amplitude or inside)
        found = fit(current.model.plus([parameter]), start, NEAR_ENOUGH, FIRST_LINEARISATIONS)
    except DivergedError:
        return None
    return compared(found, current, candidate, parameter, len(found.beta) - 1)


def _went_on(current: Fit, begun: Refit) -> Refit:
    """The refit from where it stopped to its end."""
    so_far = begun.fit.linearisations
    found = fit(begun.fit.model, begun.fit.beta, NEAR_ENOUGH, REFIT_LINEARISATIONS - so_far)
    used = so_far + found.linearisations if found.converged else REFIT_LINEARISATIONS
    whole = replace(found, linearisations=used)
    return compared(whole, current, begun.candidate, begun.parameter, len(found.beta) - 1)


def compared(found: Fit, without: Fit, candidate: Candidate, parameter: Parameter, place: int) -> Refit:
    """The refit of a term: ln BF by Laplace's approximation of both fits, a half-normal prior where it has a sign. What
    a search without it may still gain that was cut short speaks against it."""
    sd = float(np.sqrt(np.linalg.inv(found.hessian)[place, place]))
    amplitude = float(found.beta[place])
    gain = found.log_evidence - without.log_evidence - without.to_gain
    if parameter.low == 0.0 or parameter.high == 0.0:
        gain += float(np.log(2) + log_ndtr(abs(amplitude) / sd))
    moved = _moved(found, place)
    return Refit(candidate, parameter, found, gain, amplitude, sd, split(gain, found, without, place), moved)


def _moved(found: Fit, place: int) -> float:
    """How far a term moves a measured reading at most, in sd of its channel's slow discrepancy; without bound where the
    motor runs away without the term."""
    beta = found.beta.copy()
    beta[place] = 0.0
    try:
        without = found.model.residuals(beta)
    except DivergedError:
        return math.inf
    return max(
        float(np.abs(one.y - other.y).max()) / found.model.noise_of(one.channel).ou_sd
        for one, other in zip(found.series, without, strict=True)
        if one.measured and one.y.size
    )
