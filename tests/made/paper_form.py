"""A network as the paper writes it: temperatures and heat flows as coordinates, tied by constraints (its Eq. 1-4).

The coordinates are q = [q_T, q_Q]: q_T the temperatures of nodes and boundaries, q_Q the heat flows of links, sources
and capacitors. At inputs v (features and boundary temperatures) they fulfil

    Phi(q, v) = 0       Kirchhoff at every node, every boundary, every link as a resistor, every source,
    Gamma = A qdot + A1 q = 0       C dT/dt less the heat that flows into the capacitor, for every node,

which BDF2 (qdot = (3 q - 4 q' + q'') / (2 h); Hairer and Wanner, Solving Ordinary Differential Equations II, V.1)
turns into equations in q alone, solved by Newton-Raphson with exact derivatives. The first step is one of implicit
Euler. `simulate` runs the reduced form of the same network, the temperatures of the nodes alone, and is faster by
orders of magnitude: this form is its check, and says what flows where.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from made.law_heats import LawHeats, law_heats, psi_at
from twin.errors import DivergedError
from twin.motor.check import check
from twin.motor.network import NOBODY, Network
from twin.run.simulate import Frame, check_finite, check_frame

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

ITERATIONS = 20  # of Newton-Raphson: a linear network takes one
ENOUGH = 1e-10  # of a step, relative to the largest coordinate: the next would be rounding


@dataclass(frozen=True)
class Flow:
    """A heat flow that is a coordinate: into `node`, out of `other` (node or boundary), None in a source. `one_way`:
    of a fluid, not taken out of `other`, which flows on."""

    node: str
    other: str | None
    one_way: bool


@dataclass(frozen=True)
class Constraints:
    """Phi and Gamma of a network of n nodes, b boundaries and F flows. A coordinate's place in q (n + b + F + n):
    temperatures of nodes, of boundaries, heat flows as `flows`, heat into the capacitors."""

    laws: LawHeats
    flows: tuple[Flow, ...]
    flow_of: Index  # (L,) the flow that each law is part of
    incidence: Floats  # (n, F) 1 where a flow enters a node, -1 where it leaves
    capacities: Floats  # (n,) J/K
    boundaries: int

    @property
    def temperatures(self) -> int:
        """How many coordinates are temperatures."""
        return len(self.capacities) + self.boundaries

    @property
    def size(self) -> int:
        """How many coordinates there are."""
        return self.temperatures + len(self.flows) + len(self.capacities)

    def phi(self, q: Floats, amounts: Floats, around: Floats) -> Floats:
        """Phi (n + b + F,) at inputs: amounts (L,) of the laws, boundary temperatures (b,)."""
        n, end = len(self.capacities), self.temperatures
        flows, into = q[end : end + len(self.flows)], q[end + len(self.flows) :]
        psi = self._psi(q)
        found: Floats = np.concatenate(
            [
                self.incidence @ flows - into,
                q[n:end] - around,
                flows - np.bincount(self.flow_of, amounts * psi[:, 0], len(self.flows)),
            ]
        )
        return found

    def gamma(self, q: Floats, rate: Floats) -> Floats:
        """Gamma = A qdot + A1 q (n,) [W]."""
        n = len(self.capacities)
        found: Floats = self.capacities * rate[:n] - q[-n:]
        return found

    def derivatives(self, q: Floats, amounts: Floats, per_s: float) -> csc_array:
        """d [Phi, Gamma] / dq where qdot is `per_s` q and something that does not depend on q."""
        n, end, flows = len(self.capacities), self.temperatures, len(self.flows)
        slopes = amounts[:, None] * self._psi(q)[:, 1:]
        to, by = np.nonzero(self.incidence)
        rows, columns, values = [to], [end + by], [self.incidence[to, by]]

        def diagonal(row: int, column: int, entries: Floats) -> None:
            rows.append(row + np.arange(len(entries)))
            columns.append(column + np.arange(len(entries)))
            values.append(entries)

        diagonal(0, end + flows, np.full(n, -1.0))
        diagonal(n, n, np.ones(self.boundaries))
        diagonal(end, end, np.ones(flows))
        for i, place in enumerate((0, 1, 3)):  # a, b, other of `twin.compiled.laws.Table`
            node = self.laws.places[:, place]
            there = node != NOBODY
            rows.append(end + self.flow_of[there])
            columns.append(node[there])
            values.append(-slopes[there, i])
        diagonal(end + flows, 0, per_s * self.capacities)
        diagonal(end + flows, end + flows, np.full(n, -1.0))
        entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
        return csc_array(entries, shape=(self.size, self.size))

    def at(self, temperatures: Floats, amounts: Floats, around: Floats) -> Floats:
        """The coordinates q whose nodes have `temperatures` (n,): Phi = 0 solved for all others."""
        q = np.zeros(self.size)
        end, flows = self.temperatures, len(self.flows)
        q[:end] = np.concatenate([temperatures, around])
        q[end : end + flows] = np.bincount(self.flow_of, amounts * self._psi(q)[:, 0], flows)
        q[end + flows :] = self.incidence @ q[end : end + flows]
        return q

    def _psi(self, q: Floats) -> Floats:
        found = np.empty((len(self.flow_of), 4))
        at = np.ascontiguousarray(q[: self.temperatures, None])
        psi_at(self.laws.places, self.laws.numbers, self.laws.copper, at, found)
        return found


@dataclass(frozen=True)
class RunWithFlows:
    """A run in the paper's form: `temperatures` (N + 1, n) [degC], `flows` (N + 1, F) [W] as `of` names them,
    `stored` (N + 1, n) [W] heat into each capacitor. Row 0 is the start, under the inputs of the first step."""

    of: tuple[Flow, ...]
    temperatures: Floats
    flows: Floats
    stored: Floats


def constraints(network: Network) -> Constraints:
    """Phi and Gamma of a network. Raises `NetworkError` where it cannot be a motor."""
    check(network)
    laws, names, n = law_heats(network), network.names, len(network.nodes)
    places = [tuple(int(i) for i in place) for place in laws.places[:, [0, 1, 4]]]  # a, b, one way
    distinct = list(dict.fromkeys(places))
    incidence = np.zeros((n, len(distinct)))
    for f, (a, b, one_way) in enumerate(distinct):
        incidence[a, f] = 1.0
        if 0 <= b < n and not one_way:
            incidence[b, f] = -1.0
    return Constraints(
        laws=laws,
        flows=tuple(Flow(names[a], None if b == NOBODY else names[b], bool(one_way)) for a, b, one_way in distinct),
        flow_of=np.array([distinct.index(place) for place in places], dtype=np.int64),
        incidence=incidence,
        capacities=np.array([node.capacity for node in network.nodes]),
        boundaries=len(network.boundaries),
    )


def simulate_with_flows(network: Network, frame: Frame, initial: Floats) -> RunWithFlows:
    """Temperatures and every heat flow from `initial` (n,) [degC] on, by BDF2 with Newton-Raphson; inputs held over
    each step.

    Raises `NetworkError` where the network cannot be a motor, `FrameError` where shapes do not fit or an input is not
    finite, and `DivergedError` where Newton-Raphson does not converge or the temperatures leave the finite numbers.
    """
    form = constraints(network)
    check_frame(network, frame, initial)
    amounts, n = form.laws.amounts(frame.features), len(initial)
    q = np.empty((len(amounts) + 1, form.size))
    first = (
        (amounts[0], frame.boundaries[0]) if len(amounts) else (np.zeros(len(form.flow_of)), np.zeros(form.boundaries))
    )
    q[0] = form.at(initial, *first)
    for k in range(len(amounts)):
        if k == 0:
            per_s, past = 1 / frame.step_s, -q[0] / frame.step_s
        else:
            per_s, past = 1.5 / frame.step_s, (q[k - 1] - 4 * q[k]) / (2 * frame.step_s)
        q[k + 1] = _newton(form, q[k], amounts[k], frame.boundaries[k], per_s, past, k * frame.step_s)
    end = form.temperatures
    check_finite(network, frame, q[:, :n])
    return RunWithFlows(form.flows, q[:, :n], q[:, end : end + len(form.flows)], q[:, end + len(form.flows) :])


def _newton(
    form: Constraints, start: Floats, amounts: Floats, around: Floats, per_s: float, past: Floats, time_s: float
) -> Floats:
    """The q with Phi = 0 and Gamma = 0, where qdot = `per_s` q + `past`."""
    q = start
    for _ in range(ITERATIONS):
        wrong = np.concatenate([form.phi(q, amounts, around), form.gamma(q, per_s * q + past)])
        try:
            change: Floats = splu(form.derivatives(q, amounts, per_s)).solve(wrong)
        except RuntimeError:  # how splu says singular
            break
        q = q - change
        if np.abs(change).max() <= ENOUGH * np.abs(q).max():
            return q
        if not np.isfinite(q).all():
            break
    raise DivergedError(
        f"Newton-Raphson found no temperatures at {time_s:g} s in {ITERATIONS} iterations: check the coefficients and"
        " temperature slopes of the losses"
    )
