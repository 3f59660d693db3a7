"""Hidden effects: each by the id of its cause (`kind.place.law`) and a size. The catalogue is data; README.md says it
aloud.

`Effect("loss.magnet.speed2_current2", 150.0)`: 150 W more at 16,000 rpm and 450 A. Effects that no law of a thermal
network has are called `unknown.<what>`; their cause is "unknown" and `node` says where they act.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plant.geometry import BOUNDARIES, NODES

Floats = NDArray[np.float64]

KINDS = ("loss", "conductance", "capacity", "boundary", "sensor", "clock", "input", "ageing", "unknown")
GROUPS = {
    "winding": ("winding_a", "winding_b"),
    "bearing": ("bearing_a", "bearing_b"),
    "end_plate": ("end_plate_a", "end_plate_b"),
    "air": ("air_a", "air_b"),
    "endwinding_inner": ("endwinding_a_inner", "endwinding_b_inner"),
    "endwinding_outer": ("endwinding_a_outer", "endwinding_b_outer"),
}
UNKNOWN = {  # what -> where its heat or its cooling acts
    "liner_gap": "winding_a",
    "spray": "endwinding_b_outer",
    "boiling": "endwinding_a_inner",
    "resonance": "bearing_a",
    "contact": "terminal_rack",
    "demagnetised": "magnet",
    "vapour": "jacket",
}
SENSED = (
    *("endwinding_a_inner", "endwinding_b_inner", "endwinding_a_outer", "endwinding_b_outer", "teeth", "yoke"),
    *("rotor_surface", "magnet", "housing", "bearing_a"),
)
SENSOR_LAWS = ("bias", "gain", "lag", "drift", "stem", "hold", "dropout", "stuck", "saturation")
_FACTOR = re.compile(r"(speed|current|torque|flow)(\d+(?:\.\d+)?)?")


@dataclass(frozen=True)
class Effect:
    """`cause`: an id; `size`: in the unit of its kind (README.md): W or W/K at the motor file's scales, a factor for
    `scale`, K, s, K/h, a share. Raises ValueError for a cause that this plant cannot hide."""

    cause: str
    size: float

    def __post_init__(self) -> None:
        if self.kind not in KINDS or len(self.cause.split(".", 2)) < (2 if self.kind == "unknown" else 3):
            raise ValueError(f"{self.cause} is no cause this plant can hide: kinds are {', '.join(KINDS)}")
        if not self._can_hide():
            raise ValueError(f"{self.cause} is no cause this plant can hide: see the list in its README")

    def _can_hide(self) -> bool:
        kind, law = self.kind, self.law
        if kind in ("loss", "capacity"):
            laws = _is_law(law, ("scale", "temperature")) if kind == "loss" else law in ("scale", "attached")
            return set(self.nodes) <= set(NODES) and laws
        if kind in ("conductance", "ageing"):
            laws = _is_law(law, ("scale", "session")) if kind == "conductance" else law == "hours_above_180degC"
            return all(a in NODES and b in (*NODES, *BOUNDARIES) for a, b in self.links) and laws
        if kind == "sensor":
            return self.place in SENSED and (law in SENSOR_LAWS or law.removeprefix("swap_") in SENSED)
        places, laws_of = {
            "unknown": (tuple(UNKNOWN), ("",)),
            "boundary": (BOUNDARIES, ("bias",)),
            "clock": (("can1", "can2"), ("offset", "drift")),
            "input": (("speed", "current", "torque", "power", "flow"), ("gain", "bias")),
        }[kind]
        return self.place in places and law in laws_of

    @property
    def kind(self) -> str:
        """The first word of its cause."""
        return self.cause.split(".", 1)[0]

    @property
    def place(self) -> str:
        """The second."""
        return self.cause.split(".", 2)[1]

    @property
    def law(self) -> str:
        """The third; "" for what no law says."""
        return self.cause.split(".", 2)[2] if self.kind != "unknown" else ""

    @property
    def scored_as(self) -> str:
        """The cause that a diagnosis has to name."""
        return "unknown" if self.kind == "unknown" else self.cause

    @property
    def node(self) -> str:
        """Where an unknown effect acts."""
        return UNKNOWN[self.place] if self.kind == "unknown" else self.place

    @property
    def nodes(self) -> tuple[str, ...]:
        """The nodes of `place`, two for a group."""
        return GROUPS.get(self.place, (self.place,))

    @property
    def links(self) -> tuple[tuple[str, str], ...]:
        """The links of `place`: a group at one end gives two, at both ends those of equal sides."""
        a, _, b = self.place.partition("-")
        left, right = GROUPS.get(a, (a,)), GROUPS.get(b, (b,))
        if len(left) == len(right):
            return tuple(zip(left, right, strict=True))
        return tuple((x, y) for x in left for y in right)

    @property
    def is_missing_path(self) -> bool:
        """Whether it is a heat path that the motor file does not have."""
        return self.kind == "conductance" and self.law not in ("scale", "session")


def _is_law(text: str, others: tuple[str, ...]) -> bool:
    return text in (*others, "constant") or all(_FACTOR.fullmatch(part) for part in text.split("_"))


def law(text: str, features: dict[str, Floats]) -> Floats:
    """The product of powers that a law says, (M,); features are ratios to the motor file's scales."""
    result = np.ones_like(next(iter(features.values())))
    for part in () if text == "constant" else text.split("_"):
        match = _FACTOR.fullmatch(part)
        if match is None:
            raise ValueError(f"law {text}: {part} is no power of speed, current, torque or flow")
        result = result * np.abs(features[match[1]]) ** float(match[2] or 1.0)
    return result


