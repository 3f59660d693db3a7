"""Meters of one test: what they read of a run, and what each parameter changes in it.

A meter goes with the temperature of nodes, or reads a sum of the motor's heats: of all sources, or of all that a
boundary takes. A parameter changes such a sum in two ways: through the heats themselves at given temperatures
(`_Counted`, as `twin.fitting.heats` finds them), and through the temperatures that they go with (slopes of the laws,
times what `twin.fitting.responses` knows of the temperatures).
"""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np
from numpy.typing import NDArray

from twin.compiled.laws import Integers, Law, every_place, psi, psi_of
from twin.fitting.actions import Action
from twin.fitting.circuit import Circuit, CircuitRun
from twin.fitting.heats import Heats, Kind
from twin.fitting.responses import Mean, SensorRow, columns
from twin.motor.network import NOBODY
from twin.motor.observables import lag_parts, lagged_means
from twin.motor.outputs import Blocks, lagged
from twin.run.losses import takers

Floats = NDArray[np.float64]

NOWHERE = -2  # a heat that the meter does not count


class Metering:
    """The meters of a circuit's test; what does not depend on the vector is made once."""

    def __init__(self, circuit: Circuit, cuts: Sequence[Blocks]) -> None:
        self.circuit, self.cuts, self.meters = circuit, cuts, circuit.test.meters
        around = [boundary.name for boundary in circuit.network.boundaries]
        self.boundaries = [None if (b := meter.what.boundary) is None else around.index(b) for meter in self.meters]
        self._takes = takers(circuit.network, circuit.states)
        self._wanted: list[tuple[int, Action]] = []
        self._heats: Heats | None = None
        self._counted: dict[int | None, _Counted] = {}
        self._known: tuple[CircuitRun, list[Floats]] | None = None

    def counts(self, law: Law, boundary: int | None) -> bool:
        """Whether a meter of all sources (None), or of what a boundary takes, counts a law's heat."""
        return law.b == NOBODY if boundary is None else self._takes(law) == boundary

    def laws(self, boundary: int | None) -> list[int]:
        """The circuit's laws that a meter counts."""
        return [i for i, law in enumerate(self.circuit.laws) if self.counts(law, boundary)]

    def reading(self, run: CircuitRun, k: int) -> Floats:
        """Block means (B,) of meter k, with perfect gain and without bias."""
        meter, cut, step_s = self.meters[k], self.cuts[k], self.circuit.step_s
        tau_s, law, boundary = meter.sensor.time_constant_s, meter.what.law, self.boundaries[k]
        if law is not None:
            return cut.means(law.reading(lagged(run.edges @ self.circuit.weights(meter.sensor), tau_s, step_s)))
        value, _ = psi(self.circuit.table, run.means, run.boundaries)
        own = self.laws(boundary)
        heat = _sign(boundary) * (run.carried[own] * value[own]).sum(axis=0)
        return cut.of_steps(lagged_means(meter.given + heat, tau_s, step_s))

    def columns(self, run: CircuitRun, wanted: Sequence[tuple[int, Action]]) -> list[Floats]:
        """Of every meter (B, P): d(block mean of its reading) / d(parameter), `wanted`: (column, action),
        P of the last column."""
        if wanted != self._wanted:
            self._wanted, self._known = list(wanted), None
            places = {action: p for p, action in self.circuit.active}
            every = [(column, action, places.get(action, NOBODY)) for column, action in wanted]
            self._heats = Heats(self.circuit, every)
            self._counted = {b: _Counted(self, every, b) for _, b in self._of_heat()}
        if self._known is None or self._known[0] is not run:
            self._known = run, self._through_temperatures(run)
        found = [moved.copy() for moved in self._known[1]]
        for k, boundary in self._of_heat():
            own, cut = self._counted[boundary].loads(run), self.cuts[k]
            heat = lagged_means(own.heat, self.meters[k].sensor.time_constant_s, self.circuit.step_s)
            for column, row in zip(own.column, heat, strict=True):
                found[k][:, column] += _sign(boundary) * cut.of_steps(row)
        return found

    def _of_heat(self) -> list[tuple[int, int | None]]:
        """The meters of heat: (meter, its boundary)."""
        return [(k, self.boundaries[k]) for k, meter in enumerate(self.meters) if meter.what.law is None]

    def _through_temperatures(self, run: CircuitRun) -> list[Floats]:
        assert self._heats is not None
        circuit, total = self.circuit, max(column for column, _ in self._wanted) + 1
        sensors: list[SensorRow] = []
        means: list[Mean] = []
        of_meter: list[tuple[int, float]] = []  # and what it changes by with the sensor
        for k, meter in enumerate(self.meters):
            tau_s, law = meter.sensor.time_constant_s, meter.what.law
            if law is not None:
                means.append(Mean(len(sensors), self.cuts[k].old, self.cuts[k].new))
                sensors.append(SensorRow(circuit.weights(meter.sensor), tau_s))
                of_meter.append((k, law.per_K))
                continue
            slope = self._slopes(run, self.boundaries[k])
            parts = lag_parts(self.cuts[k].of_step, tau_s, circuit.step_s, self.cuts[k].length)
            for node in np.flatnonzero(slope.any(axis=1)):
                weights = np.zeros(circuit.states)
                weights[node] = 1.0
                for ahead, weight in parts:  # a step's mean temperature is that of its ends: the midpoint rule
                    half = weight * slope[node] / 2
                    means.append(Mean(len(sensors), half, half, ahead))
                sensors.append(SensorRow(weights, 0.0))
                of_meter.append((k, 1.0))
        result = [np.zeros((int(cut.there.sum()), total)) for cut in self.cuts]
        if sensors:
            length = self.cuts[0].length
            loads = self._heats.loads(run)
            found = columns(run.system, sensors, means, loads, self._heats.starts, total, length, circuit.step_s)
            for (k, factor), moved in zip(of_meter, found, strict=True):
                result[k] += factor * moved[self.cuts[k].there]
        return result

    def _slopes(self, run: CircuitRun, boundary: int | None) -> Floats:
        """(states, N) [W/K]: what a meter's heats change by with the mean temperature of each state in a step."""
        own, table = self.laws(boundary), self.circuit.table
        found = np.zeros((self.circuit.states, self.circuit.steps))
        at, carried = every_place(run.means, run.boundaries), _sign(boundary) * run.carried[own]
        _add_slopes(table.places[own], table.numbers[own], table.copper, at, carried, found)
        return found


