"""Features: the dimensionless quantities that a motor's laws are made of, and the products of powers of them.

Every feature is a magnitude, `|quantity| / scale` (|n| / n0, |torque| / T0, |i_d| / I0, ...), so any exponent is defined;
flux is 0 at standstill by definition of the frame; `hours_above_<T>degC` counts hours (scale 1 h). 0 ** 0 is 1.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.network import Network, Term
from twin.powers import power

QUANTITY = {  # feature -> the quantity of [scale] that says what 1 means
    "speed": "speed",
    "current": "current",
    "current_d": "current",
    "current_q": "current",
    "torque": "torque",
    "voltage": "voltage",
    "flux": "flux",
    "flow": "flow",
}
EXAMPLES = (*QUANTITY, "flow_jacket", "hours_above_180degC")  # of every kind of feature, for messages
_FLOW = re.compile(r"flow_[a-z][a-z0-9_]*")
_HOURS = re.compile(r"hours_above_\d+(\.\d+)?degC")


def is_known(feature: str) -> bool:
    """Whether `feature` is a name that a term may use."""
    return feature in QUANTITY or bool(_FLOW.fullmatch(feature) or _HOURS.fullmatch(feature))


def quantity(feature: str) -> str | None:
    """The quantity whose `[scale]` a feature is divided by; None for hours (1 h)."""
    if _HOURS.fullmatch(feature):
        return None
    return "flow" if _FLOW.fullmatch(feature) else QUANTITY[feature]


def scale(network: Network, feature: str) -> float:
    """What 1 means for `feature` in this motor, in the stored unit of its quantity (h for hours)."""
    name = quantity(feature)
    return 1.0 if name is None else network.scale[name]


@dataclass(frozen=True)
class Monomial:
    """A product of features to exponents, `((feature, exponent), ...)` in a fixed order, exponents above 0."""

    powers: tuple[tuple[str, float], ...]

    @property
    def exponents(self) -> Mapping[str, float]:
        """Feature -> exponent."""
        return dict(self.powers)

    @property
    def name(self) -> str:
        """The law as in cause ids: `speed2_current2`, exponents in shortest decimals, 1 not written; `constant`."""
        written = (f + ("" if e == 1 else f"{e:.15g}") for f, e in self.powers)
        return "_".join(written) or "constant"


def _order(feature: str) -> tuple[int, str]:
    known = list(QUANTITY)
    return (known.index(feature) if feature in known else len(known), feature)


def monomial(term: Term) -> Monomial:
    """The product of features of a term; exponents of 0 are left out."""
    used = sorted((f for f, e in term.exponents.items() if e != 0), key=_order)
    return Monomial(tuple((f, float(term.exponents[f])) for f in used))


def terms(network: Network) -> Iterator[Term]:
    """Every term in the order of the coefficients: links first, then sources, as written."""
    for link in network.links:
        yield from link.terms
    for source in network.sources:
        yield from source.terms


def monomials(network: Network) -> tuple[Monomial, ...]:
    """The distinct products that the network's terms use, in order of first use, the constant left out.

    These are the columns of `Frame.features`, in this order.
    """
    found = dict.fromkeys(monomial(term) for term in terms(network))
    return tuple(m for m in found if m.powers)


def evaluate(monomials: tuple[Monomial, ...], u: Mapping[str, NDArray[np.float64]], length: int) -> NDArray[np.float64]:
    """(length, m): each monomial over the dimensionless features `u`, feature -> (length,), of which the magnitude is taken.

    `u` must hold every feature used.

    >>> import numpy as np
    >>> evaluate((Monomial((("speed", 2.0),)),), {"speed": np.array([0.5, -1.0])}, 2)
    array([[0.25],
           [1.  ]])
    """
    result = np.ones((length, len(monomials)))
    for column, item in enumerate(monomials):
        for feature, exponent in item.powers:
            result[:, column] *= power(np.abs(u[feature]), exponent)
    return result
