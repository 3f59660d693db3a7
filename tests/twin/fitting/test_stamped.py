"""Block means of late readings, against the readings moved by hand."""

from __future__ import annotations

import numpy as np
import pytest

from twin.fitting.stamped import stamped_means
from twin.motor.outputs import blocks


@pytest.mark.parametrize("late_steps", [0.0, 0.3, -0.3, 1.0, 4.6, -6.2])
def test_means_of_late_stamps_are_means_of_the_moved_reading(late_steps: float) -> None:
    rng = np.random.default_rng(4)
    steps = 60
    cut = blocks((rng.random(steps) < 0.8).astype(np.float64), rng.random(steps), 2.0)
    reading, at = rng.normal(size=steps + 1), np.arange(steps + 1.0)
    found = stamped_means(cut, np.full(steps + 1, late_steps)) @ reading
    np.testing.assert_allclose(found, cut.means(np.interp(at - late_steps, at, reading)), atol=1e-12)


def test_the_example_of_the_docstring() -> None:
    cut = blocks(np.ones(4), np.ones(4), 5.0)
    found = stamped_means(cut, np.ones(5)).toarray()
    np.testing.assert_array_equal(found, [[0.5, 0.5, 0, 0, 0], [0, 0, 0.5, 0.5, 0]])
