"""Energy of every step, over random networks with circuits, radiation, free convection and temperature factors: what
sources make, boundaries give and fluids carry in is stored, whatever flows between nodes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from benchmarks.integrator import EULER, MIDPOINT, SDIRK3
from made.laws import Heats, heats, law_frame, with_laws
from twin.compiled import indexed
from twin.compiled.integrators import BDF2, DEFAULT, Tableau
from twin.compiled.kernel import compile_network, index_program
from twin.compiled.laid_out import laid_out
from twin.compiled.structure import described, structure
from twin.motor.features import monomials
from twin.motor.network import Network
from twin.run.simulate import Frame, simulate
from twin.run.sparse_march import run

Floats = NDArray[np.float64]
Make = Callable[..., Network]
Load = Callable[[str], Callable[..., None]]

STEP_S = 5.0
PROBE = 1e-5  # of the way, for slopes by central differences


def _at(network: Network, frame: Frame, T: Floats) -> Heats:
    phi = dict(zip(monomials(network), frame.features[0].tolist(), strict=True))
    every = np.concatenate([T, frame.boundaries[0]]).tolist()
    return heats(network, phi, dict(zip(network.names, every, strict=True)))


def _from_outside(found: Heats) -> Floats:
    return np.array([found.losses, found.given, found.carried])


def _linearised(network: Network, frame: Frame, start: Floats, T: Floats) -> Floats:
    """(3,) losses, given, carried [W] at T as a step has them: linear about its start."""
    ahead, back = (_from_outside(_at(network, frame, start + s * PROBE * (T - start))) for s in (1, -1))
    slopes: Floats = _from_outside(_at(network, frame, start)) + (ahead - back) / (2 * PROBE)
    return slopes


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10_000), n=st.integers(2, 7))
@pytest.mark.parametrize("tableau", [EULER, MIDPOINT, DEFAULT, SDIRK3], ids=lambda t: t.name)
def test_what_comes_in_is_stored(tableau: Tableau, seed: int, n: int, make_network: Make, plain: Load) -> None:
    network = with_laws(make_network(seed, n=n), seed)
    frame = law_frame(network, seed, 1, STEP_S)
    p = described(network)[1]
    start = np.random.default_rng(seed).uniform(25.0, 120.0, len(network.nodes))
    out, stage = np.vstack([start, start]), np.empty((len(tableau.b), start.size))
    index_program(plain)(
        indexed.program(structure(network), tableau),
        frame.features,
        frame.boundaries,
        STEP_S,
        *(p.coefficients, p.capacities, p.copper, p.factors, out, stage),
    )
    parts = sum(b * _linearised(network, frame, start, T) for b, T in zip(tableau.b, stage, strict=True))
    stored_J = p.capacities @ (out[1] - out[0])
    assert stored_J == pytest.approx(STEP_S * float(np.sum(parts)), abs=1e-9 * STEP_S * float(np.abs(parts).sum()))
    straight = simulate(compile_network(network, tableau, plain), frame, start)
    assert p.capacities @ (straight[1] - start) == pytest.approx(stored_J, abs=1e-9 * float(p.capacities @ start))


@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 10_000), n=st.integers(2, 7))
def test_what_comes_in_is_stored_in_a_march(seed: int, n: int, make_network: Make) -> None:
    """The heats are those of the step's mean temperatures."""
    network = with_laws(make_network(seed, n=n), seed)
    frame = law_frame(network, seed, 1, STEP_S)
    _, p, program, _, _ = laid_out(network)
    start = np.random.default_rng(seed).uniform(25.0, 120.0, len(network.nodes))
    nodes = [node.name for node in network.nodes]
    ran = run(program, False, p, STEP_S, frame.features, frame.boundaries, start, nodes)
    parts = _from_outside(_at(network, frame, ran.means[0]))
    assert p.capacities @ (ran.edges[1] - start) == pytest.approx(
        STEP_S * float(parts.sum()), abs=1e-9 * STEP_S * float(np.abs(parts).sum())
    )
    assert p.capacities * (ran.edges[1] - start) == pytest.approx(
        STEP_S * _at(network, frame, ran.means[0]).into, abs=1e-7 * STEP_S * float(np.abs(parts).sum())
    )


def test_every_kind_of_heat_takes_part(make_network: Make) -> None:
    network = with_laws(make_network(3, n=5), 3)
    frame = law_frame(network, 3, 1, STEP_S)
    found = _from_outside(_at(network, frame, np.linspace(30.0, 110.0, len(network.nodes))))
    assert np.abs(found).min() > 1.0


def test_what_comes_in_is_stored_by_bdf2(make_network: Make, plain: Load) -> None:
    """Its second step stores 3/2 of its own change less 1/2 of the one before."""
    network = with_laws(make_network(4, n=4), 4)
    frame = law_frame(network, 4, 1, STEP_S)
    twice = Frame(STEP_S, np.repeat(frame.features, 2, axis=0), np.repeat(frame.boundaries, 2, axis=0))
    p, start = described(network)[1], np.random.default_rng(4).uniform(25.0, 120.0, len(network.nodes))
    first, second, third = simulate(compile_network(network, BDF2, plain), twice, start)
    for stored, at, to in (
        (second - first, first, second),
        (1.5 * (third - second) - 0.5 * (second - first), second, third),
    ):
        parts = _linearised(network, frame, at, to)
        assert p.capacities @ stored == pytest.approx(
            STEP_S * float(parts.sum()), abs=1e-9 * STEP_S * float(np.abs(parts).sum())
        )
