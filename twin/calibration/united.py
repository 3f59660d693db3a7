"""Several rigs of one motor as one network, so that one fit learns from tests of all of them.

Every rig (`twin.motor.configured`) is there at once. A law that not all of them have is multiplied by a gate: a feature
that is 1 in tests of the rigs that have it, else 0. What a rig lacks is so cut off in its tests, and every coefficient
and capacity is one number. In the same way a law that ages is multiplied by what is left of it in each test.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from twin.calibration.calibrate import counted
from twin.fitting.recorded import Floats, Test
from twin.motor.ageing_law import AgeingPlace, AgeingTerm, place_of
from twin.motor.configured import configured
from twin.motor.features import Monomial, monomial, monomials, product, streams
from twin.motor.network import Configuration, FluidCircuit, Link, Network, Source, Term
from twin.run.simulate import Frame

Rigs = tuple[int, ...]  # places in `United.rigs`
E = TypeVar("E", Link, Source)

ABSENT_SD_K = 1.0  # of the start of a node that a rig does not have: no reading knows of it


@dataclass(frozen=True)
class _Place:
    """Where a link or source is written in the motor file: at `index` among those of a `configuration`, or of the motor
    itself (None); and the rigs that have it."""

    configuration: str | None
    index: int
    rigs: Rigs


class United:
    """The named rigs of a checked `motor`, None for the whole motor, as one network.

    `network` has every node, boundary and law that one of the rigs has. `names` are those of its coefficients, then of
    its capacities; what a configuration says itself ends in `@` and its name.

    Raises `ConfigurationError` where the motor has no such configuration.
    """

    def __init__(self, motor: Network, rigs: Sequence[str | None]) -> None:
        self.motor, self.rigs = motor, tuple(dict.fromkeys(rigs))
        self._own = [configured(motor, rig) for rig in self.rigs]
        said = {one.name: one for one in motor.configurations}
        self._said = [None if rig is None else said[rig] for rig in self.rigs]
        self._columns: dict[Monomial, tuple[Monomial, Rigs]] = {}
        self._ageing: dict[str, AgeingPlace] = {}  # by the feature that says what is left
        self._links = list(self._placed(motor.links, [one.links if one else () for one in self._said]))
        self._sources = list(self._placed(motor.sources, [one.sources if one else () for one in self._said]))
        self.network = replace(
            motor,
            nodes=tuple(node for node in motor.nodes if any(node in own.nodes for own in self._own)),
            boundaries=tuple(b for b in motor.boundaries if any(b in own.boundaries for own in self._own)),
            links=tuple(replace(link, terms=self._gated(link, at.rigs)) for at, link in self._links),
            sources=tuple(replace(source, terms=self._gated(source, at.rigs)) for at, source in self._sources),
            circuits=tuple(self._circuits()),
            configurations=(),
        )

    def _placed(self, whole: Sequence[E], own: Sequence[Sequence[E]]) -> Iterator[tuple[_Place, E]]:
        """Every link (or source) that one of the rigs has: the motor's, then those that each configuration says
        itself."""
        for i, one in enumerate(whole):
            if rigs := tuple(r for r, said in enumerate(self._said) if said is None or _keeps(said, one)):
                yield _Place(None, i, rigs), one
        for r, some in enumerate(own):
            yield from ((_Place(self.rigs[r], i, (r,)), one) for i, one in enumerate(some))

    def _gated(self, place: Link | Source, rigs: Rigs) -> tuple[Term, ...]:
        """The terms of a link or source, times the gate of its rigs and what is left where they age."""
        gate = {} if len(rigs) == len(self.rigs) else {_gate(rigs): 1.0}
        gated = [replace(t, exponents={**t.exponents, **gate, **self._left(place, t)}) for t in place.terms]
        self._columns.update((monomial(new), (monomial(t), rigs)) for new, t in zip(gated, place.terms, strict=True))
        return tuple(gated)

    def _left(self, place: Link | Source, term: Term) -> dict[str, float]:
        """The feature that says what is left of an ageing term."""
        if not isinstance(term, AgeingTerm):
            return {}
        at = place_of(self.motor, place, term)
        known = {found: feature for feature, found in self._ageing.items()}
        feature = known.get(at, f"aged_{len(known)}")
        self._ageing[feature] = at
        return {feature: 1.0}

    def _circuits(self) -> Iterator[FluidCircuit]:
        """Each circuit of the rigs; where not all of them have it, with a flow of its own."""
        courses: dict[FluidCircuit, list[int]] = {}
        for r, own in enumerate(self._own):
            for circuit in own.circuits:
                courses.setdefault(circuit, []).append(r)
        for circuit, found in courses.items():
            rigs, new = tuple(found), circuit
            if len(rigs) < len(self.rigs):
                new = replace(circuit, flow=f"flow_{_gate(rigs)}_{circuit.flow}")
            for term, own_term in zip(_flows(self.motor, new), _flows(self.motor, circuit), strict=True):
                self._columns[monomial(term)] = monomial(own_term), rigs
            yield new

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the coefficients of `network`, then of its capacities."""
        laws = [("conductance", f"{link.a}-{link.b}", at, link.terms) for at, link in self._links]
        laws += [("loss", source.node, at, source.terms) for at, source in self._sources]
        found = [
            f"{kind}.{place}.{product(term).name}{f'@{at.configuration}' if at.configuration else ''}"
            for kind, place, at, terms in laws
            for term in terms
        ]
        return (*counted(found), *_capacities(self.network))

    def names_of(self, rig: str | None) -> tuple[str, ...]:
        """The `names` of the coefficients and capacities of one rig, in the order of the rig's own network."""
        r, names = self.rigs.index(rig), iter(self.names)
        at: dict[frozenset[str], list[str]] = {}
        placed: tuple[tuple[_Place, Link | Source], ...] = (*self._links, *self._sources)
        for place, one in placed:
            own = [next(names) for _ in one.terms]
            if r in place.rigs:
                at[_ends(one)] = own
        there: tuple[Link | Source, ...] = (*self._own[r].links, *self._own[r].sources)
        of_laws = (name for one in there for name in at[_ends(one)])
        return (*of_laws, *_capacities(self._own[r]))

    def test(self, test: Test, rig: str | None, factors: Mapping[AgeingPlace, float] | None = None) -> Test:
        """The test of a rig, read for its own network (`configured`), as the united network takes it. `factors`: what
        is left of its laws that age, 1 where none are given."""
        r = self.rigs.index(rig)
        own, around = self._own[r], [b.name for b in self._own[r].boundaries]
        anywhere = float(test.initial.mean())
        at = {node.name: i for i, node in enumerate(own.nodes)}

        def placed(values: Floats, elsewhere: float) -> Floats:
            return np.array([values[at[node.name]] if node.name in at else elsewhere for node in self.network.nodes])

        steps = len(test.frame.features)
        outside = {name: test.frame.boundaries[:, i] for i, name in enumerate(around)}
        absent = np.full(steps, anywhere)
        boundaries = [outside.get(b.name, absent) for b in self.network.boundaries]
        edges = np.array(boundaries).reshape(-1, steps).T.copy()
        return replace(
            test,
            frame=Frame(test.frame.step_s, self._features(test, r, factors or {}), edges),
            initial=placed(test.initial, anywhere),
            initial_sd=placed(test.initial_sd, ABSENT_SD_K),
            begins={channel: placed(moved, float(moved.mean())) for channel, moved in test.begins.items()},
        )

    def _features(self, test: Test, rig: int, factors: Mapping[AgeingPlace, float]) -> Floats:
        """Monomials of the test (N, m): each as the rig has it, times what is left where it ages; 0 where the rig does
        not have it."""
        columns = monomials(self.network)
        found = np.zeros((len(test.frame.features), len(columns)))
        for j, column in enumerate(columns):
            base, rigs = self._columns[column]
            if rig in rigs:
                found[:, j] = test.features[base.name] if base.powers or base.shape else 1.0
                for feature in column.features:
                    if feature in self._ageing:
                        found[:, j] *= factors.get(self._ageing[feature], 1.0)
        return found

    def version(self, network: Network) -> Network:
        """The motor, its configurations included, with the coefficients and capacities of `network`, a version of the
        united one."""
        capacities = {node.name: node.capacity for node in network.nodes}
        links = _renewed(self._links, [link.terms for link in network.links])
        sources = _renewed(self._sources, [source.terms for source in network.sources])
        return replace(
            self.motor,
            nodes=tuple(replace(n, capacity=capacities.get(n.name, n.capacity)) for n in self.motor.nodes),
            links=tuple(links.get((None, i), one) for i, one in enumerate(self.motor.links)),
            sources=tuple(sources.get((None, i), one) for i, one in enumerate(self.motor.sources)),
            configurations=tuple(
                replace(
                    one,
                    links=tuple(links.get((one.name, i), own) for i, own in enumerate(one.links)),
                    sources=tuple(sources.get((one.name, i), own) for i, own in enumerate(one.sources)),
                )
                for one in self.motor.configurations
            ),
        )


