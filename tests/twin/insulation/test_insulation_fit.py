"""The insulation over checks of a stator that another solver ran: three lumps, its own film, a motor file that is
wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from twin.fitting.recorded import RecordedChannel, Test
from twin.insulation.check_tests import begun_alike, minutes_of_switches, without_iron
from twin.insulation.insulation_fit import OverChecks, insulated, over_checks
from twin.motor.network import Boundary, Link, Network, Node, Source, Term
from twin.motor.sensor import Sensor
from twin.run.simulate import Frame

Floats = NDArray[np.float64]

STEP_S, HEATED_S, WHOLE_S = 10.0, 7200.0, 9600.0
COURSE = (1.0, 0.93, 1.05, 1.25)  # of the insulation's resistance
STEFAN_BOLTZMANN = 5.670374419e-8
NETWORK = Network(
    name="stator",
    nodes=(Node("winding", 1000.0, "copper"), Node("head", 1500.0, "copper"), Node("yoke", 6500.0, "iron")),
    boundaries=(Boundary("air"),),
    links=(
        Link("winding", "head", (Term(22.0),)),
        Link("winding", "yoke", (Term(27.0),)),
        Link("head", "air", (Term(0.6, law="radiation"), Term(0.4, law="free_convection"))),
        Link("yoke", "air", (Term(0.6, law="radiation"), Term(0.6, law="free_convection"), Term(0.3))),
    ),
    sources=(
        Source("winding", (Term(135.0, {"current": 2.0}, copper=True),)),
        Source("head", (Term(170.0, {"current": 2.0}, copper=True),)),
    ),
    scale={"current": 160.0},
)


@cache
def check(resistance: float, emissivity: float, air_degC: float, noise: int) -> Test:
    """One check of a stator with other conductances than the file's and a film that grows with the cube root of the
    excess; `resistance` of its slots over 1 / 30 K/W."""
    capacity = np.array([950.0, 1600.0, 6300.0])
    surface = np.array([0.0, 0.12, 0.13])

    def slope(t: float, now: Floats) -> Floats:
        heat = np.array([140.0, 175.0, 0.0]) * (1.0 + 0.00393 * (now - 20.0)) * (t < HEATED_S)
        along, through = 19.0 * (now[0] - now[1]), 30.0 / resistance * (now[0] - now[2])
        excess = now - air_degC
        film = surface * (1.5 * np.cbrt(np.abs(excess)) * excess)
        radiated = surface * emissivity * STEFAN_BOLTZMANN * ((now + 273.15) ** 4 - (air_degC + 273.15) ** 4)
        inside = np.array([-along - through, along, through])
        return np.asarray((heat + inside - film - radiated) / capacity)

    edges = np.arange(0.0, WHOLE_S + STEP_S, STEP_S)
    found = [
        solve_ivp(slope, (a, b), start, t_eval=edges[(edges >= a) & (edges <= b)], method="LSODA", rtol=1e-8, atol=1e-8)
        for a, b, start in [(0.0, HEATED_S, np.full(3, air_degC + 0.5))]
    ]
    cooled = solve_ivp(
        slope,
        (HEATED_S, WHOLE_S),
        found[0].y[:, -1],
        t_eval=edges[edges >= HEATED_S],
        method="LSODA",
        rtol=1e-8,
        atol=1e-8,
    )
    whole = np.concatenate([found[0].y, cooled.y[:, 1:]], axis=1)
    random = np.random.default_rng(noise)
    means = (whole[:, :-1] + whole[:, 1:]) / 2.0 + 0.03 * random.standard_normal((3, edges.size - 1))
    current = np.where(edges[:-1] < HEATED_S, 1.0, 0.0)
    ones = np.ones(current.size)
    return Test(
        name="dc",
        kind="dc_check",
        frame=Frame(STEP_S, (current**2)[:, None], np.full((current.size, 1), air_degC)),
        inputs={"current": current},
        features={"current2": current**2},
        initial=np.full(3, air_degC),
        initial_sd=np.ones(3),
        channels=tuple(
            RecordedChannel(Sensor(node, {node: 1.0}, bus="log", noise=0.03, bias_sd=0.1), means[at], ones, 0.5 * ones)
            for node, at in (("head", 1), ("yoke", 2))
        ),
    )


def checks(course: Sequence[float], emissivities: Sequence[float], noise: int = 0) -> list[Test]:
    rooms = [21.0, 23.5, 19.0, 22.0]
    made = [check(r, e, rooms[k], 10 * noise + k) for k, (r, e) in enumerate(zip(course, emissivities, strict=True))]
    return [begun_alike(NETWORK, one) for one in made]


def heads(tests: Sequence[Test]) -> list[Test]:
    cut = [minutes_of_switches(NETWORK, without_iron(NETWORK, test), 20.0) for test in tests]
    return [test for test in cut if test is not None]


def fitted(tests: Sequence[Test], emissivity_free: bool = False) -> OverChecks:
    return over_checks(NETWORK, tests, emissivity_free)


@pytest.mark.parametrize("route", ["iron", "first minutes", "whole curve"])
def test_the_course_of_the_insulation_is_the_hidden_one(route: str) -> None:
    whole = checks(COURSE, [0.8] * 4)
    tests = {"iron": whole, "first minutes": heads(whole), "whole curve": [without_iron(NETWORK, one) for one in whole]}
    found = fitted(tests[route], emissivity_free=route == "whole curve")
    assert found.converged
    got = np.log(found.resistance / found.resistance[0])
    assert np.polyfit(np.log(COURSE), got, 1)[0] == pytest.approx(1.0, abs=0.15)
    assert np.corrcoef(np.log(COURSE), got)[0, 1] > 0.999
    assert (found.ln_sd < 0.03).all()


def test_with_sensors_on_the_iron_the_level_is_near_the_hidden_one() -> None:
    found = fitted(checks(COURSE, [0.8] * 4))
    assert found.resistance == pytest.approx(np.array(COURSE) / 30.0, rel=0.12)
    assert found.misfit_K < 0.5


@pytest.mark.parametrize("route", ["iron", "first minutes"])
def test_surfaces_that_darken_make_no_course(route: str) -> None:
    tests = checks([1.0] * 4, [0.80, 0.84, 0.88, 0.90])
    found = fitted(tests if route == "iron" else heads(tests))
    assert np.ptp(np.log(found.resistance)) < 0.012


def test_the_sd_covers_what_noise_does_to_the_course() -> None:
    courses = []
    for noise in range(5):
        found = fitted(checks(COURSE[:3], [0.8] * 3, noise))
        courses.append(np.log(found.resistance) - np.log(found.resistance).mean())
        sd = found.ln_sd
    scatter = np.std(courses, axis=0, ddof=1)
    assert (scatter < sd).all()
    assert (sd < 0.02).all()


def test_one_check_alone_has_a_resistance_too() -> None:
    found = fitted(checks([1.25], [0.8]))
    assert found.resistance[0] == pytest.approx(1.25 / 30.0, rel=0.2)


def test_another_machine_is_told_by_its_misfit() -> None:
    tests = checks(COURSE[:2], [0.8] * 2)
    fluids = replace(NETWORK, nodes=tuple(replace(node, capacity=200.0 * node.capacity) for node in NETWORK.nodes))
    assert over_checks(fluids, tests, False).misfit > 0.1
    assert fitted(tests).misfit < 0.01


def test_without_a_link_from_copper_to_iron_there_is_nothing_to_estimate() -> None:
    bare = replace(NETWORK, nodes=tuple(replace(node, region="copper") for node in NETWORK.nodes))
    assert insulated(NETWORK) and not insulated(bare)
    with pytest.raises(ValueError, match="a link from copper to iron"):
        over_checks(bare, checks([1.0], [0.8]), False)
    with pytest.raises(ValueError, match="needs a test"):
        over_checks(NETWORK, [], False)
