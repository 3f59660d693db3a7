"""Naming on a small motor whose tests come from another integrator: a hidden loss is named, a healthy motor is not."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter
from threadpoolctl import threadpool_limits

from made.motor import AMBIENT_DEGC, CHANNELS, COOLANT_DEGC, SINGLE, every_law, pulses, recorded, slow
from twin.diagnosis import naming, rounds
from twin.diagnosis.crudeness import USUAL
from twin.diagnosis.evidence import TOLD_APART
from twin.diagnosis.free_heats import as_fitted
from twin.diagnosis.naming import Naming, search
from twin.diagnosis.patchwork import around, nodes_of
from twin.diagnosis.posterior_mode import rises, slowest_mode_s
from twin.diagnosis.rounds import scored, with_refits
from twin.differences.candidates import Candidate, InputChannel, added_monomials, generate
from twin.differences.everyday import everyday
from twin.differences.proposals import Proposals
from twin.errors import DivergedError
from twin.fitting.actions import HeatTent, Parameter
from twin.fitting.fit import Fit, fit
from twin.fitting.model import Model, Test
from twin.fitting.recorded import RecordedChannel
from twin.motor import sensor_laws
from twin.motor.network import Network, Source, Term
from twin.motor.sensor import Sensor

Floats = NDArray[np.float64]

SEEDS = range(5)
INITIAL = np.array([45.0, 42.0, 41.0, 35.0])
WARM = np.array([60.0, 50.0, 55.0, 45.0])
HIDDEN = "loss.magnet.speed2_current2"
WATTS = 80.0  # at full speed and current
CANDIDATES = tuple(
    c
    for c in generate(
        every_law(),
        [Sensor(name, weights, "can1") for name, (weights, _) in CHANNELS.items()],
        [InputChannel(name, "can1") for name in (*SINGLE, "coolant", "ambient")],
    )
    if c.cause.kind in ("loss", "sensor")
)


def _with_loss() -> Network:
    network, term = every_law(), Term(WATTS, {"speed": 2.0, "current": 2.0})
    sources = tuple(replace(s, terms=(*s.terms, term)) if s.node == "magnet" else s for s in network.sources)
    return replace(network, name="with-loss", sources=sources)


def _model(true: Network, seed: int, duration_s: float = 900.0) -> Model:
    more = added_monomials(CANDIDATES)
    tests: list[Test] = [
        recorded(
            every_law(), pulses(duration_s, seed=i), INITIAL, true=true, more=more, seed=10 * seed + i, name=f"{i}"
        )
        for i in range(2)
    ]
    return Model(every_law(), tests, everyday(every_law(), tests))


@pytest.fixture(scope="module", autouse=True)
def _one_thread() -> Iterator[None]:
    """The matrices are small: more threads only wait for each other."""
    with threadpool_limits(1, user_api="blas"):
        yield


@pytest.fixture(scope="module")
def hidden() -> list[Naming]:
    return [search(_model(_with_loss(), seed), CANDIDATES) for seed in SEEDS]


@pytest.fixture(scope="module")
def calibrated() -> Fit:
    model = _model(every_law(), 1, duration_s=600.0)
    return fit(model, np.zeros(len(model.parameters)))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_healthy_motor_is_silent(seed: int) -> None:
    found = search(_model(every_law(), seed), CANDIDATES)
    assert found.accepted == ()
    assert len(found.rounds) == 1
    assert found.final is found.rounds[0].base


def test_a_hidden_loss_is_named(hidden: list[Naming]) -> None:
    for found in hidden:
        assert [str(one.candidate.cause) for one in found.accepted] == [HIDDEN]
        assert found.accepted[0].log_bayes_factor > 20


@pytest.mark.parametrize(("true", "named"), [(every_law(), []), (_with_loss(), [HIDDEN])], ids=["healthy", "hidden"])
def test_what_moves_a_reading_by_less_than_lumps_are_off_by_has_no_name(true: Network, named: list[str]) -> None:
    """A sixth of a kelvin at each step of the current stands out of quiet readings, and no lump is so good."""
    model = _model(true, 2)
    tests = [replace(test, channels=tuple(_with_current(one, test) for one in test.channels)) for test in model.tests]
    found = search(Model(model.network, tests, everyday(model.network, tests)), CANDIDATES)
    last = found.rounds[-1]
    at = [str(candidate.cause) for candidate in last.candidates].index("sensor.yoke.current")
    assert last.scores.log_bayes_factor[at] > rounds.THRESHOLD
    assert 0.5 < last.moved[at] < rounds.LEAST_MOVED and last.form == last.scores.log_bayes_factor[at]
    assert [str(one.candidate.cause) for one in found.accepted] == named
    assert not found.is_unknown


def _with_current(channel: RecordedChannel, test: Test) -> RecordedChannel:
    off = 0.15 * test.inputs["current"] if channel.name == "Y_1" else 0.0
    return replace(channel, measured=channel.measured - off)


def test_its_size_is_told(hidden: list[Naming]) -> None:
    """In watts of root mean square over the tests, within what a free magnet's own loss leaves open."""
    drives = [pulses(900.0, seed=i) for i in range(2)]
    rms = np.sqrt(np.mean(np.concatenate([d["speed"] ** 2 * d["current"] ** 2 for d in drives]) ** 2))
    for found in hidden:
        (one,) = found.accepted
        assert abs(one.amplitude - WATTS * rms) < 3 * one.sd
        assert one.sd < 0.3 * WATTS * rms


