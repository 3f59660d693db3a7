"""A motor file from drawings and textbooks: lengths, areas, masses and formulas, none of the mesh.

Films: Dittus and Boelter in a jacket, a constant Nusselt number in oil grooves, Becker and Kaye in the gap, Schubert at
winding heads, Juerges along fins. Losses: `hand_losses`. README.md gives the sources.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import log, pi
from types import MappingProxyType

from plant.drives import FLOW_lpm
from plant.films import AIR_m2_per_s, AIR_W_per_mK
from plant.form import Form
from plant.geometry import (
    ALUMINIUM,
    COPPER,
    GLYCOL,
    LINER,
    NDFEB,
    NODES,
    OIL,
    RESIN,
    SHEET,
    STEEL,
    Geometry,
    ring,
)
from plant.hand_losses import copper, other_losses
from plant.mesh import jacketed
from plant.other_meshes import FINS, POTTING_W_per_mK, cast_volume, conductivity_of_wires, finned, potted, sprayed
from plant.plant import LITRE_PER_MIN
from plant.reduction import Reduced, Term
from plant.tangential import section

Links = dict[tuple[str, str], tuple[Term, ...]]

FIT_m = 10e-6  # of air between parts pressed into each other
GLYCOL_Pas, CHANNEL_m = 1.1e-3, 0.045  # viscosity; width of the jacket's channel
PLATES_NUSSELT = 7.54  # laminar between parallel plates of one temperature
SHAFT_OIL, SPRAYED_OIL = 500.0, 250.0  # W/(m2 K) from a supplier's tests
SKIN = 10.0  # W/(m2 K), free convection and radiation
FIN_EFFICIENCY, FAN_SLIP = 0.7, 0.25
BEARING = 1.0  # W/K of the jacketed motor's size
CAVITY_m = 0.060  # length of an end cavity of that size


def by_hand(form: Form) -> Reduced:
    """The network of a form."""
    return Reduced(_capacities(form), _links(form), {**copper(form), **other_losses(form)})


def _series(*resistances: float) -> tuple[Term, ...]:
    return (Term(1.0 / sum(resistances)),)


# ---- capacities ----------------------------------------------------------------------------------------------------


def _capacities(form: Form) -> dict[str, float]:
    g, size = form.geometry, form.geometry.size
    copper = g.slots * g.layers * g.bar_area
    head = {s: 1.1 * COPPER.heats(copper / 2 * (g.near_length + g.crown(s))) for s in "ab"}
    slot = RESIN.heats(0.6 * g.slots * (g.slot_width * _depth(g) - g.layers * g.bar_area) * g.stack / 2)
    wall, wet = g.sleeve_radius + g.coolant_height, 0.5 if form.build is finned else 1.0
    sleeve = 1.2 * ALUMINIUM.heats(ring(g.stator_radius, g.sleeve_radius) * g.stack)
    masses = {
        "shaft": STEEL.heats(ring(g.shaft_hole, g.shaft_radius) * (g.stack + 0.09 * size)),
        "rotor_core": SHEET.heats(0.8 * ring(g.shaft_radius, g.core_radius) * g.stack),
        "rotor_surface": SHEET.heats(0.9 * ring(g.rotor_radius - g.surface_depth, g.rotor_radius) * g.stack),
        "magnet": NDFEB.heats(g.magnet_volume),
        "yoke": SHEET.heats(ring(g.slot_bottom_radius, g.stator_radius) * g.stack * g.stacking),
        "teeth": SHEET.heats(g.slots * g.tooth_width * _depth(g) * g.stack * g.stacking),
        "terminal_rack": 230.0 * size**3,
        "housing": 1.6 * ALUMINIUM.heats(ring(wall, wall + g.outer_wall) * g.stack)
        + 2 * 3.2 * 900.0 * size**3
        + (1.0 - wet) * sleeve,
        "jacket": wet * (sleeve + 0.7 * form.coolant.heats(ring(g.sleeve_radius, wall) * g.stack)),
    }
    for side in "ab":
        masses |= {f"bearing_{side}": 0.4 * 465.0 * size**3, f"end_plate_{side}": 0.23 * 900.0 * size**3}
        masses |= {f"winding_{side}": COPPER.heats(copper * g.stack / 2) + slot, f"air_{side}": 25.0 * size**3}
        masses |= {f"endwinding_{side}_{part}": head[side] for part in ("inner", "outer")}
        if form.build is potted:
            masses[f"endwinding_{side}_outer"] += RESIN.heats(cast_volume(g, side))
    return {node: masses[node] for node in NODES}


def _depth(g: Geometry) -> float:
    """Depth of a slot [m]."""
    return g.slot_bottom_radius - g.bore_radius


# ---- conductances --------------------------------------------------------------------------------------------------


def _links(form: Form) -> Links:
    """Every link that a textbook's network has, in the order of the nodes."""
    links = {**_rotor(form), **_stator(form), **_ends(form)}
    COOLING[form.build](form, links)
    order = [*NODES, "coolant", "ambient"]
    return dict(sorted(links.items(), key=lambda item: [order.index(node) for node in item[0]]))


