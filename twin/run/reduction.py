"""From many nodes to few: coupled nodes are merged greedily, by how much a merger would move the temperatures of
interest.

A merged node is the sum of its members (`twin.motor.merging`). Nodes of a circuit are merged with the next ones of
the same circuit only, so that the fluid goes on flowing through each node once.

To hold two nodes at one temperature a heat must flow between them. At a steady state of a linear network it is `(T_i
- T_j) / R_ij`, with R_ij the resistance between the two, `e' L^-1 e` for e = e_i - e_j, and moves node k by `(L^-1
e)_k (T_i - T_j) / R_ij` (superposition). With L + C / tau in place of L the same describes what happens within about
tau. The mean square of both over the nodes of interest, with the differences of a run of the full network, is the
estimate by which pairs are ranked (`estimates`). Only the leading pairs are then run, and the one with the least
error on kept courses, which no estimate was made from, is taken; large networks are first thinned by the estimate
alone.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.compiled.kernel import Compiled
from twin.motor.features import monomials
from twin.motor.merging import merged
from twin.motor.network import Network
from twin.run.initial import conductances
from twin.run.side_by_side import simulate_all
from twin.run.simulate import Frame

Floats = NDArray[np.float64]
Compile = Callable[[Network], Compiled]

FAST_S = 30.0  # of the transient part of an estimate: what S2 pulses and a drive move
RUN_BELOW = 48  # nodes; above, mergers are chosen by their estimates alone, several at once
THINNED = 0.15  # share of the nodes that are merged at once there
LEADING = 8  # pairs that are run at each size below


@dataclass(frozen=True)
class FullRun:
    """One session: inputs `frame` of N steps for the full network, and the full network's own temperatures (N + 1, n)
    [degC] in them."""

    frame: Frame
    temperatures: Floats


@dataclass(frozen=True)
class Error:
    """What a network is off by at the nodes of interest, against the full one [K]: root mean square, mean and largest
    size, and the node of the largest."""

    rms_K: float
    mean_K: float
    largest_K: float
    worst: str


@dataclass(frozen=True)
class Reduced:
    """A network of one size. `groups`: its nodes -> those of the full network that they stand for; `kept` is None
    without kept courses."""

    network: Network
    groups: Mapping[str, tuple[str, ...]]
    trained: Error
    kept: Error | None

    @property
    def deciding(self) -> Error:
        """The error on the kept courses, else on the trained ones: what its mergers were chosen by."""
        return self.kept or self.trained


@dataclass(frozen=True)
class _State:
    """A partition on the way down: the network, and for each of its nodes those of the full one."""

    network: Network
    groups: tuple[tuple[int, ...], ...]

    @property
    def size(self) -> int:
        """How many nodes it has."""
        return len(self.groups)


def reductions(
    network: Network,
    trained: Sequence[FullRun],
    kept: Sequence[FullRun],
    interest: Sequence[str],
    apart: Sequence[str],
    least: int,
    compile_: Compile,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[Reduced, ...]:
    """Networks from the full size down to `least` nodes (at least 1), each merged from the one before.

    `interest`: the nodes whose temperatures count; `apart`: nodes that share no group as long as another pair can be
    merged. A group is named after its member of `apart`, else after the part that makes up most of it. The trained
    courses say which pairs lead; of these the one with the least root mean square error over the kept courses is
    merged, over the trained ones where none is kept. `compile_` prepares a network to run. Sizes that were passed
    several at a time are left out.
    """
    work = _Work(network, trained, kept, interest, apart, compile_)
    state = _State(network, tuple((i,) for i in range(len(network.nodes))))
    found = [work.measured(state)]
    while state.size > max(1, least):
        pairs = work.pairs(state)
        if not pairs:
            break
        if state.size > RUN_BELOW:
            most = min(max(1, round(THINNED * state.size)), state.size - max(RUN_BELOW, least))
            state = work.joined(state, _disjoint(pairs, most))
        else:
            options = [work.joined(state, [pair]) for pair in pairs[:LEADING]]
            deciding = kept or trained
            state = (
                min(options, key=lambda option: work.error(option, deciding).rms_K) if len(options) > 1 else options[0]
            )
        found.append(work.measured(state))
        tell(f"{state.size} nodes: {found[-1].deciding.mean_K:.2f} K")
    return tuple(found)


def smallest(levels: Sequence[Reduced], within_K: float) -> Reduced | None:
    """The level of fewest nodes whose mean error is at most `within_K` [K], by its kept courses where there are any;
    None where the first level, the full network, is the only one."""
    good = [level for level in levels[1:] if level.deciding.mean_K <= within_K]
    return min(good, key=lambda level: len(level.groups), default=None)


def _may_join(network: Network) -> NDArray[np.bool_]:
    """Whether two nodes may be merged as far as circuits go (n, n)."""
    names = [node.name for node in network.nodes]
    wet = np.array([any(name in circuit.nodes for circuit in network.circuits) for name in names], dtype=np.bool_)
    may: NDArray[np.bool_] = ~(wet[:, None] | wet)
    for circuit in network.circuits:
        for one, other in itertools.pairwise(circuit.nodes):
            if sum(one in c.nodes or other in c.nodes for c in network.circuits) == 1:
                i, j = names.index(one), names.index(other)
                may[i, j] = may[j, i] = True
    return may


def _disjoint(pairs: Sequence[tuple[int, int]], most: int) -> list[tuple[int, int]]:
    """The first pairs, at most `most`, that share no group."""
    taken: set[int] = set()
    chosen: list[tuple[int, int]] = []
    for pair in pairs:
        if len(chosen) < most and not taken & set(pair):
            chosen.append(pair)
            taken |= set(pair)
    return chosen


def _part(name: str) -> str:
    """`teeth_7` -> `teeth`."""
    stem, _, number = name.rpartition("_")
    return stem if number.isdecimal() else name


class _Work:
    """What stays the same on the way down: the full network's matrices and runs."""

    def __init__(
        self,
        network: Network,
        trained: Sequence[FullRun],
        kept: Sequence[FullRun],
        interest: Sequence[str],
        apart: Sequence[str],
        compile_: Compile,
    ) -> None:
        self._names = [node.name for node in network.nodes]
        index = {name: i for i, name in enumerate(self._names)}
        self._trained, self._kept, self._compile = trained, kept, compile_
        self._interest = [index[name] for name in interest]
        self.apart = frozenset(index[name] for name in apart)
        self._capacity = np.array([node.capacity for node in network.nodes])
        mean = np.mean(np.concatenate([course.frame.features for course in trained]), axis=0)
        between = conductances(network, mean)
        n = len(self._names)
        self._between = between[:n, :n]
        self._balance = (np.diag(between.sum(axis=1)) - between)[:n, :n]
        self._columns = monomials(network)
        runs = [course.temperatures[:: max(1, round(FAST_S / course.frame.step_s))] for course in trained]
        self._slow = np.concatenate(runs)
        self._fast = np.concatenate([np.diff(run, axis=0) for run in runs])

    def _places(self, state: _State) -> list[int]:
        """The groups that the nodes of interest are in."""
        return [next(g for g, group in enumerate(state.groups) if i in group) for i in self._interest]

    def _shares(self, state: _State) -> Floats:
        """(n, groups): share of each node in its group's mean temperature."""
        share = np.zeros((len(self._names), state.size))
        for g, group in enumerate(state.groups):
            share[list(group), g] = self._capacity[list(group)] / self._capacity[list(group)].sum()
        return share

    def pairs(self, state: _State) -> list[tuple[int, int]]:
        """Coupled pairs of groups, least estimate first; two with nodes of `apart` only where there is no other
        pair."""
        member = (self._shares(state) > 0).astype(np.float64)
        between = member.T @ self._between @ member
        coupled = (np.triu(between + between.T, 1) > 0) & _may_join(state.network)
        named = np.array([bool(self.apart & set(group)) for group in state.groups])
        free = coupled & ~np.outer(named, named)
        first, second = np.nonzero(free if free.any() else coupled)
        cost = self.estimates(state, first, second)
        return [(int(first[p]), int(second[p])) for p in np.argsort(cost, kind="stable")]

    def estimates(self, state: _State, first: NDArray[np.intp], second: NDArray[np.intp]) -> Floats:
        """Root mean square (pairs,) [K] that merging groups `first` and `second` is expected to add at the nodes of
        interest."""
        share = self._shares(state)
        member = (share > 0).astype(np.float64)
        balance, capacity = member.T @ self._balance @ member, member.T @ self._capacity
        at = np.array(self._places(state), dtype=np.intp)
        total = np.zeros(len(first))
        for courses, slowness in ((self._slow, 0.0), (self._fast, 1.0 / FAST_S)):
            answer = np.linalg.inv(balance + np.diag(slowness * capacity))
            own = np.diag(answer)
            resistance = own[first] + own[second] - answer[first, second] - answer[second, first]
            moved = (answer[at][:, first] - answer[at][:, second]) / resistance
            course = courses @ share
            square = course.T @ course / len(course)
            apart2 = np.diag(square)[first] + np.diag(square)[second] - 2 * square[first, second]
            total += (moved**2).mean(axis=0) * np.maximum(apart2, 0.0)
        return np.sqrt(total)

    def joined(self, state: _State, pairs: Sequence[tuple[int, int]]) -> _State:
        """The state with these pairs of groups merged."""
        names = [node.name for node in state.network.nodes]
        new: dict[str, tuple[str, str]] = {}
        groups: list[tuple[int, ...] | None] = list(state.groups)
        for first, second in pairs:
            group = (*state.groups[first], *state.groups[second])
            new[self._name(group)] = (names[first], names[second])
            groups[first], groups[second] = group, None
        return _State(merged(state.network, new), tuple(group for group in groups if group is not None))

    def _name(self, group: Sequence[int]) -> str:
        """The name of a group: of its largest node of `apart`; else of the part that makes up most of it, the slice
        that bears the part's name or the first one."""
        named = [i for i in sorted(group) if i in self.apart]
        if named:
            return self._names[max(named, key=lambda i: self._capacity[i])]
        parts: dict[str, float] = {}
        for i in group:
            parts[_part(self._names[i])] = parts.get(_part(self._names[i]), 0.0) + self._capacity[i]
        most = max(parts, key=lambda part: parts[part])
        slices = [self._names[i] for i in sorted(group) if _part(self._names[i]) == most]
        return most if most in slices else slices[0]

    def measured(self, state: _State) -> Reduced:
        """The reduced network with its errors on all courses."""
        groups = {
            node.name: tuple(self._names[i] for i in sorted(group))
            for node, group in zip(state.network.nodes, state.groups, strict=True)
        }
        trained = self.error(state, self._trained)
        return Reduced(state.network, groups, trained, self.error(state, self._kept) if self._kept else None)

    def error(self, state: _State, courses: Sequence[FullRun]) -> Error:
        """What a run of the reduced network is off by against the full one's, over the courses."""
        compiled = self._compile(state.network)
        columns = [self._columns.index(monomial) for monomial in monomials(state.network)]
        share = self._shares(state)
        at = self._places(state)
        off = []
        frames = [
            replace(course.frame, features=np.ascontiguousarray(course.frame.features[:, columns]))
            for course in courses
        ]
        runs = simulate_all(compiled, frames, [course.temperatures[0] @ share for course in courses])
        for course, run in zip(courses, runs, strict=True):
            off.append(np.abs(run[:, at] - course.temperatures[:, self._interest]))
        size = np.concatenate(off)
        worst = int(np.argmax(size.max(axis=0)))
        return Error(
            rms_K=float(np.sqrt((size**2).mean())),
            mean_K=float(size.mean()),
            largest_K=float(size.max()),
            worst=self._names[self._interest[worst]],
        )
