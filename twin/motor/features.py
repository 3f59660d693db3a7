"""Features: the dimensionless quantities that a motor's laws are made of, and the products of powers of them.

Every feature is a magnitude, `|quantity| / scale` (|n| / n0, |torque| / T0, |i_d| / I0, ...), so any exponent is
defined; only a map may tell a torque that brakes from one that drives; flux is 0 at standstill by definition of the
frame; `hours_above_<T>degC` counts hours (scale 1 h). 0 ** 0 is 1.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.powers import power
from twin.motor.network import Map, Network, Shape, Term

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
_PLACE = {feature: i for i, feature in enumerate(QUANTITY)}
EXAMPLES = (*QUANTITY, "flow_jacket", "hours_above_180degC")  # of every kind of feature, for messages
STREAM_DEGC = 20.0  # where the coefficient of a stream holds
LPM_PER_M3_PER_S = 60_000.0
_FLOW = re.compile(r"flow_[a-z][a-z0-9_]*")
_HOURS = re.compile(r"hours_above_(\d+(?:\.\d+)?)degC")


def is_known(feature: str) -> bool:
    """Whether `feature` is a name that a term may use."""
    return feature in QUANTITY or bool(_FLOW.fullmatch(feature) or _HOURS.fullmatch(feature))


def above_degC(feature: str) -> float | None:
    """The temperature above which a feature counts hours [degC]; None where it counts none."""
    hours = _HOURS.fullmatch(feature)
    return float(hours[1]) if hours else None


def quantity(feature: str) -> str | None:
    """The quantity whose `[scale]` a feature is divided by; None for hours (1 h)."""
    if _HOURS.fullmatch(feature):
        return None
    return "flow" if _FLOW.fullmatch(feature) else QUANTITY[feature]


def is_flow(feature: str) -> bool:
    """Whether `feature` is a volume flow."""
    return feature == "flow" or bool(_FLOW.fullmatch(feature))


def scale(network: Network, feature: str) -> float:
    """What 1 means for `feature` in this motor, in the stored unit of its quantity (h for hours)."""
    name = quantity(feature)
    return 1.0 if name is None else network.scale[name]


@dataclass(frozen=True)
class Monomial:
    """A product of features to exponents, `((feature, exponent), ...)` in a fixed order, exponents above 0, times its
    shape or map."""

    powers: tuple[tuple[str, float], ...]
    shape: Shape | Map | None = None

    @property
    def exponents(self) -> Mapping[str, float]:
        """Feature -> exponent."""
        return dict(self.powers)

    @property
    def features(self) -> tuple[str, ...]:
        """Every feature that must be known to evaluate it: those of the product, then those of the shape."""
        return tuple(dict.fromkeys((*self.exponents, *_inputs_of(self.shape))))

    @property
    def name(self) -> str:
        """The law as in cause ids: `speed2_current2`, exponents in shortest decimals, 1 not written; `constant`.

        A shape or map adds digits of its own numbers' hash (`speed1.6*shape4f1c02ab`), so that two products never
        share a name.
        """
        written = "_".join(f + ("" if e == 1 else f"{e:.15g}") for f, e in self.powers) or "constant"
        if self.shape is None:
            return written
        kind = "map" if isinstance(self.shape, Map) else "shape"
        return f"{written}*{kind}{hashlib.sha256(repr(self.shape).encode()).hexdigest()[:8]}"


def _inputs_of(shape: Shape | Map | None) -> tuple[str, ...]:
    if shape is None:
        return ()
    if isinstance(shape, Map):
        return ("speed", shape.over)
    return ("speed", "current") if any(shape.current_slope) else ("speed",)


def _order(feature: str) -> tuple[int, str]:
    return _PLACE.get(feature, len(_PLACE)), feature


def product(term: Term) -> Monomial:
    """The product of features of a term, exponents of 0 and its shape left out: the law that cause ids name."""
    used = [(f, float(e)) for f, e in term.exponents.items() if e != 0]
    return Monomial(tuple(sorted(used, key=lambda one: _order(one[0])) if len(used) > 1 else used))


def monomial(term: Term) -> Monomial:
    """All that a term multiplies its coefficient by, temperatures aside; a shape that changes nothing is left out."""
    shape = term.shape
    if isinstance(shape, Map):
        values = tuple(map(_floats, shape.values))
        plain_map = replace(shape, speed=_floats(shape.speed), load=_floats(shape.load), values=values)
        return replace(product(term), shape=plain_map)
    if shape is None or not any((*shape.factor, *shape.current_slope)):
        return product(term)
    plain = Shape(_floats(shape.speed), _floats(shape.factor), _floats(shape.current_slope))
    return replace(product(term), shape=plain)


def _floats(values: tuple[float, ...]) -> tuple[float, ...]:
    """Equal numbers are spelt alike (0, 0.0 and -0.0): equal shapes have one name."""
    return tuple(float(value) + 0.0 for value in values)


def terms(network: Network) -> Iterator[Term]:
    """Every term in the order of the coefficients: links first, then sources, as written."""
    for link in network.links:
        yield from link.terms
    for source in network.sources:
        yield from source.terms


def placed_terms(network: Network) -> Iterator[tuple[str, Term]]:
    """`terms`, each with where it stands: a node, or a link as `a-b`."""
    for link in network.links:
        yield from ((f"{link.a}-{link.b}", term) for term in link.terms)
    for source in network.sources:
        yield from ((source.node, term) for term in source.terms)


def streams(network: Network) -> Iterator[Term]:
    """What the fluid carries into every node of every circuit, in order: rho cp at `STREAM_DEGC` times the flow [W/K].

    Their coefficients stand behind those of `terms`. They are physics and no parameters: nothing that fits or names
    laws iterates over them, but an error of the flow acts on them as on any term.
    """
    for circuit in network.circuits:
        per_lpm = circuit.fluid.at(STREAM_DEGC) / LPM_PER_M3_PER_S
        for _ in circuit.nodes:
            yield Term(per_lpm * scale(network, circuit.flow), {circuit.flow: 1.0})


def stream_places(network: Network) -> Iterator[tuple[str, str]]:
    """(where the fluid comes from, the node it flows into) of every stream."""
    for circuit in network.circuits:
        yield from zip((circuit.inlet, *circuit.nodes), circuit.nodes, strict=False)


def monomials(network: Network) -> tuple[Monomial, ...]:
    """The distinct products that the network's terms and streams use, in order of first use, the constant left out.

    These are the columns of `Frame.features`, in this order.
    """
    found = dict.fromkeys(monomial(term) for term in (*terms(network), *streams(network)))
    return tuple(m for m in found if m.powers or m.shape)


def evaluate(monomials: tuple[Monomial, ...], u: Mapping[str, NDArray[np.float64]], length: int) -> NDArray[np.float64]:
    """(length, m): each monomial over the dimensionless features `u`, feature -> (length,), of which the magnitude is
    taken, but for the torque of a map with torques below 0.

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
        if isinstance(item.shape, Map):
            result[:, column] *= _mapped(item.shape, u)
        elif item.shape is not None:
            result[:, column] *= _shape_factor(item.shape, u)
    return result


