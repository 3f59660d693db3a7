"""Whether a network can be a motor: every refusal names its entry and says what to do."""

from __future__ import annotations

import difflib
import itertools
import math
import re
from collections.abc import Iterable, Sequence

from twin.errors import (
    BadNameError,
    BadValueError,
    CutOffError,
    DuplicateError,
    Entry,
    FactorError,
    FeatureError,
    LinkError,
    NetworkError,
    UnknownNodeError,
)
from twin.motor import features
from twin.motor.configured import configured
from twin.motor.heat_laws import NAMED
from twin.motor.network import MOST_CURRENT, Link, Map, Network, Property, Shape, Source, Term

NAME = re.compile(r"[a-z][a-z0-9_]*")
LEAST, MOST = 1e-30, 1e30  # of a positive constant: beyond, rates overflow or lose their digits


def check(network: Network) -> None:
    """Raise the first fault found, a subclass of `NetworkError`; nothing is returned for a sound network."""
    nodes = [node.name for node in network.nodes]
    boundaries = [boundary.name for boundary in network.boundaries]
    _check_names([Entry("node", i, name) for i, name in enumerate(nodes)], [])
    _check_names([Entry("boundary", i, name) for i, name in enumerate(boundaries)], nodes)
    _check_constants(network)
    _check_links(network, nodes, boundaries)
    _check_sources(network, nodes)
    _check_circuits(network, nodes, boundaries)
    _check_reached(network, nodes, boundaries)
    _check_configurations(network)


def _check_configurations(network: Network) -> None:
    """Each must be a motor of its own."""
    configurations = network.configurations
    _check_names([Entry("configuration", i, one.name) for i, one in enumerate(configurations)], [])
    for i, one in enumerate(configurations):
        entry = Entry("configuration", i, one.name)
        for number, name in enumerate(one.remove):
            if name not in network.names:
                raise UnknownNodeError(entry, f"remove: {_unknown(name, 'node or boundary', network.names)}")
            if name in one.remove[:number]:
                raise DuplicateError(entry, f'remove: "{name}" stands there twice: name it once')
        for kind, places in (
            ("link", [frozenset((link.a, link.b)) for link in one.links]),
            ("source", [frozenset((source.node,)) for source in one.sources]),
        ):
            again = next((place for k, place in enumerate(places) if place in places[:k]), None)
            if again is not None:
                raise DuplicateError(
                    entry, f"two of its {kind}s are of {'-'.join(sorted(again))}: put all terms into one"
                )
        try:
            check(configured(network, one.name))
        except NetworkError as error:
            raise type(error)(entry, f"{error.entry}: {error.says}") from None


def _check_names(entries: Sequence[Entry], taken: Iterable[str]) -> None:
    seen = set(taken)
    for entry in entries:
        if not NAME.fullmatch(entry.name):
            raise BadNameError(entry, "a name begins with a-z and holds only a-z, 0-9 and _: rename it")
        if entry.name in seen:
            raise DuplicateError(entry, "this name is already taken by an entry above: rename one of them")
        seen.add(entry.name)


def _check_constants(network: Network) -> None:
    for i, node in enumerate(network.nodes):
        entry = Entry("node", i, node.name)
        _positive(entry, "capacity", node.capacity, "the heat capacity of the lump in J/K")
        _positive(entry, "sd", node.sd, "the prior standard deviation of the logarithm, such as 0.15")
    for i, (name, value) in enumerate(network.scale.items()):
        _positive(Entry("scale", i, name), "scale", value, "what 1 means for this quantity")
    copper = Entry("copper", 0, "copper")
    _positive(copper, "alpha_per_K", network.copper.alpha_per_K, "0.00393 for copper")
    if not math.isfinite(network.copper.reference_degC):
        raise BadValueError(copper, f"reference_degC {network.copper.reference_degC:g} is not finite: give 20")


def _positive(entry: Entry, key: str, value: float, what: str) -> None:
    if not (math.isfinite(value) and value > 0):
        raise BadValueError(entry, f"{key} {value:g} is not above 0: give {what}")
    if not LEAST <= value <= MOST:
        raise BadValueError(entry, f"{key} {value:g} is beyond any motor ({LEAST:g} to {MOST:g}): give {what}")


def _check_links(network: Network, nodes: Sequence[str], boundaries: Sequence[str]) -> None:
    seen: set[frozenset[str]] = set()
    for i, link in enumerate(network.links):
        entry = Entry("link", i, f"{link.a}-{link.b}")
        for end in (link.a, link.b):
            if end not in nodes and end not in boundaries:
                raise UnknownNodeError(entry, _unknown(end, "node or boundary", [*nodes, *boundaries]))
        if link.a == link.b:
            raise LinkError(entry, "both ends are the same: name two different nodes")
        if link.a in boundaries and link.b in boundaries:
            raise LinkError(entry, "both ends are boundaries, which no heat can change: remove it")
        if frozenset((link.a, link.b)) in seen:
            raise DuplicateError(entry, "these two are linked above already: put all terms into one link")
        seen.add(frozenset((link.a, link.b)))
        _check_terms(network, entry, link, nodes)


