"""The thermal circuit of one test under parameters: its states, its laws and what each carries, and its runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from twin.compiled.indexed import program
from twin.compiled.integrators import DEFAULT
from twin.compiled.laws import Law, Table
from twin.compiled.structure import Group, Parameters, Structure, described
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.drive import Drive
from twin.fitting.recorded import Test
from twin.fitting.rows import Product, Products
from twin.motor.heat_laws import source_law
from twin.motor.network import NOBODY, Network
from twin.motor.sensor import Sensor
from twin.motor.sensor_laws import AMBIENT, SENSOR_LAWS, Misreading, Seen
from twin.run import sparse_march

Floats = NDArray[np.float64]


class Circuit:
    """Everything about a test that does not depend on the vector. States: the network's nodes, then masses that follow
    them; boundaries are behind all states. `active`: (place in the vector, action) of what acts in this test."""

    def __init__(self, network: Network, test: Test, numbers: Sequence[Parameter], number: int) -> None:
        self.network, self.test, self.step_s = network, test, test.frame.step_s
        self.active = [(p, one.action) for p, one in enumerate(numbers) if one.test in (None, number)]
        self.n, self.steps = len(network.nodes), len(test.frame.features)
        self.followers = [
            (p, node, one.action.lag_s)
            for p, one in enumerate(numbers)
            if isinstance(one.action, actions.Attached)
            for node in one.action.nodes
        ]
        self.states = self.n + len(self.followers)
        nodes = [node.name for node in network.nodes]
        self.names = [*nodes, *(f"the mass behind {nodes[node]}" for _, node, _ in self.followers)]
        self.edges_s: Floats = np.arange(self.steps + 1, dtype=np.float64) * self.step_s
        self.drive = Drive(network, test, self.active)
        shape, values = described(network)
        self._laws: dict[Law, int] = {}
        members = [
            (self._law(self.placed(Law.of(group, values, g))), group.terms) for g, group in enumerate(shape.groups)
        ]
        self.law_of = [law for _, law in sorted((i, law) for law, terms in members for i, _ in terms)]
        self._carry()
        self.laws = tuple(self._laws)
        self.table = Table.of(self.laws, network.copper)
        self._values = Parameters(
            coefficients=np.ones(len(self.laws)),  # of what each law carries, as it comes step by step
            capacities=np.concatenate([values.capacities, np.ones(len(self.followers))]),
            copper=values.copper,
            factors=np.array([(law.slope, law.reference) for law in self.laws]).reshape(-1, 2),
        )
        groups = [
            Group(law.a, law.b, ((i, i),), law.law, law.other, law.one_way, law.fluid)
            for i, law in enumerate(self.laws)
        ]
        self._program = program(Structure.of(self.states, len(groups), tuple(groups)), DEFAULT)

    def _carry(self) -> None:
        """Find which terms and products of features each law carries, and which terms a slope with temperature."""
        terms: list[Product] = [Product(law, 1.0, i) for i, law in enumerate(self.law_of)]
        tilts: list[Product] = []
        rows: list[Product] = []
        for i, (p, node, lag_s) in enumerate(self.followers):
            rows.append(Product(self._law(Law(node, self.n + i, one_way=True)), 1 / lag_s, 0, parameter=p))
            rows.append(Product(self._law(Law(self.n + i, node, one_way=True)), 1 / lag_s, 0))
        for p, action in self.active:
            match action:
                case actions.Added(places, feature, rms, own):
                    row, factor = self.drive.feature(feature, rms)
                    laws = [self._law(self.place(place, own)) for place in places]
                    rows += [Product(law, factor, row, parameter=p) for law in laws]
                case actions.HeatTent() | actions.HeatMap():
                    law = self._law(self.place(actions.Place(action.node)))
                    rows.append(Product(law, 1.0, self.drive.free_heat(action), parameter=p))
                case actions.Tilt(places, members, references):
                    for place, own_terms, reference in zip(places, members, references, strict=True):
                        sloped = [(self._law(law), share) for law, share in self.sloped(place, reference)]
                        tilts += [Product(law, share, i, parameter=p) for law, share in sloped for i in own_terms]
        self.of_terms, self.of_features = Products.of(terms + tilts), Products.of(rows)
        turned = [Product(one.first, one.weight, one.to, parameter=one.parameter) for one in tilts]
        self.tilts = Products.of(turned)  # what each term's own law carries more

    def _law(self, law: Law) -> int:
        return self._laws.setdefault(law, len(self._laws))

    def placed(self, law: Law) -> Law:
        """The law with its boundary's index behind all states: masses stand between nodes and boundaries."""
        return replace(law, b=law.b + len(self.followers)) if law.b >= self.n else law

    def place(self, place: actions.Place, own: int = 0) -> Law:
        law = source_law(own) if place.b == NOBODY else "linear"
        return self.placed(Law(place.a, place.b, law))

    def sloped(self, place: actions.Place, reference: float) -> list[tuple[Law, float]]:
        """The laws, and their shares, that carry T - reference times what a plain law does, T of the node or the mean
        of the link's ends. T - r is the temperature factor 1 + (T - (r + 1 K)) / K."""
        law = self.place(place)
        ends = [law.a] if law.b == NOBODY else [law.a, law.b]
        return [(replace(law, other=end, slope=1.0, reference=reference + 1.0), 1.0 / len(ends)) for end in ends]

    def weights(self, sensor: Sensor) -> Floats:
        """The share (states,) of each state in what a sensor follows: none of a mass."""
        return np.append(sensor.over([node.name for node in self.network.nodes]), np.zeros(len(self.followers)))

    def start(self, beta: Floats) -> Floats:
        """Temperatures at the start (states,)."""
        found = np.concatenate([self.test.initial, [self.test.initial[node] for _, node, _ in self.followers]])
        for p, moved in self._starts:
            found += beta[p] * moved
        return found

    @cached_property
    def _starts(self) -> list[tuple[int, Floats]]:
        """The places in the vector of what moves the start, and what a number of 1 adds to it (states,)."""
        moved = [(p, self.start_moved_by(action)) for p, action in self.active]
        return [(p, start) for p, start in moved if start is not None]

    def start_moved_by(self, action: actions.Action) -> Floats | None:
        """What a number of 1 adds to the start (states,); None where the action leaves it. A start that was measured is
        as wrong as its sensor: where that reads too much, the motor is colder. To first order, about the `initial`
        temperatures."""
        match action:
            case actions.Start(node):
                nodes = np.zeros(self.n)
                nodes[node] = 1.0
            case Misreading(channel) | actions.Beside(channel) if channel in self.test.begins:
                nodes = -self._reads_more(action) * self.test.begins[channel]
            case _:
                return None
        return np.append(nodes, [nodes[follows] for _, follows, _ in self.followers])

    def _reads_more(self, action: Misreading | actions.Beside) -> float:
        """What a number of 1 adds to the first reading of the action's channel [K]."""
        sensor = next(c.sensor for c in self.test.channels if c.name == action.channel)
        followed = float(self.weights(sensor)[: self.n] @ self.test.initial)
        if isinstance(action, actions.Beside):
            return float(self.test.initial[action.node]) - followed
        more = action.of_truth * followed
        first = Seen(np.array([followed]), np.zeros(1), {name: u[:1] for name, u in self.magnitudes.items()})
        if action.of_ambient:
            around = [boundary.name for boundary in self.network.boundaries].index(AMBIENT)
            more += action.of_ambient * float(self.test.frame.boundaries[0, around])
        return more + float(np.ravel(action.adds(1.0, first))[0])

    @cached_property
    def magnitudes(self) -> dict[str, Floats]:
        """The inputs that a reading may go with, at the edges of the steps (N + 1,) in their stored units."""
        laws = [law for law in SENSOR_LAWS if issubclass(law, Misreading)]
        found = {}
        for name in {law.of_input for law in laws} & self.test.inputs.keys():
            held = np.abs(self.test.inputs[name]) * self.network.scale[name]
            found[name] = np.concatenate([held[:1], (held[:-1] + held[1:]) / 2, held[-1:]])
        return found

    def run(self, beta: Floats) -> CircuitRun:
        """One run. Raises `DivergedError`."""
        drive = self.drive
        prompt, tents = drive.terms(beta)
        late_s = drive.late_s(beta)
        values = drive.delayed(prompt, late_s)
        carried = np.zeros((len(self.laws), self.steps))
        self.of_terms.add(carried, values, drive.one, beta)
        self.of_features.add(carried, drive.delayed(drive.features.values, late_s), drive.one, beta)
        capacity, boundaries = (
            self._values.capacities.copy(),
            drive.delayed(self.test.frame.boundaries.T, late_s).T.copy(),
        )
        for p, action in self.active:
            match action:
                case actions.Capacity(nodes):
                    capacity[list(nodes)] *= np.exp(beta[p])
                case actions.BoundaryBias(boundary):
                    boundaries[:, boundary] -= beta[p]
        acting = {int(i) for own in (self.of_terms, self.of_features) for i in own.to[own.weights(beta) != 0]}
        affine = all(self.laws[i].affine for i in acting)
        physics = replace(self._values, capacities=capacity)
        start = self.start(beta)
        ran = sparse_march.run(self._program, affine, physics, self.step_s, carried.T, boundaries, start, self.names)
        return CircuitRun(beta, prompt, tents, late_s, values, carried, boundaries, ran)


@dataclass(frozen=True)
class CircuitRun:
    """One run of one test at a vector. `prompt` (T, N): terms before they are delayed by `late_s`, `tents` the factors
    of their tents; `values` (T, N) as they act; `carried` (L, N): what each law carries."""

    beta: Floats
    prompt: Floats
    tents: Floats
    late_s: float
    values: Floats
    carried: Floats
    boundaries: Floats
    march: sparse_march.MarchRun

    @property
    def edges(self) -> Floats:
        """Temperatures at the edges of the steps (N + 1, states) [degC]."""
        return self.march.edges

    @property
    def means(self) -> Floats:
        """Mean temperatures of the steps (N, states) [degC]."""
        return self.march.means
