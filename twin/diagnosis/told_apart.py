"""Which candidates the data cannot tell from the leading one, with what probability, and which next test would."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.diagnosis.evidence import TOLD_APART, posterior, prior_masses, separation, told_apart_class
from twin.diagnosis.next_tests import Proposed, as_test, menu
from twin.diagnosis.rounds import Round, is_possible
from twin.differences.candidates import Candidate
from twin.differences.everyday import of_test
from twin.errors import DivergedError
from twin.fitting.model import Columns, Floats, Model

STANDS_OUT = 5.0  # d, a cause's size over what noise and calibration leave of it


@dataclass(frozen=True)
class Member:
    """A candidate of a class: ln BF (refitted where it was) and its share of the class's probability."""

    candidate: Candidate
    log_bayes_factor: float
    probability: float


@dataclass(frozen=True)
class ToldApart:
    """A class: the `leader` and the `others` that the data cannot tell from it, best first; `probability` of all."""

    probability: float
    leader: Member
    others: tuple[Member, ...]


def told_apart(found: Round, leader: Candidate, log_bf_unknown: float, listed: float = 1.0) -> ToldApart:
    """The class that a round's candidate leads; `log_bf_unknown`: ln BF of the best free heat at the same fit;
    `listed`: how probable it is that what stands out is a candidate or a heat at all, and not the form of the file."""
    at = found.candidates.index(leader)
    if found.left_out is None:
        log_bf, amplitude, refitted = _refitted(found)
        expected = separation(amplitude, found.gram)[at]
        members = told_apart_class(at, log_bf, expected, refitted, _possible(found, amplitude))
    else:
        members, log_bf = _as_near(found, at)
    found_posterior = posterior(log_bf, prior_masses([c.cause for c in found.candidates]), log_bf_unknown)
    one = {i: Member(found.candidates[i], float(log_bf[i]), found_posterior.of_member(i, members)) for i in members}
    return ToldApart(listed * found_posterior.of_class(members), one[at], tuple(one[i] for i in members if i != at))


def _refitted(found: Round) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """ln BF and amplitude of every candidate, of its refit where it has one, and whether it has."""
    log_bf, amplitude = found.scores.log_bayes_factor.copy(), found.scores.amplitude.copy()
    log_bf[found.of_form] = np.minimum(0.0, log_bf[found.of_form])
    refitted = np.zeros(len(log_bf), dtype=np.bool_)
    for refit in found.refits:
        i = found.candidates.index(refit.candidate)
        log_bf[i], amplitude[i], refitted[i] = refit.log_bayes_factor, refit.amplitude, True
        if not refit.nameable:
            log_bf[i] = min(0.0, refit.log_bayes_factor)  # it fits, and is not what its name says
    return log_bf, amplitude, refitted


def _as_near(found: Round, leader: int) -> tuple[tuple[int, ...], Floats]:
    """Where sessions left out judge: the candidates with which these are as near as with the leader, within one
    standard error of the difference over the sessions, the leader first; and what each is worth (m,): what sessions
    left out ask for it, no more than its ln BF and than the leader's, and nothing for all others."""
    worth = np.zeros(len(found.candidates))
    holding = {found.candidates.index(r.candidate): r for r in found.refits if r.nameable and found.holds(r)}
    ahead = holding.pop(leader)
    assert ahead.left_out is not None, "it was let in"
    worth[leader] = min(float(found.gained(ahead).sum()), ahead.log_bayes_factor)
    near = [leader]
    for i, refit in sorted(holding.items(), key=lambda one: one[1].left_out_K):
        assert refit.left_out is not None, "this one holds"
        if refit.left_out.is_as_near_as(ahead.left_out):
            near.append(i)
            worth[i] = min(float(found.gained(refit).sum()), refit.log_bayes_factor, worth[leader])
    return tuple(near), worth


def _possible(found: Round, amplitude: Floats) -> NDArray[np.bool_]:
    """Which candidates can have their amplitude: it is within its range, and of its sign where there is one."""
    within = [is_possible(p, float(a)) for p, a in zip(found.parameters, amplitude, strict=True)]
    return np.array(within) & (found.scores.sign * amplitude >= 0)


# --- The next test ----------------------------------------------------------------------------------------------------


