"""How strongly the data speak for one more term, with everything a healthy motor may do integrated out.

All arrays are whitened (`twin.fitting.noise.whiten`): A (N, p) the parameters' columns with precision Lambda (p,) = 1 /
sd^2, V (N, m) the candidates' columns per unit of amplitude, and e0 (N,) the residual *referred back to the prior
mean*, e + A beta_hat where e is the residual at the calibrated mode. With P = I - A (A'A + Lambda)^-1 A' and a normal
prior of sd sigma on the amplitude,

    J = v'P v,   s = v'P e0,   ln BF = s^2 sigma^2 / (2 (1 + J sigma^2)) - ln(1 + J sigma^2) / 2,

plus ln(2 Phi(+-s sigma / sqrt(1 + J sigma^2))) where the sign is known (half-normal prior). P is not idempotent: with
the residual e at the mode s is v'e, and v'P e would count the calibration twice. Bayes factors and how to read them:
Kass and Raftery, J. Am. Stat. Assoc. 90 (1995) 773, DOI 10.1080/01621459.1995.10476572; marginal likelihood of a linear
model: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), 2.7.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.special import log_ndtr

from twin.errors import EvidenceError
from twin.fitting.noise import Array
from twin.motor.causes import Cause

TOLD_APART = float(np.log(20.0))  # least difference of ln BF that separates two causes
NULL_DRAWS, NULL_SHARE = 2000, 0.95
PRIOR_NONE, PRIOR_UNKNOWN = 0.5, 0.1  # mass; the rest is the candidates'


@dataclass(frozen=True)
class Projector:
    """P of whitened `columns` A (N, p) with `precision` (p,), by `lower` (p, p), the Cholesky factor of A'A +
    Lambda."""

    columns: Array
    precision: Array
    lower: Array

    @classmethod
    def of(cls, columns: Array, precision: Array) -> Projector:
        """Raises `EvidenceError` where a parameter has no prior, a column is not finite or shapes do not fit."""
        if columns.ndim != 2 or precision.shape != columns.shape[1:]:
            raise EvidenceError(f"columns of shape {columns.shape} with precision {precision.shape}: give one a column")
        if not (precision > 0).all():
            raise EvidenceError(f"parameter {int(np.argmin(precision > 0))} has no prior: give it a standard deviation")
        gram = columns.T @ columns + np.diag(precision)
        if not np.isfinite(gram).all():
            raise EvidenceError(
                f"column {int(np.argmin(np.isfinite(np.diag(gram))))} is not finite: mask its gaps first"
            )
        return cls(columns, precision, cholesky(gram, lower=True))

    def seen(self, x: Array, rows: slice = slice(None)) -> Array:
        """L^-1 A'x (p, k), which holds what calibration can take of columns x (n, k) or (n,). They stand in `rows` of
        the N, and are 0 in all others."""
        result: Array = solve_triangular(self.lower, self.columns[rows].T @ x, lower=True)
        return result

    def inner(self, x: Array, y: Array) -> Array:
        """x'P y, for columns x (N, k) or (N,) and y (N, l) or (N,)."""
        return x.T @ y - self.seen(x).T @ self.seen(y)


@dataclass(frozen=True)
class Scores:
    """The scores of m candidates, each (m,): s and J as above, prior sd `sigma`, `sign` (0 unknown, else +1 or -1), and
    ln BF against no such term."""

    s: Array
    J: Array
    sigma: Array
    sign: Array
    log_bayes_factor: Array

    @property
    def amplitude(self) -> Array:
        """Posterior mean, in the amplitude's unit (of the two-sided prior, also where the sign is known)."""
        return self.s * self.sigma**2 / (1 + self.J * self.sigma**2)


def log_bayes_factor(s: Array, j: Array, sigma: Array, sign: Array) -> Array:
    """ln BF of amplitudes with prior sd `sigma`; `sign` 0 normal, +1 or -1 half-normal. All (..., m)."""
    widening = 1 + j * sigma**2
    two_sided = s**2 * sigma**2 / (2 * widening) - np.log(widening) / 2
    one_sided = np.log(2) + log_ndtr(sign * s * sigma / np.sqrt(widening))
    return two_sided + np.where(sign == 0, 0.0, one_sided)


