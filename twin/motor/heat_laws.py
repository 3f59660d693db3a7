"""The laws of heat, each written once, as text: what flows into a node at given temperatures.

A text is straight-line arithmetic over these names:

    amount             what the terms of one place and law add up to [W in a source, W/K in a link]
    own                temperature of the node that takes the heat [degC]
    far                temperature of the link's other end, or of the fluid that comes [degC]
    other              temperature of the node that a temperature factor goes by [degC]
    alpha, reference   of copper [1/K, degC]
    slope, level       of the temperature factor [1/K, degC]; slope 0 where there is none
    relative           heat capacity of the fluid that comes, over that at 20 degC

Nobody writes a slope: `twin.compiled.differentiate` takes them from the text. The straight-line kernel has the text
in it (`twin.compiled.law_text`), all other programs call a function that is compiled from it (`twin.compiled.heat`).
So a new law of a link is one row of `LINKS`, its name in `replay/schema/motor.schema.json` and its row in
`docs/motor_file.md`.

numba keeps what it compiled in `__pycache__` and does not see that a text here changed: delete these folders then.

Everything is made of sums, products, quotients and square roots, for the reason given in `twin.arithmetic.powers`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

TEMPERATURES = ("own", "far", "other")  # what a heat has slopes with

FACTOR = "factor = 1.0 + slope * (other - level)"  # the temperature factor of any law

# The table of a fluid is a sum of ramps: between its knots `low` and `high` each adds its rise [1/K] times this.
RAMP = "min(max(far, low), high) - low"


@dataclass(frozen=True)
class HeatLaw:
    """`heat` [W], an expression over `amount`, `factor` and the names of `lines`; these, `name = expression` each,
    are worked out before it."""

    lines: tuple[str, ...]
    heat: str


# What drives the heat of a link, the last line of each: `drop` [K], to be multiplied by W/K. It is the difference of
# the two temperatures itself for radiation about 20 degC, for free convection at 10 K.
LINKS: Mapping[str, tuple[str, ...]] = {
    "linear": ("drop = far - own",),
    # (T_b^4 - T_a^4) / (4 (293.15 K)^3), absolute temperatures
    "radiation": (
        "cold = own + 273.15",
        "warm = far + 273.15",
        "cold2 = cold * cold",
        "warm2 = warm * warm",
        "drop = (warm2 * warm2 - cold2 * cold2) / (4.0 * 293.15 * 293.15 * 293.15)",
    ),
    # |T_b - T_a|^(1/4) (T_b - T_a) / (10 K)^(1/4): laminar films, Nu ~ Ra^(1/4) (S. W. Churchill, H. H. S. Chu, Int.
    # J. Heat Mass Transfer 18 (1975) 1323, doi:10.1016/0017-9310(75)90243-4). Below 0.1 K the power is rounded off,
    # so that it is smooth where the heat turns round.
    "free_convection": (
        "gap = far - own",
        "square = gap * gap + 0.01",
        "share = math.sqrt(math.sqrt(math.sqrt(square))) / math.sqrt(math.sqrt(math.sqrt(100.01)))",
        "drop = share * gap",
    ),
}
STREAM = ("drop = relative * (far - own)",)  # fluid whose heat capacity goes with temperature

LAWS: Mapping[str, HeatLaw] = {
    **{name: HeatLaw(lines, "amount * factor * drop") for name, lines in LINKS.items()},
    "stream": HeatLaw(STREAM, "amount * factor * drop"),
    "source": HeatLaw((), "amount * factor"),
    "copper": HeatLaw(("rise = 1.0 + alpha * (own - reference)",), "amount * rise * factor"),
    "resistance": HeatLaw(("rise = 1.0 / (1.0 + alpha * (own - reference))",), "amount * rise * factor"),
}
AFFINE = ("linear", "source", "copper")  # without a temperature factor: their heat is linear in the temperatures
NUMBER = {name: i for i, name in enumerate(LAWS)}  # of each law in the tables of compiled programs

NAMED = tuple(name for name in LINKS if name != "linear")  # what `twin.motor.network.Term.law` may say


def source_law(own: int) -> str:
    """The law of a source: `own` +1 times the factor of copper, -1 divided by it, 0 neither."""
    return {0: "source", 1: "copper", -1: "resistance"}[own]
