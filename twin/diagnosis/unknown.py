"""An unknown cause as a hypothesis: a free heat at one node, to be held against named causes.

The heat is a sum of tents whose heights are alike where tents are near. They stand in time, every 300 s, so that it has
any course that is not too fast, sessions independent; or over speed and load (`twin.diagnosis.free_maps`), so that it
is as fast as these are, and the same in all sessions. It acts linearly: with X the tents' whitened responses, K the
Cholesky factor of the heights' correlation, s = K'X'P e0 and M = K'X'P X K (`twin.diagnosis.evidence`), a heat of size
g has

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

Range = tuple[float, float]

SPACING_S = 300.0
CORRELATION_S = 900.0  # of the heights: three tents
SIZES = np.geomspace(0.005, 0.08, 5)  # of the mean modelled total loss
SIZE_PRIOR = 0.05  # half-normal, as of every candidate heat
BOOTSTRAP_DRAWS, BAND = 500, (0.025, 0.975)
SAME = 0.02  # of its largest value: a feature that varies by less is the same all the time
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
    return np.maximum(0.0, 1 - np.abs(t_s[:, None] - times) / SPACING_S)


@dataclass(frozen=True)
class Response:
    """Tents that stand together: how alike their heights are, `correlation` (q, q), and `columns` (n, q), how `rows`
    among all whitened rows respond to 1 W at each, whitened."""

    rows: slice
    correlation: Array
    columns: Array


@dataclass(frozen=True)
class FreeHeat:
    """A node's free heat: ln BF against none, and the smoothed heat `watts` with its `sd` [W], both (q,) at its tents:
    those of all sessions, one after the other, or those of a map (`is_map`)."""

    node: str
    log_bayes_factor: float
    watts: Array
    sd: Array
    is_map: bool = False


def correlation_in_time(times: Array) -> Array:
    """How alike the heights of tents at `times` (q,) [s] of a session are, (q, q)."""
    return np.exp(-np.abs(times[:, None] - times) / CORRELATION_S)


def free_heat(
    node: str, responses: Sequence[Response], e0: Array, projector: Projector, total_loss_W: float
) -> FreeHeat:
    """Evidence and heights of a free heat at one node; `e0` (N,) as in `twin.diagnosis.evidence`.

    Sizes are shares of `total_loss_W`, the mean modelled total loss over training. Raises `EvidenceError` where that is
    not above 0.
    """
    return _weighed(node, *_reduced(responses, e0, projector), total_loss_W, False)


class SumsOverTests:
    """A free heat of q heights that are the same in all tests, added up test after test: the columns of none are
    kept."""

    def __init__(self, q: int, e0: Array, projector: Projector) -> None:
        self.e0, self.projector = e0, projector
        self._seen = np.zeros((len(projector.lower), q))
        self._direct, self._gram = np.zeros(q), np.zeros((q, q))

    def add(self, rows: slice, columns: Array) -> None:
        """What a test's `rows` among all respond to 1 W of each height, whitened (n, q)."""
        self._seen += self.projector.seen(columns, rows)
        self._direct += columns.T @ self.e0[rows]
        self._gram += columns.T @ columns

    def heat(self, node: str, correlation: Array, total_loss_W: float) -> FreeHeat:
        """Evidence and heights, alike as `correlation` (q, q) says. Raises as `free_heat`."""
        factor = cholesky(correlation, lower=True)
        s = self._direct - self._seen.T @ self.projector.seen(self.e0)
        m = self._gram - self._seen.T @ self._seen
        return _weighed(node, factor, factor.T @ s, factor.T @ m @ factor, total_loss_W, True)


def _weighed(node: str, factor: Array, s: Array, m: Array, total_loss_W: float, is_map: bool) -> FreeHeat:
    """By K (q, q), s (q,) and M (q, q)."""
    if not total_loss_W > 0:
        raise EvidenceError(f"mean total loss {total_loss_W:g} W: a free heat is sized by a loss above 0")
    values, vectors = eigh(m)
    values, turned = np.maximum(values, 0.0), vectors.T @ s
    sizes = SIZES * total_loss_W
    log_bf = np.array([_log_bayes_factor(g, values, turned) for g in sizes])
    log_prior = np.log(SIZES) - (SIZES / SIZE_PRIOR) ** 2 / 2  # density times width: the sizes are spaced evenly in ln
    log_weight = log_bf + log_prior - logsumexp(log_prior)
    weight = np.exp(log_weight - logsumexp(log_weight))
    watts, variance = _smoothed(sizes, weight, values, turned, factor @ vectors)
    return FreeHeat(node, float(logsumexp(log_weight)), watts, np.sqrt(variance), is_map)