def score(columns: Array, e0: Array, projector: Projector, sigma: Array, sign: Array) -> Scores:
    """Scores of candidates with whitened columns V (N, m), prior sd (m,) and sign (m,) in {-1, 0, 1}.

    Raises `EvidenceError` where a sigma is not above 0 or shapes do not fit.
    """
    if columns.shape != (len(e0), len(sigma)) or sign.shape != sigma.shape:
        raise EvidenceError(
            f"candidates of shape {columns.shape} for {len(e0)} rows, {len(sigma)} sigmas, {len(sign)} signs"
        )
    if not (sigma > 0).all():
        raise EvidenceError(f"candidate {int(np.argmin(sigma > 0))} has sigma {sigma.min():g}: give a size above 0")
    seen = projector.seen(columns)
    s = columns.T @ e0 - seen.T @ projector.seen(e0)
    j = np.maximum(np.einsum("ij,ij->j", columns, columns) - np.einsum("ij,ij->j", seen, seen), 0.0)
    return Scores(s, j, sigma, sign, log_bayes_factor(s, j, sigma, sign))


# --- Told apart -------------------------------------------------------------------------------------------------------


def separation(amplitude: Array, gram: Array) -> Array:
    """(m, m): by how much ln BF of c is expected to exceed that of d where c is true: (a_c^2 J_c / 2) (1 - rho^2).

    `amplitude` (m,); `gram` (m, m) = V'P V, rho its correlations.
    """
    j = np.maximum(np.diag(gram), 0.0)
    scale = np.sqrt(np.outer(j, j))
    rho = np.divide(gram, scale, out=np.zeros_like(gram), where=scale > 0)
    result: Array = (amplitude**2 * j / 2)[:, None] * np.maximum(1 - rho**2, 0.0)
    return result


def told_apart_class(
    leader: int, log_bf: Array, expected: Array, refitted: NDArray[np.bool_], possible: NDArray[np.bool_]
) -> tuple[int, ...]:
    """The candidates that the data cannot tell from the leader, best first, the leader itself among them.

    Another belongs to them where its amplitude is `possible` (m,), its ln BF (m,) is within ln 20 of the leader's, and,
    unless both were `refitted` (m,), the separation `expected` (m,) from the leader is below ln 20 too. Only the leader
    is compared with: what cannot be told from another of them need not belong.
    """
    near = log_bf[leader] - log_bf < TOLD_APART
    close = (refitted & refitted[leader]) | (expected < TOLD_APART)
    members = near & close & possible
    members[leader] = True
    return tuple(int(i) for i in np.argsort(-log_bf, kind="stable") if members[i])


# --- Probabilities ----------------------------------------------------------------------------------------------------


def prior_masses(causes: Sequence[Cause]) -> Array:
    """(m,) prior probability of each: 0.4 in all, split evenly by kind, then place, then law, so that it does not
    depend on how many laws the tables have for a place."""
    places: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for cause in causes:
        places[cause.kind][cause.place] += 1
    rest = 1 - PRIOR_NONE - PRIOR_UNKNOWN
    shares = [len(places) * len(places[c.kind]) * places[c.kind][c.place] for c in causes]
    return rest / np.array(shares, dtype=np.float64)


@dataclass(frozen=True)
class Posterior:
    """Probabilities of no cause, of an unknown one, and of each candidate (m,); they sum to 1."""

    none: float
    unknown: float
    candidates: Array

    def of_class(self, members: Sequence[int]) -> float:
        """That one of the members is the cause."""
        return float(self.candidates[list(members)].sum())

    def of_member(self, member: int, members: Sequence[int]) -> float:
        """The member's share of its class; evenly where the class has no mass at all."""
        total = self.of_class(members)
        return float(self.candidates[member] / total) if total > 0 else 1 / len(members)


def posterior(log_bf: Array, prior: Array, log_bf_unknown: float) -> Posterior:
    """From ln BF (m,) against no cause and prior masses (m,), with 0.5 on none and 0.1 on unknown."""
    log_mass = np.log([PRIOR_NONE, PRIOR_UNKNOWN, *prior]) + np.array([0.0, log_bf_unknown, *log_bf])
    mass = np.exp(log_mass - log_mass.max())
    mass /= mass.sum()
    return Posterior(float(mass[0]), float(mass[1]), mass[2:])


def null_quantile(gram: Array, sigma: Array, sign: Array) -> float:
    """95 % quantile of the largest ln BF of all candidates on data that hold none of them: there Cov(P e0) = P, so s is
    drawn 2,000 times from N(0, V'P V), `gram` (m, m)."""
    j = np.maximum(np.diag(gram), 0.0)
    size = np.where(j > 0, np.sqrt(j), 1.0)
    correlation = gram / np.outer(size, size) + 1e-9 * np.eye(len(j))
    values, vectors = np.linalg.eigh((correlation + correlation.T) / 2)
    root = size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    s = np.random.default_rng(0).standard_normal((NULL_DRAWS, len(j))) @ root.T
    return float(np.quantile(log_bayes_factor(s, j, sigma, sign).max(axis=1), NULL_SHARE))
