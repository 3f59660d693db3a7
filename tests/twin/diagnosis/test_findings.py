"""What is unusual in a calibrated motor: found where it truly is so, and nothing in one that is as its file says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from threadpoolctl import threadpool_limits

from made.motor import every_law, pulses, recorded, rotor_unread, with_copper_loss
from twin.diagnosis.findings import FAR, Findings, findings, log_evidence
from twin.diagnosis.in_words import Plain
from twin.diagnosis.refined import refined
from twin.diagnosis.rounds import EVIDENT
from twin.differences.everyday import everyday
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.fit import NEAR_ENOUGH, fit
from twin.fitting.model import Model
from twin.fitting.supposed import supposing
from twin.motor.network import Network, Shape

INITIAL = np.array([45.0, 42.0, 41.0, 35.0])
FILM, IRON = ("yoke", "coolant"), "yoke"


@pytest.fixture(scope="module", autouse=True)
def _one_thread() -> Iterator[None]:
    """The matrices are small: more threads only wait for each other."""
    with threadpool_limits(1, user_api="blas"):
        yield


def _of(true: Network, most: float = np.inf) -> Findings:
    """Of tests of a motor, where calibration changes no term by more than a factor of `most`."""
    tests = [recorded(every_law(), pulses(1800.0, seed=i), INITIAL, true=true, seed=i, name=f"{i}") for i in range(4)]
    stated = tuple(
        replace(p, low=max(p.low, -np.log(most)), high=min(p.high, np.log(most))) if p.name.startswith("term") else p
        for p in everyday(every_law(), tests)
    )
    current = refined(
        fit(Model(every_law(), tests, stated), np.zeros(len(stated)), NEAR_ENOUGH), (), stated, lambda _: None
    )
    return findings(current, stated, EVIDENT)


def _with_film(factor: float) -> Network:
    """Both terms of the film times a factor."""
    network = every_law()
    links = tuple(
        replace(link, terms=tuple(replace(t, coefficient=factor * t.coefficient) for t in link.terms))
        if (link.a, link.b) == FILM
        else link
        for link in network.links
    )
    return replace(network, name=f"film-{factor}", links=links)


def _with_weakening() -> Network:
    """Iron whose loss falls with current at most speeds, and is as large in the mean."""
    network, shape = (
        every_law(),
        Shape((0.0, 0.25, 0.5, 0.75, 1.0), (-0.5, 0.5, 0.0, 0.55, 0.5), (0.9, -0.95, 0.0, -1.0, -0.95)),
    )
    sources = tuple(
        replace(s, terms=tuple(replace(t, shape=shape) for t in s.terms)) if s.node == IRON else s
        for s in network.sources
    )
    return replace(network, name="weakening", sources=sources)


@pytest.fixture(scope="module")
def found() -> Mapping[str, Findings]:
    motors = {"healthy": every_law(), "film": _with_film(0.3), "iron": _with_weakening()}
    return {name: _of(true) for name, true in motors.items()} | {"bound": _of(_with_film(0.2), most=4.0)}


def _says(found: Findings) -> list[tuple[str, bool]]:
    plain = Plain(found.fit.model.network)
    return [(plain.says(found.fit.model.parameters[one.place]), one.held) for one in found.moved]


def test_a_motor_that_is_as_its_file_says_has_none(found: Mapping[str, Findings]) -> None:
    assert found["healthy"].wide == ()
    assert found["healthy"].moved == ()


def test_a_coefficient_that_had_to_go_far_is_told_with_its_size(found: Mapping[str, Findings]) -> None:
    film = found["film"]
    assert _says(film) == [
        ("the heat path between yoke and coolant (the constant part)", False),
        ("the heat path between yoke and coolant (the part with flow to the power 0.8)", False),
    ]
    assert film.wide == (), "two numbers are no family"
    for one in film.moved:
        assert one.usual == pytest.approx(np.log(0.3) / 0.4, abs=0.3), "in the sd of the file, 0.4"
        assert one.sd < 0.4


def test_a_coefficient_that_is_further_off_than_calibration_goes_is_told_at_its_bound(
    found: Mapping[str, Findings],
) -> None:
    bound = found["bound"]
    assert [held for _, held in _says(bound)] == [True, True]
    for one in bound.moved:
        assert one.usual == pytest.approx(-np.log(4) / 0.4, rel=1e-3)


def test_an_iron_loss_of_another_form_is_told_as_a_family_and_where_it_bends_most(
    found: Mapping[str, Findings],
) -> None:
    iron = found["iron"]
    (wide,) = iron.wide
    members = [iron.fit.model.parameters[i] for i in wide.members]
    assert {Plain(every_law()).group(one) for one in members} == {"form of the losses in iron"}
    assert len(members) == 10, "all of the family"
    assert 2 < wide.times < 6
    assert wide.log_evidence > EVIDENT
    assert {says for says, _ in _says(iron)} == {
        f"how the loss in yoke follows current near {rpm} rpm" for rpm in ("2,494", "7,481", "9,975")
    }
    assert max(one.usual for one in iron.moved) < -FAR, "it falls with current where it is told"


def test_a_family_must_exceed_the_threshold(found: Mapping[str, Findings]) -> None:
    iron = found["iron"].fit
    stated = everyday(every_law(), iron.model.tests)
    (wide,) = found["iron"].wide
    assert findings(iron, stated, wide.log_evidence + 0.01).wide == ()
    assert findings(iron, stated, wide.log_evidence - 0.01).wide == (wide,)


def test_the_evidence_of_a_width_is_that_of_the_gaussian_written_out() -> None:
    rng = np.random.default_rng(3)
    a, e0 = rng.normal(size=(12, 4)), rng.normal(size=12)
    usual, wide = np.array([0.5, 0.5, 1.0, 2.0]), np.array([1.5, 1.5, 1.0, 2.0])

    def whole(sd: np.ndarray) -> float:
        return float(multivariate_normal.logpdf(e0, cov=np.eye(12) + (a * sd**2) @ a.T))

    linear = [log_evidence(a.T @ a, a.T @ e0, sd) for sd in (wide, usual)]
    assert linear[0] - linear[1] == pytest.approx(whole(wide) - whole(usual), abs=1e-9)


def test_a_node_without_a_sensor_that_is_far_from_what_the_file_says_is_found() -> None:
    """All that a fit may do to the winding, which has a third more loss, is to heat the magnet, which no sensor
    follows."""
    network = every_law()
    for factor, hotter in ((1.0, False), (1.3, True)):
        true = with_copper_loss(network, factor)
        tests = [rotor_unread(recorded(network, pulses(800.0, s), INITIAL, true=true, seed=s)) for s in range(2)]
        stated = (Parameter("loss of the magnet", actions.Scale((12,)), 3.0),)
        current = fit(supposing(Model(network, tests, stated)), np.zeros(1))
        found = findings(current, stated, EVIDENT).elsewhere
        assert [one.node for one in found] == (["magnet"] if hotter else [])
        for one in found:
            supposed = next(c for c in current.model.tests[one.test].supposed if c.sensor.node == one.node)
            step = int(supposed.samples.argmax())
            shown = current.model.course(one.test, current.beta)[1][step, 2]
            assert one.hotter_K == pytest.approx(shown - supposed.measured[step], abs=0.01)
            assert one.usual == pytest.approx(one.hotter_K / supposed.sensor.noise) and one.usual > FAR
            assert 0.0 < one.sd < supposed.sensor.noise