def _rotor(form: Form) -> Links:
    g, size, poles = form.geometry, form.geometry.size, 2 * form.machine.pole_pairs
    glue = 1e-4 / 0.3 / g.pockets
    half = g.magnet_half / (NDFEB.conductivity * g.pockets)
    cover = g.surface_depth / 2 / (SHEET.conductivity * g.pockets)
    core = log(g.core_radius / g.shaft_radius) / (2 * pi * 0.8 * SHEET.conductivity * g.stack) / 2
    fit = FIT_m / AIR_W_per_mK / (2 * pi * g.shaft_radius * g.stack)
    steel = STEEL.conductivity * ring(g.shaft_hole, g.shaft_radius)
    links: Links = {
        ("rotor_surface", "magnet"): _series(half, glue, cover),
        ("rotor_core", "magnet"): _series(half, glue, core),
        ("rotor_core", "rotor_surface"): (Term(SHEET.conductivity * poles * 2 * 0.0015 * g.stack / 0.006),),
        ("shaft", "rotor_core"): _series(core, fit),
        ("rotor_surface", "teeth"): _gap(form),
    }
    for side in "ab":
        journal = (g.stack / 4 + 0.03 * size) / steel
        links["shaft", f"bearing_{side}"] = _series(journal, 0.5 / (BEARING * size))
        links[f"bearing_{side}", "housing"] = (Term(2 * BEARING * size),)
        area = 0.5 * ring(g.shaft_radius, g.core_radius)
        links["rotor_core", f"end_plate_{side}"] = (Term(SHEET.across * area / (g.stack / 4)),)
        links[f"end_plate_{side}", f"air_{side}"] = _schubert(form, pi * g.rotor_radius**2)
    return links


def _gap(form: Form) -> tuple[Term, ...]:
    """Becker and Kaye: at rest, and at the top speed with the exponent of the range of Taylor numbers there."""
    g, omega = form.geometry, form.machine.top_rpm * pi / 30
    taylor = omega**2 * g.rotor_radius * g.gap**3 / AIR_m2_per_s**2
    factor, exponent = (0.409, 0.241) if taylor > 1e4 else (0.128, 0.367)
    area = 2 * pi * g.bore_radius * g.stack * AIR_W_per_mK / (2 * g.gap)
    nusselt = factor * taylor**exponent
    return Term(2.0 * area), Term(max(nusselt - 2.0, 0.1) * area, (("speed", round(2 * exponent, 2)),))


