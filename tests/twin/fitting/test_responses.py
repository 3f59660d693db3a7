"""Columns, block by block, against the run that they belong to: it is linear in its start and its heats."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from made.motor import CHANNELS, every_law
from twin.compiled.laws import Law, Table
from twin.fitting.march import System, run
from twin.fitting.responses import Mean, ParameterHeats, SensorRow, columns, means
from twin.motor.network import NOBODY
from twin.motor.outputs import blocks, lagged

Floats = NDArray[np.float64]

NODES = 4
LAWS = (
    Law(0, 1),
    Law(1, 2, other=3, slope=0.002, reference=30.0),
    Law(2, 3),
    Law(1, 4),
    Law(3, 5, tilt=30.0),
    Law(0, NOBODY, "copper"),
)
STEPS = 300  # more blocks than are laid side by side, and no whole number of steps side by side


def _system(step_s: float) -> System:
    """Of random conductances and losses, about a course that it need not follow."""
    rng = np.random.default_rng(3)
    carried = rng.uniform(0.5, 1.5, (len(LAWS), STEPS)) * np.array([[10.0], [5.0], [4.0], [12.0], [0.05], [300.0]])
    course, around = rng.uniform(40, 80, (STEPS, NODES)), rng.uniform(20, 40, (STEPS, 2))
    capacity = np.array([900.0, 2500.0, 600.0, 1500.0])
    return System.of(Table.of(LAWS, every_law().copper), carried, capacity, step_s, course, around)


def _sensors(step_s: float) -> tuple[list[SensorRow], list[Mean], int]:
    names = [node.name for node in every_law().nodes]
    sensors, wanted = [], []
    for k, (shares, tau_s) in enumerate(CHANNELS.values()):
        cut = blocks(np.ones(STEPS), np.full(STEPS, 0.5), step_s)
        sensors.append(SensorRow(np.array([shares.get(name, 0.0) for name in names]), tau_s))
        wanted.append(Mean(k, cut.old, cut.new))
    return sensors, wanted, cut.length


def _loads(*own: tuple[Floats, int, int, int]) -> ParameterHeats:
    heat, a, b, column = zip(*own, strict=True)
    return ParameterHeats(np.array(heat), *(np.array(one, dtype=np.int64) for one in (a, b, column)))


@pytest.mark.parametrize("step_s", [1.0, 2.0, 3.3, 20.0])
def test_starts_and_heats_add_up_to_the_run(step_s: float) -> None:
    system, (sensors, wanted, length) = _system(step_s), _sensors(step_s)
    initial = np.array([70.0, 55.0, 50.0, 35.0])
    edges, _ = run(system, initial)
    loads = _loads(*((system.heat[:, node].copy(), node, NOBODY, NODES) for node in range(NODES)))
    starts = {node: [node] for node in range(NODES)}
    found = columns(system, sensors, wanted, loads, starts, NODES + 1, length, step_s) @ np.append(initial, 1.0)
    for own, sensor, mean in zip(found, sensors, wanted, strict=True):
        reading = lagged(edges @ sensor.weights, sensor.time_constant_s, step_s)
        expected = (mean.old * reading[:-1] + mean.new * reading[1:]).reshape(-1, length).sum(axis=1)
        np.testing.assert_allclose(own, expected, rtol=1e-12)


def test_what_a_link_brings_to_one_end_it_takes_from_the_other() -> None:
    system, (sensors, wanted, length) = _system(2.0), _sensors(2.0)
    heat = np.random.default_rng(5).normal(size=STEPS)
    loads = _loads((heat, 0, NOBODY, 0), (heat, 2, NOBODY, 1), (heat, 0, 2, 2))
    found = columns(system, sensors, wanted, loads, {}, 3, length, 2.0)
    np.testing.assert_allclose(found[..., 2], found[..., 0] - found[..., 1], atol=1e-12 * np.abs(found).max())
    assert np.abs(found[..., 2]).max() > 0


def test_more_parameters_than_go_through_a_block_at_once_change_none() -> None:
    system, (sensors, wanted, length) = _system(2.0), _sensors(2.0)
    heat = np.random.default_rng(6).normal(size=(300, STEPS))
    loads = _loads(*((row, 1, NOBODY, p) for p, row in enumerate(heat)))
    found = columns(system, sensors, wanted, loads, {}, len(heat), length, 2.0)
    for p in (0, 127, 128, 299):
        alone = columns(system, sensors, wanted, _loads((heat[p], 1, NOBODY, 0)), {}, 1, length, 2.0)
        np.testing.assert_allclose(found[..., p], alone[..., 0], atol=1e-12 * np.abs(alone).max())


@pytest.mark.parametrize("late_steps", [0.3, -0.3, 1.0, 4.6, -6.2])
def test_means_of_late_stamps_are_means_of_the_moved_reading(late_steps: float) -> None:
    rng = np.random.default_rng(4)
    steps = 60
    cut = blocks((rng.random(steps) < 0.8).astype(np.float64), rng.random(steps), 2.0)
    reading, at = rng.normal(size=steps + 1), np.arange(steps + 1.0)
    found = np.zeros(steps // cut.length)
    for mean in means(0, cut, np.full(steps + 1, late_steps)):
        own = (mean.old * reading[:-1] + mean.new * reading[1:]).reshape(-1, cut.length).sum(axis=1)
        for block, value in enumerate(own):
            if 0 <= block + mean.ahead < len(found):
                found[block + mean.ahead] += value
            else:
                assert value == 0
    np.testing.assert_allclose(found[cut.there], cut.means(np.interp(at - late_steps, at, reading)), atol=1e-12)
