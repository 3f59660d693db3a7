"""Columns of a model with circuits, radiation and free convection against central differences of its residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from made.laws import GLYCOL
from made.motor import CHANNELS, every_law, pulses, recorded, smooth
from twin.differences.everyday import everyday
from twin.fitting import actions
from twin.fitting.actions import Parameter, Place
from twin.fitting.model import Model, Test
from twin.motor import features
from twin.motor.network import FluidCircuit, Link, Network, Node, Term

Floats = NDArray[np.float64]

NEAR = 1e-3  # of a column's largest entry
WINDING, YOKE, MAGNET, CASE, JACKET, OUTLET, COOLANT, AMBIENT = range(8)


def _cooled() -> Network:
    """The motor of every law in a jacket, with a case that radiates and a magnet in still air."""
    plain = every_law()
    links = [link for link in plain.links if {link.a, link.b} != {"yoke", "coolant"}]
    return replace(
        plain,
        name="every-law-cooled",
        nodes=(*plain.nodes, Node("jacket", 300.0, "fluid"), Node("outlet", 200.0, "fluid")),
        links=(
            *links[:3],
            Link("ambient", "case", (*links[3].terms, Term(2.0, law="radiation"))),
            Link("yoke", "jacket", (Term(15.0), Term(10.0, {"flow": 0.8}))),
            Link("case", "outlet", (Term(8.0, {"speed": 0.5}, law="free_convection"),)),
            Link("winding", "case", (Term(1.5, law="radiation"),)),
        ),
        circuits=(FluidCircuit("jacket", "coolant", ("jacket", "outlet"), GLYCOL),),
        scale={**plain.scale, "flow": 0.1},  # so little that the coolant warms
    )


LINKS = [(link.a, link.b, term) for link in _cooled().links for term in link.terms]
RADIATING = tuple(i for i, (_, _, term) in enumerate(LINKS) if term.law == "radiation")
CONVECTING = tuple(i for i, (_, _, term) in enumerate(LINKS) if term.law == "free_convection")
LOSSES = len(LINKS)

EVERY: dict[str, tuple[actions.Action, float]] = {
    "scale of what radiates": (actions.Scale(RADIATING), 0.3),
    "scale of free convection": (actions.Scale(CONVECTING), 0.3),
    "exponent of free convection": (actions.Power(CONVECTING, "speed"), 0.3),
    "scale of a copper loss": (actions.Scale((LOSSES,)), 0.2),
    "gain of the flow": (actions.InputGain("flow"), 0.05),
    "bias of the flow": (actions.InputBias("flow", 0.1), 0.003),
    "bias of the inlet": (actions.BoundaryBias(0), 1.0),
    "bias of the ambient": (actions.BoundaryBias(1), 1.0),
    "start of the fluid": (actions.Start(JACKET), 3.0),
    "capacity of the fluid": (actions.Capacity((OUTLET,)), 0.2),
    "heat in the fluid": (actions.Added((Place(JACKET),), "constant", 1.0), 20.0),
    "a path out of the fluid": (actions.Added((Place(OUTLET, AMBIENT),), "constant", 1.0), 1.0),
    "clock of all channels": (actions.Late(tuple(CHANNELS), False), 0.8),
    "mass that follows": (actions.Attached((JACKET,), 60.0), 200.0),
}


@pytest.fixture(scope="module")
def tests() -> Sequence[Test]:
    initial = np.array([75.0, 52.0, 51.0, 45.0, 42.0, 42.0])
    return (
        recorded(_cooled(), smooth(600.0), initial, seed=1),
        recorded(_cooled(), pulses(600.0), initial, seed=2),
    )


def _modelled(model: Model, beta: Floats) -> Floats:
    return np.concatenate([-series.y for series in model.residuals(beta)])


def _column(model: Model, beta: Floats, place: int) -> Floats:
    found = []
    for part in model.linearise(beta):
        at = list(part.at)
        found.append(part.columns[:, at.index(place)] if place in at else np.zeros(len(part.series.y)))
    return np.concatenate(found)


@pytest.mark.parametrize("name", EVERY)
def test_a_column_is_the_slope_of_the_residuals(name: str, tests: Sequence[Test]) -> None:
    action, size = EVERY[name]
    others = [
        Parameter(one, *EVERY[one]) for one in ("scale of what radiates", "gain of the flow", "bias of the inlet")
    ]
    model = Model(_cooled(), tests, [*others, Parameter(name, action, size)])
    beta = np.append(np.array([0.5, -0.7, 0.6]) * model.sd[:3], 0.9 * size)
    column = _column(model, beta, 3)
    step = np.array([0.0, 0.0, 0.0, 1e-3 * size])

    def settled(at: Floats) -> Floats:
        for _ in range(3):
            model.linearise(at)  # heats are then linearised about this run's own course
        return _modelled(model, at)

    expected = (settled(beta + step) - settled(beta - step)) / (2e-3 * size)
    assert np.abs(expected).max() > 0, "it moves nothing"
    error = np.abs(column - expected).max() / np.abs(expected).max()
    assert error < NEAR, f"{error:.2g} of the largest entry"


def test_a_run_is_that_of_the_kernel(tests: Sequence[Test]) -> None:
    model = Model(_cooled(), tests, [])
    model.linearise(np.zeros(0))
    for series in model.residuals(np.zeros(0)):
        assert np.abs(series.y).max() < 0.2, series.channel  # noise of 0.025 K, steps four times as long


def test_the_flow_warms_the_coolant(tests: Sequence[Test]) -> None:
    edges, _, _ = Model(_cooled(), tests, []).course(0, np.zeros(0))
    assert edges[-1, JACKET] > 50.0
    assert edges[-1, OUTLET] > 50.0


def test_no_healthy_difference_and_no_fit_changes_what_fluid_carries(tests: Sequence[Test]) -> None:
    """An error of the flow meter does."""
    own = len(list(features.terms(_cooled())))
    model = Model(_cooled(), tests, everyday(_cooled(), tests))
    for parameter in model.parameters:
        match parameter.action:
            case actions.Scale(terms) | actions.Power(terms, _) | actions.Course(terms, _):
                assert max(terms) < own
    flow = next(i for i, one in enumerate(model.parameters) if one.name == "input.flow.gain")
    beta = np.zeros(len(model.parameters))
    before = model.course(0, beta)[2]
    beta[flow] = 0.1
    changed = model.course(0, beta)[2] / before
    np.testing.assert_allclose(changed[:, own:], np.exp(-0.1))
    assert changed.shape[1] == own + 2