class _Counted(Heats):
    """Parameters as the heats that one meter counts: of all sources, or through all that a boundary takes."""

    def __init__(self, metering: Metering, wanted: Sequence[tuple[int, Action, int]], boundary: int | None) -> None:
        self._metering, self._boundary = metering, boundary
        super().__init__(metering.circuit, wanted)

    def _row(self, a: int, b: int, column: int) -> int:
        return super()._row(0, NOBODY, column)

    def _through(self, law: Law, column: int) -> int:
        return self._row(0, NOBODY, column) if self._metering.counts(law, self._boundary) else NOWHERE

    def _add(self, kind: Kind, to: int, weight: float, first: int, second: int = 0, parameter: int = NOBODY) -> None:
        match kind:
            case "stored" | "following":
                return
            case "given" if self._boundary is not None:
                return
            case "bounds" if not self._metering.counts(self.circuit.laws[first], self._boundary):
                return
        if to != NOWHERE:
            super()._add(kind, to, weight, first, second, parameter)


def _sign(boundary: int | None) -> float:
    """A law's heat goes into the motor, what a boundary takes out of it."""
    return 1.0 if boundary is None else -1.0


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _add_slopes(places: Integers, numbers: Floats, copper: Floats, at: Floats, carried: Floats, found: Floats) -> None:
    one = np.empty((4, at.shape[1]))
    for w in range(len(places)):
        psi_of(places[w], numbers[w], copper, at, 0, one)
        for i in range(3):
            end = places[w, (0, 1, 3)[i]]
            if 0 <= end < len(found):
                for k in range(at.shape[1]):
                    found[end, k] += carried[w, k] * one[i + 1, k]