@dataclass(frozen=True)
class Hidden:
    """A row of the catalogue: sizes worth hiding, and for what it is easily mistaken."""

    cause: str
    sizes: tuple[float, ...]
    unit: str
    mistaken_for: str

    def effects(self) -> tuple[Effect, ...]:
        """One for each size."""
        return tuple(Effect(self.cause, size) for size in self.sizes)


CATALOGUE = (
    Hidden("loss.magnet.speed2", (60.0, 120.0), "W", "windage"),
    Hidden("loss.magnet.speed2_current2", (150.0, 400.0, 900.0), "W", "stray loss in the rotor core"),
    Hidden("loss.magnet.temperature", (-0.001, -0.003), "1/K", "magnet eddy loss"),
    Hidden("loss.winding.speed2_current2", (400.0, 1200.0), "W a half", "slot conductance"),
    Hidden("loss.endwinding_a_inner.speed2_current2", (150.0, 400.0), "W", "cooling by air"),
    Hidden("loss.terminal_rack.current2", (300.0,), "W", "endwinding copper"),
    Hidden("loss.bearing_a.speed", (60.0, 150.0), "W", "the other bearing"),
    Hidden("loss.rotor_surface.speed3", (100.0, 250.0), "W", "magnet loss"),
    Hidden("loss.yoke.scale", (1.3, 1.6), "factor", "teeth"),
    Hidden("loss.magnet.scale", (1.7, 2.4), "factor", "windage, air gap"),
    Hidden("conductance.rotor_surface-teeth.speed1.5", (3.0, 8.0), "W/K", "magnet loss"),
    Hidden("conductance.endwinding_a_inner-air_a.speed1.5", (2.0, 5.0), "W/K", "AC copper"),
    Hidden("conductance.endwinding_a_outer-jacket.constant", (2.0, 5.0), "W/K", "stem conduction"),
    Hidden("conductance.shaft-coolant.constant", (2.0, 5.0), "W/K", "magnet gain"),
    Hidden("conductance.shaft-ambient.constant", (2.0, 5.0), "W/K", "drift"),
    Hidden("conductance.jacket-coolant.scale", (0.8, 0.65), "factor", "flow meter"),
    Hidden("conductance.winding-teeth.scale", (0.8, 0.65), "factor", "shrink fit"),
    Hidden("conductance.yoke-jacket.scale", (0.6,), "factor", "liner"),
    Hidden("conductance.yoke-jacket.session", (0.2,), "share a session", "flow"),
    Hidden("ageing.winding-teeth.hours_above_180degC", (-0.35,), "share per 100 h", "shrink fit"),
    Hidden("capacity.endwinding_a_inner.attached", (150.0,), "J/K", "thermocouple lag"),
    Hidden("capacity.magnet.scale", (1.4,), "factor", "lag"),
    Hidden("boundary.coolant.bias", (2.0, 4.0), "K", "bias of all"),
    Hidden("sensor.endwinding_a_inner.lag", (5.0, 10.0), "s", "added mass"),
    Hidden("sensor.magnet.bias", (3.0, 6.0), "K", "magnet loss"),
    Hidden("sensor.magnet.gain", (0.03, 0.06), "share", "shaft cooling"),
    Hidden("sensor.magnet.drift", (2.0, 4.0), "K/h", "ageing"),
    Hidden("sensor.endwinding_b_inner.stem", (0.05, 0.10), "share", "path to the housing"),
    Hidden("sensor.magnet.hold", (0.1, 0.3), "share of time", "cooling"),
    Hidden("sensor.magnet.dropout", (0.3,), "share of frames", "nothing"),
    Hidden("sensor.rotor_surface.stuck", (0.4,), "share of time", "rotor cooling"),
    Hidden("sensor.endwinding_a_inner.saturation", (150.0,), "degC", "cooling when hot"),
    Hidden("sensor.endwinding_a_inner.swap_endwinding_b_inner", (1.0,), "-", "asymmetry"),
    Hidden("sensor.teeth.swap_yoke", (1.0,), "-", "iron losses"),
    Hidden("clock.can2.offset", (0.5, 2.0, 5.0), "s", "lag of all"),
    Hidden("clock.can2.drift", (100.0, 400.0), "ppm", "lag that grows"),
    Hidden("input.current.gain", (0.03, 0.05), "share", "all copper losses"),
    Hidden("input.flow.gain", (0.3,), "share", "film"),
    Hidden("unknown.liner_gap", (0.55,), "factor while open", "two masses"),
    Hidden("unknown.spray", (6.0,), "W/K while it leaks", "flow"),
    Hidden("unknown.boiling", (0.25,), "W/K per K above 120 degC", "cooling by air"),
    Hidden("unknown.resonance", (250.0,), "W at 9,200 rpm", "bearing drag"),
    Hidden("unknown.contact", (500.0,), "W at 450 A while it is bad", "contact loss"),
    Hidden("unknown.demagnetised", (600.0,), "W at 450 A, one sign of torque only", "magnet loss"),
    Hidden("unknown.vapour", (0.45,), "factor of the film in the last quarter of an hour of hot running", "fouling"),
)


def typical(cause: str) -> Effect:
    """The first size of the catalogue. Raises ValueError where it is not there."""
    for hidden in CATALOGUE:
        if hidden.cause == cause:
            return hidden.effects()[0]
    raise ValueError(f"{cause} is not in the catalogue")
