"""What the channels and meters of one test show of it, and what that changes by with the parameters of readings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TypeVar, assert_never

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from twin.fitting import actions
from twin.fitting.actions import Action
from twin.fitting.circuit import Circuit, CircuitRun
from twin.fitting.drive import PROBE_S
from twin.fitting.metering import Metering
from twin.fitting.noise import Series
from twin.fitting.stamped import stamped_means
from twin.motor.outputs import lagged
from twin.motor.sensor_laws import AMBIENT, SENSOR_LAWS, Bias, Gain, Lag, Misreading, Seen
from twin.run.sparse_march import ColumnSensor

Floats = NDArray[np.float64]
A = TypeVar("A", bound=Action)
MISREADINGS = tuple(law for law in SENSOR_LAWS if issubclass(law, Misreading))
ON_HEATS = actions.OnTerms | actions.OnTemperatures

LAG_PROBE_S = 0.05  # for the slope of a reading by its lag, which has no kinks


class Sensing:
    """The channels of a circuit's test: everything that does not depend on the vector."""

    def __init__(self, circuit: Circuit, number: int) -> None:
        self.circuit, self.test, self.number = circuit, circuit.test, number
        channels, sensors, step_s = self.test.thermometers, self.test.sensors, circuit.step_s
        around = [boundary.name for boundary in circuit.network.boundaries]
        self.ambient = around.index(AMBIENT) if AMBIENT in around else None
        self.blocks = [one.blocks(step_s) for one in sensors]
        self.times_s = [cut.times_s(step_s) for cut in self.blocks]
        self.weights = [circuit.weights(channel.sensor) for channel in channels]
        self.measured = [b.measured(c.measured) for b, c in zip(self.blocks, sensors, strict=True)]
        self.names = [one.name for one in sensors]
        self.meters = list(range(len(channels), len(sensors)))
        self.metering = Metering(circuit, self.blocks[len(channels) :])
        self._own: list[dict[type, list[tuple[int, Action]]]] = [{} for _ in self.blocks]
        for p, action in circuit.active:
            for k in self.read_by(action):
                self._own[k].setdefault(type(action), []).append((p, action))

    def read_by(self, action: Action) -> list[int]:
        """The channels, then the meters, that an action makes read otherwise than the temperatures say. What is pulled
        towards the ambient reads its boundary; a meter reads heats, which anything may change."""
        if isinstance(action, actions.BoundaryBias) and action.boundary == self.ambient:
            return [*(k for k in range(len(self.weights)) if self.pulled(k)), *self.meters]
        if isinstance(action, ON_HEATS):
            return self.meters
        match action:
            case Misreading() | Lag() | actions.Beside():
                return self._called((action.channel,))
            case actions.Slowed(channels):
                return self._called(channels)
            case actions.Late():
                return self._called(() if self.test.is_common(action) else action.channels)
            case _:
                assert_never(action)

    def _called(self, names: Sequence[str]) -> list[int]:
        return [k for k, one in enumerate(self.names) if one in names]

    def pulled(self, k: int) -> list[tuple[int, float]]:
        """The parameters by which channel k is pulled towards the ambient, and how much for each unit."""
        laws = [law for law in MISREADINGS if law.of_ambient]
        return [(p, law.of_ambient) for law in laws for p, _ in self.of(k, law)]

    def of(self, k: int, kind: type[A]) -> list[tuple[int, A]]:
        """The parameters of channel k whose action is of a kind."""
        return [(p, action) for p, action in self._own[k].get(kind, []) if isinstance(action, kind)]

    def towards(self, k: int, node: int) -> Floats:
        """What the weights (states,) of channel k change by for each share of a node beside its place."""
        change = -self.weights[k]
        change[node] += 1.0
        return change

    def late_by(self, action: actions.Late) -> Floats:
        """Lateness (N + 1,) [s] for each unit of the parameter."""
        return self.circuit.edges_s * 1e-6 if action.drifts else np.ones(self.circuit.steps + 1)


