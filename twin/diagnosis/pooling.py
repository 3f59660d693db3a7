"""The widths of the priors of healthy differences, learnt from the data family by family.

A file whose films are fits is off by tens of per cent in its exponents; one whose truth has its own form is not. How
far a family of numbers is off (all exponents, all conductances, all missing paths ...) is learnt from all its members
together, so that one that stands out is seen. This is empirical Bayes: the scale of each family's prior is that of the
largest evidence (D. J. C. MacKay, Neural Computation 4 (1992) 415, doi:10.1162/neco.1992.4.3.415), with a prior on the
scale that counts as one member. Maps of losses are no family: one node's law may be twice as far off as all others and
be healthy.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.model import Floats
from twin.motor.network import NOBODY, Network

Bools = NDArray[np.bool_]

SMALLEST, LARGEST = 0.1, 1.0  # of the prior's own sd
WEIGHT = 1.0  # well-determined members that the prior on a family's scale counts for, at the scale that it has
ITERATIONS = 15
POOLED_FROM = 5  # members: fewer say little of their family


def kinds(network: Network) -> list[str]:
    """Of every term of the network whether it is of `films` (links to a fluid or boundary, or whose law has features),
    of `conduction`, or of `losses`."""
    solid = {node.name for node in network.nodes if node.region != "fluid"}
    found = []
    for link in network.links:
        film = not {link.a, link.b} <= solid or any(term.exponents for term in link.terms)
        found += ["films" if film else "conduction"] * len(link.terms)
    return found + ["losses" for source in network.sources for _ in source.terms]


def family(parameter: Parameter, kind: Sequence[str]) -> str | None:
    """The family of a healthy difference, `kind` of every term; None where it stands alone."""
    match parameter.action:
        case actions.Scale(terms):
            return kind[terms[0]] if len(terms) == 1 else f"{kind[terms[0]]} of both sides"
        case actions.Capacity():
            return "capacities"
        case actions.Power():
            return "exponents"
        case actions.Added(places):
            return "paths" if places[0].b != NOBODY else None
    return None


def pooled_scales(
    parameters: Sequence[Parameter], free: Bools, kind: Sequence[str], gram: Floats, right: Floats, more: Floats
) -> list[float]:
    """What to multiply the prior sd of every parameter by.

    `free` (p,) says which parameters have columns A: `gram` = A'A, `right` = A'e0, whitened. Behind them stand columns
    of other terms, with the prior sds `more`. Parameters without columns take the scale of their family. `kind`: that
    of every term of the network.
    """
    names = [family(p, kind) for p in parameters]
    inside = [name for name, own in zip(names, free, strict=True) if own]
    places = {name: np.array([i for i, other in enumerate(inside) if other == name]) for name in set(inside) if name}
    families = {name: own for name, own in places.items() if len(own) >= POOLED_FROM}
    stated = np.array([p.sd for p, own in zip(parameters, free, strict=True) if own])
    scale = dict.fromkeys(families, 1.0)
    for _ in range(ITERATIONS):
        sd = np.concatenate([stated * [scale.get(name or "", 1.0) for name in inside], more])
        factor = cho_factor(gram + np.diag(1 / sd**2), lower=True)
        beta = cho_solve(factor, right)
        variance = np.diag(cho_solve(factor, np.eye(len(sd))))
        for name, own in families.items():
            determined = float(np.sum(1 - variance[own] / sd[own] ** 2))
            square = float(np.sum((beta[own] / stated[own]) ** 2))
            fresh = np.sqrt((square + WEIGHT) / (determined + WEIGHT))
            scale[name] = float(np.clip(fresh, SMALLEST, LARGEST))
    return [scale.get(name or "", 1.0) for name in names]
