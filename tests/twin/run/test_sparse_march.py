"""The march against the network's own run, its energy and its order; its columns are linear in starts and heats."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from made.motor import AMBIENT_DEGC, CHANNELS, COOLANT_DEGC, every_law, pulses, recorded, smooth, truth
from twin.compiled.indexed import program
from twin.compiled.integrators import DEFAULT
from twin.compiled.laid_out import laid_out
from twin.compiled.laws import Law, Table, psi
from twin.compiled.structure import Group, Parameters, Structure
from twin.errors import DivergedError
from twin.fitting.model import Model
from twin.motor.features import evaluate, monomials
from twin.motor.network import NOBODY, Network, Source, Term
from twin.motor.outputs import lagged
from twin.run.sparse_march import STRIP, ColumnSensor, Loads, MarchedColumns, MarchRun, run

Floats = NDArray[np.float64]

INITIAL = np.array([70.0, 55.0, 50.0, 35.0])


def _march(network: Network, drive: Mapping[str, Floats], step_s: float) -> MarchRun:
    _, values, program, _, _ = laid_out(network)
    phi = evaluate(monomials(network), drive, len(drive["speed"]))
    around = np.tile([COOLANT_DEGC, AMBIENT_DEGC], (len(phi), 1))
    return run(program, False, values, step_s, phi, around, INITIAL, [node.name for node in network.nodes])


@pytest.mark.parametrize(("drive", "near_K"), [(smooth(900.0), 0.05), (pulses(900.0), 0.15)])
def test_block_means_of_steps_of_two_seconds_are_those_of_half_a_second(
    drive: Mapping[str, Floats], near_K: float
) -> None:
    test = recorded(every_law(), drive, INITIAL)
    for series in Model(every_law(), [test], []).residuals(np.zeros(0)):
        assert np.abs(series.y).max() < near_K, series.channel


def test_halving_the_step_divides_the_error_by_four() -> None:
    def error(step_s: float) -> float:
        edges = _march(every_law(), smooth(600.0, step_s), step_s).edges
        fine = _march(every_law(), smooth(600.0, 0.25), 0.25).edges
        return float(np.abs(edges - fine[:: round(step_s / 0.25)])[1:].max())

    coarse, halved, quartered = error(8.0), error(4.0), error(2.0)
    assert coarse / halved == pytest.approx(4.0, rel=0.15)
    assert halved / quartered == pytest.approx(4.0, rel=0.15)


def test_what_flows_in_is_stored() -> None:
    network, drive = every_law(), pulses(600.0, step_s=2.0)
    shape, values, _, laws, table = laid_out(network)
    ran = _march(network, drive, 2.0)
    phi = np.column_stack([evaluate(monomials(network), drive, len(ran.means)), np.ones(len(ran.means))])
    carried = np.array([sum(values.coefficients[i] * phi[:, j] for i, j in group.terms) for group in shape.groups])
    value, _ = psi(table, ran.means, np.tile([COOLANT_DEGC, AMBIENT_DEGC], (len(ran.means), 1)))
    from_outside = [law.b < 0 or law.b >= shape.n for law in laws]
    heat_J = 2.0 * (carried * value)[from_outside].sum(axis=0)
    stored_J = np.diff(ran.edges, axis=0) @ values.capacities
    np.testing.assert_allclose(stored_J, heat_J, rtol=0, atol=1e-9 * np.abs(ran.edges @ values.capacities).max())


OF_TESTS = (
    Law(0, NOBODY, "source", other=0, slope=1.0, reference=51.0),
    Law(1, 2, other=1, slope=1.0, reference=46.0),
    Law(3, 5, other=3, slope=1.0, reference=31.0),
    Law(3, 5, other=5, slope=1.0, reference=31.0),  # of a boundary's temperature
    Law(0, 1, one_way=True),
)


@pytest.mark.parametrize("law", range(16))
def test_the_slopes_of_a_law_are_those_of_its_value(law: int) -> None:
    """In the matrix: what a step's heat changes by, per kelvin at each node, is minus its conductance."""
    one = [*laid_out(every_law()).laws, *OF_TESTS][law]
    rng = np.random.default_rng(law)
    around, amount = rng.uniform(20, 40, (1, 2)), rng.uniform(1, 20, (1, 1))
    ran = _run_of([one], amount, np.ones(4), 0.02, around, rng.uniform(30, 90, 4))
    table = Table.of([one], every_law().copper)

    def heat(z: Floats) -> float:
        return float(amount[0, 0] * psi(table, z[None], around)[0][0, 0])

    loss = ran.matrix[0] - np.diag(ran.storage)
    for node, step in enumerate(1e-4 * np.eye(4)):
        change = (heat(ran.means[0] + step) - heat(ran.means[0] - step)) / 2e-4
        np.testing.assert_allclose(loss[one.a, node], -change, rtol=1e-5, atol=1e-6)
    stored = ran.storage * (ran.means[0] - ran.edges[0])
    np.testing.assert_allclose(stored[one.a], heat(ran.means[0]), rtol=1e-8)
    taken = loss[one.b] if 0 <= one.b < 4 and not one.one_way else np.zeros(4)
    others = [i for i in range(4) if i not in (one.a, one.b)]
    np.testing.assert_allclose(taken, -loss[one.a] if taken.any() else 0.0)
    assert not loss[others].any()


