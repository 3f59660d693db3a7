"""What a healthy motor may do that its file does not say: every difference a parameter with a prior in physical units.

A candidate cause is tested beyond these; what is left out here is found as a "cause" in every healthy motor.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import TypeVar

import numpy as np

from twin.arithmetic.hats import hat
from twin.fitting import actions
from twin.fitting.actions import Parameter, Place
from twin.fitting.recorded import Floats, RecordedChannel, Test
from twin.motor import features, sensor_laws
from twin.motor.causes import groups
from twin.motor.network import Network, Term
from twin.motor.paths import links_with_groups, missing, terms_of

BOUND = math.log(4.0)  # of the factor of one place: beyond it a cause would be called a coefficient
BOTH = math.log(20.0)  # bound of the factor of both sides: a textbook's film may be so far off, wherever it stands
ALIKE = 2.0  # times the sd of one side: what a file has wrong it has wrong on both
EXPONENT_SHARE = 0.2  # sd of an exponent over the exponent: those of a lumped file are fits
KNOTS = 5
LEAST_LEFT = 0.1  # of a loss that a map may leave, where the tests go: no loss is negative
MAP_SD = 0.2  # of the whole loss; of copper at top speed, for what direct current loses there is known
TILT_PER_K, FILM_TILT_PER_K, MOST_TILT_PER_K = 0.0015, 0.002, 0.008
STANDSTILL_SHARE = 0.0015  # of the mean total loss: heat of the current's ripple in the rotor
PATH_SHARE, MOST_PATH = 0.1, 0.05  # of the smaller end's largest conductance; at most of the median over nodes of it
COOLANT_K, AMBIENT_K = 0.2, 0.5
INPUT_GAIN = {"current": 0.005, "current_d": 0.005, "current_q": 0.005, "torque": 0.005, "flow": 0.01}
CHANNEL_GAIN, CHANNEL_LAG_S = 0.01, 0.8
LUMPS = 21  # of a motor whose channels lag by that: larger lumps are slower, as heat goes through them
BESIDE = 0.1  # share of a neighbour in what a sensor follows: a lump is not the place of its sensor
CLOCK_S, CLOCK_TEST_S, CLOCK_PPM = 0.25, 0.05, 15.0
START_K = 3.0  # least sd of a start: a measured one is in the data already, and as wrong as its sensor
ROTATING = ("rotor", "magnet")


def everyday(network: Network, tests: Sequence[Test]) -> tuple[Parameter, ...]:
    """The parameters of a healthy motor on these tests."""
    return (
        *laws(network),
        *both_sides(network),
        *_exponents(network),
        *_film_slopes(network, tests),
        *_maps(network, tests),
        *_standstill(network, tests),
        *_paths(network, tests),
        *_sensors(network, tests),
        *_beside(network, tests),
        *(p for number, test in enumerate(tests) for p in of_test(network, test, number)),
    )


def of_test(network: Network, test: Test, number: int) -> Iterator[Parameter]:
    """What a test brings along: where it starts, what its sensors, clocks, boundaries and inputs are off by."""
    yield from starts_and_biases(network, test, number, START_K)
    for bus, own in _buses([test]).items():
        yield Parameter(f"clock.{bus}.test", actions.Late(own, False), CLOCK_TEST_S, number)
    cooled = _cooled_by_flow(network)
    for b, boundary in enumerate(network.boundaries):
        sd = COOLANT_K if boundary.name in cooled else AMBIENT_K
        yield Parameter(f"boundary.{boundary.name}.bias", actions.BoundaryBias(b), sd, number)
    used = {name for m in features.monomials(network) for name in m.features}
    for name in sorted(used):
        known = "flow" if features.quantity(name) == "flow" else name
        if known in INPUT_GAIN:
            yield Parameter(f"input.{name}.gain", actions.InputGain(name), INPUT_GAIN[known], number)


def starts_and_biases(network: Network, test: Test, number: int, least_K: float = 0.0) -> Iterator[Parameter]:
    """Where a test starts, every node with an sd of at least `least_K`, and what each of its channels and meters reads
    too much all along."""
    for i, node in enumerate(network.nodes):
        yield Parameter(f"start.{node.name}", actions.Start(i), max(least_K, float(test.initial_sd[i])), number)
    for kind, recorded in (("sensor", test.channels), ("meter", test.meters)):
        for sensor in (one.sensor for one in recorded):
            if sd := sensor.bias_sd:
                yield Parameter(f"{kind}.{sensor.name}.bias", sensor_laws.Bias(sensor.name), sd, number)


def _cooled_by_flow(network: Network) -> set[str]:
    """The ends of links that follow a flow, and where the fluid of a circuit comes from."""
    flowing = [link for link in network.links if any(f.startswith("flow") for t in link.terms for f in t.exponents)]
    return {end for link in flowing for end in (link.a, link.b)} | {circuit.inlet for circuit in network.circuits}


def laws(network: Network) -> Iterator[Parameter]:
    """Every coefficient and every capacity about the motor file's, with the file's sd of its logarithm."""
    for i, term in enumerate(features.terms(network)):
        yield Parameter(f"term{i}", actions.Scale((i,)), term.sd, low=-BOUND, high=BOUND)
    for i, node in enumerate(network.nodes):
        yield Parameter(f"capacity.{node.name}", actions.Capacity((i,)), node.sd, low=-BOUND, high=BOUND)


def both_sides(network: Network) -> Iterator[Parameter]:
    """One factor for each law that stands on both sides of a motor: a file that is wrong of one side is wrong of the
    other, whatever else it says of one of them."""
    links, sources = terms_of(network)
    every = list(features.terms(network))
    conductances = {name: [links[m] for m in members] for name, members in alike_links(network).items()}
    losses = {name: [sources[m] for m in members] for name, members in alike_sources(network).items()}
    for kind, places in (("conductance", conductances), ("loss", losses)):
        for name, sides in places.items():
            for k, both in enumerate(own for own in _by_law(every, sides) if len(own) > 1):
                wide = ALIKE * every[both[0]].sd
                yield Parameter(f"{kind}.{name}.both{k}", actions.Scale(both), wide, low=-BOTH, high=BOTH)


def _by_law(every: Sequence[Term], sides: Sequence[Sequence[int]]) -> list[tuple[int, ...]]:
    """The terms of each law, one of every side that has it; what a side has twice pairs with the other's second."""
    found: defaultdict[tuple[object, int], list[int]] = defaultdict(list)
    for side in sides:
        times: Counter[object] = Counter()
        for i in side:
            law = _form(every[i])
            found[law, times[law]].append(i)
            times[law] += 1
    return [tuple(own) for own in found.values()]


