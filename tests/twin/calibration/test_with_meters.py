"""A meter of heat tells a loss from a conductance, which temperatures alone do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from made.motor import AMBIENT_DEGC, COOLANT_DEGC, FINE_S, every_law, recorded, smooth, truth
from twin.calibration.calibrate import Calibration, calibrate
from twin.fitting.model import Model, Test
from twin.fitting.recorded import METER_SHARE, RecordedMeter
from twin.motor.features import evaluate, monomials
from twin.motor.network import Network
from twin.motor.observables import Measurand
from twin.motor.sensor import Sensor
from twin.run.losses import heat_flows
from twin.run.simulate import Frame

FACTOR = 1.12  # of every heat, conductance and capacity: no temperature changes
DURATION_S, START = 600.0, np.array([45.0, 42.0, 41.0, 35.0])


def _all_times(network: Network, factor: float) -> Network:
    return replace(
        network,
        nodes=tuple(replace(n, capacity=factor * n.capacity) for n in network.nodes),
        links=tuple(
            replace(one, terms=tuple(replace(t, coefficient=factor * t.coefficient) for t in one.terms))
            for one in network.links
        ),
        sources=tuple(
            replace(one, terms=tuple(replace(t, coefficient=factor * t.coefficient) for t in one.terms))
            for one in network.sources
        ),
    )


def _heat_W(network: Network) -> NDArray[np.float64]:
    """What a motor makes in every step of 0.5 s."""
    drive = smooth(DURATION_S)
    edges = truth(network, drive, START)
    around = np.tile([COOLANT_DEGC, AMBIENT_DEGC], (len(edges) - 1, 1))
    return heat_flows(network, Frame(FINE_S, evaluate(monomials(network), drive, len(around)), around), edges).made


def _mean_W(found: Calibration) -> float:
    return float(_heat_W(replace(found.network, name=every_law().name)).mean())


@pytest.fixture(scope="module")
def true_W() -> float:
    return float(_heat_W(_all_times(every_law(), FACTOR)).mean())


@pytest.fixture(scope="module")
def off_W(true_W: float) -> float:
    """By which the motor file makes less."""
    return true_W - float(_heat_W(every_law()).mean())


def _test(gain: float = 0.0) -> Test:
    """Recorded of the true motor, with an electrical power meter that reads `gain` too much."""
    network, true, drive = every_law(), _all_times(every_law(), FACTOR), smooth(DURATION_S)
    test = recorded(network, drive, START, true=true, seed=3)
    made = _heat_W(true)
    steps = len(test.frame.features)
    given = 2000.0 * np.cos(np.arange(steps) / 11.0)
    noise = np.random.default_rng(4).normal(0.0, 2.0, steps)
    measured = (1 + gain) * (made.reshape(steps, -1).mean(axis=1) + given) + noise
    sensor = Sensor("P_el", {"P_el": 1.0}, bus="can2", noise=4.0, resolution=0.1, bias_sd=5.0)
    what = Measurand("power", "W", gain_sd=0.01)
    meter = RecordedMeter(sensor, measured, np.full(steps, 4.0), np.full(steps, 0.5), what, given)
    return replace(test, meters=(meter,))


def test_a_power_meter_finds_the_size_of_losses_and_conductances(true_W: float, off_W: float) -> None:
    with_meter, without = calibrate(every_law(), [_test()]), calibrate(every_law(), [replace(_test(), meters=())])
    assert abs(_mean_W(with_meter) - true_W) < off_W / 3
    assert abs(_mean_W(without) - true_W) > 2 * off_W / 3
    assert with_meter.mae_after[0, "P_el"] < 0.3 * with_meter.mae_before[0, "P_el"]
    path = next(i for i, e in enumerate(with_meter.estimates) if e.name.startswith("conductance.yoke-coolant"))
    assert with_meter.estimates[path].sd < without.estimates[path].sd


def test_a_wrong_gain_of_the_meter_is_taken_from_the_meter(true_W: float, off_W: float) -> None:
    found = calibrate(every_law(), [_test(gain=0.015)])
    at = next(i for i, p in enumerate(found.fit.model.parameters) if p.name == "meter.P_el.gain")
    assert found.fit.beta[at] == pytest.approx(0.015, abs=0.003)
    assert abs(_mean_W(found) - true_W) < off_W / 3


def test_the_rows_of_a_meter_are_shares_of_the_heat_that_it_reads() -> None:
    test = _test()
    (meter,) = test.meters
    heat = np.abs(meter.measured - meter.given).mean()
    assert meter.row == pytest.approx(METER_SHARE * heat)
    series = next(s for s in Model(every_law(), [test], []).residuals(np.zeros(0)) if s.channel == "P_el")
    assert series.white_sd == pytest.approx(4.0 / meter.row)
    off = calibrate(every_law(), [test]).mae_before[0, "P_el"]
    assert off == pytest.approx(meter.row * np.abs(series.y).mean())
