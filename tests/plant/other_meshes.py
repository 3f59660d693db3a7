"""Meshes of other motors than the jacketed one: what cools them and what lies in their slots."""

from __future__ import annotations

from math import pi

from plant.geometry import RESIN, Geometry
from plant.mesh import Mesh, active_parts, bars, jacket, names

POTTING_W_per_mK = 0.8  # filled epoxy


def potted(geometry: Geometry, axial: int = 6) -> Mesh:
    """Bars whose heads are cast into the housing; the jacket's coolant enters in the middle and leaves at both
    ends."""
    mesh = Mesh(geometry, axial)
    jacket(mesh)
    active_parts(mesh, bars)
    for side in "ab":
        _pot(mesh, side)
    water, half = names("water", axial), axial // 2
    mesh.pour(water[:half][::-1], half / axial)
    mesh.pour(water[half:], 1.0 - half / axial)
    return mesh


def _pot(mesh: Mesh, side: str) -> None:
    """Resin around a winding head, to the sleeve and the shield; of the layers the outermost has most of it."""
    g, last = mesh.geometry, 0 if side == "a" else mesh.axial - 1
    length = g.near_length + g.crown(side)
    skin = 2 * pi * g.slot_bottom_radius * length
    thick = (g.stator_radius - g.slot_bottom_radius) / 2
    half = thick / 2 / (POTTING_W_per_mK * skin)
    cast = mesh.cell(f"potting_{side}", f"endwinding_{side}_outer", 1.6 * RESIN.heats(skin * thick))
    for k in range(g.layers):
        deep = 1.0 + 1.5 * k
        for part, share in (("near", g.near_length / length), ("crown", g.crown(side) / length)):
            mesh.join(f"{part}_{side}{k}", cast, deep * half / share, "bundle")
    mesh.join(cast, f"sleeve.{last}", half, "bundle")
    mesh.join(cast, f"shield_{side}", 4 * half, "bundle")