def alike_links(network: Network) -> dict[str, tuple[tuple[str, str], ...]]:
    """Every link once, with the one that mirrors it where both have a law of one form: name -> links."""
    laws = {(link.a, link.b): [_form(term) for term in link.terms] for link in network.links}
    named = [(name, tuple((a, b) for a, b in places)) for name, places in links_with_groups(network, list(laws))]
    return _alike(named, laws)


def alike_sources(network: Network) -> dict[str, tuple[str, ...]]:
    """Every source once, with its twin where both have a law of one form: name -> nodes."""
    laws = {source.node: [_form(term) for term in source.terms] for source in network.sources}
    singles: list[tuple[str, tuple[str, ...]]] = [(node, (node,)) for node in laws]
    return _alike([*singles, *groups(laws).items()], laws)


K = TypeVar("K", bound=Hashable)


def _alike(named: Sequence[tuple[str, tuple[K, ...]]], laws: Mapping[K, Sequence[object]]) -> dict[str, tuple[K, ...]]:
    found: dict[str, tuple[K, ...]] = {}
    taken: set[K] = set()
    for name, members in sorted(named, key=lambda one: -len(one[1])):
        if not taken & set(members) and set(laws[members[0]]).intersection(*(laws[m] for m in members)):
            found[name] = members
            taken |= set(members)
    return found


def _form(term: Term) -> tuple[object, ...]:
    return (*sorted(term.exponents.items()), term.copper, term.resistance, term.law)


def _exponents(network: Network) -> Iterator[Parameter]:
    """The exponents of films, which are fits; what those of losses have wrong is in the maps."""
    links, _ = terms_of(network)
    terms = list(features.terms(network))
    for name, members in alike_links(network).items():
        for both in _by_law(terms, [links[m] for m in members]):
            for feature, exponent in terms[both[0]].exponents.items():
                if not feature.startswith("hours") and exponent:
                    power, sd = actions.Power(both, feature), EXPONENT_SHARE * abs(exponent)
                    yield Parameter(f"conductance.{name}.{feature}", power, sd, low=-0.8, high=0.8)


