"""Rows over the steps of a test."""

from __future__ import annotations

import numpy as np
import pytest

from twin.fitting.rows import Product, Products, delayed
from twin.motor.network import NOBODY


@pytest.mark.parametrize("steps", [0.0, 0.3, 1.0, 2.7, -0.4, -1.0, -3.6, 40.0, -40.0])
def test_a_delayed_row_is_the_row_some_steps_before(steps: float) -> None:
    x = np.random.default_rng(1).normal(size=(3, 25))
    at = np.arange(25.0)
    expected = [np.interp(at - steps, at, row) for row in x]
    np.testing.assert_allclose(delayed(x, steps), expected, atol=1e-12)


def test_products_are_weighed_by_the_parameters_that_they_name() -> None:
    rng = np.random.default_rng(2)
    first, second, beta = rng.normal(size=(2, 9)), rng.normal(size=(3, 9)), np.array([0.0, -0.7])
    out = np.ones((2, 9))
    entries = [(0, 2.0, 1, 2, NOBODY), (0, 0.5, 0, 0, 1), (1, 3.0, 0, 1, 0)]
    Products.of([Product(*one) for one in entries]).add(out, first, second, beta)
    np.testing.assert_allclose(out[0], 1 + 2 * first[1] * second[2] - 0.35 * first[0] * second[0], rtol=1e-12)
    np.testing.assert_array_equal(out[1], 1)
