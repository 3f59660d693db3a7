"""The conduction mesh: axial and radial finite volumes from geometry and materials; 182 cells of the jacketed motor.

A joint between two cells (or a cell and a boundary) conducts 1 / (resistance + 1 / (area x film)); the film, W/(m2
K), comes from `films` at every step. Cells of an interface (slot liner, air gap) belong to no node of the reduced
network.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import log, pi

import numpy as np
from numpy.typing import NDArray

from plant.geometry import (
    ALUMINIUM,
    BOUNDARIES,
    COPPER,
    GLYCOL,
    LINER,
    NDFEB,
    RESIN,
    SHEET,
    STEEL,
    Geometry,
    Material,
    ring,
)

Floats = NDArray[np.float64]

CONDUCTS, RADIATES, RISES, BOILS, GAPES = range(5)  # kinds of joints; see solver
FILMS = (
    *("jacket", "outer_jacket", "gap_rotor", "gap_stator", "endwinding", "shield", "end_plate", "tooth_end", "swirl"),
    *("shaft_end", "balls", "bare"),
)


@dataclass(frozen=True)
class Cell:
    """`node` of the reduced network, "" for an interface; capacity [J/K]."""

    name: str
    node: str
    capacity: float


@dataclass(frozen=True)
class Joint:
    """Between cells `a` and `b` (`b` may be a boundary). `area` [m2] of the film (for RADIATES times emissivity; for
    RISES plain); `group` is what is uncertain together; `low`, `high` [degC] thresholds of BOILS and GAPES."""

    a: str
    b: str
    resistance: float
    group: str
    film: str = ""
    area: float = 0.0
    kind: int = CONDUCTS
    low: float = 0.0
    high: float = 0.0


@dataclass(frozen=True)
class Station:
    """A cell that a `share` of the coolant passes, after the cell `before` ("": it comes from the inlet)."""

    cell: str
    before: str
    share: float


@dataclass
class Mesh:
    """Cells and joints by name; `stations` of the coolant, each behind the one that it passed before; `halves`: cell ->
    the one that has half of its volume and of its heat."""

    geometry: Geometry
    axial: int
    cells: list[Cell] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)
    stations: list[Station] = field(default_factory=list)
    halves: dict[str, str] = field(default_factory=dict)
    _index: dict[str, int] = field(default_factory=dict, repr=False, compare=False)

    @property
    def index(self) -> dict[str, int]:
        """Place of each cell and boundary; boundaries are behind the cells."""
        names = len(self.cells) + len(BOUNDARIES)
        if len(self._index) != names:  # made anew after cells were added
            self._index = {name: i for i, name in enumerate([*(c.name for c in self.cells), *BOUNDARIES])}
        return self._index

    @property
    def coolant(self) -> tuple[str, ...]:
        """The cells that the coolant passes."""
        return tuple(station.cell for station in self.stations)

    @property
    def capacity(self) -> Floats:
        """Heat capacity of each cell (n,) [J/K]."""
        return np.array([c.capacity for c in self.cells])

    def of_node(self, node: str) -> NDArray[np.intp]:
        """Places of a node's cells."""
        return np.array([i for i, c in enumerate(self.cells) if c.node == node], np.intp)

    def cell(self, name: str, node: str, capacity: float) -> str:
        """Add a cell of a node; returns its name."""
        self.cells.append(Cell(name, node, capacity))
        return name

    def join(self, a: str, b: str, resistance: float, group: str, film: str = "", area: float = 0.0) -> None:
        """Add a joint between two cells, or a cell and a boundary."""
        self.joints.append(Joint(a, b, resistance, group, film, area))

    def pour(self, cells: Sequence[str], share: float, before: str = "") -> None:
        """Let a share of the coolant pass cells one after the other, behind the cell `before`."""
        for cell in cells:
            self.stations.append(Station(cell, before, share))
            before = cell

    def spread(self, heat: Floats) -> Floats:
        """Heat or shares of it (..., n), half of each cell that has a second half given to that."""
        index = self.index
        for one, other in self.halves.items():
            heat[..., index[one]] /= 2
            heat[..., index[other]] += heat[..., index[one]]
        return heat

    def chain(self, names: Sequence[str], conductance: float, group: str) -> None:
        """Add joints of equal conductance [W/K] between neighbours."""
        for a, b in pairwise(names):
            self.join(a, b, 1.0 / conductance, group)


