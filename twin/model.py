"""A motor, its tests and everything that may differ, as one vector: residuals and their exact columns.

The vector holds one number for each `twin.actions.Parameter`; 0 is the motor file with perfect sensors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar

import numba
import numpy as np
from numpy.typing import NDArray

from twin import actions, features
from twin.actions import Parameter
from twin.laws import Law, Table, psi
from twin.march import Mean, Push, Sensor, System, columns, means, responses, run
from twin.network import Network
from twin.noise import ChannelNoise, Series, whiten
from twin.outputs import Output, blocks, lagged
from twin.simulate import Frame
from twin.structure import Parameters, Structure, parameters, structure

Floats = NDArray[np.float64]
Index = NDArray[np.intp]
Effect = tuple[Sequence[int], Sequence[Floats | float]]
T = TypeVar("T")

BROAD = ChannelNoise(ar_sd=0.25, ar_tau_s=60.0, ou_sd=0.4, ou_tau_s=600.0)
LEAST_INPUT = 0.02  # of its scale: where an input is smaller, a bias of it moves nothing
FIRST_COURSES = 4  # runs until the course about which heats are linearised has settled
PROBE_S = 0.25  # of time, for the slope of a reading by its stamps: past the kinks at whole steps
LAG_PROBE_S = 0.05  # the same by its lag, which has none


@dataclass(frozen=True)
class Channel:
    """An observed channel of one test. `measured` (N,) [degC]: means over the steps, any value where `output.samples` is 0;
    `white_sd`, `resolution` [K] of one sample; `bias_sd` [K] constant within the test."""

    name: str
    bus: str
    output: Output
    measured: Floats
    white_sd: float
    resolution: float
    bias_sd: float


@dataclass(frozen=True)
class Test:
    """One recorded test in steps of `frame.step_s`, whole blocks only. `inputs`: feature -> (N,) dimensionless, step means;
    `features`: name of a product -> (N,) step means of it; `initial`, `initial_sd` (n,); `course`: what `Course` multiplies with;
    `start_ns` of the first step."""

    __test__ = False

    name: str
    kind: str
    frame: Frame
    inputs: Mapping[str, Floats]
    features: Mapping[str, Floats]
    initial: Floats
    initial_sd: Floats
    channels: tuple[Channel, ...]
    course: Mapping[str, float] = field(default_factory=dict)
    start_ns: int = 0


@dataclass(frozen=True)
class Columns:
    """One channel of one test about a vector: the residual's series (not whitened), `at` the places in the vector that its
    columns (B, at) d(modelled)/d(vector) belong to, and `extra` (B, c) of parameters at zero."""

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
        courses: dict[int, Floats] | None = None,
        known: Known | None = None,
    ) -> None:
        self.network = network
        self.tests = tuple(tests)
        self.parameters = tuple(parameters)
        self.noise = dict(noise or {})
        self._courses = (
            {} if courses is None else dict(courses)
        )  # where heats are linearised: the last run of each test
        self._known = known  # the last linearisation: noise does not matter to it, and more parameters only add to it
        self._marches = [_March(network, test, self.parameters, s) for s, test in enumerate(self.tests)]

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
        return Model(self.network, self.tests, self.parameters, noise, self._courses, self._known)

    def with_priors(self, parameters: Sequence[Parameter]) -> Model:
        """The same parameters with other priors."""
        return Model(self.network, self.tests, parameters, self.noise, self._courses, self._known)

    def plus(self, more: Sequence[Parameter]) -> Model:
        """The same with more parameters at the end of the vector."""
        attached = any(isinstance(p.action, actions.Attached) for p in more)
        courses, known = (None, None) if attached else (self._courses, self._known)
        return Model(self.network, self.tests, (*self.parameters, *more), self.noise, courses, known)

    def without(self, place: int) -> Model:
        """The same without one parameter."""
        kept = [p for i, p in enumerate(self.parameters) if i != place]
        return Model(self.network, self.tests, kept, self.noise)

    def whitened(self, series: Series, x: Floats) -> Floats:
        """Columns (B, k) of a channel under the model's noise."""
        return whiten(series, self.noise_of(series.channel), x)

    def noise_of(self, channel: str) -> ChannelNoise:
        return self.noise.get(channel, BROAD)

    def residuals(self, beta: Floats) -> list[Series]:
        """Measured minus modelled of every test and channel. Raises `DivergedError`."""
        return [series for found in self._each(lambda s: self._run(s, beta).series()) for series in found]

    def linearise(self, beta: Floats, extra: Sequence[Parameter] = ()) -> list[Columns]:
        """Residuals and columns of every test and channel. Raises `DivergedError`."""
        known = self._already(beta)
        if known is None:
            found = self._each(lambda s: self._run(s, beta, settle=True).columns(self._marches[s].active, extra))
            parts = [part for own in found for part in own]
        else:
            size, parts = len(known[0]), known[1]
            if extra or size < beta.size:
                of_test: dict[int, list[Columns]] = {}
                for part in parts:
                    of_test.setdefault(part.series.session, []).append(part)
                found = self._each(lambda s: self._beside(of_test[s], s, size, beta, extra))
                parts = [part for own in found for part in own]
        self._known = beta.copy(), [replace(part, extra=part.extra[:, :0]) for part in parts]
        return parts

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
        found = self._run(test, beta, settle=True).columns(new, extra)
        return [
            Columns(old.series, np.concatenate([old.at, more.at]), np.hstack([old.columns, more.columns]), more.extra)
            for old, more in zip(known, found, strict=True)
        ]

    def course(self, test: int, beta: Floats) -> tuple[Floats, Floats, Floats]:
        """Temperatures at the edges (N + 1, n), step means (N, n) [degC] and heat of every term (N, terms) at 1 K per K."""
        ran = self._run(test, beta)
        n = len(self.network.nodes)
        return ran.edges[:, :n], ran.means[:, :n], ran.values

    def slowest_s(self, test: int, beta: Floats) -> float:
        """The longest time constant of the network at the mean step of a test [s], at most the length of the test."""
        system = self._run(test, beta).system
        middle = np.linalg.inv(system.inverse).mean(axis=0)
        rate = (middle - np.diag(system.storage)) / (system.storage[:, None] * self.tests[test].frame.step_s / 2)
        slowest = float(np.linalg.eigvals(rate).real.min())
        test_s = float(system.heat.shape[1] * self.tests[test].frame.step_s)
        return min(1.0 / slowest, test_s) if slowest > 0 else test_s

    def _run(self, test: int, beta: Floats, settle: bool = False) -> _Run:
        march = self._marches[test]
        course = self._courses.get(test)
        first = course is None
        if course is None:
            course = np.tile(march.start(beta), (len(march.test.frame.features), 1))
        for _ in range(FIRST_COURSES if first else 2 if settle else 1):
            ran = march.run(beta, course)
            moved = float(np.abs(ran.means - course).max())
            course = ran.means
            if ran.affine or moved < 1e-3:
                break
        if first or settle:
            self._courses[test] = course
        return ran

    def _each(self, what: Callable[[int], T]) -> list[T]:
        """Of every test, two at a time, the longest first."""
        order = sorted(range(len(self.tests)), key=lambda s: -len(self.tests[s].frame.features))
        with ThreadPoolExecutor(2) as pool:
            found = dict(zip(order, pool.map(what, order), strict=True))
        return [found[s] for s in range(len(self.tests))]


