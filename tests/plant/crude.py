"""Crude motor files: the fitted network with its nodes put together to seven or to three, as one begins with.

What a lump holds is one temperature: capacities and losses of its nodes add up, and so do the links that lead out of
it, whatever they began at. What a lump is inside (a winding's hot end, an air space) such a file does not know.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from plant.form import Form
from plant.motor_file import motor_file
from plant.reduction import Reduced, Term, reduce

Lumps = Mapping[str, tuple[str, ...]]  # lump -> nodes

_ENDS = ("endwinding_a_inner", "endwinding_a_outer", "endwinding_b_inner", "endwinding_b_outer", "terminal_rack")
_AROUND = ("housing", "jacket", "bearing_a", "bearing_b", "air_a", "air_b")
_ROTOR = ("shaft", "rotor_core", "rotor_surface", "end_plate_a", "end_plate_b")
SEVEN: Lumps = MappingProxyType(
    {
        "winding": ("winding_a", "winding_b"),
        "endwinding": _ENDS,
        "teeth": ("teeth",),
        "yoke": ("yoke",),
        "magnet": ("magnet",),
        "rotor": _ROTOR,
        "housing": _AROUND,
    }
)
THREE: Lumps = MappingProxyType(
    {
        "winding": ("winding_a", "winding_b", *_ENDS),
        "stator": ("teeth", "yoke", *_AROUND),
        "rotor": (*_ROTOR, "magnet"),
    }
)
LUMPS: Mapping[str, Lumps] = MappingProxyType({"seven_nodes": SEVEN, "three_nodes": THREE})  # rule -> its lumps
BIAS_SD_K = 2.0  # how well one thermocouple stands for a lump


def crude(form: Form, lumps: Lumps) -> str:
    """The motor file of a form in these lumps."""
    return motor_file(form, lumped(reduce(form), lumps))


def lumped(reduced: Reduced, lumps: Lumps) -> Reduced:
    """A network with its nodes put together; every node is in one lump."""
    of = {node: lump for lump, nodes in lumps.items() for node in nodes}
    links: dict[tuple[str, str], tuple[Term, ...]] = {}
    for (a, b), terms in reduced.links.items():
        ends = of[a], of.get(b, b)
        place = ends if ends[::-1] not in links else ends[::-1]
        if ends[0] != ends[1]:
            links[place] = _together(links.get(place, ()), terms)
    sources: dict[str, tuple[Term, ...]] = {}
    for node, terms in reduced.sources.items():
        sources[of[node]] = _together(sources.get(of[node], ()), terms)
    held = {lump: sum(reduced.capacities[node] for node in nodes) for lump, nodes in lumps.items()}
    return Reduced(held, links, sources)


def _together(some: tuple[Term, ...], more: tuple[Term, ...]) -> tuple[Term, ...]:
    """Terms of one law as one."""
    found = {(term.powers, term.copper): term for term in some}
    for term in more:
        law = term.powers, term.copper
        found[law] = replace(term, coefficient=term.coefficient + (found[law].coefficient if law in found else 0.0))
    return tuple(found.values())
