"""The motor file of the bare stator: what its designer knows, five lumps of stator, a rotor, and a jacket.

Its configuration `stator_in_air` is the rig: rotor and coolant gone, surfaces in free air, two of three phases
energised. It knows no specimen: sums of the lumps as designed, the bore's air shared among what it touches, no
supports but their path, and no loss that needs turning.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from plant.bare_stator import (
    CAPACITY,
    FILM_OF,
    INDEX,
    JOINTS,
    LENGTH_SHARES,
    SEES_ROOM,
    STEFAN_BOLTZMANN,
    BORE_m2,
    PHASE_ohm,
    Rig,
    ROOM_m2,
    designed,
    film_W_per_m2K,
)

CONFIGURATION = "stator_in_air"
PARTS: Mapping[str, tuple[str, ...]] = {  # node -> beginnings and ends of the names of its lumps
    "winding": ("slot_",),
    "endwinding_a": ("near_ua", "near_va", "near_wa", "crown_ua", "crown_va", "crown_wa"),
    "endwinding_b": ("near_ub", "near_vb", "near_wb", "crown_ub", "crown_vb", "crown_wb"),
    "teeth": ("teeth_",),
    "yoke": ("yoke_",),
}
SHARED_BORE = 0.64  # of what a surface in the bore would lose to the room, its air being warm
SUPPORTS_W_per_K = 0.25


def lumps(node: str) -> list[int]:
    """Places of the lumps of a node."""
    return [place for name, place in INDEX.items() if name.startswith(PARTS[node])]


def _between(a: str, b: str, series: Sequence[float] = ()) -> float:
    """Conductance [W/K] of all joints of two nodes, in series with others."""
    ours, theirs = lumps(a), lumps(b)
    found = sum(j.W_per_K for j in JOINTS if (j.a in ours and j.b in theirs) or (j.b in ours and j.a in theirs))
    return 1.0 / (1.0 / found + sum(1.0 / other for other in series))


def _air(node: str, rig: Rig) -> str:
    """The terms of the link to the room."""
    places = lumps(node)
    new = designed(1)
    emissivity = float((new.head_emissivity if node.startswith("endwinding") else new.iron_emissivity)[0])
    radiates = 4.0 * STEFAN_BOLTZMANN * emissivity * SEES_ROOM[places].sum() * 293.15**3
    at_10_K = rig.film_factor * float(film_W_per_m2K("quarter", np.array(10.0), np.array(20.0)))
    convects = at_10_K * ((ROOM_m2 * FILM_OF)[places].sum() + 0.8 * SHARED_BORE * BORE_m2[places].sum())
    terms = [
        f'{{coefficient = {radiates:.4f}, law = "radiation"}}',
        f'{{coefficient = {convects:.4f}, law = "free_convection"}}',
    ]
    if node == "yoke":
        terms.append(f"{{coefficient = {SUPPORTS_W_per_K}}}")
    return ", ".join(terms)


def motor_toml(rig: Rig | None = None) -> str:
    """The motor file, with the configuration of a rig. Currents are in units of the rig's."""
    rig = rig or Rig()
    text = f'schema = "whyhot.motor/1"\nname = "hairpin-stator"\n[scale]\ncurrent_A = {rig.current_A}\n'
    for node in PARTS:
        text += f'\n[[node]]\nname = "{node}"\ncapacity = {CAPACITY[lumps(node)].sum():.1f}\n'
    text += '\n[[node]]\nname = "rotor"\ncapacity = 4100.0\n'
    text += '\n[[boundary]]\nname = "coolant"\n\n[[boundary]]\nname = "ambient"\n'
    inside = 3 * 2 * 6.0  # W/K from the near to the far part of a head, to its middle
    links = {
        ("winding", "endwinding_a"): _between("winding", "endwinding_a", [inside]),
        ("winding", "endwinding_b"): _between("winding", "endwinding_b", [inside]),
        ("winding", "teeth"): _between("winding", "teeth"),
        ("winding", "yoke"): _between("winding", "yoke"),
        ("teeth", "yoke"): _between("teeth", "yoke"),
        ("teeth", "rotor"): 4.0,
        ("yoke", "coolant"): 90.0,
        ("rotor", "ambient"): 0.5,
    }
    for (a, b), conductance in links.items():
        text += f'\n[[link]]\nbetween = ["{a}", "{b}"]\nterms = [{{coefficient = {conductance:.4f}}}]\n'
    for node, watts in _copper(rig, phases=3).items():
        text += f'\n[[source]]\nnode = "{node}"\nterms = [{{coefficient = {watts:.4f}, current = 2, copper = true}}]\n'
    text += f'\n[[configuration]]\nname = "{CONFIGURATION}"\nremove = ["rotor", "coolant"]\n'
    for node in PARTS:
        if node != "winding":
            text += f'\n[[configuration.link]]\nbetween = ["{node}", "ambient"]\nterms = [{_air(node, rig)}]\n'
    for node, watts in _copper(rig, phases=len(rig.energised)).items():
        source = f"{{coefficient = {watts:.4f}, current = 2, copper = true}}"
        text += f'\n[[configuration.source]]\nnode = "{node}"\nterms = [{source}]\n'
    return text


def _copper(rig: Rig, phases: int) -> dict[str, float]:
    """Copper loss [W] of each node with the rig's current in that many phases, at 20 degC."""
    whole = phases * rig.current_A**2 * PHASE_ohm
    head = LENGTH_SHARES["near"] + LENGTH_SHARES["crown"]
    return {"winding": whole * 2 * LENGTH_SHARES["slot"], "endwinding_a": whole * head, "endwinding_b": whole * head}