class _March:
    """One test: everything that does not depend on the vector."""

    def __init__(self, network: Network, test: Test, numbers: Sequence[Parameter], number: int) -> None:
        self.network, self.test, self.parameters, self.number = network, test, numbers, number
        self.active = [p for p, one in enumerate(numbers) if one.test in (None, number)]
        self.n = len(network.nodes)
        self.followers = [
            (p, node, one.action.lag_s)
            for p, one in enumerate(numbers)
            if isinstance(one.action, actions.Attached)
            for node in one.action.nodes
        ]
        self.values: Parameters = parameters(network)
        self.structure: Structure = structure(network)
        terms = list(features.terms(network))
        self.exponents = [features.monomial(term).exponents for term in terms]
        own = {m.name: test.frame.features[:, j] for j, m in enumerate(features.monomials(network))}
        ones = np.ones(len(test.frame.features))
        # a term's values lie side by side, here and in all that is made of it
        self.base = np.array([term.coefficient * own.get(features.monomial(term).name, ones) for term in terms]).T
        self._effects: dict[actions.OnTerms, Effect] = {}
        self.laws: list[Law] = []
        self.members: list[list[int]] = []  # terms of each law
        for g, group in enumerate(self.structure.groups):
            self.laws.append(self.placed(Law.of(group, self.values, g)))
            self.members.append([i for i, _ in group.terms])
        self.law_of = {term: g for g, members in enumerate(self.members) for term in members}
        step_s = test.frame.step_s
        self.edges_s: Floats = np.arange(len(ones) + 1, dtype=np.float64) * step_s
        self.blocks = [blocks(channel.output, step_s) for channel in test.channels]
        self.weights = [self._weights(channel) for channel in test.channels]
        self.measured = [b.measured(c.measured) for b, c in zip(self.blocks, test.channels, strict=True)]
        self.on_reading: dict[str, list[tuple[int, actions.OnReading]]] = {c.name: [] for c in test.channels}
        for p in self.active:
            action = numbers[p].action
            if isinstance(action, actions.OnReading):
                for channel in _read_by(action):
                    if channel in self.on_reading:
                        self.on_reading[channel].append((p, action))

    @property
    def states(self) -> int:
        """Nodes, then masses that follow them."""
        return self.n + len(self.followers)

    def placed(self, law: Law) -> Law:
        """With boundaries behind all states."""
        return replace(law, b=law.b + len(self.followers)) if law.b >= self.n else law

    def place(self, place: actions.Place, own: int = 0, tilt: float | None = None) -> Law:
        return self.placed(Law(place.a, place.b, own, tilt=tilt))

    def _weights(self, channel: Channel) -> Floats:
        names = [node.name for node in self.network.nodes]
        weights = np.zeros(self.states)
        for node, share in channel.output.weights.items():
            weights[names.index(node)] += share
        return weights

    def towards(self, k: int, node: int) -> Floats:
        """What the weights (states,) of channel k change by for each share of a node beside its place."""
        change = -self.weights[k]
        change[node] += 1.0
        return change

    def start(self, beta: Floats) -> Floats:
        """Temperatures at the start (states,)."""
        found = np.concatenate([self.test.initial, [self.test.initial[node] for _, node, _ in self.followers]])
        for p in self.active:
            if isinstance(action := self.parameters[p].action, actions.Start):
                for state in self.moved_by_start(action.node):
                    found[state] += beta[p]
        return found

    def moved_by_start(self, node: int) -> list[int]:
        return [node, *(self.n + i for i, (_, follows, _) in enumerate(self.followers) if follows == node)]

    def effect(self, action: actions.OnTerms) -> Effect:
        """The terms that an action multiplies, and for each the change of ln factor (of the factor, in a tent) per p."""
        if action not in self._effects:
            self._effects[action] = self._effect(action)
        return self._effects[action]

    def _effect(self, action: actions.OnTerms) -> Effect:
        inputs = self.test.inputs
        match action:
            case actions.Scale(terms):
                return terms, [1.0] * len(terms)
            case actions.Power(terms, feature):
                ln = np.log(np.maximum(inputs[feature], LEAST_INPUT))
                return terms, [ln] * len(terms)
            case actions.Tent(terms, speeds, knot, current):
                unit = np.zeros(len(speeds))
                unit[knot] = 1.0
                hat = np.interp(inputs["speed"], speeds, unit)
                return terms, [hat * inputs["current"] if current else hat] * len(terms)
            case actions.Course(terms, by):
                return terms, [self.test.course.get(by, 0.0)] * len(terms)
            case actions.InputGain(name):
                terms = tuple(i for i, e in enumerate(self.exponents) if name in e)
                return terms, [-self.exponents[i][name] for i in terms]
            case actions.InputBias(name, scale):
                terms = tuple(i for i, e in enumerate(self.exponents) if name in e)
                slope = np.where(inputs[name] > LEAST_INPUT, 1 / (scale * np.maximum(inputs[name], LEAST_INPUT)), 0.0)
                return terms, [-self.exponents[i][name] * slope for i in terms]

    def term_values(self, beta: Floats) -> tuple[Floats, Floats]:
        """Every term (N, T) [W or W/K], and the factor of its tents (N, T)."""
        log = np.zeros_like(self.base)
        tents = np.ones_like(self.base)
        for p in self.active:
            action = self.parameters[p].action
            if isinstance(action, actions.OnTerms) and beta[p]:
                terms, weights = self.effect(action)
                into = tents if isinstance(action, actions.Tent) else log
                for i, w in zip(terms, weights, strict=True):
                    into[:, i] += beta[p] * w
        tents = np.maximum(tents, 0.05)
        return self.base * np.exp(log) * tents, tents

    def run(self, beta: Floats, course: Floats) -> _Run:
        """One run, heats linearised about a course (N, states)."""
        prompt, tents = self.term_values(beta)
        late = self.common_late_s(beta)
        values = self.delayed(prompt, late)
        laws = list(self.laws)
        carried = [values[:, members].sum(axis=1) for members in self.members]
        capacity = np.concatenate([self.values.capacities, np.ones(len(self.followers))])
        boundaries = self.delayed(self.test.frame.boundaries, late).copy()
        ones = np.ones(len(values))
        for i, (p, node, lag_s) in enumerate(self.followers):
            laws += [Law(node, self.n + i, one_way=True), Law(self.n + i, node, one_way=True)]
            carried += [beta[p] / lag_s * ones, ones / lag_s]
        for p in self.active:
            if not beta[p]:
                continue
            match self.parameters[p].action:
                case actions.Added(places, feature, rms, own):
                    laws += [self.place(place, own) for place in places]
                    carried += [beta[p] / rms * self.delayed(self.feature(feature)[:, None], late)[:, 0]] * len(places)
                case actions.Tilt(places, terms, references):
                    for place, own_terms, reference in zip(places, terms, references, strict=True):
                        laws.append(self.place(place, tilt=reference))
                        carried.append(beta[p] * values[:, list(own_terms)].sum(axis=1))
                case actions.Capacity(nodes):
                    capacity[list(nodes)] *= np.exp(beta[p])
                case actions.BoundaryBias(boundary):
                    boundaries[:, boundary] -= beta[p]
        table = Table.of(laws, self.network.copper)
        system = System.of(table, np.array(carried), capacity, self.test.frame.step_s, course, boundaries)
        edges, found = run(system, self.start(beta))
        return _Run(self, beta, prompt, prompt / tents, late, values, laws, carried, system, boundaries, edges, found)

    def is_common(self, action: actions.Action) -> bool:
        """Whether the stamps of every channel are late alike: then the drive is delayed instead, which is exact for columns."""
        if not isinstance(action, actions.Late) or action.drifts:
            return False
        return {channel.name for channel in self.test.channels} <= set(action.channels)

    def common_late_s(self, beta: Floats) -> float:
        found = [(p, self.parameters[p].action) for p in self.active]
        return sum(a.sign * float(beta[p]) for p, a in found if isinstance(a, actions.Late) and self.is_common(a))

    def delayed(self, x: Floats, late_s: float) -> Floats:
        """Step means (N, k) of what happened `late_s` before, a part of a step as a mixture of two."""
        return x if late_s == 0 else _delayed(x, late_s / self.test.frame.step_s)

    def delayed_slope(self, x: Floats, late_s: float) -> Floats:
        """d `delayed` / d late_s, at whole steps the mean of both sides."""
        step_s = self.test.frame.step_s
        probe = PROBE_S / step_s
        slope: Floats = (_delayed(x, late_s / step_s + probe) - _delayed(x, late_s / step_s - probe)) / (2 * PROBE_S)
        return slope

    def feature(self, name: str) -> Floats:
        """A product of features (N,) by its name."""
        return np.ones(len(self.base)) if name == "constant" else self.test.features[name]


