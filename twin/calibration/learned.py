"""What a fit learnt, as a motor: the network that a motor file can say, and the size of each named term."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import assert_never

import numpy as np

from twin.differences.proposals import between, courses
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.fit import Fit, Floats
from twin.motor import features
from twin.motor.network import LEAST_FACTOR, NOBODY, Link, Map, Network, Node, Shape, Source, TemperatureFactor, Term
from twin.motor.sensor_laws import Lag, Misreading

REFERENCE_DIGITS = 1  # of a temperature that a slope is written about


def network_of(found: Fit, monomials: Sequence[features.Monomial]) -> Network:
    """The network of a fit. `monomials`: the products that added terms may use, by their names.

    A path below 0, and what belongs to a test or a sensor, is no part of a motor (`twin.diagnosis.expressible`). A
    motor file lets a term change with the temperature of one node. So a slope is written as the straight line over
    that temperature which follows it best over the tests: for a link over the end that serves better, for copper
    beside copper's own change.
    """
    network, beta = found.model.network, found.beta
    terms = _terms(found)
    by_name = {m.name: m for m in monomials}
    links = [replace(link, terms=tuple(terms.pop(0) for _ in link.terms)) for link in network.links]
    sources = [replace(source, terms=tuple(terms.pop(0) for _ in source.terms)) for source in network.sources]
    nodes = [_node(node, i, found) for i, node in enumerate(network.nodes)]
    maps: dict[actions.HeatMap, Floats] = {}
    for amount, parameter in zip(beta.tolist(), found.model.parameters, strict=True):
        match parameter.action:
            case actions.Added(places, feature, rms) as added:
                exponents = by_name[feature].exponents if feature != "constant" and amount else {}
                for place in places if amount else ():
                    _add(network.names, place, term_of(added, amount / rms, exponents), links, sources)
            case actions.Attached(at, lag_s):
                for i in at if amount > 0 else ():
                    name = f"{network.nodes[i].name}_attached"
                    nodes.append(Node(name, amount, network.nodes[i].region))
                    links.append(Link(network.nodes[i].name, name, (Term(amount / lag_s),)))
            case actions.HeatMap() as part:
                flat = replace(part, heights=())
                maps[flat] = maps.get(flat, np.zeros(1)) + amount * np.array(part.heights)
            case actions.Scale() | actions.Power() | actions.Tent() | actions.Tilt() | actions.Capacity():
                pass  # said by the terms and nodes that are there
            case actions.Course() | actions.InputGain() | actions.InputBias() | actions.BoundaryBias():
                pass  # no part of a motor, like what follows
            case actions.Start() | actions.HeatTent() | Misreading() | Lag() | actions.Beside():
                pass
            case actions.Late() | actions.Slowed():
                pass
            case _:
                assert_never(parameter.action)
    for part, watts in maps.items():
        if part.sayable:
            rows = watts.reshape(len(part.speeds), -1).tolist()
            term = Term(1.0, shape=Map(part.speeds, part.loads, tuple(map(tuple, rows)), part.load))
            _add(network.names, actions.Place(part.node), term, links, sources)
    return replace(network, nodes=tuple(nodes), links=tuple(links), sources=tuple(sources))


def term_of(added: actions.Added, coefficient: float, exponents: Mapping[str, float]) -> Term:
    """An added heat or path as a term of a motor file."""
    return Term(coefficient, exponents, copper=added.own > 0, resistance=min(added.own, 0))


def _add(names: Sequence[str], place: actions.Place, term: Term, links: list[Link], sources: list[Source]) -> None:
    """Add a term to the link or source at a place, or make one with it; a path below 0 is left out."""
    if place.b == NOBODY:
        node = names[place.a]
        for i, source in enumerate(sources):
            if source.node == node:
                sources[i] = replace(source, terms=(*source.terms, term))
                return
        sources.append(Source(node, (term,)))
        return
    ends = {names[place.a], names[place.b]}
    for i, link in enumerate(links):
        if {link.a, link.b} == ends:
            if term.coefficient > 0:
                links[i] = replace(link, terms=(*link.terms, term))
            return
    if term.coefficient > 0:
        links.append(Link(names[place.a], names[place.b], (term,)))


def _node(node: Node, i: int, found: Fit) -> Node:
    factor = sum(
        float(b)
        for b, p in zip(found.beta, found.model.parameters, strict=True)
        if isinstance(p.action, actions.Capacity) and i in p.action.nodes
    )
    return replace(node, capacity=node.capacity * float(np.exp(factor)))


def _terms(found: Fit) -> list[Term]:
    """The network's own terms with their factors, exponents, shapes and slopes."""
    network = found.model.network
    own = list(features.terms(network))
    log: defaultdict[int, float] = defaultdict(float)
    powers: defaultdict[int, dict[str, float]] = defaultdict(dict)
    tents: dict[int, list[tuple[actions.Tent, float]]] = {}
    slopes: defaultdict[int, list[_Slope]] = defaultdict(list)
    for beta, parameter in zip(found.beta.tolist(), found.model.parameters, strict=True):
        match parameter.action:
            case actions.Scale(terms):
                for i in terms:
                    log[i] += beta
            case actions.Power((*terms,), feature):
                for i in terms:
                    powers[i][feature] = powers[i].get(feature, 0.0) + beta
            case actions.Tent(terms) as tent:
                for i in terms:
                    tents.setdefault(i, []).append((tent, beta))
            case actions.Tilt(places, terms, references) if beta:
                for place, members, reference in zip(places, terms, references, strict=True):
                    for i in members:
                        slopes[i].append(_Slope(place, beta, reference))
    lines = _straight(found, slopes)
    return [
        replace(
            term,
            coefficient=term.coefficient * float(np.exp(log[i])) * (lines[i].factor if i in lines else 1.0),
            exponents={f: e + powers[i].get(f, 0.0) for f, e in term.exponents.items()},
            shape=_shape(tents[i]) if i in tents and term.shape is None else term.shape,
            temperature=lines[i].temperature if i in lines else term.temperature,
        )
        for i, term in enumerate(own)
    ]


