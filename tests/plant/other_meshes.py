"""Meshes of other motors than the jacketed one: what cools them and what lies in their slots."""

from __future__ import annotations

from math import pi

from plant.geometry import ALUMINIUM, COPPER, GLYCOL, LINER, OIL, RESIN, Geometry, ring
from plant.mesh import Mesh, Shell, active_parts, bars, jacket, names, skin

POTTING_W_per_mK = 0.8  # filled epoxy
FINS = 4.0  # skin of a finned housing over that of a smooth one
GROOVES = Shell(  # of oil around a stack; grooves have sides, and the gearbox carries the motor by a flange
    *(OIL, 1.3, 0.5, 1.5),
    wet=1.4,
    outer_wet=0.5,
    ribs=0.35,
    contact=1800.0,
    skin=1.4,
    feet=2.2,
)


def potted(geometry: Geometry, axial: int = 6) -> Mesh:
    """Bars whose heads are cast into the housing; the jacket's coolant enters in the middle and leaves at both
    ends."""
    mesh, half = Mesh(geometry, axial), axial // 2
    water = jacket(mesh)
    active_parts(mesh, bars)
    for side in "ab":
        _pot(mesh, side)
    mesh.pour(water[:half][::-1], half / axial)
    mesh.pour(water[half:], 1.0 - half / axial)
    return mesh


def _pot(mesh: Mesh, side: str) -> None:
    """Resin around a winding head, to the sleeve and the shield; of the layers the outermost has most of it."""
    g, last = mesh.geometry, 0 if side == "a" else mesh.axial - 1
    length = g.near_length + g.crown(side)
    around = 2 * pi * g.slot_bottom_radius * length
    thick = (g.stator_radius - g.slot_bottom_radius) / 2
    half = thick / 2 / (POTTING_W_per_mK * around)
    cast = mesh.cell(f"potting_{side}", f"endwinding_{side}_outer", RESIN.heats(cast_volume(g, side)))
    for k in range(g.layers):
        deep = 1.0 + 1.5 * k
        for part, share in (("near", g.near_length / length), ("crown", g.crown(side) / length)):
            mesh.join(f"{part}_{side}{k}", cast, deep * half / share, "bundle")
    mesh.join(cast, f"sleeve.{last}", half, "bundle")
    mesh.join(cast, f"shield_{side}", 4 * half, "bundle")


def cast_volume(g: Geometry, side: str) -> float:
    """Resin of one winding head [m3]: beside what is around it, what is between and below."""
    length = g.near_length + g.crown(side)
    return 1.6 * pi * g.slot_bottom_radius * length * (g.stator_radius - g.slot_bottom_radius)


# ---- round wire ----------------------------------------------------------------------------------------------------


