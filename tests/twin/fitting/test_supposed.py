"""What the file says where no sensor sits: one reading a node, as uncertain as the file is at its sensors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from made.motor import CASE, MAGNET, every_law, pulses, recorded, rotor_unread, smooth, with_copper_loss
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.fit import fit
from twin.fitting.model import Model, Test
from twin.fitting.supposed import LEAST_SHARE, TIMES, supposing, wrong_share
from twin.motor import sensor_laws
from twin.motor.network import Network

INITIAL = np.array([45.0, 42.0, 41.0, 35.0])
STEP = 1e-4


def _tests(network: Network, true: Network | None = None) -> list[Test]:
    """A calm test and a hot one."""
    calm = {name: 0.5 * values for name, values in smooth(400.0).items()} | {"flow": smooth(400.0)["flow"]}
    drives = (calm, pulses(800.0, 1))
    return [rotor_unread(recorded(network, d, INITIAL, true=true, seed=s)) for s, d in enumerate(drives)]


def test_a_node_without_a_sensor_is_read_once_where_the_file_has_it_hottest() -> None:
    network = every_law()
    model = supposing(Model(network, _tests(network), ()))
    calm, hot = model.tests
    assert [one.sensor.node for one in hot.supposed] == ["magnet", "case"] and not calm.supposed
    run = model.course(1, np.zeros(0))[1]
    for node, one in zip((MAGNET, CASE), hot.supposed, strict=True):
        step = int(one.samples.argmax())
        assert one.samples.sum() == 1.0 and step == run[:, node].argmax()
        assert one.measured[step] == run[step, node]
    said = [series for series in model.residuals(np.zeros(0)) if not series.measured]
    assert [series.channel for series in said] == ["magnet by the file", "case by the file"]
    assert all(abs(series.y[0]) < 1e-9 for series in said), "the file's own run is what the file says"


def test_the_file_is_as_right_there_as_at_its_sensors() -> None:
    network = every_law()
    coldest = 25.0
    for times, least in ((1.0, True), (2.0, False)):
        tests = _tests(network, with_copper_loss(network, times))
        as_file = Model(network, tests, ())
        runs = [as_file.course(s, np.zeros(0))[1] for s in range(2)]
        off = wrong_share(tests, [node.name for node in network.nodes], runs)
        share = max(LEAST_SHARE, TIMES * off)
        assert (share == LEAST_SHARE) == least
        for node, one in zip((MAGNET, CASE), supposing(as_file).tests[1].supposed, strict=True):
            assert one.sensor.noise == pytest.approx(share * (runs[1][:, node].max() - coldest))


def test_what_the_file_is_off_by_at_its_sensors_counts_by_the_rise() -> None:
    network = every_law()
    test = _tests(network)[1]
    run = Model(network, [test], ()).course(0, np.zeros(0))[1]
    hot = tuple(
        replace(c, measured=25.0 + 0.8 * (run @ c.sensor.over([n.name for n in network.nodes]) - 25.0))
        for c in test.channels
    )
    off = wrong_share([replace(test, channels=hot)], [n.name for n in network.nodes], [run])
    assert off == pytest.approx(0.2)
    silent = replace(test, channels=tuple(replace(c, samples=0 * c.samples) for c in test.channels))
    assert wrong_share([silent], [n.name for n in network.nodes], [run]) == 0.0


def test_where_every_node_has_a_sensor_nothing_is_supposed() -> None:
    network = every_law()
    model = Model(network, [recorded(network, smooth(200.0), INITIAL)], ())
    assert supposing(model) is model


def test_its_columns_are_those_of_the_node() -> None:
    network = every_law()
    parameters = [
        Parameter("loss", actions.Scale((12,)), 0.3),
        Parameter("path", actions.Scale((3,)), 0.3),
        Parameter("gain", sensor_laws.Gain("W_1"), 0.01),
        Parameter("start", actions.Start(MAGNET), 3.0, 1),
    ]
    model = supposing(Model(network, _tests(network), parameters))
    beta = np.array([0.2, -0.3, 0.01, 0.5])
    for part in (p for p in model.linearise(beta) if not p.series.measured):
        for column, place in zip(part.columns.T, part.at, strict=True):
            moved = []
            for way in (1.0, -1.0):
                other = beta.copy()
                other[place] += way * STEP
                moved.append(next(s.y for s in model.residuals(other) if s.channel == part.series.channel))
            assert column == pytest.approx((moved[1] - moved[0]) / (2 * STEP), rel=1e-5, abs=1e-6)


def test_a_fit_does_not_pay_for_its_sensors_with_a_node_that_none_follows() -> None:
    """The winding has a loss that no number of the fit stands for; what holds magnet and case may differ by any
    factor."""
    network = every_law()
    tests = _tests(network, with_copper_loss(network, 1.05))
    free = [Parameter(f"{own}", actions.Scale(own), 2.0) for own in ((12,), (3, 4), (5,), (6,), (7,))]
    plain = Model(network, tests, free)
    file = plain.course(1, np.zeros(5))[1].max(axis=0)
    fitted = [fit(model, np.zeros(5)) for model in (plain, supposing(plain))]
    far, near = (abs(one.model.course(1, one.beta)[1].max(axis=0) - file) for one in fitted)
    assert (near[[MAGNET, CASE]] < far[[MAGNET, CASE]] / 1.5).all()