class Readings:
    """What channel k shows in one run; behind the channels stand the meters."""

    def __new__(cls, sensing: Sensing, run: CircuitRun, k: int) -> Readings:  # noqa: PYI034 -- k says which of the two
        return super().__new__(cls if k < len(sensing.test.thermometers) else _MeterReadings)

    def __init__(self, sensing: Sensing, run: CircuitRun, k: int) -> None:
        self.sensing, self.run, self.k = sensing, run, k
        self.channel = sensing.test.thermometers[k]
        self.step_s = sensing.circuit.step_s
        self.weights = sensing.weights[k]
        for p, action in sensing.of(k, actions.Beside):
            self.weights = self.weights + run.beta[p] * sensing.towards(k, action.node)
        self.lag_s = max(0.0, self.channel.sensor.time_constant_s + self._sum(Lag) + self._sum(actions.Slowed))
        self.factor = 1.0  # what the truth is multiplied with
        for law in MISREADINGS:
            if law.of_truth:
                self.factor += law.of_truth * self._sum(law)
        self.late_s = np.zeros(sensing.circuit.steps + 1)
        for p, late in sensing.of(k, actions.Late):
            self.late_s = self.late_s + late.sign * float(run.beta[p]) * sensing.late_by(late)
        self.truth: Floats = run.edges @ self.weights
        self.followed = lagged(self.truth, self.lag_s, self.step_s)  # by the sensor itself
        self.seen = Seen(self.followed, sensing.circuit.edges_s, sensing.circuit.magnitudes)

    def _sum(self, kind: type[Action]) -> float:
        return float(sum(self.run.beta[p] for p, _ in self.sensing.of(self.k, kind)))

    @cached_property
    def means(self) -> csr_array:
        """`stamped` of many readings, as a matrix (B, N + 1)."""
        return stamped_means(self.sensing.blocks[self.k], self.late_s / self.step_s)

    def stamped(self, reading: Floats, late_s: Floats) -> Floats:
        """Block means (B,) of a reading (N + 1,) whose stamps are late."""
        edges_s = self.sensing.circuit.edges_s
        return self.sensing.blocks[self.k].means(np.interp(edges_s - late_s, edges_s, reading))

    @property
    def sensor(self) -> ColumnSensor:
        """What reads the columns as the channel reads the temperatures."""
        return ColumnSensor.thermometer(self.weights, self.lag_s, self.step_s)

    def moved(self, shown: Floats) -> Floats:
        """What the block means (B, P) change by, where the `sensor` reads so much more (N + 1, P) at the edges."""
        found: Floats = self.factor * (self.means @ shown)
        return found

    def shown(self) -> Floats:
        """What the channel shows (N + 1,), its stamps aside."""
        found: Floats = self.factor * self.followed
        for law in MISREADINGS:
            amount = self._sum(law)
            if amount:
                found = found + self._added(law(self.channel.name), amount)
        return found

    def _added(self, law: Misreading, p: float) -> Floats | float:
        """What a law adds to the reading besides its share of the truth."""
        added = law.adds(p, self.seen)
        return added + p * law.of_ambient * self._ambient() if law.of_ambient else added

    def _ambient(self) -> Floats:
        """At the edges of the steps (N + 1,)."""
        assert self.sensing.ambient is not None, "no boundary is called so: no candidate and no file names such a law"
        around = self.run.boundaries[:, self.sensing.ambient]
        return np.append(around, around[-1])

    def series(self) -> Series:
        """Measured minus shown."""
        return Series(
            session=self.sensing.number,
            channel=self.channel.name,
            t_s=self.sensing.times_s[self.k],
            y=self.sensing.measured[self.k] - self.stamped(self.shown(), self.late_s),
            samples=self.sensing.blocks[self.k].samples,
            white_sd=self.channel.sensor.noise,
            resolution=self.channel.sensor.resolution,
            measured=self.k < len(self.sensing.test.channels),
        )

    def columns(self, wanted: Sequence[tuple[int, Action]]) -> Iterator[tuple[int, Floats]]:
        """(column, (B,)): what the reading changes by where the temperatures do not."""
        rows: list[tuple[int, Floats]] = []
        beside: list[tuple[int, int]] = []
        for column, action in wanted:
            assert isinstance(action, actions.OnReading | actions.BoundaryBias), action
            match action:
                case Misreading():
                    added = self._added(action, 1.0)
                    if action.of_truth or not isinstance(added, float):
                        rows.append((column, action.of_truth * self.followed + added))
                    else:
                        yield column, np.full(len(self.sensing.measured[self.k]), added)
                case actions.BoundaryBias():
                    share = sum(self.run.beta[p] * of_ambient for p, of_ambient in self.sensing.pulled(self.k))
                    yield column, np.full(len(self.sensing.measured[self.k]), -float(share))
                case actions.Beside(_, node):
                    beside.append((column, node))
                case Lag() | actions.Slowed():
                    low, high = max(0.0, self.lag_s - LAG_PROBE_S), self.lag_s + LAG_PROBE_S
                    changed = lagged(self.truth, high, self.step_s) - lagged(self.truth, low, self.step_s)
                    rows.append((column, self.factor * changed / (high - low)))
                case actions.Late(_, _, sign):
                    shown, by = self.shown(), PROBE_S * self.sensing.late_by(action)
                    after, before = (self.stamped(shown, self.late_s + way * by) for way in (1.0, -1.0))
                    yield column, sign * (after - before) / (2 * PROBE_S)
                case _:
                    assert_never(action)
        if beside:
            edges, nodes = self.run.edges, [node for _, node in beside]
            moved = lagged(edges[:, nodes].T - edges @ self.sensing.weights[self.k], self.lag_s, self.step_s)
            rows += [(column, self.factor * row) for (column, _), row in zip(beside, moved, strict=True)]
        if rows:
            yield from ((column, self.means @ row) for column, row in rows)


