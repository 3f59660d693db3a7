"""Dimensions and materials of the motor: everything that the mesh is computed from.

Side A carries the crowns of the hairpins and the coupling, side B the welds and the terminals; z counts from A to B.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

NODES = (
    *("shaft", "bearing_a", "bearing_b", "rotor_core", "rotor_surface", "magnet", "end_plate_a", "end_plate_b"),
    *("yoke", "teeth", "winding_a", "winding_b", "endwinding_a_inner", "endwinding_a_outer", "endwinding_b_inner"),
    *("endwinding_b_outer", "terminal_rack", "housing", "jacket", "air_a", "air_b"),
)
BOUNDARIES = ("coolant", "ambient")


@dataclass(frozen=True)
class Material:
    """Density [kg/m3], heat capacity [J/(kg K)], conductivity [W/(m K)], and across the sheets where it is
    laminated."""

    density: float
    heat_capacity: float
    conductivity: float
    across: float = 0.0

    def heats(self, volume_m3: float) -> float:
        """Heat capacity [J/K] of a volume."""
        return self.density * self.heat_capacity * volume_m3


# Handbook values (VDI Heat Atlas, chapter D6; Boglietti, Cavagnino, Staton, IEEE Trans. Energy Conv. 20 (2005), for
# slot materials).
COPPER = Material(8930.0, 385.0, 385.0)
SHEET = Material(7650.0, 460.0, 27.0, 4.0)
STEEL = Material(7800.0, 465.0, 45.0)
ALUMINIUM = Material(2700.0, 900.0, 150.0)
NDFEB = Material(7500.0, 460.0, 9.0)
RESIN = Material(1500.0, 1250.0, 0.20)  # enamel and impregnation
LINER = Material(1100.0, 1300.0, 0.14)  # aramid paper
GLYCOL = Material(1050.0, 3500.0, 0.40)  # water and glycol, 1:1, 65 degC
RHO_COPPER_20 = 1.724e-8  # ohm m
ALPHA_COPPER = 0.00393  # 1/K


@dataclass(frozen=True)
class Geometry:
    """Lengths in m. A water-jacketed 48-slot, 8-pole motor for 150 kW, 220 Nm, 16,000 rpm, 450 A rms."""

    stack: float = 0.134
    bore_radius: float = 0.0655
    slot_bottom_radius: float = 0.0820
    stator_radius: float = 0.0990
    slots: int = 48
    slot_width: float = 0.0047
    stacking: float = 0.97
    layers: int = 6  # bars of a slot; 0 lies at the slot bottom, 5 at the opening
    bar_width: float = 0.0039
    bar_height: float = 0.00195
    bar_area: float = 7.4e-6  # with rounded corners
    enamel: float = 0.10e-3
    liner: float = 0.25e-3
    near_length: float = 0.024  # of an end turn, from the stack to the bend
    crown_length_a: float = 0.034
    crown_length_b: float = 0.039  # the welds
    gap: float = 0.0008
    surface_depth: float = 0.0085  # of the iron above the magnets
    core_radius: float = 0.0500
    middle_radius: float = 0.0370  # between the two rings of the core
    shaft_radius: float = 0.0235
    shaft_hole: float = 0.0100
    magnet_volume: float = 1.85e-4  # 1.39 kg
    sleeve: float = 0.0055
    coolant_height: float = 0.0050
    outer_wall: float = 0.0060
    contact_shrink: float = 6000.0  # W/(m2 K), yoke to sleeve
    contact_shaft: float = 4000.0
    contact_plate: float = 2000.0

    @property
    def rotor_radius(self) -> float:
        """Outer radius of the rotor [m]."""
        return self.bore_radius - self.gap

    @property
    def tooth_width(self) -> float:
        """Width of a tooth at half its height [m]."""
        return pi * (self.bore_radius + self.slot_bottom_radius) / self.slots - self.slot_width

    @property
    def sleeve_radius(self) -> float:
        """Radius of the sleeve's wall that the coolant wets [m]."""
        return self.stator_radius + self.sleeve

    def crown(self, side: str) -> float:
        """Length of the winding head on side "a" or "b" [m]."""
        return self.crown_length_a if side == "a" else self.crown_length_b


def ring(inner: float, outer: float) -> float:
    """Area of a ring [m2]."""
    return pi * (outer**2 - inner**2)
