"""How large what is hidden is made: by a reference specimen of the same form and rule."""

from __future__ import annotations

import contextlib
import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.trial.answers import ENDS
from benchmarks.trial.campaigns import kept_count, logged, moved_by, planned, read
from benchmarks.trial.cases import Case, Hidden, in_catalogue, scaled
from benchmarks.trial.visibility import healthy_mode, strength
from plant import Effect, Plant
from plant.forms import FORMS

LEAST_SCALE, MOST_SCALE = 0.2, 6.0

Strengths = Mapping[str, float | None]  # cause -> d; None where the cause has none, or does not run in this form


def strengths(reference: Case, causes: Sequence[str]) -> dict[str, float | None]:
    """d of each cause at the size of the catalogue, in the reference specimen; none where that cannot be fitted."""
    plant = Plant(reference.seed, form=FORMS[reference.form])
    plan = planned(plant, reference.sessions, reference.longest_s)
    with tempfile.TemporaryDirectory() as folder:
        learnt = plan[: reference.sessions - kept_count(reference.sessions)]
        without = [one.truth for one in logged(Path(folder), reference, plant, learnt)]
        campaign = read(Path(folder))
    found: dict[str, float | None] = dict.fromkeys(causes)
    try:
        mode = healthy_mode(campaign)
    except ENDS:
        return found
    for effect in map(in_catalogue, causes):
        with contextlib.suppress(ArithmeticError, ValueError):  # a motor that runs away with it
            moved = moved_by(effect, reference, plan, without)
            found[effect.cause] = strength(mode, campaign.candidates, effect, moved)
    return found


def sized(hidden: Hidden, known: Strengths) -> Effect:
    """The effect at the size that would give the reference what is wanted."""
    effect, d = in_catalogue(hidden.cause), known[hidden.cause]
    return scaled(effect, float(np.clip(hidden.wanted / d, LEAST_SCALE, MOST_SCALE))) if d else effect


def read_strengths(path: Path) -> dict[str, float | None]:
    """What is known already."""
    found: dict[str, float | None] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return found


def write_strengths(path: Path, known: Strengths) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
