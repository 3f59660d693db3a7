"""How far healthy motors are from their priors: z of what may differ every day, by family.

z is a parameter over the sd that it was judged by, after the campaign has set the widths; its data determine the share
1 - variance / sd^2 of it. Where widths are right, the rms of z over the root of that share is near 1 in every family,
nothing is beyond 4, and nothing ends at its bound.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.fit import Fit
from twin.motor.network import NOBODY, Network
from twin.motor.sensor_laws import SensorLaw

RIGHT = (0.7, 1.2)  # the rms of z over the root of the share determined
ENOUGH = 20.0  # values determined over the motors, from which on that is judged
MOST_Z, MOST_HELD = 4.0, 0.02


@dataclass(frozen=True)
class Spread:
    """One family in one or more motors: how many parameters, the sum of z^2 and of the shares determined, the largest
    |z| and whose it is, how many ended at a bound, and in how many of the `motors` at least one."""

    parameters: int
    square: float
    determined: float
    largest: float
    whose: str
    held: int
    motors_held: int
    motors: int = 1

    @property
    def ratio(self) -> float | None:
        """The rms of z over the root of the share determined."""
        return (self.square / self.determined) ** 0.5 if self.determined > 0 else None

    @property
    def breaks(self) -> list[str]:
        """What is not as it should be, in words."""
        judged = self.ratio is not None and self.determined >= ENOUGH
        wrong = {
            "width too wide": judged and (self.ratio or 0.0) < RIGHT[0],
            "width too narrow": judged and (self.ratio or 0.0) > RIGHT[1],
            f"beyond {MOST_Z:g}": self.largest > MOST_Z,
            "held at a bound": self.motors_held > MOST_HELD * self.motors,
        }
        return [words for words, is_so in wrong.items() if is_so]


def spreads(mode: Fit) -> dict[str, Spread]:
    """Family -> its spread in one motor."""
    terms = _terms(mode.model.network)
    members: defaultdict[str, list[int]] = defaultdict(list)
    for i, parameter in enumerate(mode.model.parameters):
        members[_family(parameter, terms)].append(i)
    z = mode.beta / mode.model.sd
    determined = 1 - mode.covariance_diagonal / mode.model.sd**2
    found = {}
    for name, own in members.items():
        worst = max(own, key=lambda i: abs(z[i]))
        held = int((~mode.free[own]).sum())
        found[name] = Spread(
            len(own),
            float(np.sum(z[own] ** 2)),
            float(np.sum(determined[own])),
            abs(float(z[worst])),
            mode.model.parameters[worst].name,
            held,
            int(held > 0),
        )
    return found


Terms = Sequence[tuple[str, str]]  # of every term: `films`, `conduction` or `losses`, and the region of its heat


def _family(parameter: Parameter, terms: Terms) -> str:
    """The audit's own families, so that tables of two versions of the product can be held against each other."""
    match parameter.action:
        case actions.Scale(own):
            return terms[own[0]][0] + (" of both sides" if len(own) > 1 else "")
        case actions.Capacity():
            return "capacities"
        case actions.Power():
            return "exponents"
        case actions.Tent(own):
            return f"maps of {terms[own[0]][1]}"
        case actions.Tilt(places):
            return "slopes of losses" if places[0].b == NOBODY else "slopes of films"
        case actions.Added(places):
            return "added heats" if places[0].b == NOBODY else "paths"
        case actions.Start():
            return "starts"
        case actions.BoundaryBias():
            return "boundaries"
        case actions.InputGain() | actions.InputBias():
            return "inputs"
        case actions.Beside():
            return "place of a reading"
        case actions.Late():
            return "clocks"
        case SensorLaw():
            return f"{parameter.action.law} of a reading"
    return type(parameter.action).__name__


def _terms(network: Network) -> Terms:
    """What every term of a network is of; a film is a link to a fluid or boundary, or one whose law has features."""
    region = {node.name: node.region for node in network.nodes}
    found = []
    for link in network.links:
        fluid = {"fluid", "boundary"} & {region.get(end, "boundary") for end in (link.a, link.b)}
        film = fluid or any(term.exponents for term in link.terms)
        found += [("films" if film else "conduction", "")] * len(link.terms)
    return found + [("losses", region[source.node]) for source in network.sources for _ in source.terms]


def together(motors: Iterable[Mapping[str, Spread]]) -> dict[str, Spread]:
    """The spreads of several motors, family by family."""
    of_family: defaultdict[str, list[Spread]] = defaultdict(list)
    for motor in motors:
        for name, one in motor.items():
            of_family[name].append(one)
    return {name: _sum(own) for name, own in of_family.items()}


def _sum(own: Sequence[Spread]) -> Spread:
    worst = max(own, key=lambda one: one.largest)
    return Spread(
        sum(one.parameters for one in own),
        sum(one.square for one in own),
        sum(one.determined for one in own),
        worst.largest,
        worst.whose,
        sum(one.held for one in own),
        sum(one.motors_held for one in own),
        sum(one.motors for one in own),
    )
