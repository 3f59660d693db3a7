"""What hides in which motor: specimens of every form with the file of every rule, and the effects hidden in them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from plant import CATALOGUE, Effect
from plant.rules import CRUDE

EFFECT_SEEDS, MANY_SEEDS = 500, 1000  # after the first seed: from here on those of single effects, of many at once
OFF_LIBRARY_EVERY = 3
WANTED = (2.0, 4.0, 7.0, 12.0, 20.0)  # d of the effect in the reference specimen
LEAST_FACTOR, MOST_FACTOR = 0.2, 5.0
FACTORS = ("unknown.liner_gap", "unknown.vapour")  # besides every `scale`: sizes that do nothing at 1
MASKED = ("hold", "stuck", "dropout", "saturation")
READ_WRONG = ("sensor", "clock", "input", "boundary")
FEWEST, MOST_HIDDEN = 3, 5
FEWEST_SESSIONS, MOST_SESSIONS = 5, 12
FEWEST_OF_CRUDE = 8  # sessions: so many that they can be left out in turn
# Of many effects at once no two are of one family, or at one place: the family with the fewest places chooses first.
FAMILIES = (("capacity",), READ_WRONG, ("loss",), ("conductance",), ("unknown",))


@dataclass(frozen=True)
class Hidden:
    """A cause of the catalogue, at a size that would give the reference specimen d = `wanted`."""

    cause: str
    wanted: float


@dataclass(frozen=True)
class Case:
    """A specimen of a form with the motor file of a rule, and what it hides. Its drives end after `longest_s` at the
    latest."""

    seed: int
    layout: str
    form: str = "jacketed"
    rule: str = "fitted"
    hidden: tuple[Hidden, ...] = ()
    sessions: int = FEWEST_SESSIONS
    longest_s: float = math.inf

    @property
    def name(self) -> str:
        hidden = [f"{h.cause}_{h.wanted:g}" for h in self.hidden]
        what = hidden if len(hidden) < FEWEST else [f"{len(hidden)}_effects"]
        return "_".join([f"{self.seed}", self.layout, self.form, self.rule, *what])

    @property
    def kind(self) -> str:
        """`healthy`, `single` or `many`."""
        return ("healthy", "single")[len(self.hidden)] if len(self.hidden) < 2 else "many"


Motors = Sequence[tuple[str, str]]  # form and rule


def cases(first: int, healthy: int, effects: int, many: int, motors: Motors, layout: str) -> list[Case]:
    """Healthy specimens, single effects and many at once in turn."""
    silent = [Case(first + i, layout, *_turn(motors, i)) for i in range(healthy)]
    single = [
        Case(first + EFFECT_SEEDS + i, layout, *_turn(motors, i), (hidden,))
        for i, hidden in enumerate(_single(effects))
    ]
    several = [_many(first + MANY_SEEDS + i, layout, *_turn(motors, i)) for i in range(many)]
    return [case for row in itertools.zip_longest(silent, single, several) for case in row if case is not None]


def _turn(motors: Motors, i: int) -> tuple[str, str]:
    """Each in turn, one further on in every round, so that no motor always has the same cause."""
    return motors[(i + i // len(motors)) % len(motors)]


def _single(count: int) -> list[Hidden]:
    inside, outside = _causes(lambda kind: kind != "unknown"), _causes(lambda kind: kind == "unknown")
    found = []
    for i in range(count):
        turn, rest = divmod(i, OFF_LIBRARY_EVERY)
        known = turn * (OFF_LIBRARY_EVERY - 1) + rest
        cause = outside[turn % len(outside)] if rest == OFF_LIBRARY_EVERY - 1 else inside[known * 7 % len(inside)]
        found.append(Hidden(cause, WANTED[(i + i // len(WANTED)) % len(WANTED)]))
    return found


def _many(seed: int, layout: str, form: str, rule: str) -> Case:
    """Three to five effects of as many families, no two at one place, over 5 to 12 sessions, 8 to 12 where the file has
    few nodes."""
    random = np.random.default_rng([seed, FEWEST])
    count = int(random.integers(FEWEST, MOST_HIDDEN + 1))
    hidden: list[Hidden] = []
    for i in sorted(random.permutation(len(FAMILIES))[:count]):
        taken = {place_of(h.cause) for h in hidden}
        own = [
            cause
            for cause in _causes(FAMILIES[i].__contains__)
            if ".swap_" not in cause and place_of(cause) not in taken
        ]
        hidden.append(Hidden(str(random.choice(own)), float(random.choice(WANTED))))
    fewest = FEWEST_OF_CRUDE if rule in CRUDE else FEWEST_SESSIONS
    sessions = int(random.integers(fewest, MOST_SESSIONS + 1))
    return Case(seed, layout, form, rule, tuple(hidden), sessions)


def _causes(wanted: Callable[[str], bool]) -> list[str]:
    return [h.cause for h in CATALOGUE if wanted(h.cause.split(".", 1)[0]) and _can_be_seen(h.cause)]


def _can_be_seen(cause: str) -> bool:
    law = cause.rsplit(".", 1)[1]
    return not cause.startswith("ageing.") and law != "session" and law not in MASKED


def place_of(cause: str) -> str:
    return cause.split(".", 2)[1]


def in_catalogue(cause: str) -> Effect:
    return next(hidden.effects()[0] for hidden in CATALOGUE if hidden.cause == cause)


def scaled(effect: Effect, by: float) -> Effect:
    """The effect `by` times as large, on the logarithm where its size is a factor."""
    if effect.law == "scale" or effect.cause in FACTORS:
        return Effect(effect.cause, float(np.clip(effect.size**by, LEAST_FACTOR, MOST_FACTOR)))
    return Effect(effect.cause, effect.size * by)


def either_way(cause: str) -> tuple[str, frozenset[str], str]:
    """Kind, place and law; the plant writes the ends of a link in another order than the motor file."""
    kind, place, law = [*cause.split(".", 2), "", ""][:3]
    return kind, frozenset(place.split("-")), law
