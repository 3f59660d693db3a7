from __future__ import annotations

from typing import Any, cast

import numba
import numpy as np
import pytest

from twin.arithmetic.vectors import LANES, vectors


def _every_operation(given: Any, scale: float, out: Any) -> None:
    lanes = given.shape[2:]
    rows, found = vectors(given, lanes), vectors(out, lanes)
    kept = vectors(np.empty((1, *lanes)), lanes)
    for k in range(len(rows)):
        a, b = rows[k, 0], rows[k, 1]
        total = 0.0
        total += a * scale
        total -= scale / b
        kept[0] = total
        kept[0] *= a
        found[k, 0] = kept[0] + np.sqrt(a) - -b
        found[k, 1] = np.minimum(np.maximum(a - b, 0.0), 1.5) + scale * (b < a) * (a <= 2.0 * b)
        found[k, 2] = b if k == 1 else 2.0


compiled = numba.njit(error_model="numpy")(_every_operation)


@pytest.fixture(scope="module")
def given() -> np.ndarray[Any, Any]:
    return np.random.default_rng(1).uniform(0.1, 4.0, (5, 2, LANES))


def test_a_lane_has_the_bits_of_a_number_and_of_numpys_rows(given: np.ndarray[Any, Any]) -> None:
    wide, plain = np.zeros((5, 3, LANES)), np.zeros((5, 3, LANES))
    compiled(given, 1.7, wide)
    _every_operation(given, 1.7, plain)
    np.testing.assert_array_equal(wide, plain)
    for lane in range(LANES):
        alone = np.zeros((5, 3))
        compiled(np.ascontiguousarray(given[:, :, lane]), 1.7, alone)
        np.testing.assert_array_equal(wide[:, :, lane], alone)


def test_vectors_are_what_the_compiler_is_given(given: np.ndarray[Any, Any]) -> None:
    compiled(given, 1.7, np.zeros((5, 3, LANES)))
    texts = cast(dict[Any, str], compiled.inspect_llvm())
    text = next(text for (array, *_), text in texts.items() if array.ndim == 3)
    for instruction in ("fmul", "fdiv", "fsub", "fcmp", "llvm.sqrt"):
        assert any(instruction in line and f"{LANES} x double" in line for line in text.splitlines()), instruction
