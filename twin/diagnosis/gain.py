"""What a term is worth on sessions that nothing was learnt from.

Two questions are asked of the final set of terms: does the log score of the last 90 % of each kept session rise, and
does at least half of the error above the sensors' floor go away? For every model alike, only what a kept session brings
along (initial temperatures, biases) is estimated, under its priors, from the session's first 10 %.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from twin.errors import EvidenceError
from twin.fitting.noise import Array

OPENING = 0.1  # share of a kept session that what it brings along is estimated from
BOOTSTRAP_DRAWS, BOOTSTRAP_SHARE = 2000, 0.05
FEW_BLOCKS = 8
TOUCHED_K = 0.1  # root mean square change of the prediction from which on a channel counts
REMOVED = 0.5  # least share of the excess error


@dataclass(frozen=True)
class Kept:
    """One kept session under one model, whitened with the same noise for every model.

    `t_s` (N,) [s] of each row (of all channels); `e` (N,) the residual where what the session brings along is at its
    prior mean; `columns` (N, q) of what it brings along, `precision` (q,) of their priors.
    """

    t_s: Array
    e: Array
    columns: Array
    precision: Array


@dataclass(frozen=True)
class LnScoreGain:
    """ln score gained in each block; `lower`: 5 % bootstrap quantile of the sum, or the least leave-one-block-out sum
    where the blocks are `few` (under 8)."""

    blocks: Array
    lower: float
    few: bool

    @property
    def total(self) -> float:
        return float(self.blocks.sum())

    @property
    def positive(self) -> bool:
        """Whether the gain holds beyond the choice of blocks."""
        return self.lower > 0


def log_scores(kept: Kept, block_s: float) -> Array:
    """Predictive log score of each block of `block_s` after the first 10 %, given all before it: their sum is the log
    density of the last 90 % given the first 10 % under covariance I + A Lambda^-1 A'.

    A last block shorter than half is joined to the one before. Whitened rows come from a filter in time, so what stands
    before a block does not depend on it.
    """
    information, mean = np.diag(kept.precision), np.zeros(len(kept.precision))
    scores = []
    for chosen in _blocks(kept.t_s, block_s):
        a, r = kept.columns[chosen], kept.e[chosen] - kept.columns[chosen] @ mean
        after = information + a.T @ a
        step = np.linalg.solve(after, a.T @ r)
        volume = np.linalg.slogdet(after)[1] - np.linalg.slogdet(information)[1]
        scores.append(-(len(r) * np.log(2 * np.pi) + volume + r @ r - r @ a @ step) / 2)
        information, mean = after, mean + step
    return np.array(scores[1:])


def opened_s(t_s: Array) -> float:
    """The end of the opening of a session with rows at `t_s` (N,) [s]."""
    start, end = float(t_s.min()), float(t_s.max())
    return start + OPENING * (end - start)


def _blocks(t_s: Array, block_s: float) -> list[NDArray[np.bool_]]:
    """The rows of the opening, then those of each block."""
    opening = opened_s(t_s)
    count = max(1, round((float(t_s.max()) - opening) / block_s))
    edges = [-np.inf, opening, *(opening + block_s * np.arange(1, count)), np.inf]
    return [(t_s > low) & (t_s <= high) for low, high in pairwise(edges)]


def held_out_gain(before: Sequence[Kept], after: Sequence[Kept], block_s: float) -> LnScoreGain:
    """Gain in log score of `after` over `before`, session by session on the same rows, in blocks of `block_s` [s] (at
    least twice the slowest mode, so that blocks are nearly independent).

    Raises `EvidenceError` where the two do not hold the same sessions and rows.
    """
    if len(before) != len(after) or any(not np.array_equal(b.t_s, a.t_s) for b, a in zip(before, after, strict=True)):
        raise EvidenceError("before and after do not hold the same kept rows: score both models on the same blocks")
    pairs = zip(before, after, strict=True)
    blocks = np.concatenate([log_scores(a, block_s) - log_scores(b, block_s) for b, a in pairs])
    if len(blocks) < FEW_BLOCKS:
        return LnScoreGain(blocks, float((blocks.sum() - blocks).min()), few=True)
    drawn = np.random.default_rng(0).integers(len(blocks), size=(BOOTSTRAP_DRAWS, len(blocks)))
    return LnScoreGain(blocks, float(np.quantile(blocks[drawn].sum(axis=1), BOOTSTRAP_SHARE)), few=False)


def excess(residual: Array, floor_variance: float) -> float:
    """max(0, mean square of a channel's residual (B,) [K] - floor [K^2]): what a better model could remove."""
    return max(0.0, float(np.mean(residual**2)) - floor_variance)


def removes_excess(
    before: Mapping[str, Array], after: Mapping[str, Array], floor_variance: Mapping[str, float]
) -> bool:
    """Whether the terms halve the excess error of the channels whose prediction they move by more than 0.1 K.

    `before`, `after`: channel -> its kept residuals (B,) [K] without and with the terms; `floor_variance` [K^2].
    Without a touched channel or an excess there is nothing to remove, and the answer is no.
    """
    touched = [c for c in before if np.sqrt(np.mean((before[c] - after[c]) ** 2)) > TOUCHED_K]
    was = sum(excess(before[c], floor_variance[c]) for c in touched)
    left = sum(excess(after[c], floor_variance[c]) for c in touched)
    return was > 0 and left <= (1 - REMOVED) * was