@dataclass(frozen=True)
class _Run:
    """One run of one test at a vector. `prompt` (N, T): terms before they are delayed by `late_s`, `untented` without their tents; `values`
    (N, T) as they act; `carried`: what each law carries (N,)."""

    march: _March
    beta: Floats
    prompt: Floats
    untented: Floats
    late_s: float
    values: Floats
    laws: list[Law]
    carried: list[Floats]
    system: System
    boundaries: Floats
    edges: Floats
    means: Floats

    @property
    def affine(self) -> bool:
        """Whether every heat is linear in temperature, so that the course it was linearised about does not matter."""
        return all(law.affine for law in self.laws)

    # --- Readings -----------------------------------------------------------------------------------------------------------

    def on_channel(self, channel: Channel, kind: type) -> list[tuple[int, Any]]:
        """The active parameters of a kind that belong to a channel."""
        return [(p, action) for p, action in self.march.on_reading[channel.name] if isinstance(action, kind)]

    def lag_s(self, channel: Channel) -> float:
        extra = sum(self.beta[p] for p, _ in self.on_channel(channel, actions.Lag))
        return max(0.0, channel.output.time_constant_s + float(extra))

    def weights(self, k: int) -> Floats:
        """Of the states (states,) in what channel k follows."""
        found = self.march.weights[k]
        for p, action in self.on_channel(self.march.test.channels[k], actions.Beside):
            found = found + self.beta[p] * self.march.towards(k, action.node)
        return found

    def reading(self, k: int, lag_s: float) -> Floats:
        """What the sensor itself follows (N + 1,)."""
        return lagged(self.edges @ self.weights(k), lag_s, self.march.test.frame.step_s)

    def stamps_late_s(self, channel: Channel) -> Floats:
        """How late the channel's stamps are (N + 1,) [s]."""
        late: Floats = np.zeros_like(self.march.edges_s)
        for p, action in self.on_channel(channel, actions.Late):
            if not self.march.is_common(action):
                late = late + action.sign * float(self.beta[p]) * self.late_by(action)
        return late

    def late_by(self, action: actions.Late) -> Floats:
        """Lateness (N + 1,) [s] for each unit of the parameter."""
        if action.drifts:
            return self.march.edges_s * 1e-6
        return np.ones(len(self.march.edges_s))

    def means_of(self, k: int, edges: Floats) -> Floats:
        found: Floats = self.march.blocks[k].means(edges)
        return found

    def stamped(self, k: int, edges: Floats, late_s: Floats) -> Floats:
        """Block means of readings whose stamps are late."""
        if np.any(late_s):
            edges = np.interp(self.march.edges_s - late_s, self.march.edges_s, edges)
        return self.means_of(k, edges)

    def factor(self, channel: Channel) -> float:
        """What the truth is multiplied with: gain, less what a stem gives away."""
        gain = sum(self.beta[p] for p, _ in self.on_channel(channel, actions.Gain))
        stem = sum(self.beta[p] for p, _ in self.on_channel(channel, actions.Stem))
        return 1.0 + float(gain) - float(stem)

    def modelled(self, k: int) -> Floats:
        """Block means that the channel would show."""
        channel = self.march.test.channels[k]
        return self.stamped(k, self.shown(k, self.lag_s(channel)), self.stamps_late_s(channel))

    def shown(self, k: int, lag_s: float) -> Floats:
        """What the channel shows (N + 1,), its stamps aside."""
        channel, beta = self.march.test.channels[k], self.beta
        reading = self.factor(channel) * self.reading(k, lag_s)
        for p, action in self.on_channel(channel, actions.Stem):
            reading = reading + beta[p] * self.ambient(action)
        for p, _ in self.on_channel(channel, actions.Drift):
            reading = reading + beta[p] * self.march.edges_s / 3600
        biased: Floats = reading + sum(float(beta[p]) for p, _ in self.on_channel(channel, actions.Bias))
        return biased

    def ambient(self, action: actions.Stem) -> Floats:
        around = self.boundaries[:, action.ambient]
        return np.append(around, around[-1])

    def series(self) -> list[Series]:
        return [self._series(k) for k in range(len(self.march.test.channels))]

    def _series(self, k: int) -> Series:
        channel, cut = self.march.test.channels[k], self.march.blocks[k]
        return Series(
            session=self.march.number,
            channel=channel.name,
            t_s=cut.times_s(self.march.test.frame.step_s),
            y=self.march.measured[k] - self.modelled(k),
            samples=cut.samples,
            white_sd=channel.white_sd,
            resolution=channel.resolution,
        )

    # --- Columns ------------------------------------------------------------------------------------------------------------

    def columns(self, at: Sequence[int], extra: Sequence[Parameter]) -> list[Columns]:
        """Of the parameters at these places of the vector, and of others at zero."""
        march = self.march
        wanted = [*(march.parameters[p].action for p in at), *(p.action for p in extra)]
        mine = [True] * len(at) + [p.test in (None, march.number) for p in extra]
        heats = _Heats(self, wanted, mine, len(at))
        sensors: list[Sensor] = []
        wanted_means: list[Mean] = []
        cuts: list[slice] = []
        step_s = march.test.frame.step_s
        for k, channel in enumerate(march.test.channels):
            sensors.append(Sensor(self.weights(k), self.lag_s(channel)))
            own_means = means(k, march.blocks[k], self.stamps_late_s(channel) / step_s)
            cuts.append(slice(len(wanted_means), len(wanted_means) + len(own_means)))
            wanted_means += own_means
        found = responses(self.system, sensors, wanted_means, march.blocks[0].length, step_s)
        state = columns(found, heats.laws, heats.psi, heats.pushes, heats.starts, len(wanted))
        result = []
        for k, channel in enumerate(march.test.channels):
            moved = self.factor(channel) * state[cuts[k]].sum(axis=0)[march.blocks[k].there]
            for j, action in enumerate(wanted):
                if (
                    mine[j]
                    and isinstance(action, actions.OnReading | actions.BoundaryBias)
                    and not march.is_common(action)
                ):
                    column = self._on_reading(k, channel, action)
                    if column is not None:
                        moved[:, j] += column
            at_ = np.array(at, dtype=np.intp)
            result.append(Columns(self._series(k), at_, moved[:, : len(at)], moved[:, len(at) :]))
        return result

    def _on_reading(self, k: int, channel: Channel, action: actions.OnReading | actions.BoundaryBias) -> Floats | None:
        """What the reading changes by where the temperatures do not, or None."""
        late = self.stamps_late_s(channel)
        if isinstance(action, actions.BoundaryBias):
            stems = [p for p, stem in self.on_channel(channel, actions.Stem) if stem.ambient == action.boundary]
            return np.full(len(self.march.measured[k]), -float(self.beta[stems].sum())) if stems else None
        if channel.name not in _read_by(action):
            return None
        lag_s = self.lag_s(channel)
        match action:
            case actions.Bias():
                return np.ones(len(self.march.measured[k]))
            case actions.Gain():
                return self.stamped(k, self.reading(k, lag_s), late)
            case actions.Drift():
                return self.stamped(k, self.march.edges_s / 3600, late)
            case actions.Stem():
                return self.stamped(k, self.ambient(action) - self.reading(k, lag_s), late)
            case actions.Beside(_, node):
                moved = lagged(self.edges @ self.march.towards(k, node), lag_s, self.march.test.frame.step_s)
                return self.stamped(k, self.factor(channel) * moved, late)
            case actions.Lag():
                low, high = max(0.0, lag_s - LAG_PROBE_S), lag_s + LAG_PROBE_S
                changed = self.reading(k, high) - self.reading(k, low)
                return self.stamped(k, self.factor(channel) * changed / (high - low), late)
            case actions.Late(_, _, sign):
                shown, by = self.shown(k, lag_s), self.late_by(action)
                after, before = (self.stamped(k, shown, late + way * PROBE_S * by) for way in (1.0, -1.0))
                return sign * (after - before) / (2 * PROBE_S)


