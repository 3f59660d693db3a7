"""What each kind of stress does to ln R beside the others: hours of heat, thermal cycles, hours of discharge, whatever is counted.

    ln R_ij = b_i + sum_k a_k X_ijk + e_ij

with a start of its own for each specimen and one effect of each stress for all of them, by weighted least squares; the errors are
widened by what the courses of the specimens scatter about this (Huber-White, by specimen: White, Econometrica 48 (1980) 817,
DOI 10.2307/1912934), as specimens differ in more than their starts. Oven cycles of one length make hours and cycles the same column:
then neither is told apart from the other, and only a cycle of another length, or another temperature, would.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

TOLD_APART = 0.99  # correlation of two estimates from which on neither is told from the other
LEAST_SHARE = 1e-6  # of a column that its specimens' means leave, below which it does not vary within specimens


@dataclass(frozen=True)
class Stress:
    """Effect of one unit of the stress `name` on ln R with its standard deviation; `not_told_from`: the stresses that could be it
    instead. None where it does not vary within any specimen."""

    name: str
    effect: float | None
    sd: float | None
    not_told_from: tuple[str, ...]


def effects(
    specimen: Sequence[str], ln_resistance: ArrayLike, sd: ArrayLike, columns: Mapping[str, ArrayLike]
) -> tuple[Stress, ...]:
    """One entry a check in any order: specimen, ln R, its sd (n,), and for each stress what it had summed up to (n,)."""
    places = {name: k for k, name in enumerate(dict.fromkeys(specimen))}
    who = np.array([places[name] for name in specimen], np.int64)
    weight = 1.0 / np.asarray(sd, np.float64)
    y = _within(who, len(places), np.asarray(ln_resistance, np.float64), weight)
    given = {
        name: _within(who, len(places), np.asarray(column, np.float64), weight) for name, column in columns.items()
    }
    whole = {name: float(np.abs(np.asarray(columns[name], np.float64) * weight).max(initial=0.0)) for name in given}
    used = [name for name in given if np.abs(given[name]).max(initial=0.0) > LEAST_SHARE * whole[name] > 0.0]
    if not used or len(y) <= len(places) + len(used):
        return tuple(Stress(name, None, None, ()) for name in columns)
    scale = np.array([np.linalg.norm(given[name]) for name in used])
    x = np.stack([given[name] for name in used], axis=1) / scale
    gram = x.T @ x
    inverse = np.linalg.pinv(gram, rcond=1e-10, hermitian=True)
    estimate = inverse @ (x.T @ y)
    rest = x * (y - x @ estimate)[:, None]
    scores = np.stack([np.bincount(who, column, len(places)) for column in rest.T], axis=1)
    spread = inverse @ (scores.T @ scores) @ inverse * len(places) / max(len(places) - 1, 1)
    covariance = np.maximum(spread, inverse) if len(places) > len(used) + 1 else inverse
    correlation = inverse / np.sqrt(np.outer(np.diag(inverse), np.diag(inverse)))
    apart = (np.abs(correlation) < TOLD_APART) & (np.abs(gram) < TOLD_APART)
    found = {
        name: Stress(
            name,
            float(estimate[k] / scale[k]),
            float(np.sqrt(covariance[k, k]) / scale[k]),
            tuple(other for j, other in enumerate(used) if j != k and not apart[k, j]),
        )
        for k, name in enumerate(used)
    }
    return tuple(found.get(name, Stress(name, None, None, ())) for name in columns)


def _within(who: NDArray[np.int64], specimens: int, values: Floats, weight: Floats) -> Floats:
    """Less the weighted mean of its specimen, times the weight."""
    total = np.bincount(who, weight**2, specimens)
    mean = np.bincount(who, weight**2 * values, specimens) / total
    return np.asarray((values - mean[who]) * weight, np.float64)
