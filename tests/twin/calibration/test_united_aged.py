"""Tests of an ageing specimen in one fit: each runs as on its own aged network, and all teach the coefficient of the
new one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from twin.calibration.calibrate import calibrate
from twin.calibration.united import United
from twin.compiled.kernel import compile_indexed
from twin.fitting.model import Model, Test
from twin.fitting.recorded import RecordedChannel
from twin.motor.ageing_law import Ageing, AgeingPlace, AgeingTerm, aged, ageing_places
from twin.motor.configured import configured
from twin.motor.features import evaluate, monomials
from twin.motor.network import Boundary, Configuration, Link, Network, Node, Source, Term
from twin.motor.sensor import Sensor
from twin.run.simulate import Frame, simulate

LAW = Ageing(above_degC=180.0, percent_per_100h=-10.0, sd=1.0)
MOTOR = Network(
    "motor",
    (Node("winding", 600.0, "copper"), Node("teeth", 900.0, "iron")),
    (Boundary("air"),),
    (
        Link("winding", "teeth", (AgeingTerm(8.0, ageing=LAW), AgeingTerm(2.0, {"speed": 0.5}, sd=0.01, ageing=LAW))),
        Link("teeth", "air", (Term(5.0),)),
    ),
    (Source("winding", (Term(300.0, {"current": 2.0}, sd=0.001),)),),
    scale={"speed": 1000.0, "current": 10.0},
    configurations=(Configuration("bare", links=(Link("teeth", "air", (Term(2.0),)),)),),
)
(SLOT,) = ageing_places(MOTOR)
LEFT: dict[str, dict[AgeingPlace, float]] = {"new": {}, "old": {SLOT: 0.8}}


def recorded(motor: Network, name: str, rig: str | None, steps: int = 1600) -> Test:
    """A test of the aged motor in steps of 1 s, a thermometer at each node."""
    whole = configured(motor, rig)
    network = aged(whole, {place: LEFT[name].get(place, 1.0) for place in ageing_places(whole)})
    held = np.random.default_rng(len(name + str(rig))).uniform(0.1, 1.0, (2, 8))
    drive = dict(zip(("speed", "current"), np.repeat(held, steps // 8, axis=1), strict=True))
    columns = evaluate(monomials(network), drive, steps)
    frame, start = Frame(1.0, columns, np.full((steps, 1), 25.0)), np.full(2, 32.0)
    edges = simulate(compile_indexed(network), frame, start)
    always, middle = np.ones(steps), np.full(steps, 0.5)
    return Test(
        name=name,
        kind="drive",
        frame=frame,
        inputs=drive,
        features={m.name: columns[:, j] for j, m in enumerate(monomials(network))},
        initial=start,
        initial_sd=np.full(2, 0.3),
        channels=tuple(
            RecordedChannel(Sensor(node, {node: 1.0}, noise=0.02), (edges[:-1, i] + edges[1:, i]) / 2, always, middle)
            for i, node in enumerate(("winding", "teeth"))
        ),
    )


@pytest.mark.parametrize("rigs", [(None,), (None, "bare")])
def test_a_test_runs_as_on_its_own_aged_network(rigs: tuple[str | None, ...]) -> None:
    united = United(MOTOR, rigs)
    for rig in rigs:
        for name, factors in LEFT.items():
            test = recorded(MOTOR, name, rig)
            for one in Model(united.network, [united.test(test, rig, factors)], ()).residuals(np.zeros(0)):
                np.testing.assert_allclose(one.y, 0.0, rtol=0, atol=2e-3)
    as_new = Model(united.network, [united.test(recorded(MOTOR, "old", None), None)], ()).residuals(np.zeros(0))
    assert np.abs(as_new[0].y).max() > 1.0


def test_old_and_new_tests_teach_the_coefficient_of_the_new_specimen() -> None:
    slot = MOTOR.links[0]
    wrong = replace(slot, terms=(replace(slot.terms[0], coefficient=5.0), slot.terms[1]))
    guess = replace(MOTOR, links=(wrong, MOTOR.links[1]))
    united = United(guess, [None])
    tests = [united.test(recorded(MOTOR, name, None), None, factors) for name, factors in LEFT.items()]
    found = united.version(calibrate(united.network, tests).network)
    assert found.links[0].terms[0].coefficient == pytest.approx(8.0, rel=0.01)
    assert ageing_places(found) == (SLOT,)
    assert united.names[:2] == ("conductance.winding-teeth.constant", "conductance.winding-teeth.speed0.5")
