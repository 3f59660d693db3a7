"""What tests tell of candidate causes, with everything that a healthy motor may do integrated out.

Of each test only inner products of whitened columns are kept, those of its own parameters (start, offsets, clocks)
already integrated out: what several tests tell together is then a sum. With A the columns of the shared parameters of
precision Lambda and v that of a candidate, v'P v = v'v - v'A (A'A + Lambda)^-1 A'v, as in `twin.diagnosis.evidence`;
the own parameters are taken out first in the same way (Schur complement).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

from twin.differences.everyday import everyday, of_test
from twin.fitting.actions import Parameter
from twin.fitting.fit import Fit
from twin.fitting.model import Columns, Floats, Model, Test


@dataclass(frozen=True)
class Gathered:
    """Inner products over tests: `gram` (p, p) of the p shared parameters, `cross` (p, m) with the m candidates, and
    `square` (m,) of each candidate with itself."""

    gram: Floats
    cross: Floats
    square: Floats

    def __add__(self, other: Gathered) -> Gathered:
        return Gathered(self.gram + other.gram, self.cross + other.cross, self.square + other.square)

    def information(self) -> Floats:
        """v'P v (m,) of each candidate, in 1 / amplitude^2; priors must be among what is gathered."""
        taken = solve_triangular(cholesky(self.gram, lower=True), self.cross, lower=True)
        left: Floats = np.maximum(self.square - np.einsum("ij,ij->j", taken, taken), 0.0)
        return left


@dataclass(frozen=True)
class Ground:
    """What new tests are added to: a fit, the `candidates` as parameters (m,) sized by it, and what its own tests tell
    of them (`known`, with the priors)."""

    fit: Fit
    candidates: tuple[Parameter, ...]
    shared: NDArray[np.intp]
    known: Gathered

    @classmethod
    def of(cls, fit: Fit, candidates: Sequence[Parameter], parts: Sequence[Columns]) -> Ground:
        """`parts`: the fit linearised with the candidates. Parameters at a bound stay there."""
        model = fit.model
        shared = [p for p, one in enumerate(model.parameters) if one.test is None and fit.free[p]]
        known = Gathered(np.diag(1 / model.sd[shared] ** 2), np.zeros((len(shared), len(candidates))), np.zeros(1))
        for number in range(len(model.tests)):
            own = [p for p, one in enumerate(model.parameters) if one.test == number and fit.free[p]]
            rows = [_white(model, part, [*shared, *own]) for part in parts if part.series.session == number]
            size = len(shared) + len(own)
            known += _without_own(_products(np.concatenate(rows), size), len(shared), model.sd[own], size)
        return cls(fit, tuple(candidates), np.array(shared, dtype=np.intp), known)

    @cached_property
    def unsure(self) -> Floats:
        """What the fit's tests leave unknown of the p shared parameters: a factor U (p, p) of their covariance U U'."""
        lower = cholesky(self.known.gram, lower=True)
        found: Floats = solve_triangular(lower, np.eye(len(lower)), lower=True).T
        return found

    def model(self, test: Test, more: Sequence[Parameter] = ()) -> tuple[Model, Floats]:
        """A new test with what it brings along and `more`, and the vector: the shared parameters as they are fitted."""
        base = self.fit.model
        brought = [*of_test(base.network, test, 0), *more]
        model = Model(base.network, [test], [*(base.parameters[p] for p in self.shared), *brought], base.noise)
        return model, np.append(self.fit.beta[self.shared], np.zeros(len(brought)))

    def would_tell(self, test: Test, lengths: Sequence[int]) -> list[Gathered]:
        """What the first so many blocks of a new test tell, lengths rising. What a longer test tells is that of the
        shorter with more rows, as whitening looks back only."""
        model, beta = self.model(test)
        rows = [rows for _, rows in self._rows(model, beta)]
        own_sd = model.sd[len(self.shared) :]
        found, products = list[Gathered](), np.zeros((1, 1))
        for first, last in pairwise([0, *lengths]):
            products = products + _products(np.concatenate([r[first:last] for r in rows]), len(beta))
            found.append(_without_own(products, len(self.shared), own_sd, len(beta)))
        return found

    def each_would_tell(self, test: Test, sensors: Sequence[Parameter]) -> dict[str, Gathered]:
        """Channel -> what it alone tells in a new test; `sensors`: what channels may have wrong that no recorded test
        has."""
        model, beta = self.model(test, sensors)
        own_sd = model.sd[len(self.shared) :]
        return {
            channel: _without_own(_products(rows, len(beta)), len(self.shared), own_sd, len(beta))
            for channel, rows in self._rows(model, beta)
        }

    def _rows(self, model: Model, beta: Floats) -> Iterator[tuple[str, Floats]]:
        """Channel and its whitened columns (B, p + m)."""
        for part in model.linearise(beta, self.candidates):
            yield part.series.channel, _white(model, part, range(len(beta)))


def sensor_parameters(model: Model, test: Test) -> list[Parameter]:
    """What the channels and meters of a test may have wrong besides an offset."""
    names = (*(f"sensor.{c.name}." for c in test.channels), *(f"meter.{m.name}." for m in test.meters))
    return [p for p in everyday(model.network, [test]) if p.name.startswith(names) and p.test is None]


def _white(model: Model, part: Columns, wanted: Iterable[int]) -> Floats:
    """Whitened columns (B, w + m) of a channel: the wanted parameters, then the candidates."""
    place = {p: i for i, p in enumerate(wanted)}
    found = np.zeros((len(part.series.y), len(place) + part.extra.shape[1]))
    there = [(place[p], j) for j, p in enumerate(part.at.tolist()) if p in place]
    found[:, [i for i, _ in there]] = part.columns[:, [j for _, j in there]]
    found[:, len(place) :] = part.extra
    return model.whitened(part.series, found)


def _products(rows: Floats, size: int) -> Floats:
    """Inner products (size + 1, size + m) of rows (B, size + m): of the first `size` columns with all, and in the last
    row of each column with itself."""
    of_parameters = rows[:, :size].T @ rows
    return np.vstack([of_parameters, np.einsum("ij,ij->j", rows, rows)])


def _without_own(products: Floats, shared: int, own_sd: Floats, size: int) -> Gathered:
    """What is gathered once the own parameters, behind the shared ones, are integrated out."""
    own = products[shared:size, shared:size] + np.diag(1 / own_sd**2)
    beside = np.hstack([products[shared:size, :shared], products[shared:size, size:]])
    taken = solve_triangular(cholesky(own, lower=True), beside, lower=True)
    of_shared, of_candidates = taken[:, :shared], taken[:, shared:]
    return Gathered(
        products[:shared, :shared] - of_shared.T @ of_shared,
        products[:shared, size:] - of_shared.T @ of_candidates,
        products[-1, size:] - np.einsum("ij,ij->j", of_candidates, of_candidates),
    )