def names(stem: str, count: int) -> list[str]:
    """`stem.0`, `stem.1` ..."""
    return [f"{stem}.{z}" for z in range(count)]


def jacketed(geometry: Geometry, axial: int = 6) -> Mesh:
    """A motor with a jacket all around and bars in its slots, with `axial` slices of the stack."""
    mesh = Mesh(geometry, axial)
    water = jacket(mesh)
    active_parts(mesh, bars)
    mesh.pour(water, 1.0)
    return mesh


def active_parts(mesh: Mesh, slots: Callable[[Mesh], None]) -> None:
    """Everything inside a housing whose cells `sleeve` and `case` are there."""
    _stator(mesh)
    slots(mesh)
    _rotor(mesh)
    for side in "ab":
        _endwinding(mesh, side)
        _end(mesh, side)
    _terminals(mesh)


def half_of(mesh: Mesh, z: int) -> str:
    """The half of the stack that slice z belongs to: the middle one of an odd number goes to A."""
    return "a" if 2 * z < mesh.axial else "b"


def _ring_resistance(inner: float, outer: float, length: float, conductivity: float) -> float:
    """Resistance [K/W] of a cylinder wall."""
    return log(outer / inner) / (2 * pi * conductivity * length)


@dataclass(frozen=True)
class Shell:
    """What lies around a stack. `sleeve`, `filled`, `case`: shares of their rings that are metal, coolant and metal;
    `wet`, `outer_wet`: what the coolant wets inside and outside over smooth rings; `ribs`: share of the ring where
    sleeve and case meet, at `contact` W/(m2 K); `skin` over a smooth one; `feet`: W/K to what carries the motor."""

    coolant: Material = GLYCOL
    sleeve: float = 1.25
    filled: float = 0.75
    case: float = 1.6
    wet: float = 1.0
    outer_wet: float = 1.0
    ribs: float = 0.25
    contact: float = 2500.0
    skin: float = 1.5
    feet: float = 1.6


def jacket(mesh: Mesh, shell: Shell | None = None) -> list[str]:
    """Outer wall, coolant stations, sleeve; free convection, radiation and feet to the ambient. Returns the cells of
    the coolant from A to B."""
    g, n, s = mesh.geometry, mesh.axial, shell or Shell()
    dz = g.stack / n
    wet, outer = g.sleeve_radius, g.sleeve_radius + g.coolant_height
    wall = outer + g.outer_wall
    for z in range(n):
        sleeve = mesh.cell(f"sleeve.{z}", "jacket", ALUMINIUM.heats(s.sleeve * ring(g.stator_radius, wet) * dz))
        water = mesh.cell(f"water.{z}", "jacket", s.coolant.heats(s.filled * ring(wet, outer) * dz))
        case = mesh.cell(f"case.{z}", "housing", ALUMINIUM.heats(s.case * ring(outer, wall) * dz))
        through = g.sleeve / 2 / (ALUMINIUM.conductivity * 2 * pi * wet * dz * s.wet)
        mesh.join(sleeve, water, through, "film.jacket", "jacket", 2 * pi * wet * dz * s.wet)
        mesh.join(case, water, 1e-4, "film.jacket", "outer_jacket", 2 * pi * outer * dz * s.outer_wet)
        mesh.join(sleeve, case, 1 / (s.contact * (s.ribs * 2 * pi * wet * dz)), "ribs")
        skin(mesh, case, s.skin * 2 * pi * wall * dz)
    mesh.join("case.0", "ambient", 1 / s.feet, "ambient")
    mesh.chain(names("sleeve", n), ALUMINIUM.conductivity * ring(g.stator_radius, wet) / dz, "aluminium")
    mesh.chain(names("case", n), ALUMINIUM.conductivity * ring(outer, wall) / dz, "aluminium")
    return names("water", n)


