from __future__ import annotations

import hashlib

import numpy as np
import pytest

from twin.powers import power


@pytest.mark.parametrize("exponent", [0.0, 0.5, 0.7, 0.8, 1.0, 1.5, 1.6, 2.0, 3.0, 7.3])
def test_powers_agree_with_numpy_to_the_last_places(exponent: float) -> None:
    base = np.concatenate([[0.0, 1.0], np.geomspace(1e-9, 50, 4001)])
    np.testing.assert_allclose(power(base, exponent), base**exponent, rtol=1e-14, atol=0)


def test_zero_to_the_zero_is_one_and_zero_to_a_fraction_is_zero() -> None:
    assert power(np.zeros(1), 0.0) == 1.0
    assert power(np.zeros(1), 0.8) == 0.0


def test_powers_have_the_same_bits_on_every_machine() -> None:
    values = power(np.arange(1, 2001) / 1024.0, 1.3)
    digest = hashlib.sha256(values.astype("<f8").tobytes()).hexdigest()
    assert digest == "8788b39ebb487d21a054a09d1b4b3375bcba1a755a638a6790c52079637c5669"