def test_a_step_solves_its_system() -> None:
    """Of heats that are linear about its own mean temperatures; these show in any other start, as it is one system."""
    network, drive = every_law(), pulses(60.0, step_s=2.0)
    ran = _march(network, drive, 2.0)
    np.testing.assert_allclose(ran.edges[1:], 2 * ran.means - ran.edges[:-1], rtol=1e-12)
    found = _columns(ran, np.eye(4), NOTHING)
    for k, (matrix, before, after) in enumerate(zip(ran.matrix, found[:-1], found[1:], strict=True)):
        right = ran.storage[:, None] * before
        np.testing.assert_allclose(
            matrix @ (before + after) / 2, right, atol=1e-9 * np.abs(right).max(), err_msg=f"{k}"
        )


@pytest.mark.parametrize("node", ["winding", "case"])
def test_the_node_that_runs_away_first_is_said(node: str) -> None:
    network = every_law()
    hot = replace(network, sources=(*network.sources, Source(node, (Term(40000.0, copper=True),))))
    with pytest.raises(DivergedError, match=f'node "{node}" runs away: more heat comes in'):
        _march(hot, pulses(600.0, step_s=2.0), 2.0)


def test_a_run_is_that_of_the_network_by_its_definitions() -> None:
    drive = smooth(600.0)
    edges = _march(every_law(), drive, 0.5).edges
    np.testing.assert_allclose(edges, truth(every_law(), drive, INITIAL), rtol=0, atol=2e-3)


LAWS = (
    Law(0, 1),
    Law(1, 2, other=3, slope=0.002, reference=30.0),
    Law(2, 3),
    Law(1, 4),
    Law(3, 5, other=5, slope=1.0, reference=31.0),
    Law(0, NOBODY, "copper"),
)
STEPS = 300  # no whole number of steps side by side
NOTHING = Loads(*np.empty((3, 0), dtype=np.int64))


def _run_of(
    laws: Sequence[Law], carried: Floats, capacities: Floats, step_s: float, around: Floats, initial: Floats
) -> MarchRun:
    """Of four nodes and laws that carry so much (L, N)."""
    groups = [Group(w.a, w.b, ((i, i),), w.law, w.other, w.one_way, w.fluid) for i, w in enumerate(laws)]
    factors = np.array([(law.slope, law.reference) for law in laws])
    copper = every_law().copper
    values = Parameters(np.ones(len(laws)), capacities, np.array([copper.alpha_per_K, copper.reference_degC]), factors)
    indices = program(Structure.of(4, len(laws), tuple(groups)), DEFAULT)
    return run(indices, False, values, step_s, carried.T, around, initial, [str(i) for i in range(len(initial))])


def _random(step_s: float) -> MarchRun:
    """Of random conductances and losses."""
    rng = np.random.default_rng(3)
    carried = rng.uniform(0.5, 1.5, (len(LAWS), STEPS)) * np.array([[10.0], [5.0], [4.0], [12.0], [0.05], [300.0]])
    capacities, around = np.array([900.0, 2500.0, 600.0, 1500.0]), rng.uniform(20, 40, (STEPS, 2))
    return _run_of(LAWS, carried, capacities, step_s, around, INITIAL)


