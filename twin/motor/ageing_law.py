"""A coefficient that goes with a specimen's earlier heat: the law in the motor file, and the network as a specimen
has it now.

A dose is a number of hours above a temperature. It does not change within a session, so a session's network is one
with other coefficients, and no kernel sees anything of ageing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

from twin.motor.network import Link, Network, Source, Term

P = TypeVar("P", Link, Source)

HUNDRED_H = 100.0
UNKNOWN_SD = 5.0  # % per 100 h


@dataclass(frozen=True)
class Ageing:
    """How a coefficient changes with dose. Behind a dose of h hours above `above_degC` it is

        coefficient * exp(ln(1 + percent_per_100h / 100) max(h - from_h, 0) / 100 h)

    which is above 0 at any dose. `percent_per_100h` above -100; `sd`: how well it is known, in the same unit;
    `from_h`: the dose at which the change begins.
    """

    above_degC: float
    percent_per_100h: float
    sd: float
    from_h: float = 0.0

    @classmethod
    def of_resistance(cls, above_degC: float, slope_percent_per_100h: float, sd: float, from_h: float = 0.0) -> Ageing:
        """The law of a conductance whose resistance grows by `slope_percent_per_100h`, 100 times the slope of ln R
        over 100 h, with its sd; positive is worse."""
        left = math.exp(-slope_percent_per_100h / 100.0)
        return cls(above_degC, 100.0 * (left - 1.0), sd * left, from_h)

    @property
    def rate(self) -> float:
        """Rate of the coefficient's logarithm per 100 h."""
        return math.log1p(self.percent_per_100h / 100.0)

    @property
    def rate_sd(self) -> float:
        """Standard deviation of `rate`."""
        return self.sd / (100.0 + self.percent_per_100h)

    def counting_100h(self, from_dose_h: float, to_dose_h: float) -> float:
        """The part of the heat between two doses that is behind `from_h`, in 100 h."""
        return (max(to_dose_h, self.from_h) - max(from_dose_h, self.from_h)) / HUNDRED_H


@dataclass(frozen=True)
class AgeingTerm(Term):
    """A term whose coefficient is that of a new specimen and changes with the dose."""

    ageing: Ageing = field(kw_only=True)


def ageing_term(term: Term, law: Ageing) -> AgeingTerm:
    """A term that ages by `law`, whatever it did before."""
    return AgeingTerm(**_shared(term), ageing=law)


@dataclass(frozen=True)
class AgeingPlace:
    """An ageing law of a network: where its term stands (a node, or a link as `a-b`), and whether that is
    insulation."""

    place: str
    insulation: bool
    ageing: Ageing


def ageing_places(network: Network) -> tuple[AgeingPlace, ...]:
    """The distinct ageing laws of a network, its configurations' aside, in the order of its coefficients."""
    return tuple(dict.fromkeys(_places(network)))


def _places(network: Network) -> Iterator[AgeingPlace]:
    places: tuple[Link | Source, ...] = (*network.links, *network.sources)
    for one in places:
        yield from (place_of(network, one, term) for term in one.terms if isinstance(term, AgeingTerm))


def place_of(network: Network, one: Link | Source, term: AgeingTerm) -> AgeingPlace:
    """The ageing place of a term of a link or source."""
    if isinstance(one, Link):
        return AgeingPlace(f"{one.a}-{one.b}", is_insulation(network, one), term.ageing)
    return AgeingPlace(one.node, False, term.ageing)


def aged(network: Network, factors: Mapping[AgeingPlace, float]) -> Network:
    """The network of a specimen: each ageing term becomes a plain one, its coefficient times the factor of its place.

    `factors`: one for each of `ageing_places`; a network without any comes back as it is. Configurations are left
    alone: use it behind `configured`.
    """
    if not factors:
        return network

    def renewed(one: P) -> P:
        return replace(one, terms=tuple(_plain(network, one, term, factors) for term in one.terms))

    return replace(network, links=tuple(map(renewed, network.links)), sources=tuple(map(renewed, network.sources)))


def _plain(network: Network, one: Link | Source, term: Term, factors: Mapping[AgeingPlace, float]) -> Term:
    if not isinstance(term, AgeingTerm):
        return term
    return replace(Term(**_shared(term)), coefficient=term.coefficient * factors[place_of(network, one, term)])


def with_ageing(network: Network, law: Ageing) -> Network:
    """The network whose insulation ages by `law`: every term of every link of copper and iron, its configurations'
    too."""

    def ageing(links: tuple[Link, ...]) -> tuple[Link, ...]:
        return tuple(
            replace(link, terms=tuple(ageing_term(term, law) for term in link.terms))
            if is_insulation(network, link)
            else link
            for link in links
        )

    configurations = tuple(replace(one, links=ageing(one.links)) for one in network.configurations)
    return replace(network, links=ageing(network.links), configurations=configurations)


def insulation_law(network: Network | None, above_degC: float) -> Ageing:
    """The first ageing law of a network's insulation over hours above this temperature; a rate of 0 with an sd of 5 %
    per 100 h where it has none."""
    found = (one.ageing for one in (ageing_places(network) if network else ()) if one.insulation)
    return next((law for law in found if law.above_degC == above_degC), Ageing(above_degC, 0.0, UNKNOWN_SD))


def is_insulation(network: Network, link: Link) -> bool:
    """Whether a link leads from copper to iron."""
    regions = {node.name: node.region for node in network.nodes}
    return {regions.get(link.a), regions.get(link.b)} == {"copper", "iron"}


def _shared(term: Term) -> dict[str, Any]:
    """The fields that every term has."""
    return {one.name: getattr(term, one.name) for one in fields(Term)}
