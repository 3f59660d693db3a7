"""The default integrator: consistent, of its order, and near the tight solution on every shipped motor."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.integrator import DRIVES, EULER, MIDPOINT, SDIRK3, Physics, frame, initial_of, shipped, tight, window
from benchmarks.integrator import bdf2 as newton_bdf2
from made.laws import law_frame, rate, with_laws
from replay.engine.results.kernel_cache import load
from replay.studies.motors.new import TOPOLOGIES
from twin.compiled import indexed
from twin.compiled.integrators import BDF2, DEFAULT, INTEGRATORS, Tableau
from twin.compiled.kernel import compile_indexed, compile_network, index_program
from twin.compiled.structure import described, structure
from twin.motor.heat_laws import NAMED
from twin.motor.network import Map, Network
from twin.run.simulate import Frame, simulate

TABLEAUS = (EULER, MIDPOINT, DEFAULT, SDIRK3)
Load = Callable[[str], Callable[..., None]]


@pytest.mark.parametrize("tableau", TABLEAUS, ids=lambda t: t.name)
def test_the_table_satisfies_the_order_conditions(tableau: Tableau) -> None:
    a = np.diag(np.full(len(tableau.b), tableau.gamma))
    for i, row in enumerate(tableau.a):
        a[i, :i] = row
    b, c = np.array(tableau.b), a.sum(axis=1)
    conditions = [(b.sum(), 1.0), (b @ c, 1 / 2), (b @ c**2, 1 / 3), (b @ a @ c, 1 / 6)]
    for value, wanted in conditions[: {1: 1, 2: 2, 3: 4}[tableau.order]]:
        assert value == pytest.approx(wanted, abs=1e-14)


@pytest.mark.parametrize("tableau", TABLEAUS, ids=lambda t: t.name)
def test_the_measured_order_is_the_declared_one(
    tableau: Tableau, make_network: Callable[..., Network], make_frame: Callable[..., Frame], plain: Load
) -> None:
    network = make_network(4, n=5, linear=True)
    coarse = make_frame(network, 4, steps=8, step_s=8.0)
    truth = tight(network, coarse)
    compiled = compile_network(network, tableau, plain)

    def error(parts: int) -> float:
        fine = Frame(
            8.0 / parts, np.repeat(coarse.features, parts, axis=0), np.repeat(coarse.boundaries, parts, axis=0)
        )
        return float(np.abs(simulate(compiled, fine, initial_of(network))[::parts] - truth).max())

    measured = np.log2(error(16) / error(32))
    assert measured == pytest.approx(tableau.order, abs=0.25)


def test_terms_linearised_within_a_step_keep_second_order(
    make_network: Callable[..., Network], make_frame: Callable[..., Frame], plain: Load
) -> None:
    network = make_network(2, n=6)
    assert any(t.resistance for s in network.sources for t in s.terms)
    assert any(t.temperature for link in network.links for t in link.terms)
    coarse = make_frame(network, 2, steps=6, step_s=8.0)
    truth, compiled = tight(network, coarse), compile_network(network, load=plain)

    def error(parts: int) -> float:
        fine = Frame(
            8.0 / parts, np.repeat(coarse.features, parts, axis=0), np.repeat(coarse.boundaries, parts, axis=0)
        )
        return float(np.abs(simulate(compiled, fine, initial_of(network))[::parts] - truth).max())

    assert np.log2(error(16) / error(32)) == pytest.approx(2, abs=0.25)


SHIPPED = shipped()


def test_every_motor_file_that_comes_along_is_among_the_shipped() -> None:
    assert {"reference_motor", "sliced", "hidden_effect", "hust_motor", "hust_four_nodes"} <= SHIPPED.keys()
    assert SHIPPED.keys() >= TOPOLOGIES.keys() | {"ipm_water_jacket stator_in_air"}
    links = [term for network in SHIPPED.values() for link in network.links for term in link.terms]
    losses = [term for network in SHIPPED.values() for source in network.sources for term in source.terms]
    assert {term.law for term in links} == {None, *NAMED}
    assert any(isinstance(term.shape, Map) for term in losses) and any(term.temperature for term in losses)
    assert any(network.circuits for network in SHIPPED.values())


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("name", SHIPPED)
def test_the_default_stays_within_a_hundredth_of_a_kelvin_of_the_tight_solution(
    name: str, drive: str, plain: Load
) -> None:
    network = SHIPPED[name]
    inputs = window(frame(network, DRIVES[drive](), DEFAULT.step_s))
    compiled = compile_indexed(network, load=load) if len(network.nodes) > 50 else compile_network(network, load=plain)
    found = simulate(compiled, inputs, initial_of(network))
    assert np.ptp(found, axis=0).max() > 0.5, "the drive must heat the motor"
    assert np.abs(found - tight(network, inputs)).max() < 0.01


@pytest.mark.parametrize("seed", range(4))
def test_the_tight_solution_is_of_every_law_and_circuit_as_defined(
    seed: int, make_network: Callable[..., Network]
) -> None:
    network = with_laws(make_network(seed, n=6), seed)
    inputs = law_frame(network, seed, steps=8, step_s=0.5)
    T = np.random.default_rng(seed).uniform(10.0, 120.0, len(network.nodes))
    physics = Physics(network)
    for phi, around in zip(inputs.features, inputs.boundaries, strict=True):
        slopes = physics.rate(phi, around)(0.0, T)
        np.testing.assert_allclose(slopes, rate(network, phi, around)(0.0, T), rtol=1e-10, atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), n=st.integers(2, 9))
def test_the_energy_of_every_step_balances_to_rounding(
    seed: int, n: int, make_network: Callable[..., Network], make_frame: Callable[..., Frame], plain: Load
) -> None:
    """Heat stored = step times (losses - heat to the boundaries), both at the method's own stage temperatures."""
    network = make_network(seed, n=n, linear=True)
    inputs = make_frame(network, seed, steps=1, step_s=2.0)
    p = described(network)[1]
    out, stage = np.full((2, n), 40.0), np.empty((len(DEFAULT.b), n))
    arrays = (p.coefficients, p.capacities, p.copper, p.factors, out, stage)
    index_program(plain)(
        indexed.program(structure(network), DEFAULT), inputs.features, inputs.boundaries, inputs.step_s, *arrays
    )
    rate = Physics(network).rate(inputs.features[0], inputs.boundaries[0])
    received = inputs.step_s * sum(b * rate(0.0, T) for b, T in zip(DEFAULT.b, stage, strict=True)) * p.capacities
    stored = p.capacities * (out[1] - out[0])
    np.testing.assert_allclose(stored, received, rtol=0, atol=1e-9 * (1 + np.abs(stored).max()))
    assert stored.sum() == pytest.approx(received.sum(), rel=1e-9, abs=1e-7)


