"""A regression learnt from some recordings, its size chosen on them alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from benchmarks.real.recordings import Recording

Floats = NDArray[np.float64]
Size = TypeVar("Size")


class Regression(Protocol):
    """What was learnt."""

    def rises(self, recording: Recording) -> dict[str, Floats]:
        """Node -> how far its reading is above the coolant (B,) [K]."""
        ...


@dataclass
class Chosen(Generic[Size]):
    """How a regression is learnt, and the sizes to choose from. What is learnt from the same recordings is learnt
    once: of two recordings left out, each is the one that judges while the other is left out."""

    learn: Callable[[Sequence[Recording], Size], Regression]
    sizes: Sequence[Size]
    known: dict[tuple[frozenset[str], Size], Regression] = field(default_factory=dict)

    def of(self, recordings: Sequence[Recording]) -> Regression:
        """The regression of the size whose error is least when each of the recordings is left out in turn."""
        with threadpool_limits(1):  # the arrays are small: more threads only wait for each other
            errors = [np.mean([self._error(recordings, one, size) for one in recordings]) for size in self.sizes]
            return self._learnt(recordings, self.sizes[int(np.argmin(errors))])

    def _error(self, recordings: Sequence[Recording], one: Recording, size: Size) -> float:
        others = [other for other in recordings if other.name != one.name]
        missed = residuals(self._learnt(others, size), one)
        return float(np.mean([np.abs(missed[node]).mean() for node in missed]))

    def _learnt(self, recordings: Sequence[Recording], size: Size) -> Regression:
        key = frozenset(recording.name for recording in recordings), size
        if key not in self.known:
            self.known[key] = self.learn(recordings, size)
        return self.known[key]


def residuals(found: Regression, recording: Recording) -> dict[str, Floats]:
    """Node -> the reading less what was said of it [K], in the blocks that have samples."""
    said = found.rises(recording)
    return {node: rise - said[node][recording.blocks[node].there] for node, rise in recording.rises.items()}
