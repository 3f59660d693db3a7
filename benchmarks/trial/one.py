"""One trial, from the logs to what the diagnosis of them said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from benchmarks.trial.answers import ENDS, Result, tried
from benchmarks.trial.campaigns import Behind, driven, kept_as, read
from benchmarks.trial.cases import Case, scaled
from benchmarks.trial.visibility import Seen, healthy_mode, seen
from plant import Effect
from plant.crude import LUMPS
from plant.sensors import sensors
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
    effects = [lumped(one, case) for one in behind.effects]
    behind = replace(behind, effects=tuple(as_the_file_says(one, campaign.network) for one in effects))
    hidden = tuple(Seen(effect.cause, effect.size) for effect in behind.effects)
    try:
        hidden = _visible(behind, healthy) if healthy else hidden
        return tried(case, campaign, behind, hidden)
    except ENDS as error:
        return Result(case, hidden, failed=f"{type(error).__name__}: {error}")


@dataclass(frozen=True)
class Lumped(Effect):
    """An effect by the cause that a file of few nodes gives it."""

    def __post_init__(self) -> None:
        """Its place is a lump, which the plant does not know."""


def lumped(effect: Effect, case: Case) -> Effect:
    """The effect at the lumps of a crude file: at a sensor of several of a lump with its signal, between nodes of one
    lump unknown."""
    lumps = LUMPS.get(case.rule)
    if lumps is None or effect.kind in ("boundary", "input", "clock", "unknown"):
        return effect
    of = {node: lump for lump, nodes in lumps.items() for node in nodes}
    if effect.kind == "sensor":
        at = {sensor.node: (of[sensor.node], sensor.signal) for sensor in sensors(case.layout)}
        if effect.place not in at:
            return effect
        lump, signal = at[effect.place]
        alone = sum(lump == other for other, _ in at.values()) == 1
        return Lumped(f"sensor.{lump if alone else f'{lump}@{signal}'}.{effect.law}", effect.size)
    if effect.kind in ("loss", "capacity"):
        return Lumped(f"{effect.kind}.{of[effect.nodes[0]]}.{effect.law}", effect.size)
    a, b = (of.get(end, end) for end in effect.links[0])
    return Lumped(f"{effect.kind}.{a}-{b}.{effect.law}" if a != b else "unknown.inside", effect.size)


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
