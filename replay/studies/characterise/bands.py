"""Bands about what a filter estimates, as wide as its errors in other sessions ask for.

What a filter says of its own uncertainty holds noise and random walks, not what is wrong with the network's form, and
that keeps its sign through a session.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t

Floats = NDArray[np.float64]

Z95 = 1.96
LEAST_OTHERS = 2  # sessions that a band is made from: Student's factor of one is 12.7


@dataclass(frozen=True)
class SessionErrors:
    """What a withheld channel is off by in one session, where it counts: measured less estimated, `K` (M,), and one
    standard deviation of that by the filter and the sensor, `sd_K` (M,)."""

    K: Floats
    sd_K: Floats


def banded(sessions: Sequence[SessionErrors], factors: Sequence[float]) -> tuple[float, float]:
    """Half width [K] of the filter's 95 % band with that of each session times its factor, and the share of readings
    within it: means over all readings."""
    half = np.concatenate([factor * Z95 * one.sd_K for one, factor in zip(sessions, factors, strict=True)])
    error = np.abs(np.concatenate([one.K for one in sessions]))
    return float(half.mean()), float((error <= half).mean())


def widenings(sessions: Sequence[SessionErrors]) -> list[float]:
    """The factor for each session's band, by the errors in all others; empty where those are fewer than
    `LEAST_OTHERS`."""
    if len(sessions) <= LEAST_OTHERS:
        return []
    return [widening([*sessions[:i], *sessions[i + 1 :]]) for i in range(len(sessions))]


def widening(sessions: Sequence[SessionErrors]) -> float:
    """The factor by which a 95 % band has to be wider to hold in another session, by the errors in these: Student's,
    with as many degrees of freedom as there are sessions, as the error of one hardly changes its sign. At least 1."""
    size = float(np.sqrt(np.mean([np.mean((one.K / one.sd_K) ** 2) for one in sessions])))
    return max(1.0, student(len(sessions)) / Z95 * size)


def student(degrees: int) -> float:
    """Student's factor of a 95 % band."""
    return float(t.ppf(0.975, degrees))
