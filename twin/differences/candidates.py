"""The candidate causes of a motor on a bench, as data: what each is called, what it does, and how large it may be.

candidates = generate(network, channels, inputs)

What a cause does is an action (`twin.fitting.actions`), as of a healthy difference, with an amplitude that is 0 in the
nominal model. The prior size of an amplitude (`twin.differences.sizes`) is fixed before looking at data, as a fraction
of a scale of this motor and campaign, so that one rule serves a 5 kW servo and a 250 kW drive.
`twin.diagnosis.evidence` scores candidates.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from twin.differences.bench import InputChannel
from twin.differences.sizes import Sigma
from twin.fitting import actions
from twin.fitting.actions import Action
from twin.motor.causes import Cause, groups, spelt
from twin.motor.features import Monomial, is_flow, is_known, monomials, product, quantity
from twin.motor.network import Network, Term
from twin.motor.paths import Place, links_with_groups, missing, terms_at
from twin.motor.sensor import Sensor
from twin.motor.sensor_laws import AMBIENT, SENSOR_LAWS, Exchange, Misreading


@dataclass(frozen=True)
class Candidate:
    """One candidate. `unit` of its amplitude; `sign` +1 or -1 where the amplitude can have only that one, else 0;
    `members` the places that share its amplitude, where it is a group; `added`: the product of features of a heat or
    path that is added.

    Its `action` is on no tests yet: what depends on them `twin.differences.proposals` fills in."""

    cause: Cause
    unit: str
    sigma: Sigma
    sign: int
    action: Action | Exchange
    members: tuple[str, ...] = ()
    added: Monomial | None = None

    @property
    def discrete(self) -> bool:
        """Whether it is there or not, and so to be scanned before calibration."""
        return isinstance(self.action, Exchange)

    @property
    def repeated(self) -> bool:
        """Whether it shows only where sessions of its kind are there at least twice."""
        return isinstance(self.action, actions.Course)

    @property
    def places(self) -> tuple[Place, ...]:
        """Where a cause of the motor acts: nodes, or both ends of links."""
        return tuple(tuple(name.split("-")) for name in self.members or (self.cause.place,))


# --- The tables: laws that have a mechanism ---------------------------------------------------------------------------

HEAT, LOG_SCALE, OWN_LINK, MISSING_LINK, CAPACITY, SESSION = 0.05, float(np.log(2)), 1.0, 0.2, 0.3, 0.15
INPUT_GAIN, FLOW_GAIN, INPUT_BIAS, BOUNDARY_BIAS_K = 0.05, 0.3, 0.02, 3.0
CLOCK_S, CLOCK_PPM = 5.0, 100.0
INPUT_UNITS = {"speed": "rpm", "torque": "Nm", "voltage": "V", "flux": "Wb", "flow": "lpm", "current": "A"}
ATTACHED_LAG_S = 300.0

_ROTATING = (
    "speed",
    "speed2",
    "speed3",
    "current2",
    "speed_current",
    "speed_current2",
    "speed2_current",
    "speed2_current2",
)
_IRON = ("constant", "speed", "speed1.5", "speed2", "current2", *_ROTATING[4:])
LOSS_LAWS = {  # region -> laws of a heat there that some mechanism follows
    "copper": (
        "constant",
        "current",
        "current2",
        "speed2",
        "speed_current2",
        "speed2_current2",
    ),  # contacts, AC, rotor field
    "iron": _IRON,  # PWM ripple at standstill, hysteresis, eddies, load
    "magnet": ("constant", *_ROTATING),
    "rotor": ("constant", *_ROTATING),  # slot harmonics, windage, carrier
    "bearing": ("constant", "speed", "speed1.5", "speed2"),  # seals, rolling, churning
    "fluid": ("constant", "speed2", "speed3"),  # windage
    "housing": ("constant", "speed2", "current2", "speed_current2"),  # shields: leakage field
    "other": ("constant", *_ROTATING),
}
CONVECTION = ("constant", "speed", "speed1.5")
COOLING = ("", "0.5")  # exponents of the flow
_LIKE_AN_EXPONENT = re.compile(r"[a-z]\d+$")  # `flow_loop1`: an id would read a flow_loop to the first power
_TURNING = ("rotor", "magnet", "bearing")


def generate(network: Network, channels: Sequence[Sensor], inputs: Sequence[InputChannel]) -> tuple[Candidate, ...]:
    """Every candidate of a checked network with these observed channels and inputs, in a fixed order, ids unique.

    Laws use only features that the inputs give; an input `flow` stands for every flow that the network's laws tell
    apart. No two say the same: at a node or link with one term `scale` stands for that term's own law, and of two buses
    only the one with fewer inputs has a clock, as only their difference shows.
    """
    inputs = _as_named(network, inputs)
    features = _available(network, inputs)
    return (
        *_losses(network, features),
        *_conductances(network, features),
        *_capacities(network),
        *_boundaries(network),
        *_sensors(network, channels),
        *_clocks(channels, inputs),
        *_inputs(network, inputs),
        *_ageing(network),
    )


def added_monomials(candidates: Sequence[Candidate]) -> tuple[Monomial, ...]:
    """The products of features that the candidates' added terms need, in order of first use, the constant left out."""
    return tuple(m for m in dict.fromkeys(c.added for c in candidates) if m is not None and m.powers)


