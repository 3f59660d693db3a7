"""Everyday differences: what a healthy specimen may do that its motor file does not know. Each is drawn from the
seed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from plant.films import Film, FilmLaws
from plant.form import Form
from plant.losses import HEATS, LossLaws
from plant.mesh import Mesh

# Standard deviation of the logarithm of the conductances of each group of joints.
GROUP_SD = {
    "copper": 0.02,
    "sheet": 0.05,
    "steel": 0.05,
    "aluminium": 0.05,
    "across": 0.15,
    "enamel": 0.12,
    "liner": 0.10,
    "shrink_fit": 0.15,
    "shaft_fit": 0.15,
    "glue": 0.15,
    "bundle": 0.15,
    "plate_contact": 0.2,
    "seat": 0.15,
    "ribs": 0.15,
    "plastic": 0.15,
    "ambient": 0.12,
    "radiation": 0.1,
}
FILM_SD, EXPONENT_SD, EXPONENTS = 0.10, 0.07, (0.55, 1.0)
GAP_SD, GAP_TILT_SD = 0.12, 0.08
CAPACITY_SD = 0.04
LOSS_SD = {"tips": 0.08, "teeth": 0.06, "yoke": 0.06, "magnet": 0.15, "ripple": 0.3, "ac_slot": 0.06, "ac_end": 0.15}
OTHER_LOSS_SD, TILT_SD, DC_SD = 0.10, 0.06, 0.01
PATH_W_per_K = (0.25, 1.0)
PATH_COUNTS = (1, 2, 3)


@dataclass(frozen=True)
class Everyday:
    """One specimen. `groups`: factor of each group of joints; `capacities`: of each node; `paths`: (cell, cell,
    W/K)."""

    groups: Mapping[str, float] = field(default_factory=dict)
    capacities: Mapping[str, float] = field(default_factory=dict)
    films: FilmLaws = field(default_factory=FilmLaws)
    losses: LossLaws = field(default_factory=LossLaws)
    paths: tuple[tuple[str, str, float], ...] = ()
    dc: float = 1.0


def designed(form: Form) -> Everyday:
    """The motor as designed."""
    return Everyday(films=FilmLaws(form.films, form.machine.top_rpm), losses=LossLaws(form.losses))


def draw(seed: int, mesh: Mesh, form: Form, roughness: float = 1.0) -> Everyday:
    """The specimen of a seed; `roughness` multiplies every spread."""
    random = np.random.default_rng([seed, 1])

    def factor(sd: float) -> float:
        return float(np.exp(roughness * sd * random.standard_normal()))

    groups = {group: factor(sd) for group, sd in GROUP_SD.items()}
    nodes = sorted({cell.node for cell in mesh.cells})
    capacities = {node: factor(CAPACITY_SD) for node in nodes}
    films = {name: _film(film, factor, random, roughness) for name, film in form.films.items()}
    gap = FilmLaws(
        films, form.machine.top_rpm, factor(GAP_SD), roughness * GAP_TILT_SD * float(random.standard_normal())
    )
    kinds = (*HEATS, "ac_slot", "ac_end")
    losses = LossLaws(
        form.losses,
        {kind: factor(LOSS_SD.get(kind, OTHER_LOSS_SD)) for kind in kinds},
        {
            kind: roughness * TILT_SD * float(random.standard_normal())
            for kind in kinds
            if kind not in ("ripple", "contact")
        },
    )
    count = int(random.choice(PATH_COUNTS))
    chosen = random.choice(len(form.paths), count, replace=False)
    last = str(mesh.axial - 1)
    paths = tuple(
        (form.paths[i][0], form.paths[i][1].replace("last", last), roughness * float(random.uniform(*PATH_W_per_K)))
        for i in chosen
    )
    return Everyday(groups, capacities, gap, losses, paths, factor(DC_SD))


def _film(film: Film, factor, random: np.random.Generator, roughness: float) -> Film:  # type: ignore[no-untyped-def]
    shift = roughness * EXPONENT_SD * float(random.standard_normal())
    size = factor(FILM_SD)
    exponent = float(np.clip(film.exponent + shift, *EXPONENTS)) if film.turning else film.exponent
    return replace(film, rest=film.rest * size, turning=film.turning * size, exponent=exponent)
