"""A motor, its tests and everything that may differ, as one vector: residuals and their exact columns.

The vector holds one number for each `twin.fitting.actions.Parameter`; 0 is the motor file with perfect sensors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from twin.fitting import actions
from twin.fitting.actions import Action, Parameter
from twin.fitting.circuit import Circuit, CircuitRun
from twin.fitting.heats import Heats
from twin.fitting.noise import ChannelNoise, Series, whiten
from twin.fitting.readings import Readings, Sensing
from twin.fitting.recorded import Test
from twin.motor.network import NOBODY, Network
from twin.run import sparse_march

__all__ = ["BROAD", "Columns", "Model", "Test"]

Floats = NDArray[np.float64]
Index = NDArray[np.intp]
T = TypeVar("T")

BROAD = ChannelNoise(ar_sd=0.25, ar_tau_s=60.0, ou_sd=0.4, ou_tau_s=600.0)


@dataclass(frozen=True)
class Columns:
    """One channel of one test about a vector: the residual's series (not whitened), `at` the places in the vector that
    its columns (B, at) d(modelled)/d(vector) belong to, and `extra` (B, c) of parameters at zero."""

    series: Series
    at: Index
    columns: Floats
    extra: Floats


Known = tuple[Floats, list[Columns]]  # a vector and what linearising there gave


class Model:
    """`network` and `tests` with `parameters`; `noise`: channel -> its noise, `BROAD` where there is none."""

    def __init__(
        self,
        network: Network,
        tests: Sequence[Test],
        parameters: Sequence[Parameter],
        noise: Mapping[str, ChannelNoise] | None = None,
        known: Known | None = None,
        marches: Sequence[_March] | None = None,
    ) -> None:
        self.network = network
        self.tests = tuple(tests)
        self.parameters = tuple(parameters)
        self.noise = dict(noise or {})
        self._known = known  # the last linearisation: noise does not matter to it, and more parameters only add to it
        self._made = marches  # what they hold depends neither on noise nor on priors

    @property
    def _marches(self) -> Sequence[_March]:
        if self._made is None:
            self._made = [_March(self.network, test, self.parameters, s) for s, test in enumerate(self.tests)]
        return self._made

    @cached_property
    def sd(self) -> Floats:
        """Prior standard deviation of every entry of the vector."""
        return np.array([p.sd for p in self.parameters])

    @cached_property
    def low(self) -> Floats:
        return np.array([p.low for p in self.parameters])

    @cached_property
    def high(self) -> Floats:
        return np.array([p.high for p in self.parameters])

    def with_noise(self, noise: Mapping[str, ChannelNoise]) -> Model:
        """The same under another noise."""
        return Model(self.network, self.tests, self.parameters, noise, self._known, self._marches)

    def with_priors(self, parameters: Sequence[Parameter]) -> Model:
        """The same parameters with other priors."""
        return Model(self.network, self.tests, parameters, self.noise, self._known, self._marches)

    def plus(self, more: Sequence[Parameter]) -> Model:
        """The same with more parameters at the end of the vector."""
        attached = any(isinstance(p.action, actions.Attached) for p in more)
        known = None if attached else self._known
        return Model(self.network, self.tests, (*self.parameters, *more), self.noise, known)

    def without(self, *places: int) -> Model:
        """The same without some parameters."""
        kept = [p for i, p in enumerate(self.parameters) if i not in places]
        return Model(self.network, self.tests, kept, self.noise)

    def whitened(self, series: Series, x: Floats) -> Floats:
        """Columns (B, k) of a channel under the model's noise."""
        return whiten(series, self.noise_of(series.channel), x)

    def noise_of(self, channel: str) -> ChannelNoise:
        return self.noise.get(channel, BROAD)

    def residuals(self, beta: Floats) -> list[Series]:
        """Measured minus modelled of every test and channel. Raises `DivergedError`."""
        return [series for found in self._each(lambda s: self.residuals_of(s, beta)) for series in found]

    def residuals_of(self, test: int, beta: Floats) -> list[Series]:
        """Measured minus modelled of one test, every channel. Raises `DivergedError`."""
        return self._marches[test].series(self._run(test, beta))

    def linearise(self, beta: Floats, extra: Sequence[Parameter] = ()) -> list[Columns]:
        """Residuals and columns of every test and channel. Raises `DivergedError`."""
        known = self._already(beta)
        if known is None:
            found = self._each(lambda s: self._columns(s, beta, self._marches[s].active, extra))
            parts = [part for own in found for part in own]
        else:
            size, parts = len(known[0]), known[1]
            if extra or size < beta.size:
                of_test: dict[int, list[Columns]] = {}
                for part in parts:
                    of_test.setdefault(part.series.session, []).append(part)
                found = self._each(lambda s: self._beside(of_test[s], s, size, beta, extra))
                parts = [part for own in found for part in own]
        self._known = beta.copy(), [replace(part, extra=np.empty((len(part.extra), 0))) for part in parts]
        return parts

    def forget(self) -> None:
        """Let the columns of the last linearisation go, and what runs the tests: that is most of what a model keeps.
        Both are made anew where they are asked for."""
        self._known = self._made = None

    def _already(self, beta: Floats) -> Known | None:
        """The last linearisation, if it was here with parameters since added at zero."""
        if self._known is None:
            return None
        size = len(self._known[0])
        return self._known if np.array_equal(beta[:size], self._known[0]) and not beta[size:].any() else None

    def _beside(
        self, known: Sequence[Columns], test: int, size: int, beta: Floats, extra: Sequence[Parameter]
    ) -> list[Columns]:
        """What is known of a test with the columns of the parameters from `size` on, and those of `extra`."""
        new = [p for p in self._marches[test].active if p >= size]
        found = self._columns(test, beta, new, extra)
        return [
            Columns(old.series, np.concatenate([old.at, more.at]), np.hstack([old.columns, more.columns]), more.extra)
            for old, more in zip(known, found, strict=True)
        ]

    def _columns(self, test: int, beta: Floats, at: Sequence[int], extra: Sequence[Parameter]) -> list[Columns]:
        return self._marches[test].columns(self._run(test, beta), at, extra)

    def course(self, test: int, beta: Floats) -> tuple[Floats, Floats, Floats]:
        """Temperatures at the edges (N + 1, n), step means (N, n) [degC],
        and what every term carries (N, terms) [W or W/K]."""
        ran = self._run(test, beta)
        n = len(self.network.nodes)
        return ran.edges[:, :n], ran.means[:, :n], ran.values.T

    def slowest_s(self, test: int, beta: Floats) -> float:
        """The longest time constant of the network at the mean step of a test [s], at most the length of the test."""
        march, step_s = self._run(test, beta).march, self.tests[test].frame.step_s
        middle = march.matrix.mean(axis=0)
        rate = (middle - np.diag(march.storage)) / (march.storage[:, None] * step_s / 2)
        slowest = float(np.linalg.eigvals(rate).real.min())
        test_s = len(march.means) * step_s
        return min(1.0 / slowest, test_s) if slowest > 0 else test_s

    def _run(self, test: int, beta: Floats) -> CircuitRun:
        return self._marches[test].circuit.run(beta)

    def _each(self, what: Callable[[int], T]) -> list[T]:
        """The answer for every test, worked out for two at a time, the longest first."""
        order = sorted(range(len(self.tests)), key=lambda s: -len(self.tests[s].frame.features))
        with ThreadPoolExecutor(2) as pool:
            found = dict(zip(order, pool.map(what, order), strict=True))
        return [found[s] for s in range(len(self.tests))]