def _as_named(network: Network, inputs: Sequence[InputChannel]) -> list[InputChannel]:
    """The inputs as laws call them: a bench knows quantities,
    a motor with two circuits `flow_jacket` and `flow_oil`."""
    used = {feature for m in monomials(network) for feature in m.features}
    flows = [f for f in sorted(used) if is_flow(f)] or ["flow"]
    return [replace(i, name=name) for i in inputs for name in (flows if i.name == "flow" else [i.name])]


def _available(network: Network, inputs: Sequence[InputChannel]) -> frozenset[str]:
    given = {i.name for i in inputs if is_known(i.name)}
    return frozenset(f for f in given if quantity(f) in network.scale)


def _exponents(cause: Cause, features: frozenset[str]) -> dict[str, float] | None:
    """Those of a law, the current's taken by the torque where only that is known; None where a feature is not given."""
    stand_in = "torque" if "current" not in features else "current"
    exponents = {(stand_in if f == "current" else f): e for f, e in cause.exponents.items()}
    return exponents if exponents.keys() <= features else None


# --- Losses -----------------------------------------------------------------------------------------------------------


def _losses(network: Network, features: frozenset[str]) -> Iterator[Candidate]:
    terms = {source.node: source.terms for source in network.sources}
    regions = {node.name: node.region for node in network.nodes}
    size = Sigma(HEAT, "total_loss")
    for name, members in _places_with_groups(list(regions)):
        own = [terms.get(node, ()) for node in members]
        places = tuple((node,) for node in members)
        shown = members if len(members) > 1 else ()
        if all(own):
            for by in ("scale", "temperature"):
                yield _of_whole_law(network, Cause("loss", name, by), places, shown, size)
            if regions[members[0]] in ("magnet", "bearing"):
                yield _of_whole_law(network, Cause("loss", name, "session"), places, shown, size)
        for law in _laws(own, LOSS_LAWS[regions[members[0]]], features):
            sign = 0 if any(own) else 1  # where the model has no heat, a heat can only be missing
            yield _added(network, Cause("loss", name, law.name), places, shown, size, sign, law, own[0])


def _of_whole_law(
    network: Network, cause: Cause, places: tuple[Place, ...], shown: tuple[str, ...], size: Sigma
) -> Candidate:
    """`scale`, `temperature`, or what changes from session to session, of the whole law at the places;
    `size` of one more law there."""
    terms = tuple(terms_at(network, place) for place in places)
    every = tuple(i for own in terms for i in own)
    if cause.law == "scale":
        return Candidate(cause, "1", Sigma(LOG_SCALE), 0, actions.Scale(every), shown)
    if cause.law == "temperature":
        tilt = actions.Tilt(tuple(_place(network, place) for place in places), terms, references=())
        return Candidate(cause, _UNITS[cause.kind], size, 0, tilt, shown)
    unit = "1/session" if cause.law == "session" else "1/100 h"
    return Candidate(cause, unit, Sigma(SESSION), 0, actions.Course(every, cause.law), shown)


def _added(
    network: Network,
    cause: Cause,
    places: tuple[Place, ...],
    shown: tuple[str, ...],
    size: Sigma,
    sign: int,
    law: Monomial,
    own: Sequence[Term] = (),
) -> Candidate:
    """One more law at the places. It goes with copper as the place's own term of that law does."""
    like = next((term for term in own if product(term) == law), Term(1.0))
    copper = 1 if like.copper else like.resistance
    action = actions.Added(tuple(_place(network, place) for place in places), law.name, rms=1.0, own=copper)
    return Candidate(cause, _UNITS[cause.kind], size, sign, action, shown, law)


