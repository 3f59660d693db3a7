"""Classes that the data cannot tell apart, their probabilities, and the next test that would."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from made import motor as made
from twin.diagnosis.evidence import Scores, log_bayes_factor, posterior, prior_masses
from twin.diagnosis.left_out import LeftOut
from twin.diagnosis.next_tests import as_test, menu
from twin.diagnosis.posterior_mode import stacked
from twin.diagnosis.rounds import Refit, Round
from twin.diagnosis.told_apart import STANDS_OUT, _Recorded, separating_test, telling_test, told_apart
from twin.differences.candidates import Candidate, InputChannel, added_monomials, generate
from twin.differences.everyday import everyday, of_test
from twin.differences.proposals import Proposals
from twin.differences.sizes import Sigma
from twin.fitting.actions import InputGain, Late, Parameter
from twin.fitting.fit import Fit, fit
from twin.fitting.model import Model, Test
from twin.fitting.noise import ChannelNoise
from twin.motor.causes import Cause
from twin.motor.sensor import Sensor

Floats = NDArray[np.float64]

INITIAL = np.array([60.0, 50.0, 55.0, 45.0])
NOISE = ChannelNoise(ar_sd=0.03, ar_tau_s=60.0, ou_sd=0.05, ou_tau_s=600.0)


# --- Classes, on made scores -----------------------------------------------------------------------------------------


def _candidate(text: str) -> Candidate:
    return Candidate(Cause(*text.split(".", 2)), "W", Sigma(1.0), 0, Late((), False))


CAUSES = ("loss.magnet.speed2", "loss.magnet.speed3", "loss.yoke.speed2", "loss.case.constant")


def _round(
    s: Sequence[float], rho: Floats, refits: dict[int, tuple[float, float]], sign: Sequence[float] = (0, 0, 0, 0)
) -> Round:
    """A round of four candidates with sigma 1 and J = 4; `refits`: place -> (ln BF, amplitude)."""
    j, sigma = np.full(4, 4.0), np.ones(4)
    at = np.array(s, dtype=np.float64)
    signs = np.array(sign, dtype=np.float64)
    scores = Scores(at, j, sigma, signs, log_bayes_factor(at, j, sigma, signs))
    candidates = tuple(map(_candidate, CAUSES))
    nothing = cast(Any, None)
    one = Parameter("one", InputGain("current"), sd=1.0)
    found = tuple(Refit(candidates[i], one, nothing, bf, a, 0.1, nothing, 9.0) for i, (bf, a) in refits.items())
    return Round(nothing, candidates, (one,) * 4, scores, 4.0 * rho, np.full(4, 9.0), 4.0, found, ())


ALIKE = np.array([[1.0, 0.999, 0.1, 0.0], [0.999, 1.0, 0.1, 0.0], [0.1, 0.1, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def test_a_candidate_that_says_the_same_is_in_the_class_and_one_that_does_not_is_not() -> None:
    found = _round([20.0, 19.9, 19.5, 1.0], ALIKE, {})
    answer = told_apart(found, found.candidates[0], -1.0)
    assert str(answer.leader.candidate.cause) == CAUSES[0]
    assert [str(m.candidate.cause) for m in answer.others] == [CAUSES[1]]
    assert answer.leader.probability + answer.others[0].probability == pytest.approx(1.0)


def test_refitted_evidence_replaces_the_linear_one() -> None:
    found = _round([20.0, 19.9, 1.0, 1.0], ALIKE, {0: (40.0, 2.0), 1: (30.0, 2.0)})
    answer = told_apart(found, found.candidates[0], -1.0)
    assert answer.others == ()
    assert answer.leader.log_bayes_factor == 40.0


@pytest.mark.parametrize(("amplitude", "sign", "there"), [(3.9, 1, True), (9.0, 1, True), (-1.0, 1, False)])
def test_an_amplitude_outside_its_physical_range_is_no_member(amplitude: float, sign: int, there: bool) -> None:
    found = _round([20.0, 19.9, 1.0, 1.0], ALIKE, {0: (40.0, 2.0), 1: (39.0, amplitude)}, sign=(0, sign, 0, 0))
    assert (len(told_apart(found, found.candidates[0], -1.0).others) == 1) is there


def test_where_sessions_left_out_judge_what_is_as_near_is_not_told_apart_whatever_its_evidence() -> None:
    before = LeftOut(np.zeros(4), {"T": np.full(4, 2.0)})
    said = {
        0: LeftOut(np.full(4, 3.0), {"T": np.array([1.0, 1.2, 1.1, 0.9])}),  # let in: the nearest
        1: LeftOut(np.full(4, 9.0), {"T": np.array([0.9, 1.4, 1.2, 0.9])}),  # 0.05 K farther, give or take 0.07
        2: LeftOut(np.full(4, 9.0), {"T": np.array([1.3, 1.5, 1.5, 1.2])}),  # 0.325 K farther, in every one
    }
    plain = _round([20.0, 19.9, 30.0, 1.0], ALIKE, {0: (15.0, 2.0), 1: (40.0, 2.0), 2: (60.0, 2.0)})
    refits = tuple(replace(r, left_out=said[i]) for i, r in enumerate(plain.refits))
    found = replace(plain, refits=refits, left_out=before)
    assert found.best is refits[0]
    answer = told_apart(found, found.candidates[0], 0.0)
    assert [str(m.candidate.cause) for m in answer.others] == [CAUSES[1]]
    assert answer.leader.log_bayes_factor == answer.others[0].log_bayes_factor == 12.0, "what sessions ask for"
    assert answer.probability > 0.99


def test_probabilities_are_those_of_the_posterior_with_the_unknown_in_it() -> None:
    found = _round([6.0, 5.9, 1.0, 1.0], ALIKE, {})
    answer = told_apart(found, found.candidates[0], 6.0)
    expected = posterior(found.scores.log_bayes_factor, prior_masses([c.cause for c in found.candidates]), 6.0)
    assert answer.probability == pytest.approx(float(expected.candidates[:2].sum()))
    assert answer.probability < told_apart(found, found.candidates[0], -5.0).probability
    assert told_apart(found, found.candidates[0], 6.0, 0.25).probability == pytest.approx(0.25 * answer.probability)


# --- The next test, on a motor that only ran at one speed ------------------------------------------------------------


def _drive(duration_s: float) -> made.Drive:
    """One speed, current in pulses: laws of the speed look alike."""
    steps = round(duration_s / made.FINE_S)
    current = np.where(np.arange(steps) % 1200 < 400, 0.8, 0.2)
    return {"speed": np.full(steps, 0.5), "current": current, "flow": np.full(steps, 0.8)}


@cache
def _searched() -> Round:
    network = made.every_law()
    observed = [Sensor(name, weights, "can1") for name, (weights, _) in made.CHANNELS.items()]
    candidates = generate(network, observed, [InputChannel(name, "can1") for name in made.SINGLE])
    kept = [c for c in candidates if str(c.cause) in ("loss.magnet.speed", "loss.magnet.speed3", "loss.yoke.constant")]
    more = added_monomials(candidates)
    tests = [made.recorded(network, _drive(1800.0), INITIAL, more=more, seed=3)]
    model = Model(network, tests, everyday(network, tests), dict.fromkeys(made.CHANNELS, NOISE))
    base = fit(model, np.zeros(len(model.parameters)))
    proposals = Proposals(model, base.beta)
    parameters = [proposals.parameter(c) for c in kept]
    projector, v, _ = stacked(base, model.linearise(base.beta, parameters))
    sigma = np.array([p.sd for p in parameters])
    gram = projector.inner(v, v)
    amplitude = np.full(len(kept), 150.0)
    j = np.diag(gram)
    scores = Scores(amplitude * (1 + j * sigma**2) / sigma**2, j, sigma, np.zeros(len(kept)), np.full(len(kept), 9.0))
    return Round(base, tuple(kept), tuple(parameters), scores, gram, np.full(len(kept), 9.0), 4.0, (), ())


def test_the_separation_after_one_more_test_is_that_of_both_tests_stacked() -> None:
    found = _searched()
    base: Fit = found.base
    network, (recorded,) = base.model.network, base.model.tests
    proposed = menu(network, [recorded])[1]
    test: Test = as_test(network, [recorded], proposed)
    tests = (recorded, test)
    parameters = (*base.model.parameters, *of_test(network, test, 1))
    whole = Model(network, tests, parameters, base.model.noise)
    beta = np.append(base.beta, np.zeros(len(parameters) - len(base.beta)))
    projector, v, _ = stacked(replace(base, model=whole, beta=beta), whole.linearise(beta, found.parameters[:2]))
    gram = projector.inner(v, v)
    expected = gram[0, 0] - gram[0, 1] ** 2 / gram[1, 1]
    assert _Recorded.of(found, [0, 1]).with_test(proposed) == pytest.approx(expected, rel=1e-3)


def test_laws_of_the_speed_are_told_apart_by_a_test_at_another_speed() -> None:
    found = _searched()
    by_law = {c.cause.law: c for c in found.candidates}
    words = separating_test(found, by_law["speed3"], by_law["speed"])
    assert words is not None
    assert "rpm" in words
    assert words in {p.words for p in menu(found.base.model.network, found.base.model.tests)}


def test_no_test_separates_what_is_too_small_to_see() -> None:
    found = _searched()
    small = replace(found, scores=replace(found.scores, s=1e-4 * found.scores.s))
    assert separating_test(small, found.candidates[0], found.candidates[1]) is None


def test_no_test_separates_a_candidate_from_itself() -> None:
    found = _searched()
    assert separating_test(found, found.candidates[0], found.candidates[0]) is None


def test_a_suspicion_stands_out_after_the_test_proposed_and_not_before() -> None:
    """Small enough to hide in the recorded test; d^2 / 2 after the proposed one is that of both tests stacked."""
    found = _searched()
    at = found.candidates.index(next(c for c in found.candidates if c.cause.law == "speed3"))
    for share in (0.3, 0.1, 0.03, 0.01):
        weak = replace(found, scores=replace(found.scores, s=share * found.scores.s))
        amplitude = float(weak.scores.amplitude[at])
        words = telling_test(weak, found.candidates[at])
        if amplitude**2 * found.gram[at, at] < STANDS_OUT**2 and words is not None:
            break
    else:
        pytest.fail("no size that only a test of the menu shows")
    base = found.base
    proposed = next(p for p in menu(base.model.network, base.model.tests) if p.words == words)
    assert amplitude**2 * _Recorded.of(found, [at]).with_test(proposed) > STANDS_OUT**2
    tiny = replace(found, scores=replace(found.scores, s=1e-6 * found.scores.s))
    assert telling_test(tiny, found.candidates[at]) is None
