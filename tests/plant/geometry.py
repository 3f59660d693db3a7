"""Dimensions and materials of the motor: everything that the mesh is computed from.

Side A carries the crowns of the hairpins and the coupling, side B the welds and the terminals; z counts from A to B.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

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
OIL = Material(810.0, 2150.0, 0.13)  # automatic transmission fluid, 65 degC
RHO_COPPER_20 = 1.724e-8  # ohm m
ALPHA_COPPER = 0.00393  # 1/K
WIRE_PITCH = 1.15  # of round wires in a slot, in diameters


@dataclass(frozen=True)
class Geometry:
    """Lengths in m. A water-jacketed 48-slot, 8-pole motor for 150 kW, 220 Nm, 16,000 rpm, 450 A rms.

    A layer of a slot is a bar, or round wire: `turns` in series of `bar_area` together, the wire's diameter `wire`.
    """

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
    turns: int = 1
    paths: int = 2  # in parallel
    wire: float = 0.0
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
    pockets: float = 0.040  # m2, faces of the magnets on each side
    magnet_half: float = 0.0025  # half their thickness
    webs: float = 24.0  # W/K between the poles
    size: float = 1.0  # lengths of shields, bearings, journals and end plates over those of this motor
    bundle: tuple[float, float] = (3.0, 11.0)  # W/K between layers of an end winding, and where a hairpin joins them
    contact_shrink: float = 6000.0  # W/(m2 K), yoke to sleeve
    contact_shaft: float = 4000.0
    contact_plate: float = 2000.0

    @property
    def conductor_height(self) -> float:
        """Height of a conductor [m]; of a round wire that of a square of its area."""
        return sqrt(pi) / 2 * self.wire if self.wire else self.bar_height

    @property
    def conductors_high(self) -> int:
        """Conductors of a layer above each other."""
        return round(self.bar_height / (WIRE_PITCH * self.wire)) if self.wire else 1

    @property
    def copper_breadth(self) -> float:
        """Breadth of the copper across the slot [m]."""
        return self.bar_area / (self.conductors_high * self.conductor_height) if self.wire else self.bar_width

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