def _check_sources(network: Network, nodes: Sequence[str]) -> None:
    seen: set[str] = set()
    for i, source in enumerate(network.sources):
        entry = Entry("source", i, source.node)
        if source.node not in nodes:
            raise UnknownNodeError(entry, _unknown(source.node, "node", nodes))
        if source.node in seen:
            raise DuplicateError(entry, "this node has a source above already: put all terms into one source")
        seen.add(source.node)
        _check_terms(network, entry, source, nodes)


def _check_circuits(network: Network, nodes: Sequence[str], boundaries: Sequence[str]) -> None:
    _check_names([Entry("circuit", i, circuit.name) for i, circuit in enumerate(network.circuits)], [])
    for i, circuit in enumerate(network.circuits):
        entry = Entry("circuit", i, circuit.name)
        if circuit.inlet not in boundaries:
            raise UnknownNodeError(entry, f"inlet: {_unknown(circuit.inlet, 'boundary', boundaries)}")
        if not circuit.nodes:
            raise LinkError(entry, "it has no nodes: name those that the fluid flows through, in order")
        for number, node in enumerate(circuit.nodes):
            if node not in nodes:
                raise UnknownNodeError(entry, _unknown(node, "node", nodes))
            if node in circuit.nodes[:number]:
                raise DuplicateError(entry, f'the fluid flows through "{node}" twice: split it into two nodes')
        if not features.is_flow(circuit.flow):
            raise FeatureError(entry, f'flow "{circuit.flow}" is no volume flow: write flow, or flow_<name>')
        _check_scale(network, entry, f'flow "{circuit.flow}"', circuit.flow)
        _check_property(entry, "density", circuit.fluid.density, "kg/m3")
        _check_property(entry, "heat_capacity", circuit.fluid.heat_capacity, "J/(kg K)")


def _check_property(entry: Entry, key: str, table: Property, unit: str) -> None:
    where = f"fluid: {key}"
    if not table.degC or len(table.degC) != len(table.value):
        says = f"has {len(table.degC)} temperatures and {len(table.value)} values: give as many of each, at least one"
        raise BadValueError(entry, f"{where} {says}")
    if not all(map(math.isfinite, table.degC)) or any(b <= a for a, b in itertools.pairwise(table.degC)):
        raise BadValueError(entry, f"{where}: its temperatures do not rise: sort them, each only once")
    for value in table.value:
        _positive(entry, where, value, f"it in {unit}")


def _unknown(name: str, kind: str, known: Sequence[str]) -> str:
    return f'there is no {kind} "{name}": {meant(name, known)}'


def meant(name: str, known: Sequence[str]) -> str:
    """The known name that is near; else all of them."""
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    if close:
        return f'did you mean "{close[0]}"?'
    return f"known are {', '.join(known)}" if known else "there is none at all"


def _check_terms(network: Network, entry: Entry, place: Link | Source, nodes: Sequence[str]) -> None:
    if not place.terms:
        raise LinkError(entry, "it has no terms: give at least one coefficient")
    for number, term in enumerate(place.terms, 1):
        _check_coefficient(entry, number, term, isinstance(place, Link))
        _check_factors(entry, number, term, isinstance(place, Link), nodes)
        for feature, exponent in term.exponents.items():
            _check_feature(network, entry, number, feature, exponent)
        if isinstance(term.shape, Map):
            _check_map(network, entry, number, term.shape, isinstance(place, Link))
        elif term.shape is not None:
            _check_shape(network, entry, number, term.shape, isinstance(place, Link))


def _check_coefficient(entry: Entry, number: int, term: Term, in_link: bool) -> None:
    where = f"term {number}: coefficient {term.coefficient:g}"
    if not 0 < abs(term.coefficient) <= MOST:
        raise BadValueError(entry, f"{where} is not a number other than 0: give W{'/K' * in_link} at features of 1")
    if in_link and term.coefficient < 0:
        raise BadValueError(entry, f"{where} is negative: a conductance in W/K is above 0")
    _positive(entry, f"term {number}: sd", term.sd, "the prior standard deviation of the logarithm, such as 0.4")


def _check_factors(entry: Entry, number: int, term: Term, in_link: bool, nodes: Sequence[str]) -> None:
    if in_link and (term.copper or term.resistance):
        raise FactorError(entry, f"term {number}: copper and resistance belong to losses: use them in a source only")
    if term.resistance not in (0, -1):
        raise FactorError(entry, f"term {number}: resistance {term.resistance} is not -1: for +1 write copper = true")
    if term.copper and term.resistance:
        raise FactorError(entry, f"term {number}: copper times resistance -1 is 1: leave both out, or one of them")
    if term.law is not None and not in_link:
        raise FactorError(entry, f'term {number}: law "{term.law}" belongs to conductances: use it in a link only')
    if term.law is not None and term.law not in NAMED:
        raise FactorError(entry, f'term {number}: law "{term.law}" is not known: {meant(term.law, NAMED)}')
    factor = term.temperature
    if factor is None:
        return
    if factor.node not in nodes:
        raise UnknownNodeError(entry, f"term {number}: temperature: " + _unknown(factor.node, "node", nodes))
    if not (math.isfinite(factor.slope_per_K) and math.isfinite(factor.reference_degC)):
        raise BadValueError(entry, f"term {number}: temperature: slope_per_K and reference_degC must be finite numbers")


