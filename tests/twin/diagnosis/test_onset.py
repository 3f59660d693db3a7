"""Since when a cause acts: sums over tests are the evidence of cut columns, and what began is found where it did."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from made import motor as made
from twin.diagnosis.evidence import PRIOR_NONE, prior_masses, score
from twin.diagnosis.onset import AS_KNOWN, FROM_THE_FIRST, KnownSize, from_each_on, weighed
from twin.diagnosis.posterior_mode import linearised, stacked
from twin.differences.candidates import Candidate, InputChannel, added_monomials, generate
from twin.differences.everyday import everyday
from twin.fitting.fit import Fit, fit
from twin.fitting.model import Model
from twin.fitting.noise import ChannelNoise
from twin.motor.sensor import Sensor

NOISE = ChannelNoise(ar_sd=0.03, ar_tau_s=60.0, ou_sd=0.05, ou_tau_s=600.0)
HIDDEN, FACTOR = "loss.winding.scale", 1.5
TESTS, FIRST_ILL = 3, 1


@pytest.fixture(scope="module")
def candidates() -> tuple[Candidate, ...]:
    observed = [Sensor(name, weights, "can1") for name, (weights, _) in made.CHANNELS.items()]
    every = generate(made.every_law(), observed, [InputChannel(name, "can1") for name in made.SINGLE])
    return tuple(c for i, c in enumerate(every) if c.cause.kind == "loss" or i % 8 == 0)


@pytest.fixture(scope="module")
def fitted(candidates: tuple[Candidate, ...]) -> Iterator[Fit]:
    """Three tests of one motor, whose winding loses more from the second on."""
    network = made.every_law()
    steps = round(900.0 / made.FINE_S)
    drive = {
        "speed": np.full(steps, 0.5),
        "current": np.where(np.arange(steps) % 1200 < 400, 0.8, 0.2),
        "flow": np.full(steps, 0.8),
    }
    initial = np.array([60.0, 50.0, 55.0, 45.0])
    ill = made.with_copper_loss(network, FACTOR)
    more = added_monomials(candidates)
    tests = [
        made.recorded(network, drive, initial, true=ill if number >= FIRST_ILL else None, more=more, seed=3 + number)
        for number in range(TESTS)
    ]
    model = Model(network, tests, everyday(network, tests), dict.fromkeys(made.CHANNELS, NOISE))
    with threadpool_limits(1, user_api="blas"):
        yield fit(model, np.zeros(len(model.parameters)))


def test_each_set_of_tests_has_the_evidence_of_its_cut_columns(fitted: Fit, candidates: tuple[Candidate, ...]) -> None:
    sets = np.array([[True, True, True], [False, True, True], [True, False, True]])
    found = weighed(fitted, candidates, sets)
    chosen, parameters, parts, _ = linearised(fitted, [c for c in candidates if not c.repeated])
    projector, v, e0 = stacked(fitted, parts)
    test = np.concatenate([np.full(len(part.series.y), part.series.session) for part in parts])
    sigma, sign = np.array([p.sd for p in parameters]), np.array([float(c.sign) for c in chosen])
    mass = prior_masses([c.cause for c in chosen])
    mass *= (1 - PRIOR_NONE) / mass.sum()
    shares = (FROM_THE_FIRST, (1 - FROM_THE_FIRST) / 2, (1 - FROM_THE_FIRST) / 2)
    for acts, share, stated in zip(sets, shares, found.probability, strict=True):
        cut = v * acts[test][:, None]
        odds = share * mass / PRIOR_NONE * np.exp(score(cut, e0, projector, sigma, sign).log_bayes_factor)
        assert stated == pytest.approx(odds * found.none, rel=1e-6, abs=1e-12)
    assert found.none + found.probability.sum() == pytest.approx(1.0)


def test_what_began_is_found_where_it_began(fitted: Fit, candidates: tuple[Candidate, ...]) -> None:
    found = weighed(fitted, candidates, from_each_on(TESTS))
    assert int(found.by_set().argmax()) == FIRST_ILL
    assert str(found.candidates[int(found.probability.sum(axis=0).argmax())].cause) == HIDDEN
    assert found.in_test(HIDDEN)[FIRST_ILL] > 0.9
    assert found.in_test(HIDDEN)[0] < 0.01


def test_a_cause_known_from_elsewhere_is_found_at_its_size_and_not_at_the_other_sign(
    fitted: Fit, candidates: tuple[Candidate, ...]
) -> None:
    size = float(np.log(FACTOR))
    grown, shrunk = (
        weighed(fitted, candidates, from_each_on(TESTS), known={HIDDEN: KnownSize(amplitude, AS_KNOWN)})
        for amplitude in (size, -size)
    )
    at = grown.place(HIDDEN)
    assert at is not None
    assert grown.probability[FIRST_ILL, at] > 0.9
    assert shrunk.probability[FIRST_ILL, at] < 0.01
    assert grown.amplitude[FIRST_ILL, at] == pytest.approx(size, abs=0.1)


def test_of_a_channel_only_what_moves_it_counts(fitted: Fit, candidates: tuple[Candidate, ...]) -> None:
    found = weighed(fitted, candidates, from_each_on(TESTS), "W_1")
    every = weighed(fitted, candidates, from_each_on(TESTS))
    of_sensors = [{c.cause.place for c in one.candidates if c.cause.kind == "sensor"} for one in (every, found)]
    assert len(of_sensors[0]) > 1
    assert of_sensors[1] == {"winding"}
    assert HIDDEN in {str(c.cause) for c in found.candidates}
