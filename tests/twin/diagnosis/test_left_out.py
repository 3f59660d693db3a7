"""What a fit says of sessions left out, without fitting again: held against full refits, and by what it asks for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from made.motor import CHANNELS, SINGLE, every_law, pulses, recorded
from twin.diagnosis import rounds
from twin.diagnosis.left_out import LeftOut, left_out
from twin.diagnosis.rounds import Round, scored, with_refits
from twin.differences.candidates import InputChannel, added_monomials, generate
from twin.differences.everyday import everyday
from twin.errors import DivergedError
from twin.fitting.fit import ENOUGH, Fit, fit
from twin.fitting.model import Model, Test
from twin.fitting.noise import log_det
from twin.motor.network import Network, Term
from twin.motor.sensor import Sensor

Floats = NDArray[np.float64]

SESSIONS = 4
INITIAL = np.array([45.0, 42.0, 41.0, 35.0])
HIDDEN = "loss.magnet.speed2_current2"
CANDIDATES = tuple(
    c
    for c in generate(
        every_law(),
        [Sensor(name, weights, "can1") for name, (weights, _) in CHANNELS.items()],
        [InputChannel(name, "can1") for name in (*SINGLE, "coolant", "ambient")],
    )
    if c.cause.kind == "loss"
)


def _tests() -> list[Test]:
    """Sessions of a motor with a heat in its magnet that the file does not have."""
    term = Term(80.0, {"speed": 2.0, "current": 2.0})
    file = every_law()
    sources = tuple(replace(s, terms=(*s.terms, term)) if s.node == "magnet" else s for s in file.sources)
    true: Network = replace(file, name="with-loss", sources=sources)
    more = added_monomials(CANDIDATES)
    return [
        recorded(file, pulses(600.0, seed=i), INITIAL, true=true, more=more, seed=i, name=f"{i}")
        for i in range(SESSIONS)
    ]


@pytest.fixture(scope="module")
def found() -> Fit:
    tests = _tests()
    model = Model(every_law(), tests, everyday(every_law(), tests))
    with threadpool_limits(1, user_api="blas"):
        return fit(model, np.zeros(len(model.parameters)), ENOUGH)


@pytest.fixture(scope="module")
def said(found: Fit) -> Round:
    """A round over every candidate heat, judged by sessions left out."""
    with threadpool_limits(1, user_api="blas"):
        return with_refits(scored(found, CANDIDATES), lambda _: None, judging=True)


def _refitted_without(found: Fit, session: int) -> Floats:
    """Mean error of a session by channel, predicted by a full fit to the others."""
    model = found.model
    emptied = [replace(c, samples=np.zeros_like(c.samples)) for c in model.tests[session].channels]
    tests = [replace(t, channels=tuple(emptied)) if s == session else t for s, t in enumerate(model.tests)]
    others = fit(Model(model.network, tests, model.parameters, model.noise), found.beta, ENOUGH)
    return np.array([np.abs(s.y).mean() for s in model.residuals_of(session, others.beta)])


def test_errors_of_sessions_left_out_are_those_of_full_refits(found: Fit) -> None:
    quick = np.array(list(left_out(found).errors_K.values()))
    for session in range(SESSIONS):
        np.testing.assert_allclose(quick[:, session], _refitted_without(found, session), atol=0.06)
    inside = np.array([np.abs(series.y).mean() for series in found.series])
    assert quick.mean() > 1.2 * inside.mean(), "sessions learnt from are nearer than those left out"


def test_the_log_score_is_the_density_under_what_the_others_leave_open(found: Fit) -> None:
    session, model = 1, found.model
    parts = found.linearised()
    of_session = [p.series.session == session for p in parts]
    own = [p for p, mine in zip(parts, of_session, strict=True) if mine]
    white = np.concatenate([model.whitened(p.series, np.column_stack([p.series.y, p.columns])) for p in own])
    columns = np.zeros((len(white), found.beta.size))
    columns[:, own[0].at] = white[:, 1:]
    columns, free = columns[:, found.free], found.free
    others = found.hessian[np.ix_(free, free)] - columns.T @ columns
    without = found.beta.copy()
    without[free] -= np.linalg.solve(others, columns.T @ white[:, 0])
    without = np.clip(without, model.low, model.high)
    without[[p.test == session for p in model.parameters]] = 0.0
    ran = model.residuals_of(session, without)
    error = np.concatenate([model.whitened(s, s.y[:, None])[:, 0] for s in ran])
    covariance = np.eye(len(error)) + columns @ np.linalg.inv(others) @ columns.T
    density = -(error @ np.linalg.solve(covariance, error) + np.linalg.slogdet(covariance)[1]) / 2
    density -= sum(log_det(s, model.noise_of(s.channel)) for s in ran) / 2
    assert left_out(found).log_scores[session] == pytest.approx(density, abs=1e-6)


def test_sessions_left_out_ask_for_what_is_there(said: Round) -> None:
    best = said.best
    assert best is not None and str(best.candidate.cause) == HIDDEN
    assert said.gained(best).sum() > rounds.EVIDENT and said.holds(best)
    assert best.left_out is not None and said.left_out is not None
    assert best.left_out.mean_K() < said.left_out.mean_K()


def test_too_little_asked_for_or_a_larger_error_keeps_a_term_out(said: Round) -> None:
    best = said.best
    assert best is not None and best.left_out is not None and said.left_out is not None
    spoilt = best.left_out.log_scores.copy()
    spoilt[2] -= said.gained(best).sum() - rounds.EVIDENT + 0.1
    against = replace(best, left_out=replace(best.left_out, log_scores=spoilt))
    assert 0 < said.gained(against).sum() < rounds.EVIDENT and not said.holds(against)
    within = {c: e - 0.1 * np.array([1, -1, 1, -0.9]) for c, e in said.left_out.errors_K.items()}
    hardly = replace(best, left_out=replace(best.left_out, errors_K=within))
    assert hardly.left_out_K < said.left_out.mean_K() and said.against(hardly) is rounds.Against.NO_NEARER
    further = {channel: errors + 5.0 for channel, errors in best.left_out.errors_K.items()}
    assert not said.holds(replace(best, left_out=replace(best.left_out, errors_K=further)))
    assert not said.holds(replace(best, left_out=None)), "evidence did not let it in"


def test_a_term_with_which_sessions_are_not_nearer_any_more_under_its_own_noise_is_not_let_in(
    found: Fit, said: Round
) -> None:
    best = said.best
    assert best is not None
    again = said.asked_again(best, best.fit)
    assert again.best is not None and again.best.candidate is best.candidate, "nothing was learnt anew"
    worn = said.asked_again(best, found)
    assert worn.best is None or worn.best.candidate is not best.candidate
    refit = next(r for r in worn.refits if r.candidate is best.candidate)
    assert worn.against(refit) is rounds.Against.NO_NEARER


def test_of_those_that_hold_the_one_with_which_sessions_left_out_are_nearest_is_let_in(said: Round) -> None:
    best = said.best
    assert best is not None and best.left_out is not None
    nearer = {channel: errors - 0.01 for channel, errors in best.left_out.errors_K.items()}
    less_asked = replace(best, left_out=LeftOut(best.left_out.log_scores - 0.5, nearer))
    both = replace(said, refits=(best, less_asked))
    assert both.holds(less_asked) and both.best is less_asked


def test_errors_of_what_a_sensor_is_said_to_get_wrong_are_of_its_readings_as_recorded(found: Fit) -> None:
    place = next(i for i, p in enumerate(found.model.parameters) if p.name == "sensor.W_1.gain")
    held = [replace(p, low=0.1) if i == place else p for i, p in enumerate(found.model.parameters)]
    far = fit(found.model.with_priors(held), np.where(np.arange(found.beta.size) == place, 0.1, found.beta))
    corrected, recorded = left_out(far), left_out(far, place)
    np.testing.assert_array_equal(corrected.log_scores, recorded.log_scores)
    assert recorded.by_channel_K()["W_1"] > 1.0 + corrected.by_channel_K()["W_1"], "a tenth too much is kelvins"
    for channel in ("Y_1", "R_1"):
        np.testing.assert_allclose(corrected.errors_K[channel], recorded.errors_K[channel], atol=1e-9)


def test_a_model_that_runs_away_without_a_session_says_nothing_before_and_all_after(
    found: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    calm, own = left_out(found), Model.residuals_of

    def away(model: Model, session: int, beta: Floats) -> object:
        if session == 0:
            raise DivergedError("the twin runs away at magnet")
        return own(model, session, beta)

    monkeypatch.setattr(Model, "residuals_of", away)
    wild = left_out(found)
    assert np.isneginf(wild.log_scores[0]) and np.isfinite(wild.log_scores[1:]).all()
    assert np.isneginf(wild.gained(calm)[0]) and calm.gained(wild)[0] == 0.0
    assert all(np.isnan(errors[0]) for errors in wild.errors_K.values()) and np.isfinite(wild.mean_K())


def test_means_are_over_the_sessions_that_have_a_channel() -> None:
    one = LeftOut(np.zeros(2), {"A": np.array([1.0, 3.0]), "B": np.array([np.nan, 4.0])})
    assert one.by_channel_K() == {"A": 2.0, "B": 4.0} and one.mean_K() == 3.0
    np.testing.assert_array_equal(one.by_session_K(), [1.0, 3.5])
    away = LeftOut(np.full(2, -np.inf), {"A": np.full(2, np.nan), "B": np.array([np.nan, 4.0])})
    assert away.by_channel_K() == {"B": 4.0}
    np.testing.assert_array_equal(away.by_session_K(), [np.nan, 4.0])
    assert LeftOut(np.full(1, -np.inf), {"A": np.full(1, np.nan)}).mean_K() == np.inf


def test_only_what_evidence_would_let_in_is_judged(said: Round) -> None:
    for refit in said.refits:
        assert (refit.left_out is None) == (refit.log_bayes_factor <= rounds.EVIDENT)
