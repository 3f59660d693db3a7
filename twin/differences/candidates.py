"""The candidate causes of a motor on a bench, as data: what each is called, what it does, and how large it may be.

What a cause does is an action (`twin.fitting.actions`), as of a healthy difference, times an amplitude that is 0 in the
motor file's model. The prior size of the amplitude (`twin.differences.sizes`) is a share of a scale of this motor and
campaign, fixed before any data are seen: one rule serves a 5 kW servo and a 250 kW drive.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from twin.differences.sizes import Sigma
from twin.fitting import actions
from twin.fitting.actions import Action
from twin.motor.causes import IN_SESSION, Cause, groups, spelt
from twin.motor.features import Monomial, is_flow, is_known, monomials, product, quantity
from twin.motor.network import Network, Term
from twin.motor.paths import Place, links_with_groups, missing, terms_at
from twin.motor.sensor import Sensor
from twin.motor.sensor_laws import AMBIENT, SENSOR_LAWS, Exchange, Lag, Misreading

Places = tuple[Place, ...]


@dataclass(frozen=True)
class InputChannel:
    """What drives the model: a quantity such as `speed`, `current`, `flow`, or a boundary's name; and the bus that
    stamps it."""

    name: str
    bus: str


@dataclass(frozen=True)
class Candidate:
    """One candidate cause. Its amplitude is in `unit`, has the prior size `sigma`, and can only be above 0 (`sign` 1),
    only below (-1) or either (0). `members`: the places that share the amplitude, where the cause acts on a group of
    them; `added`: the product of features that a heat or path which the cause adds goes with; `test`: the number of the
    one that it acts in, None for all.

    What its `action` needs to know of the tests `twin.differences.proposals` fills in."""

    cause: Cause
    unit: str
    sigma: Sigma
    sign: int
    action: Action | Exchange
    members: tuple[str, ...] = ()
    added: Monomial | None = None
    test: int | None = None

    @property
    def discrete(self) -> bool:
        """Whether it is there or not, without a size: `twin.diagnosis.swaps` looks for it before calibration."""
        return isinstance(self.action, Exchange)

    @property
    def repeated(self) -> bool:
        """Whether it changes from session to session, and so shows only in several sessions of one kind."""
        return isinstance(self.action, actions.Course)

    @property
    def sayable(self) -> bool:
        """Whether a motor or bench file can say it: none says what differs from session to session."""
        return not self.repeated and self.test is None

    @property
    def places(self) -> Places:
        """Where a cause of the motor acts: nodes, or both ends of links."""
        return tuple(tuple(name.split("-")) for name in self.members or (self.cause.place,))


# --- The tables: laws that have a mechanism ---------------------------------------------------------------------------

HEAT, LOG_SCALE, OWN_LINK, MISSING_LINK, CAPACITY, SESSION = 0.05, float(np.log(2)), 1.0, 0.2, 0.3, 0.15
INPUT_GAIN, FLOW_GAIN, INPUT_BIAS, BOUNDARY_BIAS_K = 0.05, 0.3, 0.02, 3.0
CLOCK_S, CLOCK_PPM = 5.0, 100.0
LOGGER_LAG_S = 10.0  # of a mean over 20 s, as loggers take it against hum
SESSIONS_FROM = 3  # to learn from: of two nobody sees which is off
INPUT_UNITS = {"speed": "rpm", "torque": "Nm", "voltage": "V", "flux": "Wb", "flow": "lpm", "current": "A"}
ATTACHED_LAG_S = 300.0

_BOTH = ("speed_current", "speed_current2", "speed2_current", "speed2_current2")
_ROTATING = ("constant", "speed", "speed2", "speed3", "current2", *_BOTH)
LOSS_LAWS = {  # region -> laws of a heat there that some mechanism follows
    # contacts, AC, rotor field
    "copper": ("constant", "current", "current2", "speed", "speed1.5", "speed2", "speed_current2", "speed2_current2"),
    # PWM ripple at standstill, hysteresis, eddies, load
    "iron": ("constant", "speed", "speed1.5", "speed2", "current2", *_BOTH),
    "magnet": _ROTATING,
    "rotor": _ROTATING,  # slot harmonics, windage, carrier
    "bearing": ("constant", "speed", "speed1.5", "speed2"),  # seals, rolling, churning
    "fluid": ("constant", "speed2", "speed3"),  # windage
    "housing": ("constant", "speed2", "current2", "speed_current2"),  # shields: leakage field
    "other": _ROTATING,
}
CONVECTION = ("constant", "speed", "speed1.5")
COOLING = ("", "0.5")  # exponents of the flow
_LIKE_AN_EXPONENT = re.compile(r"[a-z]\d+$")  # `flow_loop1`: an id would read a flow_loop to the first power
_TURNING = ("rotor", "magnet", "bearing")
_READ_TURNING = ("rotor", "magnet")  # of a bearing it is the ring that stands which is read


def generate(
    network: Network, channels: Sequence[Sensor], inputs: Sequence[InputChannel], sessions: Sequence[str] = ()
) -> tuple[Candidate, ...]:
    """Every candidate of a checked network with these observed channels and inputs, in a fixed order, ids unique;
    `sessions`: the names of those to learn from.

    Laws use only features that the inputs give; an input `flow` stands for every flow that the network's laws tell
    apart. No two say the same: at a node or link with one term `scale` stands for that term's own law, of two buses
    only the one with fewer inputs has a clock, as only their difference shows, and of buses of inputs alone only the
    one with the most.
    """
    inputs = _as_named(network, inputs)
    features = frozenset(i.name for i in inputs if is_known(i.name) and quantity(i.name) in network.scale)
    return (
        *_losses(network, features),
        *_conductances(network, features),
        *_capacities(network),
        *_boundaries(network, sessions),
        *_sensors(network, channels, features),
        *_clocks(channels, inputs),
        *_loggers(channels, inputs),
        *_inputs(network, inputs),
        *_ageing(network),
    )


def added_monomials(candidates: Sequence[Candidate]) -> tuple[Monomial, ...]:
    """The products of features that the candidates' added terms need, in order of first use, the constant left out."""
    return tuple(m for m in dict.fromkeys(c.added for c in candidates) if m is not None and m.powers)