class _March:
    """One test's circuit, its channels, and the heats of its own parameters, which are made once."""

    def __init__(self, network: Network, test: Test, parameters: Sequence[Parameter], number: int) -> None:
        self.circuit = Circuit(network, test, parameters, number)
        self.sensing = Sensing(self.circuit, number)
        self.active = [p for p, _ in self.circuit.active]

    @cached_property
    def _own(self) -> Heats:
        return Heats(self.circuit, [(j, action, p) for j, (p, action) in enumerate(self.circuit.active)])

    def readings(self, ran: CircuitRun) -> list[Readings]:
        return [Readings(self.sensing, ran, k) for k in range(len(self.sensing.blocks))]

    def series(self, ran: CircuitRun) -> list[Series]:
        return [one.series() for one in self.readings(ran)]

    def columns(self, ran: CircuitRun, at: Sequence[int], extra: Sequence[Parameter]) -> list[Columns]:
        """Columns of the parameters at places of the vector, and of `extra` ones at zero."""
        circuit, sensing = self.circuit, self.sensing
        action_at = dict(circuit.active)
        wanted: list[tuple[int, Action, int]] = [(j, action_at[p], p) for j, p in enumerate(at)]
        own = {None, sensing.number}
        wanted += [(len(at) + j, p.action, NOBODY) for j, p in enumerate(extra) if p.test in own]
        heats = self._own if list(at) == self.active and not extra else Heats(circuit, wanted)
        readings, total = self.readings(ran), len(at) + len(extra)
        on_channel: list[list[tuple[int, Action]]] = [[] for _ in readings]
        for j, action, _ in wanted:
            for k in sensing.read_by(action):
                on_channel[k].append((j, action))
        places = np.array(at, dtype=np.intp)
        result = []
        through = _through_temperatures(ran, readings, heats, total)
        for one, moved, others in zip(readings, through, on_channel, strict=True):
            for j, column in one.columns(others):
                moved[:, j] += column
            columns, beside = moved[:, : len(at)], moved[:, len(at) :]
            # what the model keeps must not hold the others too
            result.append(Columns(one.series(), places, columns.copy() if extra else columns, beside))
        return result


def _through_temperatures(ran: CircuitRun, readings: Sequence[Readings], heats: Heats, total: int) -> list[Floats]:
    """What the block means of each channel and meter change by through the temperatures that it reads (B, total)."""
    march, starts = ran.march, len(heats.shares)
    sensors, steps = [one.sensor for one in readings], len(march.means)
    columns = sparse_march.MarchedColumns(march.program, march.storage, sensors, heats.loads, heats.begin, steps)
    found = [np.zeros((len(one.sensing.measured[one.k]), total + starts)) for one in readings]
    places = np.append(heats.heated, total + np.arange(starts))
    for number, strip in enumerate(columns.through(march, heats.about(ran))):
        own = places[number * strip.shape[2] :][: strip.shape[2]]
        for one, moved, shown in zip(readings, found, strip, strict=True):
            moved[:, own] = one.moved(shown)[:, : len(own)]
    for moved in found:
        moved[:, heats.started] = moved[:, total:] @ heats.shares
    return [moved[:, :total] for moved in found]
