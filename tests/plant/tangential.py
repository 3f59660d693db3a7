"""A section across the axis: teeth, yoke and slots in two columns each, fewer slices along the axis, ends as they
are."""

from __future__ import annotations

from dataclasses import replace
from math import pi

from plant.geometry import SHEET, Geometry
from plant.mesh import Mesh, active_parts, jacket
from plant.other_meshes import conductivity_of_wires, wound

COLUMNS = {  # middle of a tooth, yoke behind it, middle of a slot -> its flank, yoke behind a slot, wires at the wall
    **{f"tooth_{part}": f"flank_{part}" for part in ("tip", "mid", "root")},
    **{f"yoke_{part}": f"back_{part}" for part in ("in", "out")},
}


def section(geometry: Geometry, axial: int = 6) -> Mesh:
    """Round wire in a water jacket, two thirds of the slices, half of each cell of the stator in a second column."""
    mesh = Mesh(geometry, max(2 * axial // 3, 4))
    water = jacket(mesh)
    active_parts(mesh, wound)
    mesh.pour(water, 1.0)
    columns = COLUMNS | {f"bar{k}": f"wall{k}" for k in range(geometry.layers)}
    mesh.halves = {f"{one}.{z}": f"{other}.{z}" for one, other in columns.items() for z in range(mesh.axial)}
    _halve(mesh)
    _join_columns(mesh)
    return mesh


def _halve(mesh: Mesh) -> None:
    """Give each cell's second half its capacity and joints: liners touch the flanks and the wires at the wall, teeth
    the yoke behind them, slot bottoms the other."""
    halves, g, coarse = mesh.halves, mesh.geometry, list(mesh.joints)
    for i, cell in enumerate(list(mesh.cells)):
        if cell.name in halves:
            mesh.cells[i] = replace(cell, capacity=cell.capacity / 2)
            mesh.cell(halves[cell.name], cell.node, cell.capacity / 2)
    side = 2 * g.slots * g.bar_height * g.stack / mesh.axial
    nearer = g.bar_width / 12 / conductivity_of_wires(g) / side
    mesh.joints.clear()
    for joint in coarse:
        a, b = joint.a, joint.b
        if b.startswith("liner"):
            mesh.joints.append(replace(joint, a=halves[a], resistance=joint.resistance - nearer))
        elif a.startswith("liner"):
            mesh.joints.append(replace(joint, b=halves[b]))
        elif a in halves or b in halves:
            half = replace(joint, resistance=2 * joint.resistance, area=joint.area / 2)
            behind = {"tooth_root": b, "bar0": halves.get(b, b)}.get(a.split(".")[0]) if "yoke" in b else None
            mesh.joints.append(replace(half, b=behind or b))
            mesh.joints.append(replace(half, a=halves.get(a, a), b=behind or halves.get(b, b)))
        else:
            mesh.joints.append(joint)


def _join_columns(mesh: Mesh) -> None:
    """Conduction around the axis between the two columns."""
    g = mesh.geometry
    dz, faces = g.stack / mesh.axial, 2 * g.slots
    height = (g.slot_bottom_radius - g.bore_radius) / 3
    middle = (g.slot_bottom_radius + g.stator_radius) / 2
    tooth = SHEET.conductivity * g.stacking * faces * height * dz / (g.tooth_width / 4)
    thick = (g.stator_radius - g.slot_bottom_radius) / 2
    yoke = SHEET.conductivity * g.stacking * faces * thick * dz / (pi * middle / g.slots)
    slot = conductivity_of_wires(g) * faces * g.bar_height * dz / (g.bar_width / 4)
    for one, other in mesh.halves.items():
        conducts = {"t": tooth, "y": yoke, "b": slot}[one[0]]
        mesh.join(one, other, 1 / conducts, "enamel" if one.startswith("bar") else "sheet")
