"""Blank motor files by topology, to be filled in."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files

TOPOLOGIES: Mapping[str, str] = {  # name of the template -> what it is
    "ipm_water_jacket": "interior magnets, water jacket: 21 nodes, both ends apart",
    "ipm_oil_cooled": (
        "interior magnets, oil on end windings and rotor, water jacket: 14 nodes, two circuits, a loss map"
    ),
    "ipm_four_node": "interior magnets, water jacket: yoke, teeth, winding, rotor",
    "ipm_seven_node": (
        "interior magnets, water jacket, a lump for each place of a bench motor's thermocouples: yoke, teeth, winding,"
        " end winding, rotor, bearing, end cap"
    ),
    "three_node": "any motor: winding, stator, rotor",
    "induction_fan_cooled": "closed induction motor with a fan on its shaft: 9 nodes",
}
DEFAULT = "ipm_water_jacket"


def template(topology: str) -> bytes:
    """The commented motor file of a topology of `TOPOLOGIES`."""
    return (files("replay") / "templates" / f"{topology}.toml").read_bytes()
