"""One trial, from the logs to what the diagnosis of them said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.trial.answers import ENDS, Result, tried
from benchmarks.trial.campaigns import Behind, driven, kept_as, read
from benchmarks.trial.cases import Case, scaled
from benchmarks.trial.visibility import Seen, healthy_mode, seen
from plant import Effect
from replay.studies.diagnosis.question import Campaign
from twin.motor.features import product, terms
from twin.motor.network import Network
from twin.motor.paths import terms_at

HALVINGS = 4


class RunsAway(ValueError):
    """A motor that no size of its effects lets run."""


def trial(case: Case, effects: Sequence[Effect], folder: Path) -> Result:
    """One trial, its logs made or found. What ends its diagnosis is counted as no answer."""
    behind = kept_as(folder / "behind.pickle", lambda: _driven(case, effects, folder))
    campaign, healthy = read(folder), read(folder / "healthy") if behind.effects else None
    behind = replace(behind, effects=tuple(as_the_file_says(one, campaign.network) for one in behind.effects))
    hidden = tuple(Seen(effect.cause, effect.size) for effect in behind.effects)
    try:
        hidden = _visible(behind, healthy) if healthy else hidden
        return tried(case, campaign, behind, hidden)
    except ENDS as error:
        return Result(case, hidden, failed=f"{type(error).__name__}: {error}")


def as_the_file_says(effect: Effect, network: Network) -> Effect:
    """The effect by the cause that a motor file gives it: more of a law that is the only one at its node or link is
    `scale` there, and no other candidate."""
    kind, place, law = [*effect.cause.split(".", 2), "", ""][:3]
    if kind not in ("loss", "conductance"):
        return effect
    own = [list(terms(network))[i] for i in terms_at(network, tuple(place.split("-")))]
    alone = len(own) == 1 and product(own[0]).name == law
    return replace(effect, cause=f"{kind}.{place}.scale") if alone else effect


def _visible(behind: Behind, healthy: Campaign) -> tuple[Seen, ...]:
    """How well each hidden effect can be seen."""
    mode = healthy_mode(healthy)
    pairs = zip(behind.effects, behind.moved, strict=True)
    return tuple(seen(mode, healthy.candidates, effect, moved) for effect, moved in pairs)


def _driven(case: Case, effects: Sequence[Effect], folder: Path) -> Behind:
    """The logs of a case; where the motor with its effects runs away, at half their sizes, and half again."""
    for _ in range(HALVINGS):
        try:
            return driven(case, effects, folder)
        except (ArithmeticError, ValueError):
            if not effects:
                raise
        effects = [scaled(effect, 0.5) for effect in effects]
    raise RunsAway(f"{case.name}: the motor runs away at 1/{2 ** (HALVINGS - 1)} of the sizes too")