def test_the_index_program_uses_the_same_table(
    make_network: Callable[..., Network], make_frame: Callable[..., Frame], plain: Load
) -> None:
    network = make_network(7, n=5)
    inputs = make_frame(network, 7)
    for tableau in TABLEAUS:
        straight = simulate(compile_network(network, tableau, plain), inputs, initial_of(network))
        general = simulate(compile_indexed(network, tableau, plain), inputs, initial_of(network))
        np.testing.assert_allclose(straight, general, rtol=0, atol=1e-10)


# --- BDF2 ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [1, 2])
def test_both_kernels_make_the_steps_of_bdf2(
    seed: int, make_network: Callable[..., Network], make_frame: Callable[..., Frame], plain: Load
) -> None:
    network = make_network(seed, n=5, linear=True)
    inputs = make_frame(network, seed)
    straight = simulate(compile_network(network, BDF2, plain), inputs, initial_of(network))
    general = simulate(compile_indexed(network, BDF2, plain), inputs, initial_of(network))
    np.testing.assert_allclose(straight, general, rtol=0, atol=1e-10)
    np.testing.assert_allclose(straight, newton_bdf2(network, inputs), rtol=0, atol=1e-6)


@pytest.mark.parametrize("linear", [True, False])
def test_bdf2_is_of_second_order_while_inputs_are_held(
    linear: bool, make_network: Callable[..., Network], make_frame: Callable[..., Frame], plain: Load
) -> None:
    network = make_network(2, n=6, linear=linear)
    one = make_frame(network, 2, steps=1, step_s=64.0)
    truth, compiled = tight(network, one), compile_network(network, BDF2, plain)

    def error(parts: int) -> float:
        fine = Frame(64.0 / parts, np.repeat(one.features, parts, axis=0), np.repeat(one.boundaries, parts, axis=0))
        return float(np.abs(simulate(compiled, fine, initial_of(network))[-1] - truth[-1]).max())

    assert np.log2(error(128) / error(256)) == pytest.approx(2, abs=0.25)


def test_integrators_are_known_by_name() -> None:
    assert {name: method.name for name, method in INTEGRATORS.items()} == {"sdirk2": "sdirk2", "bdf2": "bdf2"}
    assert INTEGRATORS[DEFAULT.name] is DEFAULT
