"""All specimens of an assessment in one picture, however many they are, and which of them its answer holds."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from hashlib import sha256
from heapq import nsmallest

import numpy as np
from numpy.typing import NDArray

from replay.studies.ageing.assessment import Density

Floats = NDArray[np.float64]

MOST = 200  # specimens in an answer: of a larger fleet those that stand out most, all others in SQL
SAMPLE = 1000  # specimens of which it is told how many change: of a larger fleet as many, drawn by chance
LINES = 60  # specimens whose courses can be told apart in one picture: more are a density
CELLS = (60, 40)  # of the density, along dose and R
DRAWN = 0.005  # of all checks are left outside the picture at either end of R


def rank(bad: Collection[str]) -> Callable[[bool, str | None, float | None], tuple[bool, bool, float]]:
    """The order in which specimens are told, of `outlying`, `batch` and `score` of each: what stands out first, then
    the members of `bad` batches, each with those first that age fastest beyond the others. Whether one changes does
    not count: of a hundred that do not, one seems to."""

    def place(outlying: bool, batch: str | None, score: float | None) -> tuple[bool, bool, float]:
        return not outlying, batch not in bad, math.inf if score is None else -score

    return place


def drawn(names: Iterable[str]) -> set[str]:
    """`SAMPLE` of the specimens at most, by the SHA-256 of their names: as good as by chance, and always the same."""
    return set(nsmallest(SAMPLE, names, key=lambda name: sha256(name.encode()).digest()))


def density(specimen: Sequence[str], dose_h: Floats, resistance: Floats) -> Density | None:
    """How many checks (n,) lie where in the picture of all courses, R in % of the specimen's first, for more than
    `LINES` specimens; each one's checks stand together, in order. None for fewer, and where all have one dose."""
    who = np.unique(np.asarray(specimen, np.str_), return_index=True, return_inverse=True)[1:]
    if len(who[0]) <= LINES or not np.ptp(dose_h):
        return None
    percent = 100.0 * resistance / resistance[who[0]][who[1]]
    low, high = np.quantile(percent, [DRAWN, 1.0 - DRAWN])
    ends = ((float(dose_h.min()), float(dose_h.max())), (min(float(low), 99.0), max(float(high), 101.0)))
    counts, dose_edges, percent_edges = np.histogram2d(dose_h, percent, bins=CELLS, range=ends)
    return Density(
        dose_h=dose_edges.tolist(), percent=percent_edges.tolist(), checks=counts.T.astype(np.int64).tolist()
    )
