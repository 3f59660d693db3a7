"""Unknown is a hypothesis: a free heat at one node, of any course in time, against every named cause.

The heat is a sum of tents every 300 s whose heights follow an Ornstein-Uhlenbeck prior, sessions independent. Given the
calibration's parameters it is linear: with X the tents' whitened responses, K the Cholesky factor of the heights'
correlation, s = K'X'P e0 and M = K'X'P X K, a heat of size g has

    ln BF_g = g^2 s'(I + g^2 M)^-1 s / 2 - ln|I + g^2 M| / 2,

averaged over five sizes under a half-normal prior (Rasmussen and Williams 2006, 2.7 and 5.4).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, cholesky, eigh, lstsq
from scipy.special import logsumexp

from twin.diagnosis.evidence import Projector
from twin.errors import EvidenceError
from twin.fitting.noise import Array

SPACING_S = 300.0
CORRELATION_S = 900.0  # of the heights: three tents
SIZES = np.geomspace(0.005, 0.08, 5)  # of the mean modelled total loss
SIZE_PRIOR = 0.05  # half-normal, as of every candidate heat
BOOTSTRAP_DRAWS, BAND = 500, (0.025, 0.975)
ACTIVE = 0.5  # a tent counts as active from this share of the largest smoothed heat on


def tent_times(duration_s: float) -> Array:
    """(q,) [s] where the tents of a session stand: from its start, every 300 s, the last at or after its end."""
    return SPACING_S * np.arange(np.ceil(duration_s / SPACING_S) + 1, dtype=np.float64)


def tents(t_s: Array, times: Array) -> Array:
    """(N, q): height of each tent at times t_s (N,); they sum to 1 between the first and the last.

    >>> import numpy as np
    >>> tents(np.array([75.0]), tent_times(300.0))
    array([[0.75, 0.25]])
    """
    result: Array = np.maximum(0.0, 1 - np.abs(t_s[:, None] - times) / SPACING_S)
    return result


@dataclass(frozen=True)
class Response:
    """One session's rows (a slice of the whitened rows), its tents `times` (q,) [s], and the whitened responses
    `columns` (n, q) of these rows to 1 W at each tent."""

    rows: slice
    times: Array
    columns: Array


@dataclass(frozen=True)
class FreeHeat:
    """A node's free heat: ln BF against none; smoothed heat `watts` and its `sd` (tents of all sessions,
    in order) [W]."""

    node: str
    log_bayes_factor: float
    watts: Array
    sd: Array


def free_heat(
    node: str, responses: Sequence[Response], e0: Array, projector: Projector, total_loss_W: float
) -> FreeHeat:
    """Evidence and course of a free heat at one node;
    `e0` (N,) referred back to the prior mean (`twin.diagnosis.evidence`).

    `total_loss_W`: the mean modelled total loss over training, what sizes are shares of.
    Raises `EvidenceError` where it is not above 0.
    """
    if not total_loss_W > 0:
        raise EvidenceError(f"mean total loss {total_loss_W:g} W: a free heat is sized by a loss above 0")
    factor, s, m = _reduced(responses, e0, projector)
    values, vectors = eigh(m)
    values, turned = np.maximum(values, 0.0), vectors.T @ s
    sizes = SIZES * total_loss_W
    log_bf = np.array([_log_bayes_factor(g, values, turned) for g in sizes])
    log_prior = np.log(SIZES) - (SIZES / SIZE_PRIOR) ** 2 / 2  # density times width: the sizes are spaced evenly in ln
    log_weight = log_bf + log_prior - logsumexp(log_prior)
    weight = np.exp(log_weight - logsumexp(log_weight))
    watts, variance = _smoothed(sizes, weight, values, turned, factor @ vectors)
    return FreeHeat(node, float(logsumexp(log_weight)), watts, np.sqrt(variance))


def _reduced(responses: Sequence[Response], e0: Array, projector: Projector) -> tuple[Array, Array, Array]:
    """K (q, q), s (q,) and M (q, q) of all sessions together."""
    factors = [cholesky(_correlation(r.times), lower=True) for r in responses]
    columns = [r.columns @ k for r, k in zip(responses, factors, strict=True)]
    seen = np.hstack([projector.seen(x, r.rows) for r, x in zip(responses, columns, strict=True)])
    direct = np.concatenate([x.T @ e0[r.rows] for r, x in zip(responses, columns, strict=True)])
    m = block_diag(*(x.T @ x for x in columns)) - seen.T @ seen
    return block_diag(*factors), direct - seen.T @ projector.seen(e0), m


def _correlation(times: Array) -> Array:
    result: Array = np.exp(-np.abs(times[:, None] - times) / CORRELATION_S)
    return result


def _log_bayes_factor(g: float, values: Array, turned: Array) -> float:
    widening = 1 + g**2 * values
    return float((g**2 * turned**2 / widening - np.log(widening)).sum() / 2)


def _smoothed(sizes: Array, weight: Array, values: Array, turned: Array, basis: Array) -> tuple[Array, Array]:
    """Posterior mean (q,) [W] and variance [W^2] of the heights, averaged over the sizes with their weights."""
    g2 = sizes[:, None] ** 2
    means = (g2 * turned / (1 + g2 * values)) @ basis.T
    variances = (g2 / (1 + g2 * values)) @ (basis**2).T
    mean = weight @ means
    variance: Array = weight @ (variances + means**2) - mean**2
    return mean, variance


# --- What the heat goes with ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Association:
    """How the heat goes with one feature: [W] for one standard deviation of it, with its 95 % bootstrap band."""

    feature: str
    watts: float
    low: float
    high: float

    @property
    def clear(self) -> bool:
        """Whether the band leaves out 0."""
        return self.low > 0 or self.high < 0


def associations(watts: Array, features: Mapping[str, Array], block: int, seed: int = 0) -> tuple[Association, ...]:
    """The smoothed heat (q,) [W] regressed on all features together, feature -> its mean (q,) over each tent.

    Bands from resampling runs of `block` neighbouring tents (at least twice the slowest mode long), strongest first. A
    feature that does not vary is left out. Raises `EvidenceError` where lengths do not fit or block is not above 0.
    """
    if block < 1 or any(len(values) != len(watts) for values in features.values()):
        raise EvidenceError(
            f"{len(watts)} tents in runs of {block}: give each feature one mean a tent and runs of 1 or more"
        )
    varying = {name: values for name, values in features.items() if np.std(values) > 0}
    design = np.column_stack([np.ones(len(watts)), *((v - v.mean()) / v.std() for v in varying.values())])
    rng = np.random.default_rng(seed)
    drawn = np.array([_slopes(design[i], watts[i]) for i in _resampled(len(watts), block, rng)])
    band = np.quantile(drawn, BAND, axis=0)
    found = zip(varying, _slopes(design, watts), *band, strict=True)
    result = (Association(name, float(w), float(lo), float(hi)) for name, w, lo, hi in found)
    return tuple(sorted(result, key=lambda a: -abs(a.watts)))


def _slopes(design: Array, watts: Array) -> Array:
    solution: Array = lstsq(design, watts)[0]
    return solution[1:]


def _resampled(q: int, block: int, rng: np.random.Generator) -> Sequence[Array]:
    """Index sets of length q made of runs, wrapped around the end (circular block bootstrap,
    Politis and Romano 1992)."""
    starts = rng.integers(q, size=(BOOTSTRAP_DRAWS, -(-q // block)))
    runs = (starts[:, :, None] + np.arange(block)) % q
    return list(runs.reshape(BOOTSTRAP_DRAWS, -1)[:, :q])


def active_ranges(
    watts: Array, features: Mapping[str, Array]
) -> tuple[tuple[float, float], dict[str, tuple[float, float]]]:
    """Where the heat is: 10 to 90 % range of it [W] over the tents with at least half of its largest size, and the 5 to
    95 % range of each feature there."""
    chosen = np.abs(watts) >= ACTIVE * np.abs(watts).max()
    return _range(watts[chosen], 0.1), {name: _range(values[chosen], 0.05) for name, values in features.items()}


def _range(values: Array, outside: float) -> tuple[float, float]:
    low, high = np.quantile(values, (outside, 1 - outside))
    return float(low), float(high)