def _check_feature(network: Network, entry: Entry, number: int, feature: str, exponent: float) -> None:
    where = f'term {number}: feature "{feature}"'
    if not features.is_known(feature):
        raise FeatureError(entry, f"{where} is not known: {meant(feature, features.EXAMPLES)}")
    if not math.isfinite(exponent) or exponent < 0:
        raise FeatureError(entry, f"{where} has exponent {exponent:g}: at 0 it would be infinite, give 0 or more")
    _check_scale(network, entry, where, feature)


def _check_scale(network: Network, entry: Entry, where: str, feature: str) -> None:
    quantity = features.quantity(feature)
    if quantity is not None and quantity not in network.scale:
        raise FeatureError(entry, f"{where} has no scale: say in [scale] what 1 means for {quantity}")


def _check_shape(network: Network, entry: Entry, number: int, shape: Shape, in_link: bool) -> None:
    where = f"term {number}: shape"
    if in_link:
        raise FactorError(entry, f"{where} belongs to losses: use it in a source only")
    count = len(shape.speed)
    if count < 2 or {len(shape.factor), len(shape.current_slope)} != {count}:
        lengths = f"{count} speeds, {len(shape.factor)} factors and {len(shape.current_slope)} current slopes"
        raise BadValueError(entry, f"{where} has {lengths}: give as many of each, at least 2")
    if not all(map(math.isfinite, (*shape.speed, *shape.factor, *shape.current_slope))):
        raise BadValueError(entry, f"{where} holds a number that is not finite: correct it")
    if shape.speed[0] < 0 or any(b <= a for a, b in itertools.pairwise(shape.speed)):
        raise BadValueError(entry, f"{where}: its speeds do not rise from 0 or above: sort them, each only once")
    for feature in features.Monomial((), shape).features:
        _check_scale(network, entry, f'{where}: feature "{feature}"', feature)
    for speed, factor, slope in zip(shape.speed, shape.factor, shape.current_slope, strict=True):
        lowest, current = min((1 + factor + slope * current, current) for current in (0.0, MOST_CURRENT))
        if lowest <= 0:
            at = f"{speed * network.scale['speed']:g} rpm and a current of {current:g}"
            raise BadValueError(entry, f"{where} makes the loss {lowest:.3g} times itself at {at}: keep it above 0")


def _check_map(network: Network, entry: Entry, number: int, table: Map, in_link: bool) -> None:
    where = f"term {number}: map"
    loads = f"{table.over}s"
    for name, knots in (("speeds", table.speed), (loads, table.load)):
        if len(knots) < 2 or not all(map(math.isfinite, knots)):
            raise BadValueError(entry, f"{where} has {len(knots)} {name}: give at least 2, all finite numbers")
        if any(b <= a for a, b in itertools.pairwise(knots)):
            raise BadValueError(entry, f"{where}: its {name} do not rise: sort them, each only once")
    if table.over == "current" and table.load[0] < 0:
        says = "its currents begin below 0: a current is a magnitude, give the torque for a motor that brakes"
        raise BadValueError(entry, f"{where}: {says}")
    if table.speed[0] < 0:
        says = "its speeds begin below 0: a speed is a magnitude, give a torque below 0 for a motor that brakes"
        raise BadValueError(entry, f"{where}: {says}")
    if len(table.values) != len(table.speed) or any(len(row) != len(table.load) for row in table.values):
        size = f"{len(table.speed)} rows of {len(table.load)} values"
        raise BadValueError(entry, f"{where} needs {size}: a row for each speed, a value for each {table.over}")
    for row in table.values:
        for value in row:
            if not math.isfinite(value) or (in_link and value < 0):
                raise BadValueError(
                    entry, f"{where} holds {value:g}: {'a conductance is 0 or more' if in_link else 'correct it'}"
                )
    for feature in features.Monomial((), table).features:
        _check_scale(network, entry, f'{where}: feature "{feature}"', feature)


def _check_reached(network: Network, nodes: Sequence[str], boundaries: Sequence[str]) -> None:
    neighbours: dict[str, list[str]] = {name: [] for name in (*nodes, *boundaries)}
    for a, b in (*((link.a, link.b) for link in network.links), *features.stream_places(network)):
        neighbours[a].append(b)
        neighbours[b].append(a)
    reached, front = set(boundaries), list(boundaries)
    while front:
        fresh = [name for name in neighbours[front.pop()] if name not in reached]
        reached.update(fresh)
        front.extend(fresh)
    for i, name in enumerate(nodes):
        if name not in reached:
            raise CutOffError(
                Entry("node", i, name),
                "no path of links or circuits leads to a boundary, its heat could never leave: link it",
            )