def skin(mesh: Mesh, case: str, area: float, fins: float = 1.0) -> None:
    """Free convection and radiation of a housing's skin [m2]; fins radiate at each other."""
    mesh.joints.append(Joint(case, "ambient", 0.0, "ambient", area=fins * area, kind=RISES))
    mesh.joints.append(Joint(case, "ambient", 0.0, "ambient", area=0.85 * area, kind=RADIATES))


def _stator(mesh: Mesh) -> None:
    """Two rings of yoke, three of teeth."""
    g, n = mesh.geometry, mesh.axial
    dz = g.stack / n
    middle = (g.slot_bottom_radius + g.stator_radius) / 2
    height = (g.slot_bottom_radius - g.bore_radius) / 3
    face = g.slots * g.tooth_width * dz * g.stacking
    for z in range(n):
        for name, r0, r1 in (("yoke_in", g.slot_bottom_radius, middle), ("yoke_out", middle, g.stator_radius)):
            mesh.cell(f"{name}.{z}", "yoke", SHEET.heats(ring(r0, r1) * dz * g.stacking))
        for name in ("tooth_root", "tooth_mid", "tooth_tip"):
            mesh.cell(f"{name}.{z}", "teeth", SHEET.heats(face * height))
        step = height / (SHEET.conductivity * face)
        inner = _ring_resistance(g.slot_bottom_radius, middle, dz, SHEET.conductivity)
        outer = _ring_resistance(middle, g.stator_radius, dz, SHEET.conductivity)
        mesh.join(f"tooth_tip.{z}", f"tooth_mid.{z}", step, "sheet")
        mesh.join(f"tooth_mid.{z}", f"tooth_root.{z}", step, "sheet")
        mesh.join(f"tooth_root.{z}", f"yoke_in.{z}", step / 2 + inner / 2 + 0.5 * inner, "sheet")  # and the narrowing
        mesh.join(f"yoke_in.{z}", f"yoke_out.{z}", (inner + outer) / 2, "sheet")
        fit = 1 / (g.contact_shrink * 2 * pi * g.stator_radius * dz)
        mesh.join(f"yoke_out.{z}", f"sleeve.{z}", outer / 2 + fit, "shrink_fit")
    for name in ("yoke_in", "yoke_out"):
        r0, r1 = (g.slot_bottom_radius, middle) if name == "yoke_in" else (middle, g.stator_radius)
        mesh.chain(names(name, n), SHEET.across * ring(r0, r1) / dz, "across")
    for name in ("tooth_root", "tooth_mid", "tooth_tip"):
        mesh.chain(names(name, n), SHEET.across * g.slots * g.tooth_width * height / dz, "across")


