"""What an attack gives: how much was tried, and a line for each try that did not end as it must."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import ceil
from pathlib import Path


@dataclass
class Outcome:
    """`tried`: how many; `failed`: a line for each that did not end as it must; `note`: what else one should know;
    `whole`: how many tries the full table has, where only the attack itself can count them."""

    tried: int = 0
    failed: list[str] = field(default_factory=list)
    note: str = ""
    whole: int | None = None

    def count(self, *failures: str) -> None:
        """One more try, with what was wrong."""
        self.tried += 1
        self.failed += failures[:1]


@dataclass(frozen=True)
class Arena:
    """Where an attack runs: an empty `folder`; `bench`, a folder as `subjects.make_bench` leaves it, to be copied; how
    many `tries` are wanted, and what to draw them from; `verbs`: of those that write, where not all are attacked."""

    folder: Path
    bench: Path
    tries: int
    seed: str
    verbs: Sequence[str] = ()

    @property
    def chance(self) -> random.Random:
        """The same draws for the same seed."""
        return random.Random(self.seed)


@dataclass(frozen=True)
class Attack:
    """`whole`: how many tries the full table has (about, where the attack counts them itself), `least`: how many the
    smallest."""

    id: str
    name: str
    must: str
    whole: int
    least: int
    run: Callable[[Arena], Outcome]

    def tries(self, share: float) -> int:
        """How many for this share of the full table."""
        return max(self.least, ceil(self.whole * share))