@dataclass(frozen=True)
class _Slope:
    """A term grows by `per_K` of itself for each kelvin of a node, or of a link's mean, over a reference."""

    place: actions.Place
    per_K: float
    reference_degC: float


@dataclass(frozen=True)
class _Line:
    """A term times `factor`, and a temperature factor that is 1 at the mean of the tests."""

    factor: float
    temperature: TemperatureFactor


def _straight(found: Fit, slopes: Mapping[int, Sequence[_Slope]]) -> dict[int, _Line]:
    """All slopes of each term as a line of one node's temperature over the tests, steps weighed by what the term
    carries."""
    if not slopes:
        return {}
    model, network = found.model, found.model.network
    t, carried = courses(model, found.beta)
    result = {}
    for i, own in slopes.items():
        term = list(features.terms(network))[i]
        wanted = sum((s.per_K * (between(t, s.place) - s.reference_degC) for s in own), np.zeros(len(t)))
        rise = t[:, own[0].place.a] - network.copper.reference_degC
        wanted = wanted / (1 + network.copper.alpha_per_K * rise) ** (int(term.copper) + term.resistance)
        nodes = [end for end in (own[0].place.a, own[0].place.b) if 0 <= end < len(network.nodes)]
        if term.temperature is not None:
            nodes = [network.names.index(term.temperature.node)]
            wanted = wanted + term.temperature.slope_per_K * (t[:, nodes[0]] - term.temperature.reference_degC)
        result[i] = _line(network, t, 1.0 + wanted, np.abs(carried[:, i]), nodes)
    return result