def _film_slopes(network: Network, tests: Sequence[Test]) -> Iterator[Parameter]:
    """Films change with temperature: air conducts better when warm, radiation and free convection grow."""
    links, _ = terms_of(network)
    regions = {node.name: node.region for node in network.nodes}
    initial = np.mean([test.initial for test in tests], axis=0)
    outside = np.mean([test.frame.boundaries.mean(axis=0) for test in tests], axis=0)
    start = np.concatenate([initial, outside])
    for name, members in alike_links(network).items():
        between = {regions.get(end, "boundary") for end in members[0]}
        gap = bool(between & set(ROTATING)) and bool(between & {"copper", "iron"})
        if gap or between & {"fluid", "boundary"}:
            ends = [sorted(network.names.index(end) for end in link) for link in members]
            about = [float(start[places].mean()) for places in ends]
            own = [links[link] for link in members]
            yield _tilt(f"conductance.{name}", ends, own, about, FILM_TILT_PER_K)


def _tilt(
    name: str, ends: Sequence[Sequence[int]], terms: Sequence[tuple[int, ...]], about: Sequence[float], sd: float
) -> Parameter:
    """A change of `terms` with the temperature of their places, 0 at the temperatures `about` [degC]; sd in 1/K."""
    tilt = actions.Tilt(tuple(Place(*places) for places in ends), tuple(terms), tuple(about))
    return Parameter(f"{name}.temperature", tilt, sd, low=-MOST_TILT_PER_K, high=MOST_TILT_PER_K)


def _maps(network: Network, tests: Sequence[Test]) -> Iterator[Parameter]:
    """What losses may do over speed and current beside their laws, and with temperature. Copper's share by alternating
    current grows with speed^2, as eddy currents in thin wires do, and a file may lack it."""
    _, sources = terms_of(network)
    regions = {node.name: node.region for node in network.nodes}
    names = list(regions)
    terms = list(features.terms(network))
    top = max(float(t.inputs["speed"].max()) for t in tests) if all("speed" in t.inputs for t in tests) else 0.0
    speeds = tuple(np.linspace(0.0, top, KNOTS).tolist())
    currents = (False, True) if all("current" in t.inputs for t in tests) else (False,)
    for name, members in alike_sources(network).items():
        shaped = tuple(i for node in members for i in sources[node])
        copper = regions[members[0]] == "copper"
        if top > 0 and (copper or any(terms[i].exponents.get("speed") for i in shaped)):
            for knot in range(1 if copper else 0, KNOTS):
                sd = MAP_SD * (speeds[knot] / top) ** 2 if copper else MAP_SD
                for current in currents:
                    action = actions.Tent(shaped, speeds, knot, current)
                    low = (LEAST_LEFT - 1) / max(_largest(action, tests), 1e-3)
                    yield Parameter(f"map.{name}.{knot}{'i' if current else ''}", action, sd, low=low)
        at = [names.index(node) for node in members]
        about = [float(np.mean([t.initial[i] for t in tests])) for i in at]
        yield _tilt(f"loss.{name}", [(i,) for i in at], [sources[node] for node in members], about, TILT_PER_K)


def _largest(tent: actions.Tent, tests: Sequence[Test]) -> float:
    """The largest factor of the tent's number where the tests go."""
    tents = [hat(t.inputs["speed"], tent.speeds, tent.knot) for t in tests]
    by = [np.abs(t.inputs["current"]) if tent.current else 1.0 for t in tests]
    return max(float((one * own).max()) for one, own in zip(tents, by, strict=True))


def _standstill(network: Network, tests: Sequence[Test]) -> Iterator[Parameter]:
    """A little heat in the rotor by the current's ripple, at standstill too."""
    if not any("current" in t.inputs for t in tests) or not all("current2" in t.features for t in tests):
        return
    total = mean_loss_W(network, tests)
    rms = float(np.sqrt(np.mean(np.concatenate([t.features["current2"] for t in tests]) ** 2)))
    for i, node in enumerate(network.nodes):
        if node.region in ROTATING:
            ripple = actions.Added((Place(i),), "current2", rms)
            yield Parameter(f"loss.{node.name}.standstill", ripple, STANDSTILL_SHARE * total)


def _paths(network: Network, tests: Sequence[Test]) -> Iterator[Parameter]:
    """A little conduction where the network has no path."""
    largest = largest_conductance(network, tests)
    most = MOST_PATH * float(np.median([largest[node.name] for node in network.nodes]))
    for a, b in missing(network):
        ends = [largest[end] for end in (a, b) if largest[end]]
        if not ends:  # joined by fluid alone: nothing says how large a path may be
            continue
        sd = min(most, PATH_SHARE * min(ends))
        place = Place(network.names.index(a), network.names.index(b))
        yield Parameter(f"conductance.{a}-{b}", actions.Added((place,), "constant", 1.0), sd, low=-sd)


