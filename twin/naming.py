"""Naming: which term the data ask for beyond everything a healthy motor may do, one after the other, and which survive.

Broad noise, then fitted noise with the leading candidates in the design; every candidate scored with all else integrated
out; the leading ones refitted in full; the best enters where it beats the threshold; at the end every one is left out once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from twin.actions import Parameter
from twin.candidates import Candidate
from twin.errors import DivergedError
from twin.evidence import Projector, Scores, null_quantile, score
from twin.fit import Fit, fit
from twin.model import Columns, Model
from twin.noise import ChannelNoise
from twin.pooling import kinds, pooled_scales
from twin.proposals import Proposals
from twin.reml import Observed, reml

Floats = NDArray[np.float64]

THRESHOLD = 12.0  # ln BF that a term must exceed; healthy motors of another form set it (benchmarks/trials.py)
MOST_TERMS = 3
MOST_SIGMAS = 4.0  # prior sd of a candidate: a larger amplitude is not what its name says
REFITTED, WORTH_REFITTING = 5, 4.0  # how many, and from which linear ln BF on
IN_DESIGN = 10  # leading candidates beside the parameters when the noise is fitted
NEAR_ENOUGH = 0.5  # of ln posterior, for a refit
REFIT_LINEARISATIONS = 6

Tell = Callable[[str], None]


@dataclass(frozen=True)
class Refit:
    """A candidate after a full fit: ln BF against the model without it by Laplace, amplitude and its sd."""

    candidate: Candidate
    parameter: Parameter
    fit: Fit
    log_bayes_factor: float
    amplitude: float
    sd: float

    @property
    def possible(self) -> bool:
        """Whether the amplitude is one that such a cause can have."""
        return abs(self.amplitude) <= MOST_SIGMAS * self.parameter.sd


@dataclass(frozen=True)
class Round:
    """One search for one more term: scores of all candidates at the fit without it, and the refits of the leading ones."""

    base: Fit
    candidates: tuple[Candidate, ...]
    parameters: tuple[Parameter, ...]
    scores: Scores
    gram: Floats
    null: float
    refits: tuple[Refit, ...]
    dropped: tuple[str, ...]

    def order(self) -> list[int]:
        """Candidates, best linear score first."""
        return [int(i) for i in np.argsort(-self.scores.log_bayes_factor, kind="stable")]


@dataclass(frozen=True)
class Naming:
    """`rounds` in the order of the search, the last one found nothing more (or the most terms were reached); `accepted`: the
    terms that survived, with ln BF of leaving each out; `final`: the fit with them; `left_out`: those that did not survive."""

    rounds: tuple[Round, ...]
    accepted: tuple[Refit, ...]
    left_out: tuple[tuple[Candidate, float], ...]
    final: Fit
    threshold: float


def search(
    model: Model, candidates: Sequence[Candidate], tell: Tell = lambda _: None, threshold: float = THRESHOLD
) -> Naming:
    """Find the terms. Raises `DivergedError` where the model itself runs away."""
    tell("calibrating")
    current = fit(model, np.zeros(len(model.parameters)), enough=NEAR_ENOUGH)
    current = _refitted_noise(current, candidates, tell)
    rounds: list[Round] = []
    accepted: list[tuple[Candidate, Parameter]] = []
    while True:
        tell("scoring")
        found = look(current, [c for c in candidates if c not in [a for a, _ in accepted]], tell)
        rounds.append(found)
        possible = [refit for refit in found.refits if refit.possible]
        best = max(possible, key=lambda r: r.log_bayes_factor, default=None)
        if best is None or best.log_bayes_factor <= max(threshold, found.null) or len(accepted) == MOST_TERMS:
            break
        accepted.append((best.candidate, best.parameter))
        current = _refitted_noise(best.fit, candidates, tell, passes=1)
    tell("leaving out")
    return _eliminated(tuple(rounds), accepted, current, model, threshold)


def look(current: Fit, candidates: Sequence[Candidate], tell: Tell) -> Round:
    """Score every candidate at a fit and refit the leading ones."""
    chosen, parameters, parts, dropped = _linearised(current, candidates)
    projector, v, e0 = stacked(current, parts)
    sigma = np.array([p.sd for p in parameters])
    sign = np.array([c.sign for c in chosen], dtype=np.float64)
    scores = score(v, e0, projector, sigma, sign)
    gram = projector.inner(v, v)
    null = null_quantile(gram, sigma, sign)
    refits = []
    leading = [int(i) for i in np.argsort(-scores.log_bayes_factor, kind="stable")[:REFITTED]]
    for i in leading:
        if scores.log_bayes_factor[i] < WORTH_REFITTING:
            continue
        tell(f"refitting {chosen[i].cause}")
        refit = refitted(current, chosen[i], parameters[i])
        if refit is None:
            dropped.append(str(chosen[i].cause))
        else:
            refits.append(refit)
    return Round(current, tuple(chosen), tuple(parameters), scores, gram, null, tuple(refits), tuple(dropped))


def _linearised(
    current: Fit, candidates: Sequence[Candidate]
) -> tuple[list[Candidate], list[Parameter], Sequence[Columns], list[str]]:
    proposals = Proposals(current.model, current.beta)
    chosen = [c for c in candidates if not c.discrete and not c.repeated]
    parameters = [proposals.parameter(c) for c in chosen]
    parts = current.model.linearise(current.beta, parameters)
    stack = np.concatenate([p.extra for p in parts])
    good = np.isfinite(stack).all(axis=0) & (np.abs(stack).max(axis=0) > 1e-9)
    dropped = [str(c.cause) for c, ok in zip(chosen, np.isfinite(stack).all(axis=0), strict=True) if not ok]
    kept = np.flatnonzero(good)
    parts = [Columns(p.series, p.at, p.columns, p.extra[:, kept]) for p in parts]
    return [chosen[i] for i in kept], [parameters[i] for i in kept], parts, dropped


def stacked(current: Fit, parts: Sequence[Columns]) -> tuple[Projector, Floats, Floats]:
    """The projector of the free parameters, whitened candidates (N, c) and the residual referred back to the prior mean."""
    model, beta = current.model, current.beta
    free = (beta > model.low) & (beta < model.high)
    a_rows, v_rows, e_rows = [], [], []
    for part in parts:
        white = model.whitened(part.series, np.column_stack([part.series.y, part.columns, part.extra]))
        p = part.columns.shape[1]
        a = np.zeros((len(white), beta.size))
        a[:, part.at] = white[:, 1 : 1 + p]
        a_rows.append(a)
        e_rows.append(white[:, 0])
        v_rows.append(white[:, 1 + p :])
    a = np.concatenate(a_rows)[:, free]
    return Projector.of(a, 1 / model.sd[free] ** 2), np.concatenate(v_rows), np.concatenate(e_rows) + a @ beta[free]


def refitted(current: Fit, candidate: Candidate, parameter: Parameter) -> Refit | None:
    """The full fit with one more term, from amplitude 0: its first step moves all else along. None where it runs away."""
    start = 1e-3 * parameter.sd if parameter.low == 0.0 else 0.0
    try:
        found = fit(
            current.model.plus([parameter]),
            np.append(current.beta, start),
            enough=NEAR_ENOUGH,
            linearisations=REFIT_LINEARISATIONS,
        )
    except (DivergedError, np.linalg.LinAlgError):
        return None
    return _compared(found, current, candidate, parameter, len(found.beta) - 1)


def _compared(found: Fit, without: Fit, candidate: Candidate, parameter: Parameter, place: int) -> Refit:
    """ln BF of a term by Laplace on both sides; a half-normal prior where it has a sign."""
    sd = float(np.sqrt(np.linalg.inv(found.hessian)[place, place]))
    amplitude = float(found.beta[place])
    gain = found.log_evidence - without.log_evidence
    if parameter.low == 0.0 or parameter.high == 0.0:
        gain += float(np.log(2) + log_ndtr(abs(amplitude) / sd))
    return Refit(candidate, parameter, found, gain, amplitude, sd)


def _refitted_noise(current: Fit, candidates: Sequence[Candidate], tell: Tell, passes: int = 2) -> Fit:
    """The fit under noise fitted with the leading candidates in the design; at first the families' priors are fitted too."""
    for number in range(passes):
        tell("fitting the noise")
        noise = _fitted_noise(_design(current, candidates))
        current = fit(current.model.with_noise(noise), current.beta, enough=NEAR_ENOUGH)
        if passes > 1 and number == 0:
            tell("fitting the priors of families")
            current = fit(_with_pooled_priors(_design(current, candidates)), current.beta, enough=NEAR_ENOUGH)
    return current