def _line(network: Network, t: Floats, wanted: Floats, weight: Floats, nodes: Sequence[int]) -> _Line:
    """The straight line of one of the nodes that is nearest to `wanted` (N,)."""
    weight = weight / weight.sum() if weight.any() else np.full(len(t), 1 / len(t))
    middle = float(weight @ wanted)
    lines = []
    for node in nodes:
        reference = round(float(weight @ t[:, node]), REFERENCE_DIGITS)
        off = t[:, node] - float(weight @ t[:, node])
        slope = float(weight @ (off * wanted)) / max(float(weight @ off**2), 1e-12)
        left = float(weight @ (wanted - middle - slope * off) ** 2)
        at = max(LEAST_FACTOR, middle + slope * (reference - float(weight @ t[:, node])))
        lines.append((left, _Line(at, TemperatureFactor(network.names[node], slope / at, reference))))
    return min(lines, key=lambda one: one[0])[1]


def _shape(tents: Sequence[tuple[actions.Tent, float]]) -> Shape:
    speeds = tents[0][0].speeds
    factor, slope = [0.0] * len(speeds), [0.0] * len(speeds)
    for tent, beta in tents:
        (slope if tent.current else factor)[tent.knot] += beta
    factor = [max(f, LEAST_FACTOR - 1) for f in factor]
    slope = [max(c, Shape.least_slope(f)) for f, c in zip(factor, slope, strict=True)]
    return Shape(speeds, tuple(factor), tuple(slope))


@dataclass(frozen=True)
class Size:
    """A named term as people count it: `value` with its 95 % band in `unit`; `typical_W`, its mean heat over tests."""

    value: float
    low: float
    high: float
    unit: str
    typical_W: float | None


def size(found: Fit, place: int, unit: str) -> Size:
    """The size of the parameter at `place`, together with what the healthy differences of the same kind took of it.

    It is a factor where it multiplies, W or W/K at features of 1 where it adds, else in its own unit.
    """
    parameter = found.model.parameters[place]
    weights = _shares(found, parameter)
    weights[place] = 1.0
    covariance = np.linalg.inv(found.hessian)
    value, sd = float(weights @ found.beta), float(np.sqrt(weights @ covariance @ weights))
    low, high = value - 1.96 * sd, value + 1.96 * sd
    match parameter.action:
        case actions.Scale() | actions.Capacity():
            least, factor, most = (float(np.exp(x)) for x in (low, value, high))
            return Size(factor, least, most, "1", _scaled_W(found, parameter.action, factor))
        case actions.Added(places, feature, rms, _):
            per, typical = 1 / rms, None
            if places[0].b == NOBODY:
                products = [t.features[feature] for t in found.model.tests] if feature != "constant" else [np.ones(1)]
                typical = value * per * float(np.mean(np.concatenate(products))) * len(places)
            return Size(value * per, low * per, high * per, unit, typical)
        case actions.Tilt():
            unit = "1/K"
    return Size(value, low, high, unit, None)


def _scaled_W(found: Fit, action: actions.Action, factor: float) -> float | None:
    """What a factor on losses adds to their mean heat."""
    if not isinstance(action, actions.Scale):
        return None
    first = sum(len(link.terms) for link in found.model.network.links)
    if min(action.terms) < first:
        return None
    return float(courses(found.model, found.beta)[1][:, list(action.terms)].sum(axis=1).mean() * (1 - 1 / factor))


def _shares(found: Fit, parameter: Parameter) -> Floats:
    """The share of each healthy difference that counts as the named one: that of a coefficient in the `scale` of
    several, all of a channel's own gain or lag, and the mean over tests of what each brings along."""
    weights = np.zeros(len(found.beta))
    action, tests = parameter.action, len(found.model.tests)
    for p, other in enumerate(found.model.parameters):
        own = other.action
        match action:
            case actions.Scale(terms) if isinstance(own, actions.Scale) and set(own.terms) <= set(terms):
                means = np.abs(courses(found.model, found.beta)[1]).mean(axis=0)
                weights[p] = sum(means[i] for i in own.terms) / sum(means[i] for i in terms)
            case actions.Capacity(nodes) if isinstance(own, actions.Capacity) and set(own.nodes) <= set(nodes):
                weights[p] = len(own.nodes) / len(nodes)
            case _ if isinstance(action, actions.OnBench) and own == action and parameter.test in (None, other.test):
                weights[p] = 1.0 if other.test == parameter.test else 1.0 / tests
    return weights