def _as_named(network: Network, inputs: Sequence[InputChannel]) -> list[InputChannel]:
    """The inputs as laws call them: where a bench says `flow`, a motor with two circuits has `flow_jacket` and
    `flow_oil`."""
    flows = [f for f in sorted(_used(network)) if is_flow(f)] or ["flow"]
    return [replace(i, name=name) for i in inputs for name in (flows if i.name == "flow" else [i.name])]


def _used(network: Network) -> set[str]:
    """The features of the network's laws."""
    return {feature for m in monomials(network) for feature in m.features}


# --- Losses -----------------------------------------------------------------------------------------------------------


def _losses(network: Network, features: frozenset[str]) -> Iterator[Candidate]:
    terms = {source.node: source.terms for source in network.sources}
    regions = {node.name: node.region for node in network.nodes}
    size = Sigma(HEAT, "total_loss")
    for name, members in _places_with_groups(list(regions)):
        own = [terms.get(node, ()) for node in members]
        places = tuple((node,) for node in members)
        if all(own):
            changes = ["scale", "temperature", *(["session"] if regions[members[0]] in ("magnet", "bearing") else [])]
            for law in changes:
                yield _of_whole_law(network, Cause("loss", name, law), places, size)
        sign = 0 if any(own) else 1  # where the model has no heat, a heat can only be missing
        for more in _laws(own, LOSS_LAWS[regions[members[0]]], features):
            yield _added(network, Cause("loss", name, more.name), places, size, sign, more, own[0])


def _shown(places: Places) -> tuple[str, ...]:
    """The `members` of a candidate that acts at these places: none where it is a single one."""
    return tuple("-".join(place) for place in places) if len(places) > 1 else ()


