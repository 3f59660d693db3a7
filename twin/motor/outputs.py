"""What a sensor reads of the temperatures, and its means over blocks of time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.powers import exp

Floats = NDArray[np.float64]

BLOCK_S = 10.0


@dataclass(frozen=True)
class Blocks:
    """The block means of one channel: a mean is the sum over the block's steps of `old` times the reading at the
    step's start and `new` times that at its end, both (N,). `there` (B,): blocks with at least half of the samples of
    a full one, the only ones with weights; `samples` (B,) of each."""

    length: int  # steps
    old: Floats
    new: Floats
    there: NDArray[np.bool_]
    samples: Floats

    def means(self, reading: Floats) -> Floats:
        """Means (..., B) of the blocks that are there, of readings at the steps' edges (..., N + 1)."""
        starts = np.arange(0, self.old.size, self.length)
        weighted = self.old * reading[..., :-1] + self.new * reading[..., 1:]
        means: Floats = np.add.reduceat(weighted, starts, axis=-1)[..., self.there]
        return means

    @property
    def of_step(self) -> Floats:
        """Weight (N,) of each step in the mean of its block."""
        return self.old + self.new

    def of_steps(self, values: Floats) -> Floats:
        """Means (..., B) of the blocks that are there, of what is constant within each step (..., N)."""
        starts = np.arange(0, self.old.size, self.length)
        means: Floats = np.add.reduceat(self.of_step * values, starts, axis=-1)[..., self.there]
        return means

    def measured(self, values: Floats) -> Floats:
        """Means of the blocks that are there, of means over the steps (N,), NaN where there is no sample."""
        weight = self.of_step
        starts = np.arange(0, weight.size, self.length)
        means: Floats = np.add.reduceat(np.where(weight > 0, weight * values, 0.0), starts)[self.there]
        return means

    def times_s(self, step_s: float) -> Floats:
        """Mean time [s] of the samples of each block that is there, since the start of the first step."""
        return self.means(step_s * np.arange(self.old.size + 1, dtype=np.float64))


def blocks(samples: Floats, place: Floats, step_s: float) -> Blocks:
    """Cut N steps into blocks of 10 s. `samples` (N,): usable ones in each step; `place` (N,) in [0, 1]: their mean
    time within it."""
    length = max(1, round(BLOCK_S / step_s))
    starts = np.arange(0, samples.size, length)
    total = np.add.reduceat(samples, starts)
    there = (total > 0) & (2 * total >= total.max(initial=0.0))
    share = np.divide(1.0, total, out=np.zeros_like(total), where=there)
    weight = samples * np.repeat(share, length)[: samples.size]
    return Blocks(length, weight * (1 - place), weight * place, there, total[there])


def lagged(truth: Floats, tau_s: float, step_s: float) -> Floats:
    """Values at the edges of equal steps (..., N + 1) through a first-order lag, in equilibrium at the first; exact
    where they are linear in each step."""
    if tau_s <= 0.0:
        return truth
    from scipy.signal import lfilter  # brings all of scipy.stats along, a third of a second that few need

    a, before, now = lag_factors(tau_s, step_s)
    out: Floats = lfilter([now, before], [1.0, -a], truth - truth[..., :1]) + truth[..., :1]
    return out


def lag_factors(tau_s: float, step_s: float) -> tuple[float, float, float]:
    """Shares of the last reading, the last truth and the truth now in the reading now; their sum is 1."""
    a = float(exp(np.array([-step_s / tau_s]))[0])
    ramp = (1.0 - a) * tau_s / step_s
    return a, ramp - a, 1.0 - ramp