_UNITS = {"loss": "W", "conductance": "W/K"}  # of what is added


def _place(network: Network, names: Place) -> actions.Place:
    """Indices of a node or of a link's ends, boundaries last."""
    return actions.Place(*sorted(network.names.index(name) for name in names))


def _laws(own: Sequence[tuple[Term, ...]], table: Sequence[str], features: frozenset[str]) -> Iterator[Monomial]:
    """The laws of the table and of the places' own terms, without the one that a place's only term already is."""
    only = {product(terms[0]) for terms in own if len(terms) == 1}
    shared = set.intersection(*({product(term) for term in terms} for terms in own))
    ordered = [m for m in dict.fromkeys(product(t) for terms in own for t in terms) if m in shared]
    for law in table:
        exponents = _exponents(Cause("loss", "any", law), features)
        if exponents is not None:
            ordered.append(product(Term(1.0, exponents)))
    yield from (m for m in dict.fromkeys(ordered) if m not in only)


def _places_with_groups(names: Sequence[str]) -> list[tuple[str, tuple[str, ...]]]:
    return [*((name, (name,)) for name in names), *groups(names).items()]


# --- Conductances -----------------------------------------------------------------------------------------------------


def _conductances(network: Network, features: frozenset[str]) -> Iterator[Candidate]:
    present: dict[Place, tuple[Term, ...]] = {(link.a, link.b): link.terms for link in network.links}
    for name, places in links_with_groups(network, list(present)):
        shown = tuple("-".join(place) for place in places) if len(places) > 1 else ()
        own = [present[place] for place in places]
        size = Sigma(OWN_LINK, "own_conductance", places)
        yield _of_whole_law(network, Cause("conductance", name, "scale"), places, shown, size)
        table = _link_laws(network, places[0], own[0])
        if table or _at_boundary(network, places[0]):
            yield _of_whole_law(network, Cause("conductance", name, "temperature"), places, shown, size)
        if _wears(network, places[0]):
            yield _of_whole_law(network, Cause("conductance", name, "session"), places, shown, size)
        for law in _laws(own, table, features):
            yield _added(network, Cause("conductance", name, law.name), places, shown, size, 0, law, own[0])
    taken = {name for name, _ in links_with_groups(network, list(present))}
    for name, places in links_with_groups(network, missing(network)):
        if name not in taken:
            shown = tuple("-".join(place) for place in places) if len(places) > 1 else ()
            size = Sigma(MISSING_LINK, "smaller_neighbour", places)
            yield _added(network, Cause("conductance", name, "constant"), places, shown, size, 1, Monomial(()))


def _regions(network: Network, place: Place) -> tuple[str, ...]:
    regions = {node.name: node.region for node in network.nodes}
    return tuple(regions.get(end, "boundary") for end in place)


def _at_boundary(network: Network, place: Place) -> bool:
    return "boundary" in _regions(network, place)


def _link_laws(network: Network, place: Place, own: Sequence[Term]) -> tuple[str, ...]:
    """Laws with a mechanism: convection where air is, a gap turns or the file says so;
    cooling where it follows a flow."""
    regions = _regions(network, place)
    used = {feature for term in own for feature in term.exponents}
    gap = any(r in _TURNING for r in regions) and any(r in ("copper", "iron") for r in regions)
    laws = CONVECTION if "fluid" in regions or gap or "speed" in used else ()
    flows = [f for f in sorted(used) if is_flow(f) and not _LIKE_AN_EXPONENT.search(f)]
    return (*laws, *(["constant"] if flows else []), *(flow + exponent for flow in flows for exponent in COOLING))


def _wears(network: Network, place: Place) -> bool:
    """Films that foul, insulation that degrades, fits that open: what changes from session to session."""
    regions = set(_regions(network, place))
    return "boundary" in regions or _insulated(network, place) or regions in ({"iron", "housing"}, {"rotor"})


def _insulated(network: Network, place: Place) -> bool:
    regions = _regions(network, place)
    return "copper" in regions and "iron" in regions


# --- The rest ---------------------------------------------------------------------------------------------------------