def _of_whole_law(network: Network, cause: Cause, places: Places, size: Sigma) -> Candidate:
    """A change of all terms at the places together: by one factor (law `scale`), with temperature, or from session to
    session. `size`: prior of what one more law there would add, which is that of the change with temperature."""
    terms = tuple(terms_at(network, place) for place in places)
    every, shown = tuple(i for own in terms for i in own), _shown(places)
    if cause.law == "scale":
        return Candidate(cause, "1", Sigma(LOG_SCALE), 0, actions.Scale(every), shown)
    if cause.law == "temperature":
        tilt = actions.Tilt(tuple(_place(network, place) for place in places), terms, references=())
        return Candidate(cause, _UNITS[cause.kind], size, 0, tilt, shown)
    unit = "1/session" if cause.law == "session" else "1/100 h"
    return Candidate(cause, unit, Sigma(SESSION), 0, actions.Course(every, cause.law), shown)


def _added(
    network: Network, cause: Cause, places: Places, size: Sigma, sign: int, law: Monomial, own: Sequence[Term] = ()
) -> Candidate:
    """One more law at the places. It follows copper's resistance as the place's `own` term of that law does."""
    like = next((term for term in own if product(term) == law), Term(1.0))
    copper = 1 if like.copper else like.resistance
    action = actions.Added(tuple(_place(network, place) for place in places), law.name, rms=1.0, own=copper)
    return Candidate(cause, _UNITS[cause.kind], size, sign, action, _shown(places), law)


_UNITS = {"loss": "W", "conductance": "W/K"}  # of what is added


def _place(network: Network, names: Place) -> actions.Place:
    """Indices of a node or of a link's ends, boundaries last."""
    return actions.Place(*sorted(network.names.index(name) for name in names))


def _laws(own: Sequence[tuple[Term, ...]], table: Sequence[str], features: frozenset[str]) -> Iterator[Monomial]:
    """The laws that may be added at places: those that their own terms share, then those of the table whose features
    are given (torque where there is no current). A place's only term is left out, as its `scale` says the same."""
    stand_in = "current" if "current" in features else "torque"
    only = {product(terms[0]) for terms in own if len(terms) == 1}
    shared = set.intersection(*({product(term) for term in terms} for terms in own))
    ordered = [m for m in dict.fromkeys(product(t) for terms in own for t in terms) if m in shared]
    for law in table:
        powers = Cause("loss", "any", law).exponents
        exponents = {(stand_in if f == "current" else f): e for f, e in powers.items()}
        if exponents.keys() <= features:
            ordered.append(product(Term(1.0, exponents)))
    yield from (m for m in dict.fromkeys(ordered) if m not in only)


def _places_with_groups(names: Sequence[str]) -> list[tuple[str, tuple[str, ...]]]:
    """(name in cause ids, nodes): every node, then nodes that are twins together."""
    return [*((name, (name,)) for name in names), *groups(names).items()]


# --- Conductances -----------------------------------------------------------------------------------------------------


def _conductances(network: Network, features: frozenset[str]) -> Iterator[Candidate]:
    present: dict[Place, tuple[Term, ...]] = {(link.a, link.b): link.terms for link in network.links}
    named = links_with_groups(network, list(present))
    for name, places in named:
        own = [present[place] for place in places]
        size = Sigma(OWN_LINK, "own_conductance", places)
        table = _link_laws(network, places[0], own[0])
        changes = ["scale"]
        if table or "boundary" in _regions(network, places[0]):
            changes.append("temperature")
        if _wears(network, places[0]):
            changes.append("session")
        for law in changes:
            yield _of_whole_law(network, Cause("conductance", name, law), places, size)
        for more in _laws(own, table, features):
            yield _added(network, Cause("conductance", name, more.name), places, size, 0, more, own[0])
    taken = {name for name, _ in named}
    for name, places in links_with_groups(network, missing(network)):
        if name not in taken:
            size = Sigma(MISSING_LINK, "smaller_neighbour", places)
            for added in (Monomial(()), *_flow_laws(network, places[0], features)):
                yield _added(network, Cause("conductance", name, added.name), places, size, 1, added)


def _regions(network: Network, place: Place) -> tuple[str, ...]:
    """What is at both ends of a link: region of a node, or "boundary"."""
    regions = {node.name: node.region for node in network.nodes}
    return tuple(regions.get(end, "boundary") for end in place)


