"""How an engineer makes the motor file of a form: `RULES` has each by name, `CRUDE` those of few nodes. No rule knows a
specimen, and none but the jacketed motor's first says how badly its values are known."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from types import MappingProxyType

from plant.crude import LUMPS, crude
from plant.energy_weighted import energy_weighted
from plant.form import Form
from plant.geometry import Geometry
from plant.hand import by_hand
from plant.motor_file import motor_file
from plant.reduction import Reduced, Term, reduce

SMALLER = {"stack": 0.70, "radius": 0.85, "wire": 0.88}  # lengths of the supplier's motor over this one's


def fitted(form: Form) -> str:
    """Conductances of the mesh, losses fitted to the loss map: `reduction`."""
    return motor_file(form, reduce(form), form.spreads)


def weighted(form: Form) -> str:
    """Flows and mean temperatures of rated runs, losses by two points: `energy_weighted`."""
    return motor_file(form, energy_weighted(form))


def hand(form: Form) -> str:
    """Lengths, areas and textbook formulas: `hand`."""
    return motor_file(form, by_hand(form))


def scaled(form: Form) -> str:
    """The fitted file of a smaller motor of the same make, every length multiplied by the cube root of the ratio of
    volumes: capacities and losses with the volume, conductances as area over length, copper to the phase resistance
    that one measures."""
    small = smaller(form)
    volume = _volume(form.geometry) / _volume(small.geometry)
    found, right = reduce(small), _direct_copper(reduce(form))
    copper = right / (_direct_copper(found) * volume)
    return motor_file(
        form,
        Reduced(
            {node: capacity * volume for node, capacity in found.capacities.items()},
            {link: _times(terms, volume ** (1 / 3)) for link, terms in found.links.items()},
            {
                node: _times(terms, volume * (copper if any(term.copper for term in terms) else 1.0))
                for node, terms in found.sources.items()
            },
        ),
    )


@cache
def smaller(form: Form) -> Form:
    """A motor of the same make with a shorter stack and smaller radii. Liner, enamel, gap and contacts stay as they
    are, and so does how fast it turns; its iron and its other losses go with its volume."""
    g, by = form.geometry, SMALLER
    radii = ("bore", "slot_bottom", "stator", "core", "middle", "shaft")
    lengths = ("near_length", "crown_length_a", "crown_length_b", "surface_depth", "shaft_hole", "slot_width", "size")
    small = replace(
        g,
        stack=by["stack"] * g.stack,
        magnet_volume=by["stack"] * by["radius"] ** 2 * g.magnet_volume,
        pockets=by["stack"] * by["radius"] * g.pockets,
        webs=by["stack"] * g.webs,
        bar_width=by["wire"] * g.bar_width,
        bar_height=by["wire"] * g.bar_height,
        bar_area=by["wire"] ** 2 * g.bar_area,
        wire=by["wire"] * g.wire,
        **{f"{name}_radius": by["radius"] * getattr(g, f"{name}_radius") for name in radii},
        **{name: by["radius"] * getattr(g, name) for name in lengths},
    )
    share, design = _volume(small) / _volume(g), form.losses
    losses = replace(
        design,
        tips_kg=share * design.tips_kg,
        teeth_kg=share * design.teeth_kg,
        yoke_kg=share * design.yoke_kg,
        weakening_W=share * design.weakening_W,
        courses={
            name: tuple((share * watts, by_speed, by_current) for watts, by_speed, by_current in course)
            for name, course in design.courses.items()
        },
    )
    rated = (form.rated[0], share * form.rated[1])
    return replace(form, name=f"{form.name}-smaller", geometry=small, losses=losses, rated=rated)


def _volume(g: Geometry) -> float:
    return g.stack * g.stator_radius**2


def _times(terms: tuple[Term, ...], factor: float) -> tuple[Term, ...]:
    return tuple(replace(term, coefficient=factor * term.coefficient) for term in terms)


def _direct_copper(reduced: Reduced) -> float:
    """Copper loss [W] at full direct current, 20 degC."""
    return sum(term.coefficient for terms in reduced.sources.values() for term in terms if term.copper == 1)


RULES: Mapping[str, Callable[[Form], str]] = MappingProxyType(
    {"fitted": fitted, "energy_weighted": weighted, "hand": hand, "scaled": scaled}
)
CRUDE: Mapping[str, Callable[[Form], str]] = MappingProxyType(
    {rule: partial(crude, lumps=own) for rule, own in LUMPS.items()}
)
