"""The trials' own measures on a small motor: how well an effect can be seen, which step lost it, z of healthy ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.trial import lost
from benchmarks.trial.audit import spreads
from benchmarks.trial.campaigns import Course
from benchmarks.trial.inside import inside
from benchmarks.trial.one import as_the_file_says
from benchmarks.trial.visibility import seen
from made.motor import CHANNELS, SINGLE, every_law, pulses, recorded, truth
from plant import Effect
from replay.studies.diagnosis.search import Found
from twin.diagnosis.evidence import log_bayes_factor
from twin.diagnosis.evidence_split import EvidenceSplit
from twin.diagnosis.free_heats import free_heats
from twin.diagnosis.naming import Naming
from twin.diagnosis.rounds import Refit, Round, scored
from twin.differences.candidates import InputChannel, added_monomials, generate
from twin.differences.everyday import everyday
from twin.fitting.fit import NEAR_ENOUGH, Fit, fit
from twin.fitting.model import Model
from twin.motor.network import Network, Term
from twin.motor.sensor import Sensor

INITIAL = np.array([45.0, 42.0, 41.0, 35.0])
WATTS = 80.0
CANDIDATES = generate(
    every_law(),
    [Sensor(name, weights, "can1") for name, (weights, _) in CHANNELS.items()],
    [InputChannel(name, "can1") for name in (*SINGLE, "coolant", "ambient")],
)
LOSS, SENSOR, SAME_LAW = "loss.magnet.constant", "sensor.yoke.bias", "loss.yoke.speed1.5"


def _with_more(node: str, term: Term) -> Network:
    network = every_law()
    sources = tuple(replace(s, terms=(*s.terms, term)) if s.node == node else s for s in network.sources)
    return replace(network, name=f"more-loss-in-{node}", sources=sources)


@pytest.fixture(scope="module")
def mode() -> Fit:
    more = added_monomials(CANDIDATES)
    tests = [recorded(every_law(), pulses(600.0, seed=i), INITIAL, more=more, seed=i, name=f"{i}") for i in range(2)]
    model = Model(every_law(), tests, everyday(every_law(), tests))
    return fit(model, np.zeros(len(model.parameters)), enough=1e-3)


@pytest.fixture(scope="module")
def first(mode: Fit) -> Round:
    return scored(mode, CANDIDATES)


@pytest.fixture(scope="module")
def moved() -> list[Course]:
    return _moved(_with_more("magnet", Term(WATTS)))


def _moved(hiding: Network) -> list[Course]:
    """What a motor that hides something reads more in each test, once a second."""
    pairs = [
        [recorded(every_law(), pulses(600.0, seed=i), INITIAL, true=true) for true in (every_law(), hiding)]
        for i in range(2)
    ]
    return [
        {a.name: np.repeat(b.measured - a.measured, 2) for a, b in zip(*(t.channels for t in pair), strict=True)}
        for pair in pairs
    ]


def _at(first: Round, cause: str) -> int:
    return [str(c.cause) for c in first.candidates].index(cause)


def test_a_sensor_that_reads_wrong_is_seen_by_its_size_and_what_calibration_leaves(mode: Fit, first: Round) -> None:
    found, i = seen(mode, CANDIDATES, Effect(SENSOR, 2.0), ()), _at(first, SENSOR)
    j, sigma = first.scores.J[i : i + 1], first.scores.sigma[i : i + 1]
    assert found.d == pytest.approx(2.0 * j[0] ** 0.5)
    line = log_bayes_factor(2.0 * j, j, sigma, np.zeros(1))[0]
    assert found.log_bf == pytest.approx(line, abs=NEAR_ENOUGH), (
        "what acts linearly gains by full fits what the line says"
    )
    assert found.band == "below 3"


def test_what_a_coefficient_of_the_file_does_as_well_is_seen_less_than_the_line_says(mode: Fit, first: Round) -> None:
    """More of a law that the file has grows its coefficient by a factor: the line takes each watt more for as dear."""
    i = _at(first, SAME_LAW)
    found = seen(mode, CANDIDATES, Effect(SAME_LAW, WATTS), _moved(_with_more("yoke", Term(6 * WATTS, {"speed": 1.5}))))
    j, sigma = first.scores.J[i : i + 1], first.scores.sigma[i : i + 1]
    assert found.d is not None and found.log_bf is not None
    line = float(log_bayes_factor(found.d * j**0.5, j, sigma, np.ones(1))[0])
    assert line > 8 and found.log_bf < line - 3


def test_a_loss_is_seen_by_what_it_does_to_the_readings(mode: Fit, first: Round, moved: list[Course]) -> None:
    found, i = seen(mode, CANDIDATES, Effect(LOSS, WATTS), moved), _at(first, LOSS)
    assert found.d == pytest.approx(WATTS * first.scores.J[i] ** 0.5, rel=0.1)
    twice = seen(mode, CANDIDATES, Effect(LOSS, WATTS), [{k: 2 * x for k, x in one.items()} for one in moved])
    assert found.d is not None and found.log_bf is not None and twice.log_bf is not None
    assert twice.d == pytest.approx(2 * found.d)
    assert twice.log_bf > found.log_bf


def test_off_the_library_an_effect_is_seen_by_its_own_course(mode: Fit, first: Round, moved: list[Course]) -> None:
    known, found = (seen(mode, CANDIDATES, Effect(c, WATTS), moved) for c in (LOSS, "unknown.demagnetised"))
    assert known.d is not None and found.d is not None and found.log_bf is not None
    assert found.d >= known.d  # no column of another has more of a course than the course itself
    j = np.array([found.d**2])
    assert found.log_bf == pytest.approx(log_bayes_factor(j, j, np.ones(1), np.zeros(1))[0])


def test_what_no_candidate_says_and_moves_no_reading_has_no_visibility(mode: Fit) -> None:
    assert seen(mode, (), Effect(SENSOR, 2.0), ()).band is None


def test_a_lost_cause_is_told_by_the_last_step_that_it_came_to(mode: Fit, first: Round) -> None:
    i = _at(first, LOSS)
    candidate, parameter = first.candidates[i], first.parameters[i]
    heats = tuple(replace(heat, log_bayes_factor=-1.0) for heat in free_heats(mode))

    def step(refits: tuple[Refit, ...] = (), cause: str = LOSS, **more: object) -> str:
        naming = Naming((replace(first, refits=refits),), (), (), mode, heats, 6.0)
        refused = [(refit, "") for refit in refits] if more.pop("refused", False) else []
        found = Found(replace(naming, **more), refused, [], [], None, mode)  # type: ignore[arg-type]
        return lost.lost_at(found, cause, CANDIDATES)

    strong = Refit(candidate, parameter, mode, 20.0, parameter.sd, 1.0, EvidenceSplit(20.0, np.zeros(0), 0.0), 9.0)
    bound = replace(parameter, low=-1.0)
    empty = replace(strong, parameter=bound, amplitude=-1.0)
    assert step(cause="loss.magnet.speed9") == lost.NOT_PROPOSED
    assert step(cause="unknown.spray") == lost.NOT_UNKNOWN
    assert step() == lost.SCREENED
    assert step((replace(strong, log_bayes_factor=5.0),)) == lost.WEAK
    assert step((empty,)) == lost.IMPOSSIBLE
    assert step((strong,)) == lost.OTHER_FIRST
    assert step((strong,), left_out=((candidate, 3.0),)) == lost.LEFT_OUT
    assert step((strong,), patchwork=(strong,)) == lost.PATCHWORK
    assert step((strong,), refused=True) == lost.KEPT
    assert step(heats=(replace(heats[0], log_bayes_factor=1e6),)) == lost.UNKNOWN
    assert step(rounds=(replace(first, dropped=(LOSS,)),)) == lost.RAN_AWAY


def test_a_motor_that_is_as_its_file_says_has_small_z(mode: Fit) -> None:
    found = spreads(mode)
    assert sum(one.parameters for one in found.values()) == len(mode.beta)
    assert {"starts", "films", "maps of iron", "gain of a reading"} <= found.keys()
    assert max(one.largest for one in found.values()) < 3.0
    assert not any(one.held for one in found.values())
    bound = next(i for i, p in enumerate(mode.model.parameters) if p.name == "capacity.case")
    far = mode.beta.copy()
    far[bound] = mode.model.high[bound]
    capacities = spreads(replace(mode, beta=far))["capacities"]
    assert (capacities.held, capacities.motors_held, capacities.whose) == (1, 1, "capacity.case")
    assert capacities.largest == pytest.approx(far[bound] / mode.model.sd[bound])


def test_nodes_without_a_sensor_are_held_against_their_true_temperatures(mode: Fit) -> None:
    drive = pulses(600.0, seed=5)
    kept = recorded(every_law(), drive, INITIAL, name="kept")
    edges = truth(every_law(), drive, INITIAL)
    second = ((edges[:-1] + edges[1:]) / 2).reshape(-1, 2, 4).mean(axis=1)
    nodes = {node.name: second[:, i] for i, node in enumerate(every_law().nodes)}
    off = {**nodes, "case": nodes["case"] + 1.5}  # no channel follows the case most
    found = Found(Naming((), (), (), mode, (), 6.0), [], [], [], None, mode)
    right, wrong = (inside(found, every_law(), [kept], [one]) for one in (nodes, off))
    assert right["published"] == pytest.approx(0.0, abs=0.05)
    assert wrong["published"] == pytest.approx(1.5, abs=0.05)
    assert right["recalibrated"] == right["extended"]


def test_more_of_the_only_law_of_a_place_is_what_the_file_calls_scale() -> None:
    network = every_law()
    node = network.sources[0].node
    only = replace(
        network, sources=(replace(network.sources[0], terms=(Term(5.0, {"current": 2.0}),)), *network.sources[1:])
    )
    more = Effect(f"loss.{node}.current2", 3.0)
    assert as_the_file_says(more, only) == replace(more, cause=f"loss.{node}.scale")
    for other in (f"loss.{node}.speed2", "unknown.spray", "sensor.yoke.lag", "capacity.yoke.attached"):
        assert as_the_file_says(replace(more, cause=other), only).cause == other
    assert as_the_file_says(more, network) == more, "one law of several"
