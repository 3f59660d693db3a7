"""Meters of one test: what they read of a run, and what each parameter changes in it.

A meter goes with the temperature of nodes, or reads a sum of the motor's heats: of all sources, or of all that a
boundary takes. A parameter changes such a sum in two ways: through the heats themselves at given temperatures
(`_Counted`, as `twin.fitting.heats` finds them), and through the temperatures that they go with (slopes of the laws,
as the weights of a `ColumnSensor` of the temperatures' columns).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numba
import numpy as np
from numpy.typing import NDArray

from twin.compiled.laws import Integers, Law, every_place, psi, psi_of
from twin.fitting.actions import Action
from twin.fitting.circuit import Circuit, CircuitRun
from twin.fitting.heats import Heats, Kind
from twin.fitting.stamped import stamped_means
from twin.motor.network import NOBODY
from twin.motor.observables import lagged_means
from twin.motor.outputs import Blocks, lagged
from twin.run.losses import takers
from twin.run.sparse_march import ColumnSensor

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
        self._counted: dict[int | None, _Counted] = {}

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
        return self._means_of_heat(meter.given + heat, k)

    def sensor(self, run: CircuitRun, k: int) -> ColumnSensor:
        """What reads the columns as meter k reads the temperatures: the mean that it goes with, or its heats."""
        meter = self.meters[k]
        if meter.what.law is None:
            return ColumnSensor.of_means(self._slopes(run, self.boundaries[k]))
        weights, tau_s = self.circuit.weights(meter.sensor), meter.sensor.time_constant_s
        return ColumnSensor.thermometer(weights, tau_s, self.circuit.step_s)

    def moved(self, shown: Floats, k: int) -> Floats:
        """What the block means (B, P) of meter k change by, where its `sensor` reads so much more (N + 1, P)."""
        law = self.meters[k].what.law
        if law is None:
            return self._means_of_heat(shown[1:].T, k).T
        found: Floats = law.per_K * (stamped_means(self.cuts[k], np.zeros(len(shown))) @ shown)
        return found

    def _means_of_heat(self, heat: Floats, k: int) -> Floats:
        """Block means (..., B) of a heat (..., N) as meter k shows it."""
        tau_s = self.meters[k].sensor.time_constant_s
        return self.cuts[k].of_steps(lagged_means(heat, tau_s, self.circuit.step_s))

    def counted(self, run: CircuitRun, wanted: Sequence[tuple[int, Action]], k: int) -> Iterator[tuple[int, Floats]]:
        """(column, (B,)) of the `wanted`, (column, action): what meter k shows more per unit of a parameter through the
        heats that it counts, at given temperatures. A column may come more than once: they add up."""
        if self.meters[k].what.law is not None:
            return
        if wanted != self._wanted:
            self._wanted, self._counted = list(wanted), {}
        boundary = self.boundaries[k]
        if boundary not in self._counted:
            places = {action: p for p, action in self.circuit.active}
            every = [(column, action, places.get(action, NOBODY)) for column, action in wanted]
            self._counted[boundary] = _Counted(self, every, boundary)
        own = self._counted[boundary]
        means = _sign(boundary) * self._means_of_heat(own.about(run), k)
        yield from zip(own.heated[own.loads.column].tolist(), means, strict=True)

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
        psi_of(places[w], numbers[w], copper, at, one)
        for i in range(3):
            end = places[w, (0, 1, 3)[i]]
            if 0 <= end < len(found):
                for k in range(at.shape[1]):
                    found[end, k] += carried[w, k] * one[i + 1, k]