def wound(mesh: Mesh) -> None:
    """The winding window of round wire: each layer a lump that conducts as wires in resin do, as hot as its mean."""
    g, n = mesh.geometry, mesh.axial
    dz = g.stack / n
    across = conductivity_of_wires(g)
    resin = g.slot_width * (g.slot_bottom_radius - g.bore_radius) / g.layers - g.bar_area
    side, flat = 2 * g.slots * g.bar_height * dz, g.slots * g.bar_width * dz
    to_wall = g.bar_width / 6 / across  # of an evenly heated slab that is cooled on both sides
    half = g.liner / 2 / LINER.conductivity
    for z in range(n):
        for k in range(g.layers):
            heat = COPPER.heats(g.bar_area) + RESIN.heats(0.7 * resin)
            mesh.cell(f"bar{k}.{z}", f"winding_{'a' if 2 * z < n else 'b'}", g.slots * dz * heat)
        for k in range(g.layers - 1):
            mesh.join(f"bar{k}.{z}", f"bar{k + 1}.{z}", g.bar_height / across / flat, "enamel")
        for place, tooth in enumerate(("tooth_root", "tooth_mid", "tooth_tip")):
            beside = [k for k in range(g.layers) if k * 3 // g.layers == place]
            liner = mesh.cell(f"liner{place}.{z}", "", LINER.heats(len(beside) * side * g.liner))
            for k in beside:
                mesh.join(f"bar{k}.{z}", liner, (to_wall + 1.2e-4 + half) / side, "liner")
            mesh.join(liner, f"{tooth}.{z}", (half + 1.2e-4) / (len(beside) * side), "liner")
        bottom = g.bar_height / 2 / across + 2 * half + 3.0e-4
        mesh.join(f"bar0.{z}", f"yoke_in.{z}", bottom / (g.slots * g.slot_width * dz), "liner")
    for k in range(g.layers):
        mesh.chain(names(f"bar{k}", n), COPPER.conductivity * g.slots * g.bar_area / dz, "copper")


def conductivity_of_wires(g: Geometry) -> float:
    """Conductivity [W/(m K)] across round wires in resin, by their share of the slot (Hashin and Shtrikman, J. Appl.
    Phys. 33 (1962) 3125)."""
    share = g.bar_area / (g.bar_width * g.bar_height)
    low, high = RESIN.conductivity, COPPER.conductivity
    return low * ((1 + share) * high + (1 - share) * low) / ((1 - share) * high + (1 + share) * low)


# ---- oil -----------------------------------------------------------------------------------------------------------


def sprayed(geometry: Geometry, axial: int = 6) -> Mesh:
    """Round wire and oil: two fifths through the hollow shaft and flung onto the inner half of the winding heads, the
    rest through grooves around the stack and sprayed onto their outer half. Oil that leaves one is warmer at the
    other."""
    mesh = Mesh(geometry, axial)
    grooves = jacket(mesh, GROOVES)
    active_parts(mesh, wound)
    g = mesh.geometry
    wet = 2 * pi * g.shaft_hole * g.stack / axial
    for z in range(axial):
        oil = mesh.cell(f"shaft_oil.{z}", "shaft", OIL.heats(0.5 * pi * g.shaft_hole**2 * g.stack / axial))
        mesh.join(f"shaft.{z}", oil, 0.0, "film.shaft_oil", "shaft_oil", wet)
    for part, cells, share in (("inner", names("shaft_oil", axial), 0.4), ("outer", grooves, 0.6)):
        mesh.pour(cells, share)
        for side in "ab":
            mesh.pour([_spray(mesh, side, part)], share / 2, cells[-1])
    return mesh


def _spray(mesh: Mesh, side: str, part: str) -> str:
    """The oil on one half of a winding head's layers; flung oil reaches it with the speed, sprayed with the flow."""
    g = mesh.geometry
    oil = mesh.cell(f"spray_{side}_{part}", f"endwinding_{side}_{part}", OIL.heats(4.0e-6))
    film = {"inner": "sling", "outer": "spray"}[part]
    radius = {"inner": g.bore_radius, "outer": g.slot_bottom_radius}[part]
    half = g.layers // 2
    for k in range(g.layers):
        if (k < half) == (part == "outer"):
            bare = 0.5 if k in (0, g.layers - 1) else 0.25
            for cell, length in (("near", g.near_length), ("crown", g.crown(side))):
                mesh.join(f"{cell}_{side}{k}", oil, 0.02, f"film.{film}", film, bare * 2 * pi * radius * length)
    return oil


# ---- air -----------------------------------------------------------------------------------------------------------


def finned(geometry: Geometry, axial: int = 6) -> Mesh:
    """Round wire in a housing with fins and a fan on the shaft; only half B of it has a jacket, that of the inverter.
    The wall under the fins of half A belongs to the housing."""
    mesh = Mesh(geometry, axial)
    g, half = geometry, axial // 2
    dz, wet = g.stack / axial, g.sleeve_radius
    outer = wet + g.coolant_height
    wall = outer + g.outer_wall
    for z in range(axial):
        cooled = z >= half
        sleeve = mesh.cell(
            f"sleeve.{z}", "jacket" if cooled else "housing", ALUMINIUM.heats(1.1 * ring(g.stator_radius, wet) * dz)
        )
        case = mesh.cell(f"case.{z}", "housing", ALUMINIUM.heats(2.5 * ring(outer, wall) * dz))
        ribs = (0.25 if cooled else 0.9) * 2 * pi * wet * dz
        mesh.join(sleeve, case, 1 / (6000.0 * ribs), "ribs")
        around = 2 * pi * wall * dz
        skin(mesh, case, around, FINS)
        mesh.join(case, "ambient", 0.02 / (around * FINS), "ambient", "fan", FINS * around)
        if cooled:
            water = mesh.cell(f"water.{z}", "jacket", GLYCOL.heats(0.6 * ring(wet, outer) * dz))
            area = 2 * pi * wet * dz
            mesh.join(sleeve, water, g.sleeve / 2 / (ALUMINIUM.conductivity * area), "film.jacket", "jacket", area)
            mesh.join(case, water, 1e-4, "film.jacket", "outer_jacket", 0.5 * area)
    mesh.join("case.0", "ambient", 1 / 0.8, "ambient")  # feet
    mesh.chain(names("sleeve", axial), ALUMINIUM.conductivity * ring(g.stator_radius, wet) / dz, "aluminium")
    mesh.chain(names("case", axial), ALUMINIUM.conductivity * ring(outer, wall) / dz, "aluminium")
    active_parts(mesh, wound)
    mesh.pour(names("water", axial)[half:], 1.0)
    return mesh
