"""The march against the network's own run, its energy and its order."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from made.motor import AMBIENT_DEGC, COOLANT_DEGC, every_law, pulses, recorded, smooth, truth
from twin.compiled.laws import Law, Table, psi
from twin.compiled.structure import parameters, structure
from twin.errors import DivergedError
from twin.fitting.march import System, run
from twin.fitting.model import Model
from twin.motor.features import evaluate, monomials
from twin.motor.network import NOBODY, Network

Floats = NDArray[np.float64]

INITIAL = np.array([70.0, 55.0, 50.0, 35.0])


def _laws(network: Network) -> list[Law]:
    values = parameters(network)
    return [Law.of(group, values, i) for i, group in enumerate(structure(network).groups)]


def _carried(network: Network, drive: Mapping[str, Floats]) -> Floats:
    values = parameters(network)
    phi = evaluate(monomials(network), drive, len(drive["speed"]))
    one = np.ones(len(phi))
    return np.array(
        [
            sum((values.coefficients[i] * (phi[:, j] if j >= 0 else one) for i, j in group.terms), 0 * one)
            for group in structure(network).groups
        ]
    )


def _march(network: Network, drive: Mapping[str, Floats], step_s: float) -> tuple[System, Floats, Floats]:
    """The system about a settled course, temperatures at the edges and means of the steps."""
    carried = _carried(network, drive)
    around = np.tile([COOLANT_DEGC, AMBIENT_DEGC], (carried.shape[1], 1))
    table = Table.of(_laws(network), network.copper)
    course = np.tile(INITIAL, (carried.shape[1], 1))
    for _ in range(8):
        system = System.of(table, carried, parameters(network).capacities, step_s, course, around)
        edges, course = run(system, INITIAL)
    return system, edges, course


@pytest.mark.parametrize(("drive", "near_K"), [(smooth(900.0), 0.05), (pulses(900.0), 0.15)])
def test_block_means_of_steps_of_two_seconds_are_those_of_half_a_second(
    drive: Mapping[str, Floats], near_K: float
) -> None:
    test = recorded(every_law(), drive, INITIAL)
    for series in Model(every_law(), [test], []).residuals(np.zeros(0)):
        assert np.abs(series.y).max() < near_K, series.channel


def test_halving_the_step_divides_the_error_by_four() -> None:
    def error(step_s: float) -> float:
        _, edges, _ = _march(every_law(), smooth(600.0, step_s), step_s)
        _, fine, _ = _march(every_law(), smooth(600.0, 0.25), 0.25)
        return float(np.abs(edges - fine[:: round(step_s / 0.25)])[1:].max())

    coarse, halved, quartered = error(8.0), error(4.0), error(2.0)
    assert coarse / halved == pytest.approx(4.0, rel=0.15)
    assert halved / quartered == pytest.approx(4.0, rel=0.15)


def test_what_flows_in_is_stored() -> None:
    network, drive = every_law(), pulses(600.0, step_s=2.0)
    _, edges, course = _march(network, drive, 2.0)
    carried = _carried(network, drive)
    around = np.tile([COOLANT_DEGC, AMBIENT_DEGC], (len(course), 1))
    value, _ = psi(Table.of(_laws(network), network.copper), course, around)
    from_outside = [law.b < 0 or law.b >= len(network.nodes) for law in _laws(network)]
    heat_J = 2.0 * (carried * value)[from_outside].sum(axis=0)
    stored_J = np.diff(edges, axis=0) @ parameters(network).capacities
    np.testing.assert_allclose(
        stored_J, heat_J, rtol=0, atol=1e-9 * np.abs(edges @ parameters(network).capacities).max()
    )


@pytest.mark.parametrize("law", range(15))
def test_the_slopes_of_a_law_are_those_of_its_value(law: int) -> None:
    """In the matrix: what a step's heat changes by, per kelvin at each node, is minus L."""
    network = every_law()
    one = [
        *_laws(network),
        Law(0, NOBODY, "source", tilt=50.0),
        Law(1, 2, tilt=45.0),
        Law(3, 5, tilt=30.0),
        Law(0, 1, one_way=True),
    ][law]
    rng = np.random.default_rng(law)
    at, around = rng.uniform(30, 90, (3, 4)), rng.uniform(20, 40, (3, 2))
    carried = rng.uniform(1, 20, (1, 3))
    table = Table.of([one], network.copper)
    system = System.of(table, carried, np.ones(4), 2.0, at, around)
    loss = system.matrix - np.eye(4)
    for node in range(4):
        ahead, back = at.copy(), at.copy()
        ahead[:, node] += 1e-4
        back[:, node] -= 1e-4
        change = carried[0] * (psi(table, ahead, around)[0][0] - psi(table, back, around)[0][0])
        np.testing.assert_allclose(loss[:, one.a, node], -change / 2e-4, rtol=1e-6, atol=1e-7)
    heat = carried[0] * psi(table, at, around)[0][0]
    np.testing.assert_allclose((system.heat - np.einsum("kij,kj->ki", loss, at))[:, one.a], heat, rtol=1e-10)
    taken = loss[:, one.b] if 0 <= one.b < 4 and not one.one_way else np.zeros((3, 4))
    others = [i for i in range(4) if i not in (one.a, one.b)]
    np.testing.assert_allclose(taken, -loss[:, one.a] if taken.any() else 0.0)
    assert not loss[:, others].any()


def test_a_step_solves_its_system() -> None:
    system, edges, course = _march(every_law(), pulses(60.0, step_s=2.0), 2.0)
    right = system.storage * edges[:-1] + system.heat
    np.testing.assert_allclose(np.einsum("kij,kj->ki", system.matrix, course), right, rtol=1e-12)
    np.testing.assert_allclose(edges[1:], 2 * course - edges[:-1], rtol=1e-12)


def test_temperatures_that_run_away_are_said() -> None:
    network = every_law()
    runaway = Law(0, NOBODY, "copper")
    table = Table.of([*_laws(network), runaway], network.copper)
    drive = pulses(600.0, step_s=2.0)
    around = np.tile([COOLANT_DEGC, AMBIENT_DEGC], (300, 1))
    carried = np.vstack([_carried(network, drive), np.full(300, 40000.0)])
    system = System.of(table, carried, parameters(network).capacities, 2.0, np.tile(INITIAL, (300, 1)), around)
    with pytest.raises(DivergedError, match="temperatures run away"):
        run(system, INITIAL)


def test_a_settled_course_is_that_of_the_network_s_own_run() -> None:
    drive = smooth(600.0)
    _, edges, _ = _march(every_law(), drive, 0.5)
    np.testing.assert_allclose(edges, truth(every_law(), drive, INITIAL), rtol=0, atol=2e-3)
