"""What tests tell of candidate causes, with everything that a healthy motor may do integrated out.

Of each test only inner products of whitened columns are kept, those of its own parameters (start, offsets, clocks)
already integrated out: what several tests tell together is then a sum. With A the columns of the shared parameters of
precision Lambda and v that of a candidate, v'P v = v'v - v'A (A'A + Lambda)^-1 A'v, as in `twin.diagnosis.evidence`;
the own parameters are taken out first in the same way (Schur complement).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

from twin.differences.everyday import everyday, of_test
from twin.fitting.actions import Parameter
from twin.fitting.fit import Fit
from twin.fitting.model import Columns, Floats, Model, Test
from twin.planning.multiples import Multiples


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
            products = _products(np.concatenate(rows), len(shared) + len(own))
            known += _without_own(products, len(shared), model.sd[own])
        return cls(fit, tuple(candidates), np.array(shared, dtype=np.intp), known)

    @cached_property
    def lower(self) -> Floats:
        """L (p, p), lower, of what the fit's tests and the priors say of the p shared parameters: L L' is their
        precision."""
        found: Floats = cholesky(self.known.gram, lower=True)
        return found

    @property
    def since_before(self) -> Gathered:
        """What the fit's tests tell of what came after they had been run once before: they tell all else twice."""
        prior = np.diag(1 / self.fit.model.sd[self.shared] ** 2)
        return replace(self.known, gram=2 * self.known.gram - prior)

    def untried(self, test: Test, more: Sequence[Parameter] = ()) -> Untried:
        """A new test by the fit, with what it brings along and `more`."""
        base = self.fit.model
        brought = [*of_test(base.network, test, 0), *more]
        model = Model(base.network, [test], [*(base.parameters[p] for p in self.shared), *brought], base.noise)
        return Untried(self, model, np.append(self.fit.beta[self.shared], np.zeros(len(brought))))


@dataclass(frozen=True)
class Untried:
    """A new test: its `model` and the vector `beta` (P,), the shared parameters of the `ground` as they are fitted,
    then the test's own. What these do to it is marched once, whatever is asked of it."""

    ground: Ground
    model: Model
    beta: Floats

    def would_tell(self, lengths: Sequence[int]) -> list[Gathered]:
        """What its first so many blocks tell, lengths rising. What a longer test tells is that of the shorter with more
        rows, as whitening looks back only."""
        rows = [rows for _, rows in self._rows()]
        more = (np.concatenate([r[first:last] for r in rows]) for first, last in pairwise([0, *lengths]))
        products = accumulate((_products(one, len(self.beta)) for one in more), Gathered.__add__)
        return [self._without_own(one) for one in products]

    def each_would_tell(self) -> dict[str, Gathered]:
        """Channel -> what it alone tells."""
        return {channel: self._without_own(_products(rows, len(self.beta))) for channel, rows in self._rows()}

    @cached_property
    def _multiples(self) -> Multiples:
        return Multiples.of(self.ground.candidates, self.model.parameters, self.model.tests[0])

    def _rows(self) -> Iterator[tuple[str, Floats]]:
        """Each channel and meter and its whitened columns (B, P + k), of the vector and of the candidates that are
        `made`; supposed thermometers read nothing."""
        for part in self.model.linearise(self.beta, self._multiples.made):
            if part.series.measured:
                yield part.series.channel, _white(self.model, part, range(len(self.beta)))

    def _without_own(self, made: Gathered) -> Gathered:
        """What is gathered of all candidates, from products with those that are made."""
        shared, place, times = len(self.ground.shared), self._multiples.place, self._multiples.times
        cross = np.hstack([made.gram, made.cross])[:, place] * times
        square = np.append(np.diag(made.gram), made.square)[place] * times**2
        return _without_own(Gathered(made.gram, cross, square), shared, self.model.sd[shared:])


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


def _products(rows: Floats, size: int) -> Gathered:
    """Inner products of rows (B, size + m): of the first `size` columns, and of the m candidates behind them."""
    parameters, candidates = rows[:, :size], rows[:, size:]
    square = np.einsum("ij,ij->j", candidates, candidates)
    return Gathered(parameters.T @ parameters, parameters.T @ candidates, square)


def _without_own(products: Gathered, shared: int, own_sd: Floats) -> Gathered:
    """What is gathered once the own parameters, behind the shared ones, are integrated out."""
    lower = cholesky(products.gram[shared:, shared:] + np.diag(1 / own_sd**2), lower=True)
    of_shared = solve_triangular(lower, products.gram[shared:, :shared], lower=True)
    of_candidates = solve_triangular(lower, products.cross[shared:], lower=True)
    return Gathered(
        products.gram[:shared, :shared] - of_shared.T @ of_shared,
        products.cross[:shared] - of_shared.T @ of_candidates,
        products.square - np.einsum("ij,ij->j", of_candidates, of_candidates),
    )