def _columns(
    ran: MarchRun,
    begin: Floats,
    loads: Loads,
    heats: Floats | None = None,
    sensors: Sequence[ColumnSensor] | None = None,
) -> Floats:
    """(N + 1, m, P) of sensors, else of every node."""
    read = [ColumnSensor(weights) for weights in np.eye(4)] if sensors is None else sensors
    steps = len(ran.means)
    columns = MarchedColumns(ran.program, ran.storage, read, loads, begin, steps)
    strips = [shown.copy() for shown in columns.through(ran, np.empty((0, steps)) if heats is None else heats)]
    return np.concatenate(strips, axis=2)[:, :, : begin.shape[1]].transpose(1, 0, 2)


def _loads(*own: tuple[int, int, int]) -> Loads:
    """Into, out of, column."""
    return Loads(*np.array(own, dtype=np.int64).T)


@pytest.mark.parametrize("step_s", [1.0, 2.0, 3.3, 20.0])
def test_starts_and_heats_add_up_to_the_run(step_s: float) -> None:
    """It is linear in both; a lag follows the columns as it follows the temperatures."""
    ran, names = _random(step_s), [node.name for node in every_law().nodes]
    outputs = [(np.array([shares.get(name, 0.0) for name in names]), tau_s) for shares, tau_s in CHANNELS.values()]
    sensors = [ColumnSensor.thermometer(weights, tau_s, step_s) for weights, tau_s in outputs]
    heats = np.einsum("kij,kj->ik", ran.matrix, ran.means) - ran.storage[:, None] * ran.edges[:-1].T
    loads = _loads(*((node, NOBODY, 4) for node in range(4)))
    found = _columns(ran, np.eye(4, 5), loads, heats, sensors) @ np.append(INITIAL, 1.0)
    for own, (weights, tau_s) in zip(found.T, outputs, strict=True):
        np.testing.assert_allclose(own, lagged(ran.edges @ weights, tau_s, step_s), rtol=1e-11)


def test_a_sum_of_mean_temperatures_may_change_from_step_to_step() -> None:
    ran, rng = _random(2.0), np.random.default_rng(8)
    weights, heat = rng.normal(size=(4, STEPS)), rng.normal(size=(1, STEPS))
    begin, loads = np.eye(4, 5), _loads((2, 0, 4))
    nodes = _columns(ran, begin, loads, heat)
    found = _columns(ran, begin, loads, heat, [ColumnSensor.of_means(weights)])[1:, 0]
    means = (nodes[1:] + nodes[:-1]) / 2
    np.testing.assert_allclose(found, np.einsum("nk,knp->kp", weights, means), atol=1e-12 * np.abs(found).max())


def test_what_a_link_brings_to_one_end_it_takes_from_the_other() -> None:
    ran = _random(2.0)
    heat = np.tile(np.random.default_rng(5).normal(size=STEPS), (3, 1))
    found = _columns(ran, np.zeros((4, 3)), _loads((0, NOBODY, 0), (2, NOBODY, 1), (0, 2, 2)), heat)
    np.testing.assert_allclose(found[..., 2], found[..., 0] - found[..., 1], atol=1e-12 * np.abs(found).max())
    assert np.abs(found[..., 2]).max() > 0


def test_more_parameters_than_a_strip_has_change_none() -> None:
    ran = _random(2.0)
    heat = np.random.default_rng(6).normal(size=(3 * STRIP + 5, STEPS))
    found = _columns(ran, np.zeros((4, len(heat))), _loads(*((1, NOBODY, p) for p in range(len(heat)))), heat)
    for p in (0, STRIP, 2 * STRIP - 1, len(heat) - 1):
        alone = _columns(ran, np.zeros((4, 1)), _loads((1, NOBODY, 0)), heat[p : p + 1])
        np.testing.assert_allclose(found[..., p], alone[..., 0], atol=1e-12 * np.abs(alone).max())