def separating_test(found: Round, leader: Candidate, other: Candidate) -> str | None:
    """The next test, in words, that tells two candidates of a round apart at the least bench time; None where none of
    the menu does (`twin.diagnosis.next_tests`).

    With the recorded tests and the new one stacked, the leader's amplitude a and everything else free, the other's ln
    BF is expected to fall behind by (a^2 / 2) (v_c - beta v_d)'P(v_c - beta v_d), beta = v_d'P v_c / v_d'P v_d. A test
    separates where that reaches ln 20; of these the one with the largest gain an hour is proposed.
    """
    return _best_test(found, [found.candidates.index(c) for c in (leader, other)], TOLD_APART)


def telling_test(found: Round, candidate: Candidate) -> str | None:
    """The next test, in words, after which a candidate of its present size a stands out: a^2 v'P v / 2 = d^2 / 2, d =
    5."""
    return _best_test(found, [found.candidates.index(candidate)], STANDS_OUT**2 / 2)


def _best_test(found: Round, at: Sequence[int], enough: float) -> str | None:
    """The test of the menu that gains most an hour, among those that reach `enough` in ln BF."""
    amplitude = float(_refitted(found)[1][at[0]])
    base = found.base
    recorded = _Recorded.of(found, at)
    before = amplitude**2 / 2 * _residual(recorded.gram, recorded.free, len(at))
    rates: dict[str, float] = {}
    for proposed in menu(base.model.network, base.model.tests):
        try:
            after = amplitude**2 / 2 * recorded.with_test(proposed)
        except DivergedError:
            continue
        hours = len(proposed.speed) * base.model.tests[0].frame.step_s / 3600
        if after > enough:
            rates[proposed.words] = (after - before) / hours
    return max(rates, key=lambda words: rates[words]) if rates else None


@dataclass(frozen=True)
class _Recorded:
    """`gram` (k + p, k + p): over the recorded tests, inner products of the whitened columns of k candidates (one or
    two, at the places `at` of the round), then of the p parameters with their priors; `free` (k + p,): which of them
    are not at a bound."""

    found: Round
    at: Sequence[int]
    gram: Floats
    free: NDArray[np.bool_]

    @classmethod
    def of(cls, found: Round, at: Sequence[int]) -> _Recorded:
        model, beta = found.base.model, found.base.beta
        parts = model.linearise(beta, [found.parameters[i] for i in at])
        k, size = len(at), len(at) + len(beta)
        gram = _gram(model, parts, np.arange(len(beta)), np.zeros((size, size)), k)
        gram[k:, k:] += np.diag(1 / model.sd**2)
        free = np.append(np.ones(k, dtype=np.bool_), found.base.free)
        return cls(found, at, gram, free)

    def with_test(self, proposed: Proposed) -> float:
        """v_c'P v_c, less (v_c'P v_d)^2 / v_d'P v_d where there is a second candidate, after one more test."""
        base = self.found.base
        test = as_test(base.model.network, base.model.tests, proposed)
        shared = [p for p, one in enumerate(base.model.parameters) if one.test is None]
        brought = list(of_test(base.model.network, test, 0))
        parameters = [*(base.model.parameters[p] for p in shared), *brought]
        model = Model(base.model.network, [test], parameters, base.model.noise)
        parts = model.linearise(
            np.append(base.beta[shared], np.zeros(len(brought))), [self.found.parameters[i] for i in self.at]
        )
        size, old, k = len(self.gram) + len(brought), len(self.gram), len(self.at)
        gram = np.zeros((size, size))
        gram[:old, :old] = self.gram
        gram[old:, old:] = np.diag([1 / one.sd**2 for one in brought])
        place = np.array([*shared, *range(old - k, size - k)])
        free = np.append(self.free, np.ones(len(brought), dtype=np.bool_))
        return _residual(_gram(model, parts, place, gram, k), free, k)


def _gram(model: Model, parts: Sequence[Columns], place: NDArray[np.intp], into: Floats, k: int) -> Floats:
    """`into` with inner products of whitened columns added: k candidates first, then parameters at their `place`."""
    for part in parts:
        white = model.whitened(part.series, np.column_stack([part.extra, part.columns]))
        at = np.append(np.arange(k), k + place[part.at])
        into[np.ix_(at, at)] += white.T @ white
    return into


def _residual(gram: Floats, free: NDArray[np.bool_], k: int) -> float:
    """Square of the first column, less what the free parameters and the second of k candidates can take of it."""
    kept = gram[np.ix_(free, free)]
    left = kept[:k, :k] - kept[:k, k:] @ np.linalg.solve(kept[k:, k:], kept[k:, :k])
    taken = float(left[0, 1] ** 2 / left[1, 1]) if k > 1 and left[1, 1] > 0 else 0.0
    return max(0.0, float(left[0, 0]) - taken)
