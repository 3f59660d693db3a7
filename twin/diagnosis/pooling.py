"""The widths of the priors of healthy differences, learnt from the data family by family.

A file whose films are fits is off by tens of per cent in its exponents; one whose truth has its own form is not. How
far a family of numbers is off (all exponents, all conductances, all missing paths ...) is learnt from all its members
together, so that one that stands out is seen. This is empirical Bayes: the scale of each family's prior is that of the
largest evidence (D. J. C. MacKay, Neural Computation 4 (1992) 415, doi:10.1162/neco.1992.4.3.415), with a prior on the
scale that counts as one member. The form of the losses is a family in each region: iron whose loss falls with current
may be three times as far from its file as a magnet's, and both be healthy. Capacities are never narrower than the file
says, however many agree with it: how much of a thick lump follows depends on the pace.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.model import Floats
from twin.motor import sensor_laws
from twin.motor.network import NOBODY, Network

Bools = NDArray[np.bool_]

STATED = (0.1, 3.0)  # times the prior's own sd: what a file says of its numbers
FORM = (1.0, 6.0)  # of how far the losses of a region are from the file's form, of which a file says nothing
LUMPED = (1.0, 3.0)  # of a capacity, which is exact of the lump and not of the part of it that follows
BENCH = (0.3, 3.0)  # of what a bench and its sensors are off by: a few tests say little of what others may do
WEIGHT = 1.0  # well-determined members that the prior on a family's scale counts for, at the scale that it has
ITERATIONS = 15
POOLED_FROM = 5  # members: fewer say little of their family


def kinds(network: Network) -> list[str]:
    """The kind of every term of the network: `films` (links to a fluid or boundary, or whose law has features),
    `conduction`, or `losses`."""
    solid = {node.name for node in network.nodes if node.region != "fluid"}
    found = []
    for link in network.links:
        film = not {link.a, link.b} <= solid or any(term.exponents for term in link.terms)
        found += ["films" if film else "conduction"] * len(link.terms)
    return found + ["losses" for source in network.sources for _ in source.terms]


def regions(network: Network) -> list[str]:
    """The region where the loss of every term of the network arises; "" for terms of links."""
    region = {node.name: node.region for node in network.nodes}
    links = [""] * sum(len(link.terms) for link in network.links)
    return links + [region[source.node] for source in network.sources for _ in source.terms]


@dataclass(frozen=True)
class Family:
    """Healthy differences that are as wide as each other: `name`, and what their prior sd is multiplied by at `least`
    and at `most`."""

    name: str
    least: float
    most: float


def family(parameter: Parameter, kind: Sequence[str], region: Sequence[str]) -> Family | None:
    """The family of a healthy difference, `kind` and `region` of every term; None where it stands alone."""
    match parameter.action:
        case actions.Scale(terms):
            return Family(kind[terms[0]] if len(terms) == 1 else f"{kind[terms[0]]} of both sides", *STATED)
        case actions.Tent(terms):
            return Family(f"form of the losses in {region[terms[0]]}", *FORM)
        case actions.Capacity():
            return Family("capacities", *LUMPED)
        case actions.Power():
            return Family("exponents", *STATED)
        case actions.Added(places) if places[0].b != NOBODY:
            return Family("paths", *STATED)
        case actions.Tilt(_, terms):
            return Family(f"slopes of {kind[terms[0][0]]}", *BENCH)
        case actions.Start():
            return Family("starts", *BENCH)
        case sensor_laws.Bias() | sensor_laws.Gain() | sensor_laws.Lag() as law:
            return Family(f"{type(law).__name__.lower()} of {parameter.name.partition('.')[0]}s", *BENCH)
    return None


def pooled_scales(
    parameters: Sequence[Parameter], free: Bools, network: Network, gram: Floats, right: Floats, more: Floats
) -> list[float]:
    """What to multiply the prior sd of every parameter by.

    `free` (p,) says which parameters have columns A: `gram` = A'A, `right` = A'e0, whitened. Behind them stand columns
    of other terms, with the prior sds `more`. Parameters without columns take the scale of their family.
    """
    kind, region = kinds(network), regions(network)
    every = [family(p, kind, region) for p in parameters]
    inside = [one for one, own in zip(every, free, strict=True) if own]
    places = {one: np.array([i for i, other in enumerate(inside) if other == one]) for one in set(inside) if one}
    families = {one: own for one, own in places.items() if len(own) >= POOLED_FROM}
    stated = np.array([p.sd for p, own in zip(parameters, free, strict=True) if own])
    scale: dict[Family | None, float] = dict.fromkeys(families, 1.0)
    scales = np.ones(len(inside))
    for _ in range(ITERATIONS):
        sd = np.concatenate([stated * scales, more])
        factor = cho_factor(gram + np.diag(1 / sd**2), lower=True)
        beta = cho_solve(factor, right)
        variance = np.diag(cho_solve(factor, np.eye(len(sd))))
        for one, own in families.items():
            determined = float(np.sum(1 - variance[own] / sd[own] ** 2))
            square = float(np.sum((beta[own] / stated[own]) ** 2))
            fresh = np.sqrt((square + WEIGHT) / (determined + WEIGHT))
            scales[own] = scale[one] = float(np.clip(fresh, one.least, one.most))
    return [scale.get(one, 1.0) for one in every]
