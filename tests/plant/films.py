"""Heat transfer coefficients of the films over speed and flow, each with an exponent of its own; W/(m2 K)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from plant.geometry import Geometry

Floats = NDArray[np.float64]

FLOW0 = 10.0  # l/min: the scale of a motor file
AIR_W_per_mK, AIR_m2_per_s = 0.029, 2.1e-5  # at 80 degC


@dataclass(frozen=True)
class Film:
    """The coefficient h = rest + turning x ratio^exponent, ratio of the speed or the flow (`by`) to its scale."""

    rest: float
    turning: float
    exponent: float
    by: str = "speed"


NOMINAL: Mapping[str, Film] = {  # the air gap has a law of its own; balls in W/K
    "jacket": Film(350.0, 3900.0, 0.80, "flow"),
    "outer_jacket": Film(250.0, 2600.0, 0.80, "flow"),
    "endwinding": Film(18.0, 95.0, 0.75),
    "shield": Film(14.0, 75.0, 0.70),
    "end_plate": Film(12.0, 190.0, 0.80),
    "tooth_end": Film(8.0, 80.0, 0.70),
    "swirl": Film(15.0, 130.0, 0.80),
    "shaft_end": Film(10.0, 60.0, 0.60),
    "balls": Film(3.2, 1.4, 0.50),
    "bare": Film(4.0, 0.0, 1.0),
}


@dataclass(frozen=True)
class FilmLaws:
    """The laws of one specimen: `films` over speeds up to `top_rpm`, and of the air gap a `gap_factor` and a change
    `gap_tilt` of its exponent."""

    films: Mapping[str, Film] = field(default_factory=lambda: dict(NOMINAL))
    top_rpm: float = 16_000.0
    gap_factor: float = 1.0
    gap_tilt: float = 0.0


def gap_film(geometry: Geometry, speed_rpm: Floats, top_rpm: float, tilt: float = 0.0) -> Floats:
    """Each side of the air gap: Nu k / (2 gap) with Becker & Kaye's Nusselt numbers over the Taylor number
    omega^2 r gap^3 / nu^2 (J. Heat Transfer 84 (1962) 97), the three ranges joined smoothly."""
    omega = np.abs(speed_rpm) * np.pi / 30
    taylor = omega**2 * geometry.rotor_radius * geometry.gap**3 / AIR_m2_per_s**2
    vortices, turbulent = 0.128 * taylor**0.367, 0.409 * taylor**0.241
    inner = 1.0 / (1.0 / np.maximum(vortices, 1e-9) ** 4 + 1.0 / np.maximum(turbulent, 1e-9) ** 4) ** 0.25
    nusselt = (2.0**4 + inner**4) ** 0.25
    ratio = np.maximum(np.abs(speed_rpm) / top_rpm, 0.02)
    return 2.0 * nusselt * ratio**tilt * AIR_W_per_mK / (2.0 * geometry.gap)


def films(laws: FilmLaws, geometry: Geometry, speed_rpm: Floats, flow_lpm: Floats) -> dict[str, Floats]:
    """The coefficient (M,) of each film."""
    speed, flow = np.abs(speed_rpm) / laws.top_rpm, np.abs(flow_lpm) / FLOW0
    result = {
        name: film.rest + film.turning * (flow if film.by == "flow" else speed) ** film.exponent
        for name, film in laws.films.items()
    }
    wet = np.where(flow > 0.0, 1.0, 0.02)  # a dry jacket holds air
    result |= {name: result[name] * wet for name, film in laws.films.items() if film.by == "flow"}
    gap = laws.gap_factor * gap_film(geometry, speed_rpm, laws.top_rpm, laws.gap_tilt)
    return result | {"gap_rotor": gap, "gap_stator": gap}