def test_the_last_round_looked_with_it_in_the_model(hidden: list[Naming]) -> None:
    for found in hidden:
        assert found.rounds[-1].base.model.parameters[-1].name == HIDDEN
        assert found.final.beta[-1] == found.accepted[0].amplitude


def test_the_first_round_ranks_it_first(hidden: list[Naming]) -> None:
    for found in hidden:
        first = found.rounds[0]
        assert str(first.candidates[first.order()[0]].cause) == HIDDEN
        assert first.scores.log_bayes_factor.max() > first.null


def test_a_loss_that_is_there_already_is_not_named_again(hidden: list[Naming]) -> None:
    for found in hidden:
        assert HIDDEN not in [str(c.cause) for c in found.rounds[-1].candidates]


def _all_off(by: float) -> Network:
    """No cause, and a file that is wrong in every coefficient: by a factor, up and down in turn."""
    network, turns = every_law(), itertools.cycle((by, 1 / by))

    def off(terms: Sequence[Term]) -> tuple[Term, ...]:
        return tuple(replace(term, coefficient=term.coefficient * next(turns)) for term in terms)

    links = tuple(replace(link, terms=off(link.terms)) for link in network.links)
    return replace(network, links=links, sources=tuple(replace(s, terms=off(s.terms)) for s in network.sources))


def test_a_name_of_a_crude_file_says_little_and_of_a_good_one_all(hidden: list[Naming]) -> None:
    crude = search(_model(_all_off(3.0), 0), CANDIDATES)
    assert [str(one.candidate.cause) for one in crude.accepted] == ["loss.winding.scale"], "there is no cause"
    assert crude.crudeness > 1.5 * USUAL and crude.listed < 0.2
    assert replace(crude, wrong_in_form=True).listed < 0.2, "a larger noise does not mend the file"
    for found in hidden:
        assert found.crudeness < USUAL and found.listed == 1.0, "the cause relieves the file's numbers"


def test_a_threshold_above_what_the_data_say_names_nothing() -> None:
    assert search(_model(_with_loss(), 0), CANDIDATES, threshold=1e4).accepted == ()


def test_refits_that_cannot_win_any_more_stop_and_the_winner_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Begun with one linearisation each; the winner ends where it ends when all are fitted in full."""
    model = _model(_with_loss(), 0)
    current = fit(model, np.zeros(len(model.parameters)))
    leading = [c for c in CANDIDATES if c.cause.place == "magnet" and c.cause.kind == "loss"]
    monkeypatch.setattr(rounds, "FAR_BEHIND", np.inf)
    monkeypatch.setattr(rounds, "OUT_OF_REACH", np.inf)
    whole = with_refits(scored(current, leading), lambda _: None).refits
    monkeypatch.setattr(rounds, "OUT_OF_REACH", 0.1)
    monkeypatch.setattr(rounds, "FIRST_LINEARISATIONS", 1)
    raced = with_refits(scored(current, leading), lambda _: None).refits
    assert all(one.ended for one in whole)
    assert any(not one.ended for one in raced)
    best, same = (max(some, key=lambda r: r.log_bayes_factor) for some in (whole, raced))
    assert best.candidate == same.candidate
    assert same.ended
    assert same.log_bayes_factor == pytest.approx(best.log_bayes_factor, abs=0.5)
    assert sum(one.fit.linearisations for one in raced) < sum(one.fit.linearisations for one in whole)


def test_what_leads_before_any_calibration_is_refitted_from_there_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where calibration stood in for the cause so well that its score says nothing there."""
    model = _model(_with_loss(), 0)
    current = fit(model, np.zeros(len(model.parameters)))
    found = scored(current, CANDIDATES)
    usual = max(with_refits(found, lambda _: None).refits, key=lambda one: one.log_bayes_factor)
    monkeypatch.setattr(rounds, "REFITTED", 0)
    assert with_refits(found, lambda _: None).refits == ()
    (from_there,) = with_refits(found, lambda _: None, rounds.uncalibrated(current, len(model.parameters))).refits
    assert str(from_there.candidate.cause) == str(usual.candidate.cause) == HIDDEN
    assert from_there.log_bayes_factor == pytest.approx(usual.log_bayes_factor, abs=0.5)