@dataclass(frozen=True)
class _Design:
    """A fit with its `leading` candidates beside it: `free` parameters (not at a bound), columns `a` (N, f) and `v` (N, l)
    whitened, `sigma` (l,) of the candidates, `e0` (N,), and the series with their columns as they stand."""

    current: Fit
    free: NDArray[np.bool_]
    a: Floats
    v: Floats
    sigma: Floats
    e0: Floats
    parts: Sequence[Columns]


def _design(current: Fit, candidates: Sequence[Candidate]) -> _Design:
    _, parameters, parts, _ = _linearised(current, candidates)
    projector, v, e0 = stacked(current, parts)
    sigma = np.array([p.sd for p in parameters])
    scores = score(v, e0, projector, sigma, np.zeros(len(sigma)))
    leading = np.argsort(-scores.log_bayes_factor, kind="stable")[:IN_DESIGN]
    free = (current.beta > current.model.low) & (current.beta < current.model.high)
    kept = [Columns(p.series, p.at, p.columns, p.extra[:, leading]) for p in parts]
    return _Design(current, free, projector.columns, v[:, leading], sigma[leading], e0, kept)


def _fitted_noise(design: _Design) -> Mapping[str, ChannelNoise]:
    """The channels' noise by restricted maximum likelihood, parameters and leading candidates integrated out."""
    current, free = design.current, design.free
    observed = []
    for part in design.parts:
        columns = np.zeros((part.series.y.size, current.beta.size))
        columns[:, part.at] = part.columns
        own = np.column_stack([columns[:, free], part.extra])
        observed.append(Observed(part.series, part.series.y + columns[:, free] @ current.beta[free], own))
    precision = 1 / np.concatenate([current.model.sd[free], design.sigma]) ** 2
    return reml(observed, precision, slowest_mode_s(current), rises(current.model)).noise


