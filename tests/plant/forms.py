"""What makes a motor's form: geometry, cooling, machine, loss and film laws, sensors. `FORMS` has them all by name.

The jacketed motor is the first of them. The others differ from it in what a file's maker may not know of: where iron
loss falls with current, what cools the winding heads, how much of the housing is cooled at all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from plant.drives import Vehicle
from plant.films import NOMINAL, Film
from plant.geometry import GLYCOL, OIL, Geometry, Material
from plant.losses import Iron, LossDesign
from plant.machine import Machine
from plant.mesh import Mesh, jacketed
from plant.other_meshes import finned, potted, sprayed
from plant.tangential import section
from plant.thermocouples import SENSORS, Sensor, thermocouples

Path = tuple[str, str]  # cell, cell or boundary


def paths(layers: int) -> tuple[Path, ...]:
    """Heat paths that no motor file has, for a winding of so many layers."""
    inner = layers - 1
    return (
        *(("crown_a0", "sleeve.0"), ("crown_b0", "sleeve.last"), ("near_a0", "sleeve.0"), ("busbar", "ambient")),
        *(("journal_b", "ambient"), ("hub_b", "ambient"), (f"near_b{inner}", "tooth_tip.last")),
        *(("rack", "sleeve.last"), (f"crown_a{inner}", "hub_a"), ("air_b_out", "sleeve.last")),
    )


@dataclass(frozen=True, eq=False)
class Form:
    """One motor as designed. `build` makes its mesh of so many slices; `rated`: speed [rpm] and torque [Nm] of its
    continuous point; `spreads`: whether its fitted file says how badly some of its values are known."""

    name: str
    build: Callable[[Geometry, int], Mesh] = jacketed
    geometry: Geometry = field(default_factory=Geometry)
    losses: LossDesign = field(default_factory=LossDesign)
    films: Mapping[str, Film] = field(default_factory=lambda: NOMINAL)
    coolant: Material = GLYCOL
    sensors: tuple[Sensor, ...] = SENSORS
    paths: tuple[Path, ...] = paths(6)
    rated: tuple[float, float] = (6000.0, 75.0)
    vehicle: Vehicle = field(default_factory=Vehicle)
    spreads: bool = False

    @property
    def machine(self) -> Machine:
        """Its electric side."""
        return self.losses.machine


JACKETED = Form("mesh-150kW", spreads=True)

# 250 kW, 400 Nm, 14,000 rpm, 400 A rms at 800 V: 54 slots, 6 poles, eight bars in three paths, heads cast in resin.
# Half of its d inductance is leakage: in field weakening the slots keep flux that the iron no longer sees.
WEAKENED = Form(
    "potted-250kW",
    build=potted,
    geometry=Geometry(
        stack=0.150,
        bore_radius=0.0775,
        slot_bottom_radius=0.0935,
        stator_radius=0.1120,
        slots=54,
        slot_width=0.0042,
        layers=8,
        bar_width=0.0034,
        bar_height=0.00160,
        bar_area=5.1e-6,
        paths=3,
        near_length=0.027,
        crown_length_a=0.040,
        crown_length_b=0.044,
        gap=0.0010,
        surface_depth=0.0100,
        core_radius=0.0590,
        middle_radius=0.0440,
        shaft_radius=0.0270,
        shaft_hole=0.0120,
        magnet_volume=2.9e-4,
        pockets=0.055,
        magnet_half=0.0027,
        webs=20.0,
        sleeve=0.0060,
        coolant_height=0.0055,
        outer_wall=0.0055,
        size=1.12,
        bundle=(7.0, 16.0),
        contact_shrink=4500.0,
    ),
    losses=LossDesign(
        machine=Machine(
            pole_pairs=3,
            psi_Wb=0.140,
            ld_H=0.33e-3,
            lq_H=0.66e-3,
            lq_falls=0.28,
            leakage_H=0.18e-3,
            voltage_V=415.0,
            current_A=400.0,
            top_rpm=14_000.0,
            torque_Nm=400.0,
            table_Nm=450.0,
            resistance_ohm=0.017,
        ),
        iron=Iron(hysteresis=0.016, exponent=1.85, eddy=3.74e-5, excess=1.5e-4),  # 0.30 mm: 13.6 W/kg
        saturation_T=2.80,  # far below it up to full current
        knee=0.70,
        tips_kg=2.6,
        teeth_kg=1.4 * 4.5,
        yoke_kg=1.4 * 13.7,
        yoke_density=0.78,
        weakening=0.0,
        weakening_W=20.0,
        ripple_W=14.0,
        end_ac=0.12,
        terminal_ohm=0.16e-3,
        courses={
            "surface": ((170.0, 1.6, 0.0), (300.0, 1.5, 1.7)),
            "core": ((50.0, 1.4, 0.0), (45.0, 1.1, 1.0)),
            "magnet": ((70.0, 2.0, 0.0), (260.0, 1.8, 1.8)),
            "gap_drag": ((150.0, 2.75, 0.0),),
            "end_drag": ((40.0, 2.8, 0.0),),
            "bearing_a": ((120.0, 1.5, 0.0), (5.0, 1.0, 0.0)),
            "bearing_b": ((95.0, 1.5, 0.0), (5.0, 1.0, 0.0)),
            "contact": ((30.0, 0.0, 2.0),),
        },
    ),
    films={
        **NOMINAL,
        "jacket": Film(250.0, 3100.0, 0.75, "flow"),
        "outer_jacket": Film(200.0, 2200.0, 0.75, "flow"),
        "endwinding": Film(10.0, 45.0, 0.70),
        "end_plate": Film(12.0, 150.0, 0.75),
        "swirl": Film(12.0, 100.0, 0.75),
        "tooth_end": Film(6.0, 40.0, 0.70),
    },
    sensors=thermocouples(8),
    paths=paths(8),
    rated=(5250.0, 200.0),
    vehicle=Vehicle(mass=4800.0, road=(420.0, 2.2, 1.10), ratio=10.6, torque=(-220.0, 400.0)),
)
# 110 kW, 180 Nm, 12,000 rpm, 320 A rms: 60 slots, 10 poles, one turn of round wire a layer; oil instead of glycol.
SPRAYED = Form(
    "oil-110kW",
    build=sprayed,
    geometry=Geometry(
        stack=0.112,
        bore_radius=0.0660,
        slot_bottom_radius=0.0835,
        stator_radius=0.0985,
        slots=60,
        slot_width=0.0034,
        layers=4,
        bar_width=0.0029,
        bar_height=0.0041,
        bar_area=5.6e-6,
        wire=0.8e-3,
        near_length=0.020,
        crown_length_a=0.036,
        crown_length_b=0.039,
        gap=0.0009,
        surface_depth=0.0070,
        core_radius=0.0530,
        middle_radius=0.0400,
        shaft_radius=0.0260,
        shaft_hole=0.0140,
        magnet_volume=1.6e-4,
        pockets=0.038,
        magnet_half=0.0022,
        webs=30.0,
        sleeve=0.0040,
        coolant_height=0.0035,
        outer_wall=0.0070,
        size=0.95,
        bundle=(7.0, 7.5),
        contact_shrink=3000.0,
    ),
    losses=LossDesign(
        machine=Machine(
            pole_pairs=5,
            psi_Wb=0.045,
            ld_H=0.100e-3,
            lq_H=0.190e-3,
            lq_falls=0.20,
            leakage_H=0.022e-3,
            current_A=320.0,
            top_rpm=12_000.0,
            torque_Nm=180.0,
            table_Nm=205.0,
            resistance_ohm=0.016,
        ),
        iron=Iron(hysteresis=0.0135, exponent=1.75, eddy=3.0e-5, excess=2.5e-4),  # 0.25 mm: 12.2 W/kg
        saturation_T=2.0,
        knee=1.30,
        tips_kg=1.6,
        teeth_kg=1.5 * 3.0,
        yoke_kg=1.3 * 7.2,
        yoke_density=0.80,
        weakening=0.20,
        weakening_W=260.0,
        ripple_W=11.0,
        end_ac=0.20,
        terminal_ohm=0.25e-3,
        courses={
            "surface": ((110.0, 1.6, 0.0), (240.0, 1.7, 1.8)),
            "core": ((25.0, 1.4, 0.0), (25.0, 1.0, 1.2)),
            "magnet": ((60.0, 1.8, 0.0), (230.0, 1.8, 2.0)),
            "gap_drag": ((120.0, 2.4, 0.0),),  # oil mist
            "end_drag": ((110.0, 2.3, 0.0),),
            "bearing_a": ((70.0, 1.4, 0.0), (4.0, 1.0, 0.0)),
            "bearing_b": ((62.0, 1.4, 0.0), (4.0, 1.0, 0.0)),
            "contact": ((28.0, 0.0, 2.0),),
        },
    ),
    films={
        **NOMINAL,
        "jacket": Film(120.0, 420.0, 0.60, "flow"),
        "outer_jacket": Film(90.0, 260.0, 0.60, "flow"),
        "shaft_oil": Film(120.0, 520.0, 0.70),
        "spray": Film(50.0, 430.0, 0.65, "flow"),
        "sling": Film(60.0, 480.0, 0.60),
        "endwinding": Film(22.0, 110.0, 0.75),
    },
    coolant=OIL,
    sensors=thermocouples(4),
    paths=paths(4),
    rated=(4500.0, 120.0),
    vehicle=Vehicle(mass=2300.0, road=(210.0, 1.2, 0.62), ratio=9.1, torque=(-100.0, 180.0)),
)

# 30 kW, 60 Nm, 9,000 rpm, 115 A rms: twelve coils around twelve teeth, 10 poles with magnets on the rotor's surface
# under a bandage (`rotor_surface`).
HOUSED = Form(
    "finned-30kW",
    build=finned,
    geometry=Geometry(
        stack=0.070,
        bore_radius=0.0450,
        slot_bottom_radius=0.0650,
        stator_radius=0.0745,
        slots=12,
        slot_width=0.0140,
        layers=6,
        bar_width=0.0130,
        bar_height=0.0031,
        bar_area=17.0e-6,
        turns=4,
        paths=1,
        wire=1.25e-3,
        near_length=0.007,
        crown_length_a=0.016,
        crown_length_b=0.018,
        gap=0.0010,
        surface_depth=0.0020,
        core_radius=0.0370,
        middle_radius=0.0270,
        shaft_radius=0.0150,
        shaft_hole=0.0,
        magnet_volume=7.6e-5,
        pockets=0.017,
        magnet_half=0.0020,
        webs=4.0,
        sleeve=0.0040,
        coolant_height=0.0040,
        outer_wall=0.0060,
        size=0.62,
        bundle=(3.0, 3.4),
        contact_shrink=3500.0,
        contact_shaft=3000.0,
    ),
    losses=LossDesign(
        machine=Machine(
            pole_pairs=5,
            psi_Wb=0.055,
            psi_slope=-0.0012,
            ld_H=0.200e-3,
            lq_H=0.220e-3,
            lq_falls=0.15,
            leakage_H=0.080e-3,
            current_A=115.0,
            top_rpm=9_000.0,
            torque_Nm=60.0,
            table_Nm=72.0,
            resistance_ohm=0.055,
        ),
        iron=Iron(hysteresis=0.019, exponent=1.65, eddy=5.9e-5, excess=3.0e-4),  # 0.35 mm: 19.4 W/kg
        saturation_T=1.85,
        knee=1.35,
        tips_kg=0.35,
        teeth_kg=1.4 * 1.25,
        yoke_kg=1.3 * 1.95,
        yoke_density=0.70,
        weakening=0.10,
        weakening_W=25.0,
        ripple_W=4.0,
        end_ac=0.25,
        terminal_ohm=0.5e-3,
        courses={
            "surface": ((5.0, 1.8, 0.0), (12.0, 1.7, 1.8)),
            "core": ((6.0, 1.3, 0.0), (16.0, 1.3, 1.6)),
            "magnet": ((16.0, 1.8, 0.0), (75.0, 1.9, 1.9)),
            "gap_drag": ((7.0, 2.7, 0.0),),
            "end_drag": ((6.0, 2.8, 0.0),),
            "bearing_a": ((22.0, 1.5, 0.0), (2.0, 1.0, 0.0)),
            "bearing_b": ((18.0, 1.5, 0.0), (2.0, 1.0, 0.0)),
            "contact": ((9.0, 0.0, 2.0),),
        },
    ),
    films={
        **NOMINAL,
        "jacket": Film(200.0, 2400.0, 0.80, "flow"),
        "outer_jacket": Film(150.0, 1500.0, 0.80, "flow"),
        "endwinding": Film(14.0, 60.0, 0.70),
        "end_plate": Film(10.0, 110.0, 0.75),
        "fan": Film(3.0, 42.0, 0.75),
    },
    rated=(3400.0, 25.0),
    vehicle=Vehicle(mass=620.0, road=(70.0, 0.5, 0.34), radius=0.28, ratio=5.7, torque=(-40.0, 60.0)),
)

# 110 kW, 200 Nm, 13,000 rpm, 350 A rms: 24 wide slots of round wire, 8 poles, resolved around the axis.
SECTION = Form(
    "section-110kW",
    build=section,
    geometry=Geometry(
        stack=0.100,
        bore_radius=0.0700,
        slot_bottom_radius=0.0960,
        stator_radius=0.1120,
        slots=24,
        slot_width=0.0105,
        layers=6,
        bar_width=0.0095,
        bar_height=0.0040,
        bar_area=17.5e-6,
        turns=2,
        paths=2,
        wire=0.9e-3,
        near_length=0.020,
        crown_length_a=0.046,
        crown_length_b=0.050,
        gap=0.0008,
        surface_depth=0.0075,
        core_radius=0.0560,
        middle_radius=0.0420,
        shaft_radius=0.0250,
        shaft_hole=0.0090,
        magnet_volume=1.7e-4,
        pockets=0.036,
        webs=20.0,
        sleeve=0.0060,
        coolant_height=0.0060,
        size=1.05,
        bundle=(5.0, 5.5),
        contact_shrink=5000.0,
    ),
    losses=LossDesign(
        machine=Machine(
            psi_Wb=0.060,
            ld_H=0.100e-3,
            lq_H=0.200e-3,
            lq_falls=0.25,
            leakage_H=0.022e-3,
            current_A=350.0,
            top_rpm=13_000.0,
            torque_Nm=200.0,
            table_Nm=235.0,
            resistance_ohm=0.014,
        ),
        iron=Iron(hysteresis=0.015, exponent=1.9, eddy=4.4e-5, excess=2.0e-4),  # 0.30 mm: 14.6 W/kg
        saturation_T=2.1,
        knee=1.15,
        tips_kg=1.8,
        teeth_kg=1.5 * 3.5,
        yoke_kg=1.4 * 7.7,
        yoke_density=0.80,
        weakening=0.15,
        weakening_W=300.0,
        ripple_W=10.0,
        end_ac=0.20,
        courses={
            "surface": ((190.0, 1.8, 0.0), (300.0, 1.7, 1.7)),  # wide slots open towards the rotor
            "core": ((30.0, 1.4, 0.0), (35.0, 1.1, 1.1)),
            "magnet": ((110.0, 1.9, 0.0), (240.0, 2.0, 1.8)),
            "gap_drag": ((90.0, 2.8, 0.0),),
            "end_drag": ((40.0, 2.8, 0.0),),
            "bearing_a": ((90.0, 1.5, 0.0), (4.0, 1.0, 0.0)),
            "bearing_b": ((76.0, 1.5, 0.0), (4.0, 1.0, 0.0)),
            "contact": ((32.0, 0.0, 2.0),),
        },
    ),
    films={**NOMINAL, "jacket": Film(300.0, 3300.0, 0.80, "flow"), "endwinding": Film(16.0, 80.0, 0.72)},
    rated=(4900.0, 85.0),
    vehicle=Vehicle(mass=2600.0, road=(230.0, 1.3, 0.66), ratio=9.9, torque=(-110.0, 200.0)),
)

FORMS: Mapping[str, Form] = MappingProxyType(
    {"jacketed": JACKETED, "weakened": WEAKENED, "sprayed": SPRAYED, "housed": HOUSED, "section": SECTION}
)