def _link_laws(network: Network, place: Place, own: Sequence[Term]) -> tuple[str, ...]:
    """The laws that some mechanism lets a link follow: convection where air is, where a gap turns or where the file
    says so; cooling where the link follows a flow."""
    regions = _regions(network, place)
    used = {feature for term in own for feature in term.exponents}
    gap = any(r in _TURNING for r in regions) and any(r in ("copper", "iron") for r in regions)
    laws = CONVECTION if "fluid" in regions or gap or "speed" in used else ()
    flows = _flows(used)
    return (*laws, *(["constant"] if flows else []), *(flow + exponent for flow in flows for exponent in COOLING))


def _flow_laws(network: Network, place: Place, features: frozenset[str]) -> Iterator[Monomial]:
    """The laws of a missing path to a coolant besides the constant: of the flows that the coolant's links follow."""
    around = {boundary.name for boundary in network.boundaries} & set(place)
    cooling = (term for link in network.links if {link.a, link.b} & around for term in link.terms)
    flows = _flows({feature for term in cooling for feature in term.exponents} & features)
    yield from (product(Term(1.0, {flow: float(power or 1)})) for flow in flows for power in COOLING)


def _flows(used: Collection[str]) -> list[str]:
    """The flows among features, but for those whose names a cause's id would misread."""
    return [f for f in sorted(used) if is_flow(f) and not _LIKE_AN_EXPONENT.search(f)]


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
        nodes, shown = tuple(map(network.names.index, members)), _shown(tuple((node,) for node in members))
        yield Candidate(Cause("capacity", name, "scale"), "1", Sigma(CAPACITY), 0, actions.Capacity(nodes), shown)
        size = Sigma(CAPACITY * float(np.mean([capacity[node] for node in members])))
        mass = actions.Attached(nodes, ATTACHED_LAG_S)
        yield Candidate(Cause("capacity", name, "attached"), "J/K", size, 1, mass, shown)


def _boundaries(network: Network, sessions: Sequence[str]) -> Iterator[Candidate]:
    """What a boundary reads too much, always or in one session: an inlet that is not measured but taken to be the
    outlet, a thermometer put elsewhere, air that is drawn from another hall that day are as large then as any
    constant error."""
    names = Counter(map(spelt, sessions))
    for b, boundary in enumerate(network.boundaries):
        size, bias = Sigma(BOUNDARY_BIAS_K), actions.BoundaryBias(b)
        yield Candidate(Cause("boundary", boundary.name, "bias"), "K", size, 0, bias)
        for number, session in enumerate(map(spelt, sessions)):
            if len(sessions) >= SESSIONS_FROM and names[session] == 1:
                cause = Cause("boundary", boundary.name, f"{IN_SESSION}{session}")
                yield Candidate(cause, "K", size, 0, bias, test=number)


def sensor_place(channel: Sensor, channels: Sequence[Sensor]) -> str:
    """A sensor's place in ids: its node where it is the only channel that follows no other node, or, where every
    channel there does, the only one that follows this node by more than half; else `node@signal`."""
    own = [c for c in channels if c.node == channel.node and c.weights[c.node] > 0.5]
    alone = [c for c in own if len(c.weights) == 1]
    return channel.node if (alone or own) == [channel] else f"{channel.node}@{spelt(channel.name)}"


def _sensors(network: Network, channels: Sequence[Sensor], features: frozenset[str]) -> Iterator[Candidate]:
    ambient = {AMBIENT} & {boundary.name for boundary in network.boundaries}
    turning = {node.name for node in network.nodes if node.region in _READ_TURNING}
    places = {c.name: sensor_place(c, channels) for c in channels}
    for channel in channels:
        for one in SENSOR_LAWS:
            if _can_misread(one, channel, ambient | features, turning):
                cause = Cause("sensor", places[channel.name], one.law)
                yield Candidate(cause, one.unit, Sigma(_sd(one, network)), one.sign, one(channel.name))
    for a, b in combinations(channels, 2):
        if a.bus == b.bus and a.weights != b.weights:
            cause = Cause("sensor", places[a.name], f"swap_{places[b.name]}")
            yield Candidate(cause, "1", Sigma(1.0), 1, Exchange(a.name, b.name))