def _with_pooled_priors(design: _Design) -> Model:
    """The model with the priors of its families of healthy differences scaled by the data."""
    model = design.current.model
    columns = np.hstack([design.a, design.v])
    kind, gram, right = kinds(model.network), columns.T @ columns, columns.T @ design.e0
    scales = pooled_scales(model.parameters, design.free, kind, gram, right, design.sigma)
    return model.with_priors([replace(p, sd=p.sd * s) for p, s in zip(model.parameters, scales, strict=True)])


def slowest_mode_s(current: Fit) -> float:
    """The longest time constant of the fitted network at the mean of its tests [s]."""
    return max(current.model.slowest_s(s, current.beta) for s in range(len(current.model.tests)))


def rises(model: Model) -> dict[str, float]:
    """Channel -> how far it rises over the coldest boundary, at least 1 K."""
    rise: dict[str, float] = {}
    for test in model.tests:
        coldest = float(test.frame.boundaries.mean(axis=0).min())
        for channel in test.channels:
            hottest = channel.measured[channel.output.samples > 0].max(initial=coldest)
            rise[channel.name] = max(rise.get(channel.name, 1.0), float(hottest) - coldest)
    return rise


def _without(current: Fit, place: int, calm: Floats) -> Fit:
    """The fit without one term, from where the others are; from the first fit `calm` with no term where that runs away."""
    model = current.model.without(place)
    try:
        return fit(model, np.delete(current.beta, place), enough=NEAR_ENOUGH)
    except DivergedError:
        return fit(model, np.append(calm, np.zeros(len(model.parameters) - len(calm))), enough=NEAR_ENOUGH)


def _eliminated(
    rounds: tuple[Round, ...],
    accepted: list[tuple[Candidate, Parameter]],
    current: Fit,
    model: Model,
    threshold: float,
) -> Naming:
    """Leave every term out once, both sides fitted; the weakest goes while it is under the threshold."""
    left_out: list[tuple[Candidate, float]] = []
    while accepted:
        compared = []
        for i, (candidate, parameter) in enumerate(accepted):
            place = len(model.parameters) + i
            without = _without(current, place, rounds[0].base.beta)
            compared.append((_compared(current, without, candidate, parameter, place), without))
        weakest = min(range(len(compared)), key=lambda i: compared[i][0].log_bayes_factor)
        if compared[weakest][0].log_bayes_factor > threshold:
            return Naming(rounds, tuple(c for c, _ in compared), tuple(left_out), current, threshold)
        left_out.append((accepted[weakest][0], compared[weakest][0].log_bayes_factor))
        current = compared[weakest][1]
        del accepted[weakest]
    return Naming(rounds, (), tuple(left_out), current, threshold)