def beyond(table: Map, u: Mapping[str, NDArray[np.float64]]) -> NDArray[np.bool_]:
    """In which steps (length,) speed or load is outside the table."""
    result: NDArray[np.bool_] = np.zeros(1, dtype=np.bool_)
    for at, knots in zip(_operating_point(table, u), (table.speed, table.load), strict=True):
        result = result | (at < knots[0]) | (at > knots[-1])
    return result


def _operating_point(table: Map, u: Mapping[str, NDArray[np.float64]]) -> tuple[NDArray[np.float64], ...]:
    """Speed and load (length,) as a map takes them."""
    speed, load = u["speed"], u[table.over]
    brakes = speed * load < 0 if table.load[0] < 0 else np.zeros(1, dtype=np.bool_)
    return np.abs(speed), np.where(brakes, -np.abs(load), np.abs(load))


def _shape_factor(shape: Shape, u: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """What a shape multiplies by (length,). Elementwise products and sums only, for the reason given in
    `twin.arithmetic.powers`."""
    left, share = _placed(shape.speed, np.abs(u["speed"]))

    def between(values: tuple[float, ...]) -> NDArray[np.float64]:
        at = np.array(values)
        result: NDArray[np.float64] = (1 - share) * at[left] + share * at[left + 1]
        return result

    factor: NDArray[np.float64] = 1 + between(shape.factor)
    if any(shape.current_slope):
        factor = factor + between(shape.current_slope) * np.abs(u["current"])
    return factor


def _mapped(table: Map, u: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """What a map multiplies by (length,)."""
    values = np.array(table.values)
    speed, load = _operating_point(table, u)
    (i, along), (j, across) = _placed(table.speed, speed), _placed(table.load, load)
    low = (1 - across) * values[i, j] + across * values[i, j + 1]
    high = (1 - across) * values[i + 1, j] + across * values[i + 1, j + 1]
    result: NDArray[np.float64] = (1 - along) * low + along * high
    return result


def _placed(rising: tuple[float, ...], u: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """The knot at or before each value (length,), the last but one at most, and the share of the way to the next
    (length,)."""
    knots = np.array(rising)
    at = np.clip(u, knots[0], knots[-1])
    left = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, knots.size - 2)
    return left, (at - knots[left]) / (knots[left + 1] - knots[left])
