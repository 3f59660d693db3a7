"""What tests tell together is the sum of what each tells, and is what the diagnosis would find in all of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twin.diagnosis.posterior_mode import stacked
from twin.differences.everyday import of_test
from twin.fitting.model import Model
from twin.planning.courses import BenchRange, courses, cut
from twin.planning.detectable import Prospect

LENGTHS = [30, 90]


def test_a_test_added_tells_as_much_as_both_tests_diagnosed_together(found: Prospect) -> None:
    fit, ground = found.ground.fit, found.ground
    base = fit.model
    bench = BenchRange.of(base.network, base.tests)
    test = bench.test(cut(next(iter(courses(bench))), LENGTHS[-1]))
    parameters = (*base.parameters, *of_test(base.network, test, 1))
    both = Model(base.network, (*base.tests, test), parameters, base.noise)
    beta = np.append(fit.beta, np.zeros(len(parameters) - len(fit.beta)))
    projector, v, _ = stacked(replace(fit, model=both, beta=beta), both.linearise(beta, ground.candidates))
    (told,) = ground.untried(test).would_tell(LENGTHS[-1:])
    expected = np.diag(projector.inner(v, v))
    np.testing.assert_allclose((ground.known + told).information(), expected, rtol=1e-6, atol=1e-9 * expected.max())
    assert (expected >= ground.known.information() * (1 - 1e-9)).all()


def test_a_length_tells_what_the_test_cut_there_tells(found: Prospect) -> None:
    bench = BenchRange.of(found.ground.fit.model.network, found.ground.fit.model.tests)
    course = next(c for c in courses(bench) if c.words.startswith("S2"))
    whole = bench.test(cut(course, LENGTHS[-1]))
    shorter, longer = found.ground.untried(whole).would_tell(LENGTHS)
    short = replace(
        whole,
        frame=replace(
            whole.frame, features=whole.frame.features[: LENGTHS[0]], boundaries=whole.frame.boundaries[: LENGTHS[0]]
        ),
        inputs={name: values[: LENGTHS[0]] for name, values in whole.inputs.items()},
        features={name: values[: LENGTHS[0]] for name, values in whole.features.items()},
        channels=tuple(
            replace(c, measured=c.measured[: LENGTHS[0]], samples=c.samples[: LENGTHS[0]], place=c.place[: LENGTHS[0]])
            for c in whole.channels
        ),
    )
    (alone,) = found.ground.untried(short).would_tell(LENGTHS[:1])
    np.testing.assert_allclose(shorter.cross, alone.cross, rtol=1e-6, atol=1e-6 * np.abs(alone.cross).max())
    np.testing.assert_allclose(shorter.square, alone.square, rtol=1e-6, atol=1e-9 * alone.square.max())
    assert (longer.square >= shorter.square * (1 - 1e-9)).all()


def test_a_cause_that_came_since_the_same_tests_shows_as_in_both_diagnosed_together(found: Prospect) -> None:
    fit, ground = found.ground.fit, found.ground
    base = fit.model
    own = [p for p, one in enumerate(base.parameters) if one.test is not None]
    parameters = (*base.parameters, *(replace(base.parameters[p], test=1) for p in own))
    both = Model(base.network, (*base.tests, *base.tests), parameters, base.noise)
    beta = np.append(fit.beta, fit.beta[own])
    parts = both.linearise(beta, ground.candidates)
    since = [replace(one, extra=one.extra * one.series.session) for one in parts]
    projector, v, _ = stacked(replace(fit, model=both, beta=beta), since)
    expected = np.diag(projector.inner(v, v))
    told = ground.since_before.information()
    np.testing.assert_allclose(told, expected, rtol=1e-6, atol=1e-9 * expected.max())
    assert (told >= ground.known.information() * (1 - 1e-9)).all()


def test_a_candidate_of_one_recorded_test_is_nothing_in_a_new_one(found: Prospect) -> None:
    base, ground = found.ground.fit.model, found.ground
    bench = BenchRange.of(base.network, base.tests)
    test = bench.test(cut(next(iter(courses(bench))), LENGTHS[0]))
    (always,) = ground.untried(test).would_tell(LENGTHS[:1])
    place = int(always.square.argmax())
    once = [replace(one, test=0) if i == place else one for i, one in enumerate(ground.candidates)]
    (told,) = replace(ground, candidates=tuple(once)).untried(test).would_tell(LENGTHS[:1])
    assert always.square[place] > 0.0
    assert told.square[place] == 0.0
    assert not told.cross[:, place].any()
