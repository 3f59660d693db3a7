"""What is unusual in the fits of a diagnosis, as its answer holds it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from made.motor import SINGLE, every_law, pulses, recorded, rotor_unread
from replay.engine.results.as_json import from_json, to_json
from replay.studies.diagnosis import answer_parts
from replay.studies.diagnosis.answer import EvidenceParts, Unusual
from replay.studies.diagnosis.answer_parts import OTHER_CAUSES, evidence_parts
from replay.studies.diagnosis.beyond_usual import beyond_usual
from twin.diagnosis.free_heats import as_parameters, free_heats
from twin.diagnosis.in_words import PATHS
from twin.diagnosis.naming import Naming
from twin.diagnosis.rounds import Refit, refitted, scored
from twin.differences.candidates import Candidate, InputChannel, added_monomials, generate
from twin.differences.everyday import everyday
from twin.differences.proposals import Proposals
from twin.fitting.fit import NEAR_ENOUGH, Fit, fit
from twin.fitting.model import Model
from twin.fitting.supposed import supposing
from twin.motor.network import Network

INITIAL = np.array([45.0, 42.0, 41.0, 35.0])
SESSIONS = ["first", "second"]
CANDIDATES = {str(c.cause): c for c in generate(every_law(), [], [InputChannel(name, "can1") for name in SINGLE])}
FILM, OTHER = "conductance.yoke-coolant.scale", "input.flow.gain"
SENSOR_OFF_K = 4.0  # in the second session, where 0.3 K is usual


@pytest.fixture(scope="module", autouse=True)
def _one_thread() -> Iterator[None]:
    """The matrices are small: more threads only wait for each other."""
    with threadpool_limits(1, user_api="blas"):
        yield


def _with_film() -> Network:
    """Both terms of the film between yoke and coolant at a quarter."""
    network = every_law()
    quarter = [
        replace(link, terms=tuple(replace(t, coefficient=t.coefficient / 4) for t in link.terms))
        if link.b == "coolant"
        else link
        for link in network.links
    ]
    return replace(network, name="quarter-of-a-film", links=tuple(quarter))


@pytest.fixture(scope="module")
def base() -> Fit:
    more = added_monomials(tuple(CANDIDATES.values()))
    tests = [
        recorded(every_law(), pulses(1200.0, seed=i), INITIAL, true=_with_film(), more=more, seed=i, off_K=off)
        for i, off in enumerate(({}, {"W_1": SENSOR_OFF_K}))
    ]
    stated = everyday(every_law(), tests)
    return fit(Model(every_law(), tests, stated), np.zeros(len(stated)), NEAR_ENOUGH)


def _refit(current: Fit, candidate: Candidate) -> Refit:
    found = refitted(current, candidate, Proposals(current.model, current.beta).parameter(candidate))
    assert found is not None
    return found


@pytest.fixture(scope="module")
def naming(base: Fit) -> Naming:
    return Naming((scored(base, [CANDIDATES[FILM]]),), (), (), base, (), 6.0)


@pytest.fixture(scope="module")
def film(base: Fit) -> Refit:
    return _refit(base, CANDIDATES[FILM])


def test_findings_stand_by_place_and_size_those_of_a_session_by_its_id(naming: Naming) -> None:
    found = {(one.kind, one.place, one.session): one for one in beyond_usual(naming, SESSIONS)}
    assert {one.when for one in found.values()} == {"before"}
    path = found["conductance", "yoke-coolant", None]
    assert (path.about, path.unit, path.sharper, path.bound) == ("moved", "1", ", or ".join(PATHS), None)
    assert path.estimate == pytest.approx(1 / 4 - 1, abs=0.15)
    low, high = path.ci95
    assert low < 1 / 4 - 1 < high < 0
    assert path.times_usual < -2
    offset = found["sensor", "W_1", "second"]
    assert offset.unit == "K"
    assert offset.estimate is not None
    assert 2 * 0.3 < offset.estimate < SENSOR_OFF_K, "as much as its prior lets it"
    assert offset.says == "the offset of W_1"
    assert ("sensor", "W_1", "first") not in found


def test_with_causes_both_fits_are_told_and_what_a_cause_takes_over_goes(naming: Naming, film: Refit) -> None:
    found = beyond_usual(replace(naming, accepted=(film,), final=film.fit), SESSIONS)
    before, after = ([one.place for one in found if one.when == when] for when in ("before", "after"))
    assert "yoke-coolant" in before
    assert "yoke-coolant" not in after
    assert "W_1" in before
    assert "W_1" in after, "the cause is no sensor's"


def test_the_parts_of_an_evidence_sum_to_it_by_family(naming: Naming, film: Refit) -> None:
    parts = evidence_parts(naming, film)
    assert parts.fit + parts.priors_relieved + parts.rest == pytest.approx(film.log_bayes_factor, abs=1e-9)
    assert next(iter(parts.relieved)) == "films"
    assert parts.relieved["films"] > 3
    assert sum(parts.relieved.values()) == pytest.approx(parts.priors_relieved, abs=1.0)


def test_what_another_cause_no_longer_has_to_do_is_told_as_that(naming: Naming, base: Fit) -> None:
    """A flow that stood in for the film is relieved by the film."""
    first = _refit(base, CANDIDATES[OTHER])
    both = _refit(first.fit, CANDIDATES[FILM])
    relieved = float(both.evidence.relieved[-1])
    parts = evidence_parts(naming, both)
    assert relieved > 0.1
    assert parts.relieved[OTHER_CAUSES] == pytest.approx(relieved)


def test_what_a_heat_without_a_name_no_longer_has_to_do_is_told_as_that(
    naming: Naming, base: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(answer_parts, "WORTH_TELLING", 0.0)
    tents = as_parameters(base, free_heats(base)[0])
    with_heat = fit(base.model.plus(tents), np.append(base.beta, np.zeros(len(tents))), NEAR_ENOUGH)
    first = _refit(with_heat, CANDIDATES[OTHER])
    both = _refit(first.fit, CANDIDATES[FILM])
    parts = evidence_parts(naming, both)
    of_heat = float(both.evidence.relieved[len(base.beta) : -1].sum())
    assert of_heat != 0.0
    assert parts.relieved["the heat without a name"] == pytest.approx(of_heat)
    assert parts.relieved[OTHER_CAUSES] == pytest.approx(float(both.evidence.relieved[-1]))


def test_both_are_read_back_from_json_as_they_were(naming: Naming, film: Refit) -> None:
    for one in beyond_usual(naming, SESSIONS):
        assert from_json(Unusual, to_json(one)) == one
    parts = evidence_parts(naming, film)
    assert from_json(EvidenceParts, to_json(parts)) == parts


def test_a_node_without_a_sensor_stands_with_how_much_hotter_it_is_than_by_the_file() -> None:
    network = every_law()
    tests = [rotor_unread(recorded(network, pulses(800.0, seed=i), INITIAL, seed=i)) for i in range(2)]
    stated = everyday(network, tests)
    hot = np.array([1.5 if p.name == "term12" else 0.0 for p in stated])  # the magnet's loss
    current = fit(supposing(Model(network, tests, stated)), hot, linearisations=1)
    naming = Naming((scored(current, [CANDIDATES[FILM]]),), (), (), current, (), 6.0)
    (one,) = [one for one in beyond_usual(naming, SESSIONS) if one.kind == "temperature"]
    assert (one.about, one.place, one.unit, one.sharper) == ("moved", "magnet", "K", "a sensor there")
    assert one.says == "the temperature of magnet, where no sensor sits" and one.session in SESSIONS
    assert one.estimate is not None and one.ci95[0] < one.estimate < one.ci95[1] and one.times_usual > 2.0
