"""Parameters as heats through laws: what a change of each brings into every node in every step."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal, assert_never

import numpy as np
from numpy.typing import NDArray

from twin.compiled.laws import Law, Table, psi
from twin.fitting import actions
from twin.fitting.actions import Action
from twin.fitting.circuit import Circuit, CircuitRun
from twin.fitting.rows import Product, Products, parts_of_delay, shifted
from twin.motor.network import NOBODY
from twin.motor.outputs import lagged
from twin.run.sparse_march import Loads

Floats = NDArray[np.float64]
Kind = Literal[
    "terms", "tents", "features", "tilts", "stored", "following", "bounds", "late", "late features", "late bounds"
]


class Heats:
    """What the actions `wanted` (column, action, place in the circuit's own vector or NOBODY) bring into the circuit as
    heats and change of its start: made once, for any vector.

    `heated` (H,): columns that bring heat, in rising order; the `loads` count them, and leave others out. `started`
    (S,): those that change the start alone; each is a mixture, by `shares` (K, S), of K starts that are marched for all
    of them."""

    def __init__(self, circuit: Circuit, wanted: Sequence[tuple[int, Action, int]]) -> None:
        self.circuit = circuit
        self._starts: dict[int, Floats] = {}  # column -> what it adds to the start (states,)
        self._laws = {law: i for i, law in enumerate(circuit.laws)}
        self._rows: dict[tuple[int, int, int], int] = {}  # into, out of, column -> row of the loads
        self._entries: dict[Kind, list[Product]] = {}
        self._followers: list[tuple[int, float]] = []
        for column, action, place in wanted:
            self._enter(column, action, place)
        self._products = {kind: Products.of(entries) for kind, entries in self._entries.items()}
        a, b, changed = np.array(list(self._rows), dtype=np.int64).reshape(-1, 3).T
        self.heated = np.unique(changed)
        self.loads = Loads(a, b, np.searchsorted(self.heated, changed).astype(np.int64))
        self.started = np.array(list(self._starts), dtype=np.int64)
        own: Floats = np.array(list(self._starts.values())).reshape(-1, circuit.states).T
        few = own.shape[1] < circuit.states
        self._marched: Floats = own if few else np.eye(circuit.states)
        self.shares: Floats = np.eye(own.shape[1]) if few else own
        self._table = Table.of(tuple(self._laws), circuit.network.copper)

    def _row(self, a: int, b: int, column: int) -> int:
        return self._rows.setdefault((a, b, column), len(self._rows))

    def _through(self, law: Law, column: int) -> int:
        """The row of a column's heat through a law."""
        taken = 0 <= law.b < self.circuit.states and not law.one_way
        return self._row(law.a, law.b if taken else NOBODY, column)

    def _law(self, law: Law) -> int:
        return self._laws.setdefault(law, len(self._laws))

    def _add(self, kind: Kind, to: int, weight: float, first: int, second: int = 0, parameter: int = NOBODY) -> None:
        self._entries.setdefault(kind, []).append(Product(to, weight, first, second, parameter))

    def _enter(self, column: int, action: Action, at: int) -> None:
        if (moved := self.circuit.start_moved_by(action)) is not None:
            self._starts[column] = moved
        if isinstance(action, actions.OnTerms):
            self._enter_terms(column, action)
        elif isinstance(action, actions.OnTemperatures):
            self._enter_temperatures(column, action, at)
        elif isinstance(action, actions.OnReading):
            if isinstance(action, actions.Late) and self.circuit.test.is_common(action):
                self._enter_late(column, action.sign)
        else:
            assert_never(action)

    def _enter_terms(self, column: int, action: actions.OnTerms) -> None:
        circuit = self.circuit
        kind: Kind = "tents" if isinstance(action, actions.Tent) else "terms"
        for i, shape, factor in circuit.drive.effect(action):
            law = circuit.laws[circuit.law_of[i]]
            self._add(kind, self._through(law, column), factor, shape, i)

    def _enter_temperatures(self, column: int, action: actions.OnTemperatures, at: int) -> None:
        circuit = self.circuit
        match action:
            case actions.Added(places, feature, rms, copper):
                row, factor = circuit.drive.feature(feature, rms)
                for place in places:
                    law = circuit.place(place, copper)
                    self._add("features", self._through(law, column), factor, row, self._law(law))
            case actions.Tilt(places, terms, references):
                for place, members, reference in zip(places, terms, references, strict=True):
                    for law, share in circuit.sloped(place, reference):
                        for i in members:
                            self._add("tilts", self._through(law, column), share, i, self._law(law))
            case actions.Capacity(nodes):
                for node in nodes:
                    self._add("stored", self._row(node, NOBODY, column), -1.0, node)
            case actions.Attached(_, lag_s) if at != NOBODY:
                for i, (p, node, _) in enumerate(circuit.followers):
                    if p == at:
                        law = Law(node, circuit.n + i, one_way=True)
                        self._add("features", self._through(law, column), 1 / lag_s, 0, self._law(law))
            case actions.Attached(nodes, lag_s):
                for node in nodes:
                    self._add("following", self._row(node, NOBODY, column), 1.0, len(self._followers))
                    self._followers.append((node, lag_s))
            case actions.Start():
                pass
            case actions.BoundaryBias(boundary):
                for i, law in self._ending_at(boundary):
                    self._add("bounds", self._row(law.a, NOBODY, column), -1.0, i, i)
            case actions.HeatTent() | actions.HeatMap():
                law, row = circuit.place(actions.Place(action.node)), circuit.drive.free_heat(action)
                self._add("features", self._through(law, column), 1.0, row, self._law(law))
            case _:
                assert_never(action)

    def _enter_late(self, column: int, sign: float) -> None:
        """The drive a second later: of every law that a feature of the test drives, and of the boundaries."""
        circuit = self.circuit
        for i, own in enumerate(circuit.law_of):
            self._add("late", self._through(circuit.laws[own], column), sign, i)
        for p, action in circuit.active:
            if isinstance(action, actions.Added) and action.feature != "constant":
                row, factor = circuit.drive.feature(action.feature, action.rms)
                for place in action.places:
                    law = circuit.place(place, action.own)
                    to = self._through(law, column)
                    self._add("late features", to, sign * factor, row, self._law(law), p)
        for i, law in enumerate(circuit.laws):
            if law.b >= circuit.states:
                self._add("late bounds", self._row(law.a, NOBODY, column), sign, i, i)

    def _ending_at(self, boundary: int) -> list[tuple[int, Law]]:
        """The circuit's laws that end at a boundary."""
        return [(i, law) for i, law in enumerate(self.circuit.laws) if law.b == self.circuit.states + boundary]

    @property
    def begin(self) -> Floats:
        """Where what is marched begins (states, H + K): the heated columns, then the starts."""
        return np.hstack([np.zeros((self.circuit.states, len(self.heated))), self._marched])

    def about(self, run: CircuitRun) -> Floats:
        """The heats (L, N) of all `loads` about a run [W per unit of each parameter]."""
        circuit = self.circuit
        value, by_b = psi(self._table, run.means, run.boundaries)
        of_terms = value[circuit.law_of]
        circuit.tilts.add(of_terms, value, circuit.drive.one, run.beta)
        found = np.zeros((len(self._rows), circuit.steps))
        for kind, products in self._products.items():
            for first, second in self._factors(kind, run, value, by_b, of_terms):
                products.add(found, first, second, run.beta)
        return found

    def _factors(
        self, kind: Kind, run: CircuitRun, value: Floats, by_b: Floats, of_terms: Floats
    ) -> Iterator[tuple[Floats, Floats]]:
        """What the entries of a kind multiply. `value`, `by_b` (L, N): psi and its slope with T_b; `of_terms` (T, N):
        psi of the terms' laws, their tilts included."""
        circuit, drive = self.circuit, self.circuit.drive
        match kind:
            case "terms" | "tents":
                changed = run.prompt if kind == "terms" else run.prompt / run.tents
                for steps, share in parts_of_delay(run.late_s / circuit.step_s):
                    heat = share * of_terms
                    heat *= shifted(changed, steps)
                    yield shifted(drive.shapes.values, steps), heat
            case "features":
                yield drive.delayed(drive.features.values, run.late_s), value
            case "tilts":
                yield run.values, value
            case "stored":
                yield (run.march.storage * (run.means - run.edges[:-1])).T.copy(), drive.one
            case "following":
                yield np.array([self._following(run, node, lag_s) for node, lag_s in self._followers]), drive.one
            case "bounds":
                yield run.carried, by_b
            case "late":
                yield drive.delayed_slope(run.prompt, run.late_s) * of_terms, drive.one
            case "late features":
                yield drive.delayed_slope(drive.features.values, run.late_s), value
            case "late bounds":
                outside = drive.delayed_slope(circuit.test.frame.boundaries.T, run.late_s)
                moved = np.zeros_like(by_b)
                for boundary, slope in enumerate(outside):
                    for i, _ in self._ending_at(boundary):
                        moved[i] = by_b[i] * slope
                yield run.carried, moved
            case _:
                assert_never(kind)

    def _following(self, run: CircuitRun, node: int, lag_s: float) -> Floats:
        """Heat into a node of 1 J/K that follows it (N,) [W]."""
        behind = lagged(run.edges[:, node], lag_s, self.circuit.step_s) - run.edges[:, node]
        heat: Floats = (behind[:-1] + behind[1:]) / (2 * lag_s)
        return heat
