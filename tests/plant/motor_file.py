"""A motor file from a reduced network; every rule of `rules` ends here."""

from __future__ import annotations

from dataclasses import replace

from plant.films import FLOW0
from plant.form import Form
from plant.geometry import ALPHA_COPPER
from plant.reduction import Reduced, Term

BEARING_SD = 1.0  # what rolling contacts and their grease conduct is known to a factor of three
GAP_SD = 0.8  # what an air gap conducts to a factor of two: slots, tips as hot as no lump, drag in between
REGIONS = {
    **dict.fromkeys(("shaft", "rotor_core", "rotor_surface", "end_plate_a", "end_plate_b"), "rotor"),
    **dict.fromkeys(("bearing_a", "bearing_b"), "bearing"),
    **dict.fromkeys(("yoke", "teeth"), "iron"),
    **dict.fromkeys(("housing", "jacket"), "housing"),
    **dict.fromkeys(("air_a", "air_b"), "fluid"),
    "magnet": "magnet",
    "rotor": "rotor",  # and the lumps of crude files
    "stator": "iron",
}


def motor_file(form: Form, reduced: Reduced, spreads: bool = False) -> str:
    """The motor file of a form; with `spreads` it says how badly copper, bearings, air gap and air are known."""
    scale = form.machine
    lines = ['schema = "whyhot.motor/1"', f'name = "{form.name}"', "", "[scale]", f"speed_rpm = {scale.top_rpm}"]
    lines += [f"current_A = {scale.current_A}", f"flow_lpm = {FLOW0}", ""]
    lines += ["[copper]", f"alpha_per_K = {ALPHA_COPPER}", "reference_degC = 20.0", ""]
    for node, capacity in reduced.capacities.items():
        region = REGIONS.get(node, "copper")
        limit = {"copper": "limit_degC = 180.0\n", "magnet": "limit_degC = 150.0\n"}.get(region, "")
        spread = "sd = 0.4\n" if spreads and region == "fluid" else ""
        lines.append(f'[[node]]\nname = "{node}"\ncapacity = {capacity:.5g}\nregion = "{region}"\n{spread}{limit}')
    lines += [f'[[boundary]]\nname = "{boundary}"\n' for boundary in ("coolant", "ambient")]
    for (a, b), terms in reduced.links.items():
        if any(end.startswith("bearing") for end in (a, b)):
            terms = tuple(replace(term, sd=BEARING_SD) for term in terms)
        if (a, b) == ("rotor_surface", "teeth"):
            terms = tuple(replace(term, sd=GAP_SD) for term in terms)
        lines.append(f'[[link]]\nbetween = ["{a}", "{b}"]\nterms = [{_written(terms, spreads)}]\n')
    for node, terms in reduced.sources.items():
        lines.append(f'[[source]]\nnode = "{node}"\nterms = [{_written(terms, spreads)}]\n')
    return "\n".join(lines)


def _written(terms: tuple[Term, ...], spreads: bool) -> str:
    return ", ".join(_term(term if spreads else replace(term, sd=None)) for term in terms)


def _term(term: Term) -> str:
    parts = [f"coefficient = {term.coefficient:.5g}", *(f"{name} = {power:g}" for name, power in term.powers)]
    parts += {1: ["copper = true"], -1: ["resistance = -1"]}.get(term.copper, [])
    parts += [f"sd = {term.sd:g}"] if term.sd is not None else []
    return "{" + ", ".join(parts) + "}"
