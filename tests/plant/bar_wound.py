"""Motors with bars in their slots: the jacketed one, and one that is potted and runs deep in field weakening."""

from __future__ import annotations

from plant.drives import Vehicle
from plant.films import NOMINAL, Film
from plant.form import Form, paths
from plant.geometry import Geometry
from plant.losses import Iron, LossDesign
from plant.machine import Machine
from plant.other_meshes import potted
from plant.thermocouples import thermocouples

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
