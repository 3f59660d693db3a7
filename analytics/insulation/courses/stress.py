"""What each kind of stress does to ln R beside the others: hours of heat, thermal cycles, hours of discharge,
whatever is counted.

    ln R_ij = b_i + s_i X_ij1 + f(X_ij1) + sum_{k > 1} a_k X_ijk + e_ij

with a start of its own for each specimen and one effect of each further stress for all of them, by weighted least
squares. Specimens age at their own rates, so the first stress (heat) has a slope for each where they have four
checks, and its effect is the one slope of all; and insulation does not age evenly, so what heat does may change along
its way, f: a natural cubic spline, the same for all. Else a course that levels off is put down to whatever was done
early: without f, of six stators that all had their voltage tests in the first half of a campaign, half are said to
suffer from discharges that do nothing.

The errors are widened to how far the effect moves when each specimen is left out (the jackknife by clusters:
MacKinnon, Nielsen and Webb, J. Appl. Econometrics 38 (2023) 671, arXiv:2301.04527), as specimens differ in more than
their starts. Oven cycles of one length make hours and cycles the same column: then neither is told apart from the
other, and only a cycle of another length, or another temperature, would. What either would be alone is still known,
and given. Rates over campaigns: `benchmarks/stress.py`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from analytics.insulation.arrays import Flags, Floats, Ints

TOLD_APART = 0.99  # correlation from which on neither is told from the other
NEARLY = 1e-10  # of a square of 1: nothing
LEAST_SHARE = 1e-6  # of a column that its specimens' means leave, below which it does not vary within specimens
BENDS = 3  # of the first stress' course beside the straight line
LEAST_SPECIMENS = 3  # that can say how much specimens differ
CHECKS_A_RATE = 4  # from which on each specimen has a rate of its own
CHECKS_A_BEND = 4  # that are left when each specimen has its start


@dataclass(frozen=True)
class Stress:
    """The `effect` of one unit of the stress `name` on ln R with its standard deviation; None where the stress does
    not vary within any specimen. `not_told_from`: the stresses that could be it instead; the effect is then what it
    would be if they did nothing."""

    name: str
    effect: float | None
    sd: float | None
    not_told_from: tuple[str, ...]


def effects(
    specimen: Sequence[str], ln_resistance: ArrayLike, sd: ArrayLike, columns: Mapping[str, ArrayLike]
) -> tuple[Stress, ...]:
    """The effect of each stress. Arguments have one entry for each check, in any order: specimen, ln R, its sd (n,),
    and for each stress what it had summed up to (n,); the first stress is the one whose course may bend."""
    places = {name: k for k, name in enumerate(dict.fromkeys(specimen))}
    who = np.array([places[name] for name in specimen], np.int64)
    weight = 1.0 / np.asarray(sd, np.float64)
    y = _within(who, len(places), np.asarray(ln_resistance, np.float64), weight)
    whole = {name: np.asarray(column, np.float64) for name, column in columns.items()}
    given = {name: _within(who, len(places), column, weight) for name, column in whole.items()}
    used = [
        name
        for name in given
        if np.abs(given[name]).max(initial=0.0) > LEAST_SHARE * np.abs(whole[name] * weight).max(initial=0.0) > 0.0
    ]
    if not used or len(y) <= len(places) + len(used):
        return tuple(Stress(name, None, None, ()) for name in columns)
    x = np.stack([given[name] for name in used], axis=1)
    bends = np.empty((len(y), 0))
    if len(used) > 1 and used[0] == next(iter(columns)):
        most = (len(y) - len(places)) // CHECKS_A_BEND
        curves = [_within(who, len(places), curve, weight) for curve in _bends(whole[used[0]], min(BENDS, most)).T]
        bends = _beside(x[:, 0], np.array(curves).reshape(-1, len(y)).T)
    rates = len(y) >= CHECKS_A_RATE * len(places)
    apart = _told_apart(who, x, bends, rates)
    found = {}
    for k, name in enumerate(used):
        with_it = [k, *(j for j in range(len(used)) if j != k and apart[k, j])]
        beside = np.hstack([x[:, with_it], bends if 0 in with_it else bends[:, :0], y[:, None]])
        if k and 0 in with_it and rates:
            beside = _less_lines(who, x[:, 0], beside)
        effect, error = _first_effect(who, beside[:, :-1], beside[:, -1])
        found[name] = Stress(name, effect, error, tuple(used[j] for j in range(len(used)) if j not in with_it))
    return tuple(found.get(name, Stress(name, None, None, ())) for name in columns)


def _bends(along: Floats, count: int) -> Floats:
    """Natural cubic splines (n, count) of a stress over knots at its quantiles, without the straight line (Hastie,
    Tibshirani and Friedman, The Elements of Statistical Learning, 2nd ed., eq. 5.4)."""
    knots = np.unique(np.quantile(np.unique(along), np.linspace(0.0, 1.0, count + 2)))
    if count < 1 or len(knots) < 3:
        return np.empty((len(along), 0))
    scaled, knots = (along - knots[0]) / np.ptp(knots), (knots - knots[0]) / np.ptp(knots)

    def cut(knot: float) -> Floats:
        return np.asarray((np.maximum(scaled - knot, 0.0) ** 3 - np.maximum(scaled - 1.0, 0.0) ** 3) / (1.0 - knot))

    return np.stack([cut(knot) - cut(knots[-2]) for knot in knots[:-2]], axis=1)


def _beside(straight: Floats, curves: Floats) -> Floats:
    """Orthonormal columns that span what `curves` (n, C) hold beside `straight` (n,)."""
    line = straight[:, None] / np.linalg.norm(straight)
    basis, size, _ = np.linalg.svd(_less(curves, line), full_matrices=False)
    return np.asarray(basis[:, size > NEARLY**0.5 * size.max(initial=NEARLY)])


def _less(columns: Floats, basis: Floats) -> Floats:
    """`columns` (n, K) without what lies in `basis` (n, C), orthonormal."""
    return np.asarray(columns - basis @ (basis.T @ columns))


def _less_lines(who: Ints, along: Floats, columns: Floats) -> Floats:
    """`columns` (n, K) less, in each specimen, what goes in proportion to `along` (n,)."""
    size = np.bincount(who, along**2)
    slopes = [np.bincount(who, along * column) / np.maximum(size, NEARLY) for column in columns.T]
    return columns - np.array(slopes).reshape(-1, len(size)).T[who] * along[:, None]


def _beside_lines(who: Ints, along: Floats, columns: Floats, bends: Floats) -> tuple[Floats, Floats]:
    """Columns (n, K) less what goes in proportion to `along` in each specimen, and orthonormal ones that span what is
    left of `bends` (n, C) then."""
    basis, size, _ = np.linalg.svd(_less_lines(who, along, bends), full_matrices=False)
    return _less_lines(who, along, columns), np.asarray(basis[:, size > NEARLY**0.5])


def _told_apart(who: Ints, x: Floats, bends: Floats, rates: bool) -> Flags:
    """Which of the columns (n, K) are told from which (K, K): those that do not go together, and whose estimated
    effects do not either. What is nearly a bent course of the first column is not told from it."""
    unit = x / np.linalg.norm(x, axis=0)
    left = _less(unit, bends)
    size = np.linalg.norm(left, axis=0)
    beside = _less(*_beside_lines(who, x[:, 0], unit, bends)) if rates else left
    of_first = np.linalg.norm(beside, axis=0) ** 2 < 1.0 - TOLD_APART**2
    left = left / np.maximum(size, NEARLY)
    gram = unit.T @ unit
    inverse = np.linalg.inv(left.T @ left + NEARLY * np.eye(len(gram)))  # huge, along what adds up to nothing
    correlation = inverse / np.sqrt(np.outer(np.diag(inverse), np.diag(inverse)))
    apart = (np.abs(correlation) < TOLD_APART) & (np.abs(gram) < TOLD_APART)
    apart[0, 1:] &= ~of_first[1:]
    apart[1:, 0] &= ~of_first[1:]
    return np.asarray(apart)


def _first_effect(who: Ints, x: Floats, y: Floats) -> tuple[float, float]:
    """The effect of the first of the columns (n, K) beside the others, and its sd: by the errors, or by leaving out
    each specimen in turn where that is larger."""
    scale = np.linalg.norm(x, axis=0)
    unit, specimens = x / np.where(scale > NEARLY * scale[0], scale, np.inf), int(who.max()) + 1
    products = np.stack([unit * column[:, None] for column in (*unit.T, y)], axis=2)
    of_each = np.zeros((specimens, *products.shape[1:]))
    np.add.at(of_each, who, products)
    whole = of_each.sum(axis=0)
    estimate, variance = _solved(whole)
    if specimens >= LEAST_SPECIMENS:
        without = np.array([_solved(whole - one)[0] for one in of_each])
        variance = max(variance, (specimens - 1) / specimens * float(((without - estimate) ** 2).sum()))
    return estimate / float(scale[0]), float(np.sqrt(variance)) / float(scale[0])


def _solved(sums: Floats) -> tuple[float, float]:
    """The first effect and its variance from normal equations (K, K + 1)."""
    inverse = np.linalg.pinv(sums[:, :-1], rcond=NEARLY, hermitian=True)
    return float(inverse[0] @ sums[:, -1]), float(inverse[0, 0])


def _within(who: Ints, specimens: int, values: Floats, weight: Floats) -> Floats:
    """Values less the weighted mean of their specimen, times the weight."""
    total = np.bincount(who, weight**2, specimens)
    mean = np.bincount(who, weight**2 * values, specimens) / total
    return np.asarray((values - mean[who]) * weight, np.float64)