def _capacities(network: Network) -> Iterator[str]:
    return (f"capacity.{node.name}.scale" for node in network.nodes)


def _keeps(said: Configuration, one: Link | Source) -> bool:
    """Whether a configuration leaves a link or source of the motor as it is."""
    ends, others = _ends(one), [*map(_ends, said.links), *map(_ends, said.sources)]
    return not ends & set(said.remove) and ends not in others


def _ends(one: Link | Source) -> frozenset[str]:
    """What a link or source stands between: two names or one."""
    return frozenset((one.a, one.b) if isinstance(one, Link) else (one.node,))


def _gate(rigs: Rigs) -> str:
    """The feature that is 1 in tests of these rigs and else 0."""
    return "rig_" + "_".join(map(str, rigs))


def _flows(motor: Network, circuit: FluidCircuit) -> Iterator[Term]:
    """The terms of a circuit's flow."""
    return streams(replace(motor, circuits=(circuit,)))


def _renewed(placed: Sequence[tuple[_Place, E]], terms: Sequence[Sequence[Term]]) -> dict[tuple[str | None, int], E]:
    """(configuration, index) -> the link or source with new coefficients."""
    return {
        (at.configuration, at.index): replace(
            one,
            terms=tuple(replace(term, coefficient=new.coefficient) for term, new in zip(one.terms, found, strict=True)),
        )
        for (at, one), found in zip(placed, terms, strict=True)
    }
