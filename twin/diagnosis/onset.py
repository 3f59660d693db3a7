"""Since when a cause acts: every candidate in every set of tests that it may act in, weighed against none.

A candidate's column v is cut into its tests. Where it acts in some of them alone, its column is 0 in all others, and
with P of `twin.diagnosis.evidence` (everything that a healthy motor may do integrated out, over all tests together)

    s = sum of v_t' (P e0)_t,    J = sum of v_t' v_t - |sum of L^-1 A_t' v_t|^2    over its tests t,

so that all sets cost as much as one. Of its size it has one over all tests that it acts in. The posterior over sets is
that over when it began: none is given a threshold.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.diagnosis.evidence import PRIOR_NONE, PRIOR_UNKNOWN, Scores, log_bayes_factor, prior_masses
from twin.diagnosis.posterior_mode import linearised, stacked
from twin.differences.candidates import Candidate
from twin.differences.proposals import at_one
from twin.fitting.actions import Parameter
from twin.fitting.fit import Fit
from twin.fitting.model import Columns, Floats

FROM_THE_FIRST = 0.5  # prior share of a cause that acts in all tests; the other sets have the rest, evenly
AS_KNOWN = 1.0 - PRIOR_NONE - PRIOR_UNKNOWN  # prior mass of a cause that is asked for: all others have the unknown's

Sets = NDArray[np.bool_]  # (h, t): in which tests a cause acts, the first of them in all


def from_each_on(tests: int) -> Sets:
    """In all tests, from the second on, and so on to the last alone."""
    return np.triu(np.ones((tests, tests), dtype=np.bool_))


@dataclass(frozen=True)
class Onsets:
    """When candidates (c,) act: of each set of tests (h, t) and candidate the `probability` (h, c), the mean of its
    amplitude in its unit at features of 1 and the sd of that (h, c); `none`: the probability that none acts. All
    probabilities sum to 1."""

    sets: Sets
    candidates: tuple[Candidate, ...]
    none: float
    probability: Floats
    amplitude: Floats
    sd: Floats

    def by_set(self) -> Floats:
        """(h,) that some candidate acts in exactly these tests."""
        found: Floats = self.probability.sum(axis=1)
        return found

    def place(self, cause: str) -> int | None:
        """Which candidate has this id; None where it moves no reading of these tests."""
        return next((i for i, one in enumerate(self.candidates) if str(one.cause) == cause), None)

    def in_test(self, cause: str) -> Floats:
        """(t,) that a cause acts in each test."""
        at = self.place(cause)
        found: Floats = (np.zeros(len(self.sets)) if at is None else self.probability[:, at]) @ self.sets
        return found


@dataclass(frozen=True)
class KnownSize:
    """A cause whose size is known from elsewhere: of `amplitude` [its unit at features of 1] and its sign, more or
    less. `mass`: the prior probability that it acts at all."""

    amplitude: float
    mass: float


def weighed(
    current: Fit,
    candidates: Sequence[Candidate],
    sets: Sets,
    channel: str | None = None,
    known: Mapping[str, KnownSize] | None = None,
) -> Onsets:
    """When candidates act, about a fit of healthy motors (`twin.diagnosis.refined.calibrated`). `channel`: only those
    count that move it by more than its noise. `known`: id -> its size, for those that are asked for; the mass that they
    leave is shared by all others."""
    chosen, parameters, parts, _ = linearised(current, [c for c in candidates if not c.repeated])
    counts = _moving(current, parts, parameters, channel)
    chosen, parameters = [chosen[i] for i in counts], [parameters[i] for i in counts]
    parts = [Columns(p.series, p.at, p.columns, p.extra[:, counts]) for p in parts]
    s, j = _summed(current, parts, sets)
    sigma, sign = _sizes(chosen, parameters, known or {})
    told = Scores(s, j, sigma, sign, log_bayes_factor(s, j, sigma, sign))
    share = np.full(len(sets), (1.0 - FROM_THE_FIRST) / max(len(sets) - 1, 1))
    share[0] = FROM_THE_FIRST if len(sets) > 1 else 1.0
    mass = _masses(chosen, known or {})
    odds = np.log(np.append(1.0 - mass.sum(), np.outer(share, mass)))
    odds[1:] += told.log_bayes_factor.ravel()
    probability = np.exp(odds - odds.max())
    probability /= probability.sum()
    per = np.array([at_one(parameter) for parameter in parameters])
    return Onsets(
        sets=sets,
        candidates=tuple(chosen),
        none=float(probability[0]),
        probability=probability[1:].reshape(s.shape),
        amplitude=told.amplitude / per,
        sd=sigma / np.sqrt(1 + j * sigma**2) / per,
    )


def _moving(current: Fit, parts: Sequence[Columns], parameters: Sequence[Parameter], channel: str | None) -> list[int]:
    """Places of the candidates that count: of a channel those that move it, at their usual size, by more than its
    noise."""
    if channel is None:
        return list(range(len(parameters)))
    own = [current.model.whitened(part.series, part.extra) for part in parts if part.series.channel == channel]
    size = np.sqrt(sum((np.square(white).sum(axis=0) for white in own), np.zeros(len(parameters))))
    return [int(i) for i in np.flatnonzero(size * [p.sd for p in parameters] > 1.0)]


def _summed(current: Fit, parts: Sequence[Columns], sets: Sets) -> tuple[Floats, Floats]:
    """s and J (h, c) of each candidate in each set of tests."""
    projector, v, e0 = stacked(current, parts)
    test = np.concatenate([np.full(len(part.series.y), part.series.session) for part in parts])
    at_e0 = projector.seen(e0)
    rows = [np.flatnonzero(test == number) for number in range(sets.shape[1])]
    spans = [slice(int(own[0]), int(own[-1]) + 1) for own in rows]  # `linearise` goes test by test
    seen = [projector.seen(v[span], span) for span in spans]
    s = np.array([v[span].T @ e0[span] - own.T @ at_e0 for span, own in zip(spans, seen, strict=True)])
    square = np.array([np.einsum("ij,ij->j", v[span], v[span]) for span in spans])
    taken = np.array([np.square(np.einsum("t,tij->ij", acts, np.array(seen))).sum(axis=0) for acts in sets])
    return sets @ s, np.maximum(sets @ square - taken, 0.0)


def _sizes(
    candidates: Sequence[Candidate], parameters: Sequence[Parameter], known: Mapping[str, KnownSize]
) -> tuple[Floats, Floats]:
    """Prior sd (c,) of each parameter and its sign (c,)."""
    sigma, sign = np.array([p.sd for p in parameters]), np.array([float(c.sign) for c in candidates])
    for i, (candidate, parameter) in enumerate(zip(candidates, parameters, strict=True)):
        if size := known.get(str(candidate.cause)):
            sigma[i], sign[i] = abs(size.amplitude) * at_one(parameter), np.sign(size.amplitude)
    return sigma, sign


def _masses(candidates: Sequence[Candidate], known: Mapping[str, KnownSize]) -> Floats:
    """Prior probabilities (c,): those asked for have their own, all others together what these leave of one half."""
    mass = prior_masses([candidate.cause for candidate in candidates])
    own = np.array([known[str(c.cause)].mass if str(c.cause) in known else np.nan for c in candidates])
    others = np.isnan(own)
    left = 1.0 - PRIOR_NONE - (own[~others].sum() if (~others).any() else 0.0)
    found: Floats = np.where(others, mass * left / max(mass[others].sum(), 1e-300), own)
    return found
