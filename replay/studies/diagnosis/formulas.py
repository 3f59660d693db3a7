"""A term as a formula with numbers and units, and what a new motor file says otherwise than the old one."""

from __future__ import annotations

import difflib
import re

from twin.motor.features import product, scale
from twin.motor.network import Map, Network, Shape, Term

_SYMBOLS = {  # feature -> symbol, unit of its scale
    "speed": ("n", "rpm"),
    "current": ("I", "A"),
    "current_d": ("I_d", "A"),
    "current_q": ("I_q", "A"),
    "torque": ("M", "Nm"),
    "voltage": ("U", "V"),
    "flux": ("Psi", "Wb"),
    "flow": ("V", "l/min"),
}


def formula(term: Term, place: str, network: Network) -> str:
    """What a term adds at a place: a node, or a link as `a-b`. Features are magnitudes, temperatures T in degC.

    `loss of magnet [W] += 96 (n/16000 rpm)^2 (I/450 A)^2`
    """
    ends = place.split("-")
    what = f"loss of {place} [W]" if len(ends) == 1 else f"conductance {ends[0]} to {ends[1]} [W/K]"
    factors = [_power(feature, exponent, network) for feature, exponent in product(term).powers]
    where = ""
    if isinstance(term.shape, Map):
        factors.append(f"map(n, {_SYMBOLS[term.shape.over][0]})")
    elif term.shape is not None:
        factors.append("f(n, I)" if any(term.shape.current_slope) else "f(n)")
        where = f", {_shape(term.shape, network)}"
    factors += _temperatures(term, place, network)
    sign = "-=" if term.coefficient < 0 else "+="
    return " ".join([what, sign, f"{abs(term.coefficient):.4g}", *factors]) + where


def text_diff(before: bytes, after: bytes) -> str:
    """The changed lines of a text with one line around them, `-` old, `+` new; "" where both are equal.

    Line ends and a byte order mark do not count; there are no names or dates of files above.
    """
    old, new = (data.decode("utf-8-sig").splitlines() for data in (before, after))
    return "\n".join(list(difflib.unified_diff(old, new, n=1, lineterm=""))[2:])


def _power(feature: str, exponent: float, network: Network) -> str:
    return f"({_ratio(feature, network)})" + ("" if exponent == 1 else f"^{exponent:.4g}")


def _ratio(feature: str, network: Network) -> str:
    """`n/16000 rpm`."""
    hours = re.fullmatch(r"hours_above_(.+)degC", feature)
    if hours:
        return f"hours above {hours[1]} degC/1 h"
    base, _, circuit = feature.partition("_") if feature.startswith("flow_") else (feature, "", "")
    symbol, unit = _SYMBOLS[base]
    return f"{symbol}{'_' * bool(circuit)}{circuit}/{scale(network, feature):.7g} {unit}"


def _temperatures(term: Term, place: str, network: Network) -> list[str]:
    found = []
    if term.copper or term.resistance:
        copper = network.copper
        divided = "/ " * (term.resistance == -1)
        found.append(divided + _slope(copper.alpha_per_K, place, copper.reference_degC))
    if term.temperature is not None:
        found.append(_slope(term.temperature.slope_per_K, term.temperature.node, term.temperature.reference_degC))
    return found


def _slope(per_K: float, node: str, reference_degC: float) -> str:
    sign = "-" if per_K < 0 else "+"
    return f"(1 {sign} {abs(per_K):.4g}/K (T_{node} - {reference_degC:g} degC))"


def _shape(shape: Shape, network: Network) -> str:
    """`f = 0.9 at 0, 1.2 + 0.1 I/450 A at 4000, 1 at 16000 rpm, linear between`."""
    current = f" {_ratio('current', network)}" if any(shape.current_slope) else ""
    at = []
    for knot, factor, slope in zip(shape.speed, shape.factor, shape.current_slope, strict=True):
        grows = f" {'-' if slope < 0 else '+'} {abs(slope):.4g}{current}" if slope else ""
        at.append(f"{1 + factor:.4g}{grows} at {knot * scale(network, 'speed'):.7g}")
    return f"f = {', '.join(at)} rpm, linear between"