def _schubert(form: Form, area: float, share: float = 1.0) -> tuple[Term, ...]:
    """h = 15 (1 + 0.4 v^0.9), v a share of the rotor's surface speed [m/s]."""
    v = share * form.geometry.rotor_radius * form.machine.top_rpm * pi / 30
    return Term(15.0 * area), Term(15.0 * 0.4 * v**0.9 * area, (("speed", 0.9),))


def _stator(form: Form) -> Links:
    g = form.geometry
    middle = (g.slot_bottom_radius + g.stator_radius) / 2
    tooth = _depth(g) / 2 / (SHEET.conductivity * g.slots * g.tooth_width * g.stack * g.stacking)
    yoke = log(middle / g.slot_bottom_radius) / (2 * pi * SHEET.conductivity * g.stack)
    copper = g.slots * g.layers * g.bar_area * COPPER.conductivity
    inside = g.bar_width / 6 / conductivity_of_wires(g) if g.wire else g.enamel / RESIN.conductivity
    lining = inside + g.liner / LINER.conductivity + 1e-4 / RESIN.conductivity
    links: Links = {
        ("yoke", "teeth"): _series(tooth, yoke),
        ("winding_a", "winding_b"): (Term(copper / (g.stack / 2)),),
    }
    for side in "ab":
        links["teeth", f"winding_{side}"] = (Term(2 * g.slots * _depth(g) * g.stack / 2 / lining),)
        links["yoke", f"winding_{side}"] = (Term(g.slots * g.slot_width * g.stack / 2 / lining),)
        for part in ("inner", "outer"):
            along = g.stack / 4 + (g.near_length + g.crown(side)) / 2
            links[f"winding_{side}", f"endwinding_{side}_{part}"] = (Term(copper / 2 / along),)
    return links


def _ends(form: Form) -> Links:
    g, size = form.geometry, form.geometry.size
    leads = 3 * 30e-6 * COPPER.conductivity / 0.05
    links: Links = {
        ("endwinding_b_outer", "terminal_rack"): (Term(leads * size),),
        ("terminal_rack", "housing"): (Term(2.0 * size),),
        ("shaft", "ambient"): _schubert(form, 0.01 * size**2, g.shaft_radius / g.rotor_radius),
    }
    between = conductivity_of_wires(g) if g.wire else RESIN.conductivity
    for side in "ab":
        length = g.near_length + g.crown(side)
        middle = (g.bore_radius + g.slot_bottom_radius) / 2
        apart = g.layers / 2 * g.bar_height if g.wire else 0.0015
        links[f"endwinding_{side}_inner", f"endwinding_{side}_outer"] = (
            Term(between * 2 * pi * middle * length / apart),
        )
        for part, radius in (("inner", g.bore_radius), ("outer", g.slot_bottom_radius)):
            links[f"endwinding_{side}_{part}", f"air_{side}"] = _schubert(form, 2 * pi * radius * length)
        teeth = g.slots * g.tooth_width * _depth(g)
        links["teeth", f"air_{side}"] = _schubert(form, teeth, 0.5)
        links["yoke", f"air_{side}"] = _schubert(form, ring(g.slot_bottom_radius, g.stator_radius), 0.5)
        shield = pi * g.stator_radius**2 + 2 * pi * g.stator_radius * CAVITY_m * size
        links["housing", f"air_{side}"] = _schubert(form, shield, 0.5)
    return links


# ---- what cools it -------------------------------------------------------------------------------------------------


def _fit_of_stack(g: Geometry, share: float = 1.0) -> tuple[Term, ...]:
    """Yoke to what holds a share of it."""
    middle = (g.slot_bottom_radius + g.stator_radius) / 2
    yoke = log(g.stator_radius / middle) / (2 * pi * SHEET.conductivity * g.stack)
    gap = FIT_m / AIR_W_per_mK / (2 * pi * g.stator_radius * g.stack)
    return (Term(share / (yoke + gap)),)