def _capacities(network: Network) -> Iterator[Candidate]:
    capacity = {node.name: node.capacity for node in network.nodes}
    for name, members in _places_with_groups(list(capacity)):
        nodes = tuple(map(network.names.index, members))
        shown = members if len(members) > 1 else ()
        yield Candidate(Cause("capacity", name, "scale"), "1", Sigma(CAPACITY), 0, actions.Capacity(nodes), shown)
        size = Sigma(CAPACITY * float(np.mean([capacity[node] for node in members])))
        mass = actions.Attached(nodes, ATTACHED_LAG_S)
        yield Candidate(Cause("capacity", name, "attached"), "J/K", size, 1, mass, shown)


def _boundaries(network: Network) -> Iterator[Candidate]:
    for b, boundary in enumerate(network.boundaries):
        cause = Cause("boundary", boundary.name, "bias")
        yield Candidate(cause, "K", Sigma(BOUNDARY_BIAS_K), 0, actions.BoundaryBias(b))


def sensor_place(channel: Sensor, channels: Sequence[Sensor]) -> str:
    """A sensor's place in ids: its node where it is the only channel that follows it alone, or, where none does, the
    only one that follows it by more than half; else `node@signal`."""
    own = [c for c in channels if c.node == channel.node and c.weights[c.node] > 0.5]
    alone = [c for c in own if len(c.weights) == 1]
    return channel.node if (alone or own) == [channel] else f"{channel.node}@{spelt(channel.name)}"


def _sensors(network: Network, channels: Sequence[Sensor]) -> Iterator[Candidate]:
    ambient = any(boundary.name == AMBIENT for boundary in network.boundaries)
    places = {c.name: sensor_place(c, channels) for c in channels}
    for channel in channels:
        for one in SENSOR_LAWS:
            if ambient or not (issubclass(one, Misreading) and one.of_ambient):
                cause = Cause("sensor", places[channel.name], one.law)
                yield Candidate(cause, one.unit, Sigma(one.sd), one.sign, one(channel.name))
    for a, b in combinations(channels, 2):
        if a.bus == b.bus and a.weights != b.weights:
            cause = Cause("sensor", places[a.name], f"swap_{places[b.name]}")
            yield Candidate(cause, "1", Sigma(1.0), 1, Exchange(a.name, b.name))


def _clocks(channels: Sequence[Sensor], inputs: Sequence[InputChannel]) -> Iterator[Candidate]:
    if not inputs:
        return
    buses = list(dict.fromkeys([*(i.bus for i in inputs), *(c.bus for c in channels)]))
    driving = [sum(i.bus == bus for i in inputs) for bus in buses]
    # Only their difference shows: the one with fewer inputs stands for it, and one alone shows nothing.
    if len(buses) < 3:
        buses = buses[1:] if driving[0] >= driving[-1] else buses[:1]
    for bus in buses:
        own = tuple(c.name for c in channels if c.bus == bus)
        for drifts, size in ((False, CLOCK_S), (True, CLOCK_PPM)):
            late = actions.Late(own, drifts) if own else actions.Late(tuple(c.name for c in channels), drifts, -1.0)
            yield Candidate(Cause("clock", spelt(bus), late.law), late.unit, Sigma(size), 0, late)


def _inputs(network: Network, inputs: Sequence[InputChannel]) -> Iterator[Candidate]:
    used = {feature for m in monomials(network) for feature in m.features}
    for name in dict.fromkeys(i.name for i in inputs if i.name in used):
        own = str(quantity(name))
        gain = FLOW_GAIN if own == "flow" else INPUT_GAIN
        yield Candidate(Cause("input", name, "gain"), "1", Sigma(gain), 0, actions.InputGain(name))
        size, bias = Sigma(INPUT_BIAS * network.scale[own]), actions.InputBias(name, network.scale[own])
        yield Candidate(Cause("input", name, "bias"), INPUT_UNITS[own], size, 0, bias)


def _ageing(network: Network) -> Iterator[Candidate]:
    """Slot insulation with the hours above its class: the limit of its copper node, 180 degC where none is given."""
    limits = {node.name: node.limit_degC or 180.0 for node in network.nodes if node.region == "copper"}
    insulated = [(link.a, link.b) for link in network.links if _insulated(network, (link.a, link.b))]
    for name, places in links_with_groups(network, insulated):
        limit = next(limits[end] for end in places[0] if end in limits)
        law = f"hours_above_{limit:.15g}degC"
        shown = tuple("-".join(place) for place in places) if len(places) > 1 else ()
        yield _of_whole_law(network, Cause("ageing", name, law), places, shown, Sigma(SESSION))
