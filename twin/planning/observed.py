"""What else a bench could observe in a test: a thermocouple more, power, the coolant's heat, a resistance, a flux.

A thermocouple that is there and was not read comes as it is, and a new one is as good as the best that there is. A
power or heat is read to `HEAT_SHARE`, power with the mechanical power in it; the winding's resistance at standstill
without current, as after switch-off; the magnets' flux, by the voltage that they induce, where the motor turns
without load.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from twin.diagnosis.next_tests import load_of, read_throughout
from twin.differences.everyday import mean_loss_W
from twin.fitting.model import Floats, Test
from twin.fitting.recorded import RecordedChannel, RecordedMeter
from twin.motor.network import Network
from twin.motor.observables import Measurand, Thermometric, copper_slope
from twin.motor.sensor import Sensor
from twin.motor.sensor_laws import AMBIENT

HEAT_SHARE = 0.03  # of a coolant's heat: flow, two thermometers
POWER_SHARE = 0.002  # of the electrical power
RESISTANCE_SHARE, FLUX_SHARE = 0.001, 0.002  # of the reading, once it was read at a known temperature
READING_K = 0.3  # noise of a resistance or flux, as a temperature
FLUX_PER_K = -0.0011  # NdFeB's remanence: -0.09 to -0.13 % a kelvin
TURNS = 0.1  # of the top speed: slower, the induced voltage is too small


def observing(network: Network, test: Test, tests: Sequence[Test], beyond: Sequence[Sensor] = ()) -> Test:
    """The test with all that it could observe besides and nothing else, each under a name in words; `tests`: the
    recorded ones; `beyond`: thermometers that are there and were not read. What its own meters measure is observed
    already."""
    has = {(meter.what.quantity, meter.what.boundary) for meter in test.meters}
    length = len(test.frame.features)
    channels = read_throughout(
        [RecordedChannel(s, np.zeros(0), np.zeros(0), np.zeros(0)) for s in _thermocouples(network, test, beyond)],
        length,
    )
    meters = _meters(network, test, mean_loss_W(network, tests))
    new = tuple(meter for meter in meters if (meter.what.quantity, meter.what.boundary) not in has)
    return replace(test, channels=channels, meters=new)


def _thermocouples(network: Network, test: Test, beyond: Sequence[Sensor]) -> Iterator[Sensor]:
    there = [channel.sensor for channel in test.channels]
    seen = {node for sensor in (*there, *beyond) for node in sensor.weights}
    best = min(there, key=lambda s: (s.bias_sd, s.noise, s.time_constant_s))
    for sensor in beyond:
        yield replace(sensor, name=f"{sensor.name}, which is there")
    for node in network.nodes:
        if node.name not in seen:
            yield replace(best, name=f"a sensor at {node.name}", weights={node.name: 1.0})


def _meters(network: Network, test: Test, loss_W: float) -> Iterator[RecordedMeter]:
    mechanical = _mechanical_W(network, test)
    if mechanical is not None:
        power = Measurand("power", "W", POWER_SHARE)
        yield _meter("electrical power", {}, power, loss_W + mechanical, given=mechanical)
    taken = np.full(len(test.frame.features), loss_W)
    for boundary in network.boundaries:
        if boundary.name != AMBIENT:
            heat = Measurand("heat", "W", HEAT_SHARE, boundary=boundary.name)
            yield _meter(f"heat into {boundary.name}", {}, heat, taken)
    yield from _thermometric(network, test)


def _thermometric(network: Network, test: Test) -> Iterator[RecordedMeter]:
    load, speed = load_of([test]), np.abs(test.inputs["speed"])
    idle = np.abs(test.inputs[str(load)]) == 0.0
    copper, magnets = ({n.name: n.capacity for n in network.nodes if n.region == of} for of in ("copper", "magnet"))
    if copper and (at := idle & (speed == 0.0)).any():
        law = Thermometric(1.0, copper_slope(network.copper, 20.0), 20.0)
        what = Measurand("resistance", "ohm", RESISTANCE_SHARE, law=law)
        yield _meter("winding resistance at rest", copper, what, np.ones(len(speed)), at=at)
    if magnets and (at := idle & (speed > TURNS * speed.max())).any():
        what = Measurand("flux", "Wb", FLUX_SHARE, law=Thermometric(1.0, FLUX_PER_K, 20.0))
        yield _meter("flux without load", magnets, what, np.ones(len(speed)), at=at)


def _meter(
    name: str,
    capacities: Mapping[str, float],
    what: Measurand,
    measured: Floats,
    given: Floats | float = 0.0,
    at: Floats | None = None,
) -> RecordedMeter:
    """A meter of the mean of nodes by heat capacity, or of heats; read in the steps `at`, else in all."""
    weights = {node: capacity / sum(capacities.values()) for node, capacity in capacities.items()}
    noise = READING_K * abs(what.law.per_K) if what.law else 0.0
    samples = np.ones(len(measured)) if at is None else at.astype(np.float64)
    return RecordedMeter(
        Sensor(name, weights, noise=noise), measured, samples, np.full(len(measured), 0.5), what, given
    )


def _mechanical_W(network: Network, test: Test) -> Floats | None:
    """The mechanical power (N,) [W]; None where no torque is known."""
    if not {"speed", "torque"} <= test.inputs.keys():
        return None
    turns = test.inputs["speed"] * network.scale["speed"] * np.pi / 30.0
    found: Floats = turns * test.inputs["torque"] * network.scale["torque"]
    return found