def _lag_sd(network: Network) -> float:
    """What a reading may be late by, beyond its sensor's own lag [s]: heat goes through a lump in a time that grows
    with the square of its length, and a motor in few lumps has large ones."""
    return float(CHANNEL_LAG_S * max(1.0, LUMPS / len(network.nodes)) ** (2 / 3))


def _sensors(network: Network, tests: Sequence[Test]) -> Iterator[Parameter]:
    for name, channel in {c.name: c for test in tests for c in test.channels}.items():
        yield Parameter(f"sensor.{name}.gain", sensor_laws.Gain(name), CHANNEL_GAIN)
        yield Parameter(
            f"sensor.{name}.lag", sensor_laws.Lag(name), _lag_sd(network), low=-channel.sensor.time_constant_s
        )
    for name, sd in {m.name: m.what.gain_sd for test in tests for m in test.meters if m.what.gain_sd}.items():
        yield Parameter(f"meter.{name}.gain", sensor_laws.Gain(name), sd)
    for bus, own in _buses(tests).items():
        yield Parameter(f"clock.{bus}.offset", actions.Late(own, False), CLOCK_S)
        yield Parameter(f"clock.{bus}.drift", actions.Late(own, True), CLOCK_PPM)


def _buses(tests: Sequence[Test]) -> dict[str, tuple[str, ...]]:
    """Channels by the bus that stamps them."""
    buses = {c.name: c.sensor.bus for test in tests for c in test.channels}
    return {bus: tuple(name for name, own in buses.items() if own == bus) for bus in dict.fromkeys(buses.values())}


def _beside(network: Network, tests: Sequence[Test]) -> Iterator[Parameter]:
    """A sensor follows a little of what its node is joined to, and of the air around it, but of nothing across a
    rotating gap."""
    air = {node.name for node in network.nodes if node.region == "fluid"}
    turning = {node.name for node in network.nodes if node.region in ROTATING}
    for channel in {c.name: c for test in tests for c in test.channels}.values():
        turns = channel.sensor.node in turning
        for one, node in every_neighbour(network, channel):
            if node in air or (node in turning) == turns:
                yield one


def every_neighbour(network: Network, channel: RecordedChannel) -> Iterator[tuple[Parameter, str]]:
    """The share of each node beside the one that a channel mostly follows, and the node."""
    names, place = [node.name for node in network.nodes], channel.sensor.node
    joined = {end for link in network.links if place in (link.a, link.b) for end in (link.a, link.b)}
    for node in sorted(joined & set(names) - {place}, key=names.index):
        beside = actions.Beside(channel.name, names.index(node))
        yield Parameter(f"sensor.{channel.name}.beside.{node}", beside, BESIDE, low=-0.5, high=0.9), node


def mean_loss_W(network: Network, tests: Sequence[Test]) -> float:
    """Mean total loss of the tests by the file, copper at its reference temperature [W]."""
    of_sources = [i for own in terms_of(network)[1].values() for i in own]
    terms = list(features.terms(network))
    total = steps = 0.0
    for test in tests:
        products = products_of(network, test.frame.features)
        for i in of_sources:
            total += terms[i].coefficient * float(products[i].sum())
        steps += len(test.frame.features)
    return total / steps


def products_of(network: Network, columns: Floats) -> list[Floats]:
    """What each term multiplies its coefficient by (N,), temperatures aside, from the `monomials` (N, m)."""
    at = {m: columns[:, j] for j, m in enumerate(features.monomials(network))}
    return [at.get(features.monomial(term), np.ones(len(columns))) for term in features.terms(network)]


def mean_conductances(network: Network, tests: Sequence[Test]) -> dict[tuple[str, str], float]:
    """Mean conductance of every link over the tests by the file [W/K]."""
    mean = np.mean(np.concatenate([t.frame.features for t in tests]), axis=0, keepdims=True)
    terms, products = list(features.terms(network)), products_of(network, mean)
    links = terms_of(network)[0]
    return {ends: float(sum(terms[i].coefficient * products[i][0] for i in own)) for ends, own in links.items()}


def largest_conductance(network: Network, tests: Sequence[Test]) -> dict[str, float]:
    """The largest mean conductance at every node and boundary [W/K]."""
    found = dict.fromkeys(network.names, 0.0)
    for (a, b), g in mean_conductances(network, tests).items():
        found[a], found[b] = max(found[a], g), max(found[b], g)
    return found