def _reduced(responses: Sequence[Response], e0: Array, projector: Projector) -> tuple[Array, Array, Array]:
    """K (q, q), s (q,) and M (q, q) of all responses together."""
    factors = [cholesky(r.correlation, lower=True) for r in responses]
    columns = [r.columns @ k for r, k in zip(responses, factors, strict=True)]
    seen = np.hstack([projector.seen(x, r.rows) for r, x in zip(responses, columns, strict=True)])
    direct = np.concatenate([x.T @ e0[r.rows] for r, x in zip(responses, columns, strict=True)])
    m = block_diag(*(x.T @ x for x in columns)) - seen.T @ seen
    return block_diag(*factors), direct - seen.T @ projector.seen(e0), m


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
    """How the heat goes with one feature: `watts` [W] for one standard deviation of it, with a 95 % bootstrap band."""

    feature: str
    watts: float
    low: float
    high: float

    @property
    def clear(self) -> bool:
        """Whether the band leaves out 0."""
        return self.low > 0 or self.high < 0


def associations(watts: Array, features: Mapping[str, Array], block: int) -> tuple[Association, ...]:
    """The smoothed heat (q,) [W] regressed on all features together (feature -> its mean (q,) over each tent), the
    strongest first.

    Bands come from resampling runs of `block` neighbouring tents (at least twice the slowest mode long). A feature that
    does not vary is left out. Raises `EvidenceError` where lengths do not fit or block is not above 0.
    """
    if block < 1 or any(len(values) != len(watts) for values in features.values()):
        raise EvidenceError(
            f"{len(watts)} tents in runs of {block}: give each feature one mean a tent and runs of 1 or more"
        )
    varying = {name: values for name, values in features.items() if np.std(values) > 0}
    design = np.column_stack([np.ones(len(watts)), *((v - v.mean()) / v.std() for v in varying.values())])
    drawn = np.array([_slopes(design[i], watts[i]) for i in _resampled(len(watts), block)])
    band = np.quantile(drawn, BAND, axis=0)
    found = zip(varying, _slopes(design, watts), *band, strict=True)
    result = (Association(name, float(w), float(lo), float(hi)) for name, w, lo, hi in found)
    return tuple(sorted(result, key=lambda a: -abs(a.watts)))


def _slopes(design: Array, watts: Array) -> Array:
    solution: Array = lstsq(design, watts)[0]
    return solution[1:]


def _resampled(q: int, block: int) -> Sequence[Array]:
    """Index sets (q,) made of runs, wrapped around the end (circular block bootstrap: Politis and Romano 1992)."""
    starts = np.random.default_rng(0).integers(q, size=(BOOTSTRAP_DRAWS, -(-q // block)))
    runs = (starts[:, :, None] + np.arange(block)) % q
    return list(runs.reshape(BOOTSTRAP_DRAWS, -1)[:, :q])


def active_ranges(
    watts: Array, temperature_degC: Array, features: Mapping[str, Array]
) -> tuple[Range, Range, dict[str, Range]]:
    """When the heat is there: where it has at least half of its largest size, its 10 to 90 % range [W], and the 5 to
    95 % ranges of the temperature and of each feature that is not the same all the time."""
    chosen = np.abs(watts) >= ACTIVE * np.abs(watts).max()
    varying = {name: values for name, values in features.items() if np.ptp(_range(values, 0.05)) > SAME * values.max()}
    among = {name: _range(values[chosen], 0.05) for name, values in varying.items()}
    return _range(watts[chosen], 0.1), _range(temperature_degC[chosen], 0.05), among


def _range(values: Array, outside: float) -> Range:
    low, high = np.quantile(values, (outside, 1 - outside))
    return float(low), float(high)
