"""The heats of a run: they close, they are where the network says, and they are named by what makes them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from made.laws import law_frame, with_laws
from made.motor import every_law
from twin.compiled.kernel import compile_network
from twin.motor.features import evaluate, monomials
from twin.motor.network import Network, Term
from twin.run.losses import account, flows_between, heat_flows, kind_of
from twin.run.simulate import Frame, simulate, source_heat

Load = Callable[[str], Callable[..., None]]
STEPS = 400


def _frame(network: Network, seed: int, steps: int = STEPS, step_s: float = 0.5) -> Frame:
    rng = np.random.default_rng(seed)
    u = {name: np.repeat(rng.random(steps // 4 + 1), 4)[:steps] for name in ("speed", "current", "flow")}
    around = 30 + np.cumsum(rng.normal(0, 0.2, (steps, len(network.boundaries))), axis=0)
    return Frame(step_s, evaluate(monomials(network), u, steps), around)


@pytest.mark.parametrize("seed", range(5))
def test_what_sources_make_is_what_boundaries_take_and_nodes_store(
    seed: int, make_network: Callable[..., Network], make_frame: Callable[..., Frame], plain: Load
) -> None:
    """Random networks: copper, its inverse, and temperature factors on losses and links."""
    network = make_network(seed)
    frame = make_frame(network, seed)
    temperatures = simulate(compile_network(network, load=plain), frame, np.linspace(25.0, 90.0, len(network.nodes)))
    flows = heat_flows(network, frame, temperatures)
    capacity = np.array([node.capacity for node in network.nodes])
    stored = (np.diff(temperatures, axis=0) @ capacity) / frame.step_s
    scale = np.abs(flows.terms).sum(axis=0).max() + np.abs(flows.boundaries).sum(axis=0).max()
    np.testing.assert_allclose(flows.made, flows.boundaries.sum(axis=0) + stored, rtol=0, atol=1e-11 * scale)


@pytest.mark.parametrize("seed", range(5))
def test_fluid_that_flows_through_takes_heat_to_where_it_came_from(
    seed: int, make_network: Callable[..., Network], plain: Load
) -> None:
    """Circuits with properties over temperature, radiation and free convection."""
    network = with_laws(make_network(seed), seed)
    frame = law_frame(network, seed, 60, 0.5)
    temperatures = simulate(compile_network(network, load=plain), frame, np.linspace(25.0, 90.0, len(network.nodes)))
    flows = heat_flows(network, frame, temperatures)
    capacity = np.array([node.capacity for node in network.nodes])
    stored = (np.diff(temperatures, axis=0) @ capacity) / frame.step_s
    scale = np.abs(flows.terms).sum(axis=0).max() + np.abs(flows.boundaries).sum(axis=0).max()
    np.testing.assert_allclose(flows.made, flows.boundaries.sum(axis=0) + stored, rtol=0, atol=1e-11 * scale)
    still = heat_flows(replace(network, circuits=()), _without_streams(network, frame), temperatures)
    assert np.abs(flows.boundaries - still.boundaries).max() > 1.0  # not the links alone


def _without_streams(network: Network, frame: Frame) -> Frame:
    own = [monomials(network).index(m) for m in monomials(replace(network, circuits=()))]
    return replace(frame, features=frame.features[:, own])


def test_the_account_of_a_run_closes_to_rounding_and_its_parts_are_the_whole(plain: Load) -> None:
    network = every_law()
    frame = _frame(network, 3)
    temperatures = simulate(compile_network(network, load=plain), frame, np.array([45.0, 42.0, 41.0, 35.0]))
    found = account(network, frame, temperatures, heat_flows(network, frame, temperatures))
    assert abs(found.left_J) < 1e-10 * found.energy_J
    assert found.energy_J == found.mean_W * STEPS * 0.5
    for parts in (found.kinds, found.regions, found.nodes):
        assert sum(part.energy_J for part in parts.values()) == pytest.approx(found.energy_J, rel=1e-12)
    assert set(found.boundaries) == {"coolant", "ambient"}
    assert list(found.kinds) == ["copper_dc", "copper_ac", "iron", "magnet"]
    assert found.stored["copper"].energy_J == pytest.approx(900.0 * (temperatures[-1, 0] - temperatures[0, 0]))


def test_the_heat_of_a_step_is_that_of_its_mean_temperature_where_it_hardly_moves(plain: Load) -> None:
    network = every_law()
    frame = _frame(network, 4)
    temperatures = simulate(compile_network(network, load=plain), frame, np.array([45.0, 42.0, 41.0, 35.0]))
    flows = heat_flows(network, frame, temperatures)
    by_source = np.add.reduceat(flows.terms, [0, 2, 4], axis=0)
    np.testing.assert_allclose(by_source.T, source_heat(network, frame, temperatures), rtol=2e-4, atol=1e-9)


def test_what_flows_to_boundaries_between_places_is_what_these_take(plain: Load) -> None:
    network = every_law()
    frame = _frame(network, 4)
    temperatures = simulate(compile_network(network, load=plain), frame, np.array([45.0, 42.0, 41.0, 35.0]))
    flows = flows_between(network, frame, (temperatures[1:] + temperatures[:-1]) / 2)
    assert all(network.names.index(first) < network.names.index(second) for first, second in flows)
    for boundary, taken in zip(network.boundaries, heat_flows(network, frame, temperatures).boundaries, strict=True):
        into = np.sum([heat for (_, end), heat in flows.items() if end == boundary.name], axis=0)
        np.testing.assert_allclose(into, taken, rtol=0, atol=2e-3 * np.abs(taken).max())


def test_a_long_run_is_the_sum_of_its_chunks(plain: Load, monkeypatch: pytest.MonkeyPatch) -> None:
    network = every_law()
    frame = _frame(network, 5)
    temperatures = simulate(compile_network(network, load=plain), frame, np.array([45.0, 42.0, 41.0, 35.0]))
    whole = heat_flows(network, frame, temperatures)
    monkeypatch.setattr("twin.run.losses.CHUNK_STEPS", 90)
    cut = heat_flows(network, frame, temperatures)
    np.testing.assert_array_equal(cut.terms, whole.terms)
    np.testing.assert_array_equal(cut.boundaries, whole.boundaries)


@pytest.mark.parametrize(
    ("region", "term", "kind"),
    [
        ("copper", Term(1.0, {"current": 2.0}, copper=True), "copper_dc"),
        ("copper", Term(1.0, {"current_d": 2.0}), "copper_dc"),
        ("copper", Term(1.0, {"current": 2.0, "speed": 0.0}), "copper_dc"),
        ("copper", Term(1.0, {"current": 2.0, "speed": 2.0}), "copper_ac"),
        ("copper", Term(1.0, {"current": 2.0}, resistance=-1), "copper_ac"),
        ("copper", Term(1.0), "copper_ac"),
        ("iron", Term(1.0, {"speed": 1.5}), "iron"),
        ("rotor", Term(1.0, {"speed": 1.5}), "iron"),
        ("magnet", Term(1.0, {"speed": 2.0}), "magnet"),
        ("bearing", Term(1.0, {"speed": 1.0}), "mechanical"),
        ("fluid", Term(1.0, {"speed": 3.0}), "mechanical"),
        ("housing", Term(1.0, {"speed": 3.0}), "other"),
    ],
)
def test_a_loss_is_named_by_what_makes_it(region: str, term: Term, kind: str) -> None:
    assert kind_of(region, term) == kind