def bars(mesh: Mesh) -> None:
    """The winding window of bars: liner between those beside a ring of the teeth and that ring, slot bottom to the
    yoke."""
    g, n = mesh.geometry, mesh.axial
    dz = g.stack / n
    resin = g.slot_width * (g.slot_bottom_radius - g.bore_radius) - g.layers * g.bar_area
    bar_heat = COPPER.heats(g.bar_area) + RESIN.heats(0.7 * resin / g.layers)
    side, flat = 2 * g.slots * g.bar_height * dz, g.slots * g.bar_width * dz
    enamel = g.enamel / RESIN.conductivity
    for z in range(n):
        for k in range(g.layers):
            mesh.cell(f"bar{k}.{z}", f"winding_{half_of(mesh, z)}", g.slots * dz * bar_heat)
        for k in range(g.layers - 1):
            mesh.join(f"bar{k}.{z}", f"bar{k + 1}.{z}", (2 * enamel + 5e-4) / flat, "enamel")
        for pair, tooth in enumerate(("tooth_root", "tooth_mid", "tooth_tip")):
            beside = [k for k in range(g.layers) if k * 3 // g.layers == pair]
            liner = mesh.cell(f"liner{pair}.{z}", "", LINER.heats(len(beside) * side * g.liner))
            for k in beside:
                mesh.join(f"bar{k}.{z}", liner, (enamel + 1.8e-4 + g.liner / 2 / LINER.conductivity) / side, "liner")
            across = len(beside) * side
            mesh.join(liner, f"{tooth}.{z}", (g.liner / 2 / LINER.conductivity + 1.6e-4) / across, "liner")
        bottom = (enamel + g.liner / LINER.conductivity + 8.0e-4) / (g.slots * g.slot_width * dz)
        mesh.join(f"bar0.{z}", f"yoke_in.{z}", bottom, "liner")
    for k in range(g.layers):
        mesh.chain(names(f"bar{k}", n), COPPER.conductivity * g.slots * g.bar_area / dz, "copper")


def _rotor(mesh: Mesh) -> None:
    """Air gap, rotor surface, magnets, two rings of the core, shaft."""
    g, n = mesh.geometry, mesh.axial
    dz = g.stack / n
    top, glue = g.rotor_radius, 1.0 / (2200.0 * g.pockets)  # 2,200 W/(m2 K) of glue
    half = g.magnet_half / (NDFEB.conductivity * g.pockets)
    rings = (("core_out", g.middle_radius, g.core_radius, 0.80), ("core_in", g.shaft_radius, g.middle_radius, 0.75))
    for z in range(n):
        mesh.cell(f"gap.{z}", "", 0.05 / n + 0.02)
        mesh.cell(f"surface.{z}", "rotor_surface", SHEET.heats(0.9 * ring(top - g.surface_depth, top) * dz))
        mesh.cell(f"magnet.{z}", "magnet", NDFEB.heats(g.magnet_volume / n))
        for name, r0, r1, full in rings:  # less magnet pockets and holes
            mesh.cell(f"{name}.{z}", "rotor_core", SHEET.heats(full * ring(r0, r1) * dz))
        mesh.cell(f"shaft.{z}", "shaft", STEEL.heats(ring(g.shaft_hole, g.shaft_radius) * dz))
        mesh.join(f"surface.{z}", f"gap.{z}", 0.0, "film.gap", "gap_rotor", 2 * pi * top * dz)
        mesh.join(f"gap.{z}", f"tooth_tip.{z}", 0.0, "film.gap", "gap_stator", 1.1 * 2 * pi * g.bore_radius * dz)
        depth = g.surface_depth / 2 / (SHEET.conductivity * g.pockets)
        mesh.join(f"magnet.{z}", f"surface.{z}", n * (glue + depth + half), "glue")
        mesh.join(f"magnet.{z}", f"core_out.{z}", n * (1.3 * glue + depth + half), "glue")
        mesh.join(f"surface.{z}", f"core_out.{z}", n / g.webs, "sheet")
        ring_out = _ring_resistance(g.middle_radius, g.core_radius, dz, 0.6 * SHEET.conductivity)
        ring_in = _ring_resistance(g.shaft_radius, g.middle_radius, dz, 0.6 * SHEET.conductivity)
        fit = 1 / (g.contact_shaft * 2 * pi * g.shaft_radius * dz)
        mesh.join(f"core_out.{z}", f"core_in.{z}", (ring_out + ring_in) / 2, "sheet")
        mesh.join(f"core_in.{z}", f"shaft.{z}", ring_in / 2 + fit, "shaft_fit")
    mesh.chain(names("surface", n), SHEET.across * ring(top - g.surface_depth, top) / dz, "across")
    mesh.chain(names("magnet", n), 0.35 * NDFEB.conductivity * g.magnet_volume / g.stack / dz, "across")  # segmented
    for name, r0, r1, full in rings:
        mesh.chain(names(name, n), SHEET.across * full * ring(r0, r1) / dz, "across")
    mesh.chain(names("shaft", n), STEEL.conductivity * ring(g.shaft_hole, g.shaft_radius) / dz, "steel")
    mesh.chain(names("gap", n), 0.02, "film.gap")


def _endwinding(mesh: Mesh, side: str) -> None:
    """Each layer in two cells: from the stack to the bend, and the crown; hairpins join neighbouring layers there."""
    g, last = mesh.geometry, 0 if side == "a" else mesh.axial - 1
    crown, half_slice = g.crown(side), g.stack / mesh.axial / 2
    area = g.slots * g.bar_area
    for k in range(g.layers):
        node = f"endwinding_{side}_{'outer' if k < g.layers // 2 else 'inner'}"
        coat = RESIN.heats(1.6e-6 * g.slots)
        near = mesh.cell(f"near_{side}{k}", node, (COPPER.heats(area) + coat) * g.near_length)
        far = mesh.cell(f"crown_{side}{k}", node, (COPPER.heats(area) + coat) * crown)
        mesh.join(f"bar{k}.{last}", near, (half_slice + g.near_length / 2) / (COPPER.conductivity * area), "copper")
        mesh.join(near, far, (g.near_length + crown) / 2 / (COPPER.conductivity * area), "copper")
    for k in range(g.layers - 1):
        loose, tight = g.bundle
        mesh.join(f"near_{side}{k}", f"near_{side}{k + 1}", 1 / loose, "bundle")
        mesh.join(f"crown_{side}{k}", f"crown_{side}{k + 1}", 1 / (tight if k % 2 == 0 else loose), "bundle")


def _end(mesh: Mesh, side: str) -> None:
    """Cavity, end plate, shield, bearing and shaft end of one side."""
    g, last = mesh.geometry, 0 if side == "a" else mesh.axial - 1
    half, long, wide, large = g.stack / mesh.axial / 2, g.size, g.size**2, g.size**3
    air_in, air_out = (mesh.cell(f"air_{side}_{part}", f"air_{side}", 20.0 * large) for part in ("in", "out"))
    plate_in, plate_out = (
        mesh.cell(f"plate_{side}_{part}", f"end_plate_{side}", 105.0 * large) for part in ("in", "out")
    )
    shield = mesh.cell(f"shield_{side}", "housing", 2350.0 * large)
    hub = mesh.cell(f"hub_{side}", "housing", 650.0 * large)
    race_in, race_out = (mesh.cell(f"race_{side}_{part}", f"bearing_{side}", 95.0 * large) for part in ("in", "out"))
    journal = mesh.cell(f"journal_{side}", "shaft", (260.0 if side == "a" else 210.0) * large)
    _cavity(mesh, side, last)
    mesh.join(air_in, air_out, 0.0, "film.swirl", "swirl", 0.06 * wide)
    for cell, area in ((shield, 0.050 * wide), (hub, 0.012 * wide)):
        mesh.join(cell, air_out if cell == shield else air_in, 1e-3 / wide, "film.shield", "shield", area)
    mesh.join(plate_in, air_in, 0.0, "film.end_plate", "end_plate", 0.005 * wide)
    mesh.join(plate_out, air_in, 0.0, "film.end_plate", "end_plate", 0.009 * wide)
    mesh.join(plate_in, plate_out, 1 / (16.0 * long), "aluminium")
    top = g.rotor_radius
    for cell, rotor, area in (
        (plate_in, "core_in", 0.75 * ring(g.shaft_radius, g.middle_radius)),
        (plate_in, "core_out", 0.4 * ring(g.middle_radius, g.core_radius)),
        (plate_out, "core_out", 0.4 * ring(g.middle_radius, g.core_radius)),
        (plate_out, "surface", 0.9 * ring(top - g.surface_depth, top)),
    ):
        mesh.join(cell, f"{rotor}.{last}", half / (SHEET.across * area) + 1 / (g.contact_plate * area), "plate_contact")
    mesh.join(
        plate_out,
        f"magnet.{last}",
        half / (0.35 * NDFEB.conductivity * g.magnet_volume / g.stack) + 1.5 / wide,
        "plate_contact",
    )
    across_shaft = STEEL.conductivity * ring(g.shaft_hole, g.shaft_radius)
    mesh.join(f"shaft.{last}", journal, (half + 0.022 * long) / across_shaft, "steel")
    mesh.join(journal, race_in, 1 / (9.0 * long), "seat")
    mesh.join(race_in, race_out, 0.0, "balls", "balls", long)
    mesh.join(race_out, hub, 1 / (8.0 * long), "seat")
    mesh.join(hub, shield, 1 / (14.0 * long), "aluminium")
    mesh.join(shield, f"case.{last}", 1 / (38.0 * long), "aluminium")
    mesh.join(shield, f"sleeve.{last}", 1 / (12.0 * long), "aluminium")
    mesh.join(f"gap.{last}", air_in, 0.0, "film.gap", "swirl", 0.004 * wide)
    end = (0.016 if side == "a" else 0.004) * wide
    mesh.join(journal, "ambient", 0.0, "film.shaft_end", "shaft_end", end)
    mesh.joints.append(Joint(shield, "ambient", 0.0, "ambient", area=0.045 * wide, kind=RISES))
    mesh.joints.append(Joint(shield, "ambient", 0.0, "ambient", area=0.85 * 0.045 * wide, kind=RADIATES))


def _cavity(mesh: Mesh, side: str, last: int) -> None:
    """Films inside a cavity: end winding, ends of teeth and yoke; radiation of the end winding to shield and sleeve."""
    g, longer, wide = mesh.geometry, mesh.geometry.crown(side) / mesh.geometry.crown_length_a, mesh.geometry.size**2
    share = wide * 6 / g.layers
    for k in range(g.layers):
        air = f"air_{side}_{'out' if k < g.layers // 2 else 'in'}"
        bare = 1.0 if k in (0, g.layers - 1) else 0.35  # the layers between are partly covered
        mesh.join(f"near_{side}{k}", air, 0.05 / share, "film.endwinding", "endwinding", 0.0055 * bare * share)
        crown = 0.0095 * bare * longer * share
        mesh.join(f"crown_{side}{k}", air, 0.05 / share, "film.endwinding", "endwinding", crown)
    half, height = g.stack / mesh.axial / 2, (g.slot_bottom_radius - g.bore_radius) / 3
    tooth, middle = g.slots * g.tooth_width * height, (g.slot_bottom_radius + g.stator_radius) / 2
    for name in ("tooth_tip", "tooth_mid", "tooth_root"):
        mesh.join(
            f"{name}.{last}",
            f"air_{side}_in",
            half / (SHEET.across * tooth),
            "film.tooth_end",
            "tooth_end",
            1.6 * tooth,
        )
    inner, outer = ring(g.slot_bottom_radius, middle), ring(middle, g.stator_radius)
    mesh.join(
        f"yoke_in.{last}", f"air_{side}_out", half / (SHEET.across * inner), "film.tooth_end", "tooth_end", 1.3 * inner
    )
    mesh.join(f"yoke_out.{last}", f"shield_{side}", half / (SHEET.across * outer) + 0.3 / wide, "plate_contact")
    for cell in (f"crown_{side}0", f"near_{side}0"):
        mesh.joints.append(Joint(cell, f"shield_{side}", 0.0, "radiation", area=0.8 * 0.010 * wide, kind=RADIATES))
        mesh.join(cell, f"shield_{side}", 0.0, "film.bare", "bare", 0.010 * wide)


def _terminals(mesh: Mesh) -> None:
    """Busbars and their plastic rack on side B."""
    long, wide, large = mesh.geometry.size, mesh.geometry.size**2, mesh.geometry.size**3
    busbar = mesh.cell("busbar", "terminal_rack", 150.0 * large)
    rack = mesh.cell("rack", "terminal_rack", 80.0 * large)
    for k in (0, 1, 2):
        mesh.join(f"crown_b{k}", busbar, 1 / (1.05 * long), "copper")
    mesh.join(busbar, rack, 1 / (4.0 * long), "plastic")
    mesh.join(rack, "shield_b", 1 / (4.5 * long), "plastic")
    mesh.join(busbar, "air_b_out", 0.0, "film.endwinding", "endwinding", 0.008 * wide)


def along(mesh: Mesh, stem: str) -> NDArray[np.intp]:
    """Places of the cells `stem.0` ... in order."""
    index = mesh.index
    return np.array([index[f"{stem}.{z}"] for z in range(mesh.axial)], np.intp)