def test_a_refit_from_there_that_is_given_up_on_the_way_says_nothing_of_its_candidate(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One was 21,742 behind in ln BF by what it had reached, and its candidate as good as no other."""
    model = _model(_with_loss(), 0)
    current = fit(model, np.zeros(len(model.parameters)))
    found = scored(current, CANDIDATES)
    monkeypatch.setattr(rounds, "FIRST_LINEARISATIONS", 1)
    monkeypatch.setattr(rounds, "NEAR_ENOUGH", -np.inf)
    monkeypatch.setattr(rounds, "OUT_OF_REACH", -np.inf)
    monkeypatch.setattr(rounds, "REFITTED", 0)
    there = rounds.uncalibrated(current, len(model.parameters))
    assert with_refits(found, lambda _: None, there).refits == ()


def test_what_would_take_away_more_than_there_is_takes_no_others_place(monkeypatch: pytest.MonkeyPatch) -> None:
    model = _model(_with_loss(), 0)
    found = scored(fit(model, np.zeros(len(model.parameters))), CANDIDATES)
    first, second = found.order()[:2]
    parameters = list(found.parameters)
    parameters[first] = replace(parameters[first], low=float(found.scores.amplitude[first]) * 1.01, high=np.inf)
    assert parameters[first].low > 0, "for this test: as impossible as a loss below nothing"
    monkeypatch.setattr(rounds, "REFITTED", 1)
    monkeypatch.setattr(rounds, "is_possible", lambda parameter, amount: amount > parameter.low)
    (refit,) = with_refits(replace(found, parameters=tuple(parameters)), lambda _: None).refits
    assert refit.candidate == found.candidates[second]


def test_patchwork_is_no_name_and_progress_says_which_cause_the_search_is_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(naming, "is_patchwork", lambda *_: True)
    said: list[str] = []
    found = search(_model(_with_loss(), 0), CANDIDATES, said.append)
    assert found.accepted == ()
    assert [str(one.candidate.cause) for one in found.patchwork] == [HIDDEN]
    assert found.is_unknown
    assert found.final is found.rounds[0].base
    assert any(re.fullmatch(rf"cause 1: refit \d of \d: {HIDDEN}", line) for line in said)
    second = [line for line in said if line.startswith("cause 2: ")]
    assert second[:2] == [
        "cause 2: recalibrating, fit 1 of 3: noise",
        "cause 2: recalibrating, fit 2 of 3: priors of families",
    ]


def test_a_heat_that_no_candidate_holds_against_is_unknown(
    hidden: list[Naming], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Behind the best candidate it is none; where candidates were refitted and none let in, it is, unless sessions left
    out judged them."""
    found = hidden[0]
    behind = replace(found.heats[0], log_bayes_factor=found.best - 1.0)
    assert behind.log_bayes_factor > TOLD_APART, "for this test: a heat that is worth telling"
    assert not replace(found, heats=(behind,)).is_unknown
    assert replace(found, heats=(behind,), accepted=()).is_unknown
    weak = replace(behind, log_bayes_factor=TOLD_APART)
    assert not replace(found, heats=(weak,), accepted=()).is_unknown
    monkeypatch.setattr(naming, "ENOUGH_SESSIONS", 1)
    assert not replace(found, heats=(behind,), accepted=(), wrong_in_form=True).is_unknown


LATE_S = 60.0


@pytest.fixture(scope="module")
def beside_heat() -> Naming:
    """A motor whose case takes a heat that no law of the list has, and a winding sensor that is late."""
    network = every_law()
    hidden = Source("case", (Term(120.0, {"flow": 3.0}),))
    heated = replace(network, name="heated", sources=(*network.sources, hidden))
    more = added_monomials(CANDIDATES)
    tests = []
    for seed, duration_s in enumerate((3600.0, 1800.0)):
        test = recorded(network, slow(duration_s), WARM, true=heated, more=more, seed=seed)
        late = [replace(c, measured=_late(c.measured)) if c.name == "W_1" else c for c in test.channels]
        tests.append(replace(test, channels=tuple(late)))
    return search(Model(network, tests, everyday(network, tests)), CANDIDATES)


def test_where_sessions_left_out_judge_nothing_is_looked_for_beside_such_a_heat(
    beside_heat: Naming, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = beside_heat.rounds[0].base.model
    monkeypatch.setattr(naming, "ENOUGH_SESSIONS", 1)
    monkeypatch.setattr(naming, "calibrated", lambda *_: beside_heat.rounds[0].base)
    monkeypatch.setattr(naming, "is_wrong_in_form", lambda _: True)
    found = search(model, CANDIDATES)
    assert found.is_unknown and found.judged
    assert found.heat is None and not found.accepted


def _late(measured: Floats) -> Floats:
    """Readings every 2 s through a first-order lag."""
    kept = np.exp(-2.0 / LATE_S)
    late: Floats = measured[0] + lfilter([1 - kept], [1, -kept], measured - measured[0])
    return late


def test_what_a_sensor_gets_wrong_is_named_beside_a_heat_without_a_name(beside_heat: Naming) -> None:
    assert beside_heat.is_unknown
    assert beside_heat.heat is not None
    assert beside_heat.heat.node == "case"
    (one,) = beside_heat.accepted
    assert str(one.candidate.cause) == "sensor.winding.lag"
    assert one.amplitude > LATE_S / 2


def test_the_heat_is_told_as_the_last_fit_has_it(beside_heat: Naming) -> None:
    heat, model = beside_heat.heat, beside_heat.final.model
    assert heat is not None
    tents = [i for i, p in enumerate(model.parameters) if isinstance(p.action, HeatTent)]
    told = as_fitted(beside_heat.final, heat)
    np.testing.assert_array_equal(told.watts, beside_heat.final.beta[tents])
    np.testing.assert_allclose(told.sd, np.sqrt(beside_heat.final.covariance_diagonal[tents]))
    assert 60.0 < np.ptp(told.watts) < 120.0  # its mean is nothing that a constant loss could not be


def test_nothing_is_named_at_the_place_of_a_heat_without_a_name(beside_heat: Naming) -> None:
    network = beside_heat.final.model.network
    near = around(frozenset({"case"}), network)
    for found in beside_heat.rounds[1:]:
        assert not any(near & nodes_of(candidate, network) for candidate in found.candidates)
    assert any(near & nodes_of(candidate, network) for candidate in beside_heat.rounds[0].candidates)


def test_the_terms_were_let_in_by_the_rounds_that_have_the_heat(beside_heat: Naming, hidden: list[Naming]) -> None:
    assert beside_heat.searched == beside_heat.rounds[1:]
    assert hidden[0].searched == hidden[0].rounds


def test_a_candidate_without_a_finite_column_is_dropped_and_said(calibrated: Fit) -> None:
    """Its heat is not a number somewhere: the others are scored as if it were not there."""
    model = calibrated.model
    wild = replace(
        model.tests[1],
        features={**model.tests[1].features, "speed3": np.full(len(model.tests[1].frame.features), np.nan)},
    )
    broken = replace(calibrated, model=Model(model.network, [model.tests[0], wild], model.parameters, model.noise))
    some = [c for c in CANDIDATES if c.cause.kind == "loss"]
    names = {str(c.cause) for c in some if c.cause.law == "speed3"}
    assert names
    found = with_refits(scored(broken, some), lambda _: None)
    assert set(found.dropped) == names
    assert names.isdisjoint(str(c.cause) for c in found.candidates)
    expected = with_refits(scored(calibrated, [c for c in some if str(c.cause) not in names]), lambda _: None)
    assert [c.cause for c in found.candidates] == [c.cause for c in expected.candidates]
    np.testing.assert_allclose(found.scores.log_bayes_factor, expected.scores.log_bayes_factor, atol=0.02)


def test_a_refit_that_runs_away_is_no_refit(calibrated: Fit, monkeypatch: pytest.MonkeyPatch) -> None:
    def runs_away(*_: object, **__: object) -> Fit:
        raise DivergedError("temperatures run away")

    monkeypatch.setattr(rounds, "fit", runs_away)
    candidate: Candidate = CANDIDATES[0]
    parameter = Proposals(calibrated.model, calibrated.beta).parameter(candidate)
    assert rounds.refitted(calibrated, candidate, parameter) is None


def test_the_slowest_mode_and_the_rises_are_those_of_the_motor(calibrated: Fit) -> None:
    """Cooled from afar: minutes; the rises are measured over the coldest boundary."""
    assert 60 < slowest_mode_s(calibrated) < 1800
    for channel, rise in rises(calibrated.model).items():
        top = max(c.measured.max() for t in calibrated.model.tests for c in t.channels if c.name == channel)
        assert rise == pytest.approx(top - min(COOLANT_DEGC, AMBIENT_DEGC))


def test_what_takes_away_more_than_there_is_is_not_possible() -> None:
    """It ends at its bound; a cause that has a sign may end at 0, and one that is larger than usual is possible too."""
    cooling = Parameter("p", sensor_laws.Bias("W_1"), 1.0, low=-2.0)
    assert rounds.is_possible(cooling, -1.9)
    assert not rounds.is_possible(cooling, -2.0)
    assert rounds.is_possible(cooling, 9.0)
    assert rounds.is_possible(Parameter("p", sensor_laws.Bias("W_1"), 1.0, low=0.0), 0.0)