def _can_misread(
    law: type[Misreading | Lag], channel: Sensor, given: Collection[str], turning: Collection[str]
) -> bool:
    """Whether what the law goes with is `given`, and its place turns (is one of the nodes `turning`) where it goes with
    speed."""
    if not issubclass(law, Misreading):
        return True
    beside = AMBIENT if law.of_ambient else law.of_input
    return (not beside or beside in given) and (law.of_input != "speed" or channel.node in turning)


def _sd(law: type[Misreading | Lag], network: Network) -> float:
    """The prior size of a law's amount on this motor, in its unit."""
    if issubclass(law, Misreading) and law.of_input:
        return law.sd * law.per / network.scale[law.of_input]
    return law.sd


def _clocks(channels: Sequence[Sensor], inputs: Sequence[InputChannel]) -> Iterator[Candidate]:
    if not inputs:
        return
    watching, inputs_of = {c.bus for c in channels}, Counter(i.bus for i in inputs)
    # of loggers of inputs alone, each as if all sensors were early, the one that drives most stands for all
    alone = max((bus for bus in inputs_of if bus not in watching), key=inputs_of.__getitem__, default=None)
    every = dict.fromkeys([*inputs_of, *(c.bus for c in channels)])
    buses = [bus for bus in every if bus in watching or bus == alone]
    driving = [inputs_of[bus] for bus in buses]
    # only their difference shows: the one with fewer inputs stands for it, and one alone shows nothing
    if len(buses) < 3:
        buses = buses[1:] if driving[0] >= driving[-1] else buses[:1]
    for bus in buses:
        own = tuple(c.name for c in channels if c.bus == bus)
        for drifts, size in ((False, CLOCK_S), (True, CLOCK_PPM)):
            late = actions.Late(own, drifts) if own else actions.Late(tuple(c.name for c in channels), drifts, -1.0)
            yield Candidate(Cause("clock", spelt(bus), late.law), late.unit, Sigma(size), 0, late)


def _loggers(channels: Sequence[Sensor], inputs: Sequence[InputChannel]) -> Iterator[Candidate]:
    """A logger that smooths all that it records, where another one records beside it: a filter against hum or a mean
    over some seconds, which nobody wrote down. Of one with a single sensor it is that sensor's lag."""
    buses = dict.fromkeys(c.bus for c in channels)
    several = bool(inputs) and len({*buses, *(i.bus for i in inputs)}) > 1
    for bus in buses if several else ():
        smoothed = actions.Slowed(tuple(c.name for c in channels if c.bus == bus))
        if len(smoothed.channels) > 1:
            cause = Cause("clock", spelt(bus), smoothed.law)
            yield Candidate(cause, smoothed.unit, Sigma(LOGGER_LAG_S), 1, smoothed)


def _inputs(network: Network, inputs: Sequence[InputChannel]) -> Iterator[Candidate]:
    used = _used(network)
    for name in dict.fromkeys(i.name for i in inputs if i.name in used):
        own = str(quantity(name))
        gain = FLOW_GAIN if own == "flow" else INPUT_GAIN
        yield Candidate(Cause("input", name, "gain"), "1", Sigma(gain), 0, actions.InputGain(name))
        size, bias = Sigma(INPUT_BIAS * network.scale[own]), actions.InputBias(name, network.scale[own])
        yield Candidate(Cause("input", name, "bias"), INPUT_UNITS[own], size, 0, bias)


def _ageing(network: Network) -> Iterator[Candidate]:
    """Slot insulation that changes with the hours above its class: the limit of its copper node, 180 degC where the
    file gives none."""
    limits = {node.name: node.limit_degC or 180.0 for node in network.nodes if node.region == "copper"}
    insulated = [(link.a, link.b) for link in network.links if _insulated(network, (link.a, link.b))]
    for name, places in links_with_groups(network, insulated):
        limit = next(limits[end] for end in places[0] if end in limits)
        cause = Cause("ageing", name, f"hours_above_{limit:.15g}degC")
        yield _of_whole_law(network, cause, places, Sigma(SESSION))