class _MeterReadings(Readings):
    """What a meter shows in one run. Of the meter of a heat, `moved` is what goes through the temperatures, and
    `columns` what goes through the heats at given temperatures."""

    def __init__(self, sensing: Sensing, run: CircuitRun, k: int) -> None:
        self.sensing, self.run, self.k = sensing, run, k
        self.at = k - len(sensing.test.thermometers)
        self.meter = sensing.test.meters[self.at]
        self.factor = 1.0 + self._sum(Gain)
        self.truth_means = sensing.metering.reading(run, self.at)

    @property
    def sensor(self) -> ColumnSensor:
        return self.sensing.metering.sensor(self.run, self.at)

    def moved(self, shown: Floats) -> Floats:
        return self.factor / self.meter.row * self.sensing.metering.moved(shown, self.at)

    def series(self) -> Series:
        shown = (self.factor * self.truth_means + self._sum(Bias)) / self.meter.row
        return Series(
            session=self.sensing.number,
            channel=self.meter.name,
            t_s=self.sensing.times_s[self.k],
            y=self.sensing.measured[self.k] / self.meter.row - shown,
            samples=self.sensing.blocks[self.k].samples,
            white_sd=self.meter.sensor.noise / self.meter.row,
            resolution=self.meter.sensor.resolution / self.meter.row,
        )

    def columns(self, wanted: Sequence[tuple[int, Action]]) -> Iterator[tuple[int, Floats]]:
        return ((column, moved / self.meter.row) for column, moved in self._moved(wanted))

    def _moved(self, wanted: Sequence[tuple[int, Action]]) -> Iterator[tuple[int, Floats]]:
        """(column, (B,)) in the meter's unit."""
        heats = [(column, action) for column, action in wanted if not isinstance(action, Bias | Gain)]
        if heats:
            counted = self.sensing.metering.counted(self.run, heats, self.at)
            yield from ((column, self.factor * moved) for column, moved in counted)
        for column, action in wanted:
            if isinstance(action, Bias):
                yield column, np.ones(len(self.truth_means))
            elif isinstance(action, Gain):
                yield column, self.truth_means
