"""A motor of another size from one that is known: every length times one number, materials and turns the same.

What stays the same at features of 1: flux density, linear current density, speed, number of turns and poles, and the
speed of the coolant. So 1 means `length` times the current, its cube the torque, its square the voltage, flux and
coolant flow. Each value then follows a power of the length ratio k, from lambda A / d, h A, rho l / A and the eddy
loss per volume, omega^2 B^2 d^2 / rho:

capacity k^3; conduction k^1; film k^2; copper DC loss k^1 (current squared by k^2, resistance by 1/k); eddy losses in
bars and magnets, which grow with the motor, k^5; iron, bearings and all else by volume, k^3.

None of these powers is certain: a contact lies between conduction and area, the surface of a rotor loses by volume
and by eddy currents. So each has a standard deviation, which widens the prior of the value by `sd |ln k|`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from twin.errors import BadValueError, Entry
from twin.motor.network import Link, Network, Node, Source, Term

MOST = 10.0  # times larger or smaller: beyond that no similarity is left


@dataclass(frozen=True)
class Growth:
    """How a value grows with the motor: with `k ** power`; `sd`: standard deviation of that power."""

    power: float
    sd: float


CAPACITY = Growth(3, 0.2)
CONDUCTION = Growth(1, 0.5)
FILM = Growth(2, 0.5)
COPPER_DC = Growth(1, 0.25)
EDDY = Growth(5, 1.0)  # AC loss of bars, and magnets
VOLUME = Growth(3, 0.5)  # iron, bearings
MIXED = Growth(3, 1.0)  # rotor surface, windage and what else has no rule of its own

SCALE = {"speed": 0.0, "current": 1.0, "torque": 3.0, "voltage": 2.0, "flux": 2.0, "flow": 2.0}  # power of what 1 means
_LOSS = {"iron": VOLUME, "bearing": VOLUME, "magnet": EDDY}


def scaled(network: Network, length: float) -> Network:
    """The motor with every length times `length` [1], named `<name>_x<length>`.

    Raises `BadValueError` where `length` is not between 1/10 and 10.
    """
    if not (math.isfinite(length) and 1 / MOST <= length <= MOST):
        says = f"length {length:g} times is no motor of the same kind: give a number from {1 / MOST:g} to {MOST:g}"
        raise BadValueError(Entry("motor", 0, network.name), says)
    regions = {node.name: node.region for node in network.nodes}

    def links(of: Sequence[Link]) -> tuple[Link, ...]:
        return tuple(_link(link, regions, length) for link in of)

    def sources(of: Sequence[Source]) -> tuple[Source, ...]:
        return tuple(_source(source, regions.get(source.node, "other"), length) for source in of)

    return replace(
        network,
        name=f"{network.name}_x{length:g}",
        nodes=tuple(_node(node, length) for node in network.nodes),
        links=links(network.links),
        sources=sources(network.sources),
        scale={quantity: value * length ** SCALE[quantity] for quantity, value in network.scale.items()},
        configurations=tuple(
            replace(one, links=links(one.links), sources=sources(one.sources)) for one in network.configurations
        ),
    )


def link_growth(link: Link, term: Term, regions: dict[str, str]) -> Growth:
    """How a link's term grows: as a film where an end is a fluid or a boundary, or the term has a law of its own or
    moves with a feature; else as conduction."""
    still = term.law is None and not any(term.exponents.values())
    solid = all(regions.get(end, "fluid") != "fluid" for end in (link.a, link.b))
    return CONDUCTION if still and solid else FILM


def loss_growth(term: Term, region: str) -> Growth:
    """How a loss grows, by what makes the heat: copper by its factors and features, the rest by the region of its
    node."""
    if term.copper or term.resistance or region == "copper":
        alternating = term.resistance or term.exponents.get("speed", 0.0) > 0
        return EDDY if alternating else COPPER_DC
    return _LOSS.get(region, MIXED)


def _grown(value: float, sd: float, growth: Growth, length: float) -> tuple[float, float]:
    return value * length**growth.power, round(math.hypot(sd, growth.sd * math.log(length)), 3)


def _node(node: Node, length: float) -> Node:
    capacity, sd = _grown(node.capacity, node.sd, CAPACITY, length)
    return replace(node, capacity=capacity, sd=sd)


def _term(term: Term, growth: Growth, length: float) -> Term:
    coefficient, sd = _grown(term.coefficient, term.sd, growth, length)
    return replace(term, coefficient=coefficient, sd=sd)


def _link(link: Link, regions: dict[str, str], length: float) -> Link:
    return replace(link, terms=tuple(_term(t, link_growth(link, t, regions), length) for t in link.terms))


def _source(source: Source, region: str, length: float) -> Source:
    return replace(source, terms=tuple(_term(t, loss_growth(t, region), length) for t in source.terms))