def _outside(g: Geometry) -> tuple[float, float]:
    """Area of the housing's cylinder [m2], and of its shields and the housing around the cavities."""
    wall = g.sleeve_radius + g.coolant_height + g.outer_wall
    return 2 * pi * wall * g.stack, 2 * pi * wall**2 + 4 * pi * wall * CAVITY_m * g.size


def dittus_boelter(g: Geometry) -> float:
    """Film [W/(m2 K)] of glycol in a channel as high as the jacket, at the flow of a motor file's scale."""
    v = FLOW_lpm * LITRE_PER_MIN / (g.coolant_height * CHANNEL_m)
    reynolds = GLYCOL.density * v * 2 * g.coolant_height / GLYCOL_Pas
    prandtl = GLYCOL_Pas * GLYCOL.heat_capacity / GLYCOL.conductivity
    return float(0.023 * reynolds**0.8 * prandtl**0.4 * GLYCOL.conductivity / (2 * g.coolant_height))


def _jacket(form: Form, links: Links, share: float = 1.0) -> None:
    g = form.geometry
    area = share * 2 * pi * g.sleeve_radius * g.stack
    links["yoke", "jacket"] = _fit_of_stack(g, share)
    links["jacket", "coolant"] = (Term(dittus_boelter(g) * area, (("flow", 0.8),)),)
    links["housing", "jacket"] = (Term(0.5 * dittus_boelter(g) * area),)
    links["housing", "ambient"] = (Term(SKIN * sum(_outside(g))),)


def _potting(form: Form, links: Links) -> None:
    g = form.geometry
    _jacket(form, links)
    for side in "ab":
        length = g.near_length + g.crown(side)
        slab = POTTING_W_per_mK * 2 * pi * g.slot_bottom_radius * length / (g.stator_radius - g.slot_bottom_radius)
        links[f"endwinding_{side}_outer", "jacket"] = (Term(slab),)
        del links[f"endwinding_{side}_outer", f"air_{side}"]


def _oil(form: Form, links: Links) -> None:
    g = form.geometry
    grooves = PLATES_NUSSELT * OIL.conductivity / (2 * g.coolant_height) * 2 * pi * g.sleeve_radius * g.stack
    links["yoke", "jacket"] = _fit_of_stack(g)
    links["jacket", "coolant"] = (Term(2 * grooves),)  # both walls and the ribs
    links["housing", "jacket"] = _series(2 * FIT_m / AIR_W_per_mK / (0.35 * 2 * pi * g.sleeve_radius * g.stack))
    links["housing", "ambient"] = (Term(SKIN * sum(_outside(g))),)
    links["shaft", "coolant"] = (Term(SHAFT_OIL * 2 * pi * g.shaft_hole * g.stack),)
    for side in "ab":
        for part, radius in (("inner", g.bore_radius), ("outer", g.slot_bottom_radius)):
            area = 2 * pi * radius * (g.near_length + g.crown(side))
            links[f"endwinding_{side}_{part}", "coolant"] = (Term(SPRAYED_OIL * area, (("flow", 0.5),)),)


def _fins(form: Form, links: Links) -> None:
    """Juerges: h = 7.13 v^0.78 along the fins, v a share of the fan's tip speed [m/s]."""
    g = form.geometry
    _jacket(form, links, 0.5)
    links["yoke", "housing"] = _fit_of_stack(g, 0.5)
    around, rest = _outside(g)
    v = FAN_SLIP * (g.sleeve_radius + g.coolant_height + g.outer_wall) * form.machine.top_rpm * pi / 30
    fan = 7.13 * v**0.78 * FIN_EFFICIENCY * FINS * around
    links["housing", "ambient"] = (Term(SKIN * (around + rest)), Term(fan, (("speed", 0.78),)))


COOLING: Mapping[Callable[..., object], Callable[[Form, Links], None]] = MappingProxyType(
    {jacketed: _jacket, section: _jacket, potted: _potting, sprayed: _oil, finned: _fins}
)
