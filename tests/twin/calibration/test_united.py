"""Tests of several rigs of one motor in one fit: each runs as on its own network, and all of them teach the same
coefficients."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from made.laws import OIL
from twin.calibration.calibrate import calibrate, freedom
from twin.calibration.united import United
from twin.compiled.kernel import compile_indexed
from twin.errors import ConfigurationError
from twin.fitting.model import Model, Test
from twin.fitting.recorded import RecordedChannel, RecordedMeter
from twin.motor.check import check
from twin.motor.configured import configured
from twin.motor.features import evaluate, monomials
from twin.motor.network import Boundary, Configuration, FluidCircuit, Link, Network, Node, Source, Term
from twin.motor.observables import Measurand
from twin.motor.sensor import Sensor
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]

MOTOR = Network(
    "motor",
    tuple(Node(name, 300.0 * (i + 2), "other")
        for i, name in enumerate(("winding", "yoke", "magnet", "jacket_1", "jacket_2"))),
    (Boundary("coolant"), Boundary("air")),
    (
        Link("winding", "yoke", (Term(8.0),)),
        Link("yoke", "magnet", (Term(2.0), Term(3.0, {"speed": 0.5}))),
        Link("yoke", "jacket_1", (Term(20.0),)),
        Link("yoke", "jacket_2", (Term(21.0),)),
    ),
    (
        Source("winding", (Term(400.0, {"current": 2.0}, copper=True),)),
        Source("magnet", (Term(70.0, {"speed": 2.0}),)),
        Source("yoke", (Term(40.0, {"speed": 1.5}),)),
    ),
    scale={"speed": 1000.0, "current": 10.0, "flow": 5.0},
    circuits=(FluidCircuit("jacket", "coolant", ("jacket_1", "jacket_2"), OIL),),
    configurations=(
        Configuration(
            "stator_in_air",
            remove=("magnet", "jacket_1", "jacket_2", "coolant"),
            links=(Link("air", "yoke", (Term(3.0, law="free_convection"),)),),
            sources=(Source("yoke", (Term(5.0, {"current": 2.0}),)),),
        ),
        Configuration("one_jacket", remove=("jacket_1",), links=(Link("yoke", "winding", (Term(8.0),)),)),
    ),
)  # fmt: skip
EVERY = (None, "stator_in_air", "one_jacket")


def _drive(steps: int, seed: int) -> Mapping[str, Floats]:
    rng = np.random.default_rng(seed)
    held = steps // 8
    return {name: np.repeat(rng.uniform(0.1, 1.0, 8), held) for name in ("speed", "current", "flow")}


def _recorded(motor: Network, rig: str | None, seed: int = 1, steps: int = 1600) -> Test:
    """A test of a rig in steps of 1 s; a thermometer at each of two nodes, and a meter of what one boundary takes."""
    network = configured(motor, rig)
    drive = _drive(steps, seed)
    columns = evaluate(monomials(network), drive, steps)
    around = np.column_stack([np.full(steps, {"coolant": 40.0, "air": 25.0}[b.name]) for b in network.boundaries])
    start = np.full(len(network.nodes), 32.0)
    edges = simulate(compile_indexed(network), Frame(1.0, columns, around), start)
    always, middle = np.ones(steps), np.full(steps, 0.5)
    channels = tuple(
        RecordedChannel(
            Sensor(f"{node}_1", {node: 1.0}, noise=0.02), (edges[:-1, i] + edges[1:, i]) / 2, always, middle
        )
        for i, node in enumerate(("winding", "yoke"))
    )
    heat, taker = Sensor("heat", {"heat": 1.0}, noise=1.0), network.boundaries[0].name
    taken = RecordedMeter(heat, np.full(steps, 90.0), always, middle, Measurand("heat", "W", 0.0, taker))
    return Test(
        name=str(rig),
        kind="drive",
        frame=Frame(1.0, columns, around),
        inputs=drive,
        features={m.name: columns[:, j] for j, m in enumerate(monomials(network))},
        initial=start,
        initial_sd=np.full(len(start), 0.3),
        channels=channels,
        meters=(taken,),
    )


def _wrong(motor: Network) -> Network:
    """Half the conductance to the yoke, and twice the film of the bare stator."""
    stator, other = motor.configurations
    film = Link("air", "yoke", (Term(6.0, law="free_convection"),))
    links = (Link("winding", "yoke", (Term(4.0),)), *motor.links[1:])
    return replace(motor, links=links, configurations=(replace(stator, links=(film,)), other))


def test_a_test_in_the_united_network_reads_as_on_its_own() -> None:
    check(MOTOR)
    united, sizes = United(MOTOR, EVERY), []
    for rig in EVERY:
        test = _recorded(_wrong(MOTOR), rig)
        alone = Model(configured(MOTOR, rig), [test], ()).residuals(np.zeros(0))
        together = Model(united.network, [united.test(test, rig)], ()).residuals(np.zeros(0))
        assert [one.channel for one in together] == ["winding_1", "yoke_1", "heat"]
        for one, other in zip(together, alone, strict=True):
            np.testing.assert_allclose(one.y, other.y, rtol=0, atol=1e-9)
        sizes.append(float(np.abs(alone[0].y).max()))
    assert min(sizes[:2]) > 0.5


def test_what_a_rig_lacks_changes_nothing_in_its_tests_and_all_else_what_it_changes_alone() -> None:
    united = United(MOTOR, EVERY)
    for rig in EVERY:
        test, own = _recorded(MOTOR, rig), United(MOTOR, [rig])
        alone = Model(own.network, [own.test(test, rig)], freedom(own.network, ()))
        together = Model(united.network, [united.test(test, rig)], freedom(united.network, ()))
        known = dict(zip(own.names, range(len(alone.parameters)), strict=True))
        for found, wanted in zip(
            together.linearise(np.zeros(len(together.parameters))),
            alone.linearise(np.zeros(len(alone.parameters))),
            strict=True,
        ):
            for j, name in enumerate(united.names):
                column = wanted.columns[:, known[name]] if name in known else 0.0
                np.testing.assert_allclose(found.columns[:, j], column, rtol=0, atol=1e-7, err_msg=name)
        assert len(known) == len(alone.parameters)


def test_a_rig_alone_is_its_own_network() -> None:
    united = United(MOTOR, [None, None])
    assert united.network == configured(MOTOR, None)
    test = _recorded(MOTOR, None)
    taken = united.test(test, None)
    np.testing.assert_array_equal(taken.frame.features, test.frame.features)
    np.testing.assert_array_equal(taken.frame.boundaries, test.frame.boundaries)
    np.testing.assert_array_equal(taken.initial, test.initial)
    assert taken.meters == test.meters


def test_a_reading_moves_the_start_of_the_rigs_own_nodes_as_it_does_on_the_rig() -> None:
    united, (_, rig, _) = United(MOTOR, EVERY), EVERY
    own = [node.name for node in configured(MOTOR, rig).nodes]
    test = replace(_recorded(MOTOR, rig), begins={"W_1": np.linspace(1.0, 0.2, len(own))})
    moved = dict(zip(united.network.names, united.test(test, rig).begins["W_1"], strict=False))
    assert [moved[name] for name in own] == test.begins["W_1"].tolist()
    absent = {moved[node.name] for node in united.network.nodes if node.name not in own}
    assert absent == {test.begins["W_1"].mean()}, "they start at the mean of the others"


def test_names_say_what_a_configuration_says_itself() -> None:
    names = United(MOTOR, EVERY).names
    assert "conductance.winding-yoke.constant" in names
    assert "conductance.air-yoke.constant@stator_in_air" in names
    assert "loss.yoke.current2@stator_in_air" in names
    assert "loss.yoke.speed1.5" in names
    assert "conductance.yoke-winding.constant@one_jacket" in names
    assert len(set(names)) == len(names)
    assert United(MOTOR, ["stator_in_air"]).names == (
        "conductance.winding-yoke.constant",
        "conductance.air-yoke.constant@stator_in_air",
        "loss.winding.current2",
        "loss.yoke.current2@stator_in_air",
        "capacity.winding.scale",
        "capacity.yoke.scale",
    )


@pytest.mark.parametrize("rig", EVERY)
def test_names_in_the_order_of_a_rigs_own_network(rig: str | None) -> None:
    united, own = United(MOTOR, EVERY), configured(MOTOR, rig)
    names = united.names_of(rig)
    assert len(set(names)) == len(freedom(own, ()))
    assert set(names) <= set(united.names)
    assert [name.partition("@")[0] for name in names] == [p.name for p in freedom(own, ())]
    assert {name.partition("@")[2] for name in names} <= {"", rig}


def test_both_rigs_teach_one_motor() -> None:
    rigs = [None, "stator_in_air"]
    united = United(_wrong(MOTOR), rigs)
    tests = [united.test(replace(_recorded(MOTOR, rig, seed), meters=()), rig) for seed, rig in enumerate(rigs)]
    found = calibrate(united.network, tests)
    motor = united.version(found.network)
    stator, other = motor.configurations
    assert motor.links[0].terms[0].coefficient == pytest.approx(8.0, rel=0.05)
    assert stator.links[0].terms[0].coefficient == pytest.approx(3.0, rel=0.15)
    assert other == MOTOR.configurations[1]  # no test of it
    assert found.fit.converged
    # one number says it all: the same fit from the bare stator alone leaves the paths to the coolant as they were
    alone = United(_wrong(MOTOR), ["stator_in_air"])
    bare = calibrate(
        alone.network, [alone.test(replace(_recorded(MOTOR, "stator_in_air"), meters=()), "stator_in_air")]
    )
    assert alone.version(bare.network).links[1:] == MOTOR.links[1:]


def test_a_version_without_a_change_is_the_motor() -> None:
    united = United(MOTOR, EVERY)
    assert united.version(united.network) == MOTOR


def test_a_rig_that_the_motor_does_not_have_is_refused() -> None:
    with pytest.raises(ConfigurationError, match='has no configuration "wet"'):
        United(MOTOR, [None, "wet"])