def _read_by(action: actions.OnReading) -> tuple[str, ...]:
    """The channels that an action is about."""
    return action.channels if isinstance(action, actions.Late) else (action.channel,)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _delayed_rows(x: Floats, steps: float, out: Floats) -> None:
    last = x.shape[1] - 1
    whole = int(np.floor(-steps))
    share = -steps - whole
    for i in range(len(x)):
        for k in range(last + 1):
            low = k + whole
            out[i, k] = (1 - share) * x[i, min(max(low, 0), last)] + share * x[i, min(max(low + 1, 0), last)]


def _delayed(x: Floats, steps: float) -> Floats:
    """(N, k) so many steps late; the first and the last value hold beyond the ends."""
    rows = np.ascontiguousarray(x.T)
    out = np.empty_like(rows)
    _delayed_rows(rows, steps, out)
    return out.T


class _Heats:
    """Parameters as heats through laws: what `twin.march.columns` takes."""

    def __init__(self, ran: _Run, wanted: Sequence[actions.Action], mine: Sequence[bool], own: int) -> None:
        self.ran, self.march = ran, ran.march
        self.laws = list(ran.laws)
        self.psi: list[Floats] = []
        self._by_boundary: list[Floats] = []
        self._evaluate(self.laws)
        self._index = {law: i for i, law in reversed(list(enumerate(self.laws)))}
        self.pushes: dict[int, list[Push]] = {}
        self.starts: dict[int, list[int]] = {}
        self._tilts = self._active_tilts()
        for j, action in enumerate(wanted):
            if mine[j]:
                self._add(j, action, j < own)

    def _law(self, law: Law) -> int:
        if law not in self._index:
            self._index[law] = len(self.laws)
            self.laws.append(law)
            self._evaluate([law])
        return self._index[law]

    def _evaluate(self, laws: Sequence[Law]) -> None:
        values, slopes = psi(laws, self.march.network.copper, self.ran.means, self.ran.boundaries)
        self.psi += list(values)
        self._by_boundary += list(slopes)

    def _active_tilts(self) -> list[tuple[int, int, set[int]]]:
        """(parameter, law, terms) of every slope with temperature that is not 0."""
        found = []
        for p in self.march.active:
            action = self.march.parameters[p].action
            if isinstance(action, actions.Tilt) and self.ran.beta[p]:
                for place, terms, reference in zip(action.places, action.terms, action.references, strict=True):
                    found.append((p, self._law(self.march.place(place, tilt=reference)), set(terms)))
        return found

    def _add(self, j: int, action: actions.Action, own: bool) -> None:
        ran, march = self.ran, self.march
        match action:
            case actions.Added(places, feature, rms, copper):
                weight = self._delayed(march.feature(feature)) / rms
                self.pushes[j] = [Push(self._law(march.place(place, copper)), weight) for place in places]
            case actions.Tilt(places, terms, references):
                self.pushes[j] = [
                    Push(self._law(march.place(place, tilt=reference)), ran.values[:, list(members)].sum(axis=1))
                    for place, members, reference in zip(places, terms, references, strict=True)
                ]
            case actions.Capacity(nodes):
                stored = ran.system.storage * (ran.means - ran.edges[:-1])
                self.pushes[j] = [Push(self._plain(node), -stored[:, node]) for node in nodes]
            case actions.Attached(nodes, lag_s):
                if own:
                    ones = np.full(len(ran.means), 1 / lag_s)
                    at = [i for i, (p, _, _) in enumerate(march.followers) if march.parameters[p].action == action]
                    self.pushes[j] = [
                        Push(self._law(Law(march.followers[i][1], march.n + i, one_way=True)), ones) for i in at
                    ]
                else:
                    self.pushes[j] = [Push(self._plain(node), self._following(node, lag_s)) for node in nodes]
            case actions.Start(node):
                self.starts[j] = march.moved_by_start(node)
            case actions.BoundaryBias(boundary):
                self.pushes[j] = self._boundary(boundary)
            case actions.FreeHeat(node, time_s, spacing_s):
                middle = march.edges_s[:-1] + march.test.frame.step_s / 2
                self.pushes[j] = [Push(self._plain(node), np.maximum(0.0, 1 - np.abs(middle - time_s) / spacing_s))]
            case actions.Late(_, _, sign) if march.is_common(action):
                self.pushes[j] = self._delay(sign)
            case _ if isinstance(action, actions.OnTerms):
                self.pushes[j] = self._on_terms(action)

    def _on_terms(self, action: actions.OnTerms) -> list[Push]:
        terms, weights = self.march.effect(action)
        changes: dict[int, Floats] = {}
        for i, w in zip(terms, weights, strict=True):
            if isinstance(action, actions.Tent):
                change = self._delayed(self.ran.untented[:, i] * w)
            elif np.ndim(w):
                change = self._delayed(self.ran.prompt[:, i] * w)
            else:
                change = self.ran.values[:, i] * w
            laws = [(self.march.law_of[i], 1.0)]
            laws += [(law, float(self.ran.beta[p])) for p, law, members in self._tilts if i in members]
            for law, share in laws:
                changes[law] = changes.get(law, 0.0) + share * change
        return [Push(law, change) for law, change in changes.items()]

    def _delayed(self, x: Floats) -> Floats:
        return self.march.delayed(x[:, None], self.ran.late_s)[:, 0]

    def _delay(self, sign: float) -> list[Push]:
        """The drive a second later: of every law that a feature of the test drives, and of the boundaries."""
        ran, march = self.ran, self.march
        moved = sign * march.delayed_slope(ran.prompt, ran.late_s)
        found = [Push(law, moved[:, members].sum(axis=1)) for law, members in enumerate(march.members)]
        for p, law, members in self._tilts:
            found.append(Push(law, float(ran.beta[p]) * moved[:, sorted(members)].sum(axis=1)))
        for p in march.active:
            action = march.parameters[p].action
            if isinstance(action, actions.Added) and ran.beta[p] and action.feature != "constant":
                slope = march.delayed_slope(march.feature(action.feature)[:, None], ran.late_s)[:, 0]
                weight = sign * float(ran.beta[p]) / action.rms * slope
                found += [Push(self._law(march.place(place, action.own)), weight) for place in action.places]
        outside = sign * march.delayed_slope(march.test.frame.boundaries, ran.late_s)
        for boundary in range(outside.shape[1]):
            found += [replace(p, weight=-p.weight * outside[:, boundary]) for p in self._boundary(boundary)]
        return found

    def _following(self, node: int, lag_s: float) -> Floats:
        """Heat into a node of 1 J/K that follows it (N,) [W]."""
        behind = lagged(self.ran.edges[:, node], lag_s, self.march.test.frame.step_s) - self.ran.edges[:, node]
        heat: Floats = (behind[:-1] + behind[1:]) / (2 * lag_s)
        return heat

    def _boundary(self, boundary: int) -> list[Push]:
        """A kelvin less outside, through every law that ends there."""
        end = self.march.states + boundary
        return [
            Push(self._plain(law.a), -carried * self._by_boundary[i])
            for i, (law, carried) in enumerate(zip(self.ran.laws, self.ran.carried, strict=True))
            if law.b == end
        ]

    def _plain(self, node: int) -> int:
        return self._law(Law(node))
