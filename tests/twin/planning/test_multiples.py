"""What a test shows as a multiple of something else has the columns that it would have had by itself."""

from __future__ import annotations

import numpy as np
import pytest

from twin.planning.courses import BenchRange, courses, cut
from twin.planning.detectable import Prospect
from twin.planning.multiples import Multiples


@pytest.mark.parametrize("kind", ["S1", "S2", "spin-downs", "flow halved", "coolant"])
def test_columns_of_multiples_are_those_of_the_candidates(found: Prospect, kind: str) -> None:
    base, candidates = found.ground.fit.model, found.ground.candidates
    bench = BenchRange.of(base.network, base.tests)
    course = next(one for one in courses(bench) if one.words.startswith(kind) and one.speed.any())
    untried = found.ground.untried(bench.test(cut(course, 60)))
    model, size = untried.model, len(untried.beta)
    multiples = Multiples.of(candidates, model.parameters, model.tests[0])
    assert len(multiples.made) < 0.9 * len(candidates)
    assert (multiples.place < size).any()
    made = [size + candidates.index(one) for one in multiples.made]
    for part in model.linearise(untried.beta, candidates):
        columns = np.zeros((len(part.series.y), size + len(candidates)))
        columns[:, part.at], columns[:, size:] = part.columns, part.extra
        few = columns[:, [*range(size), *made]]
        expected, atol = columns[:, size:], 1e-9 * np.abs(columns).max()
        np.testing.assert_allclose(few[:, multiples.place] * multiples.times, expected, rtol=1e-9, atol=atol)
