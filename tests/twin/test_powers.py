from __future__ import annotations

import hashlib
from decimal import Decimal, localcontext

import numpy as np
import pytest

from twin.powers import exp, log, power


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


def test_exp_and_log_agree_with_fifty_digits_to_the_last_place() -> None:
    rng = np.random.default_rng(1)
    exponents = np.concatenate([rng.uniform(-40, 40, 500), [0.0, -1e-9, np.log(2) / 2, 700.0]])
    numbers = np.concatenate(
        [rng.uniform(0.4, 3.0, 400), np.geomspace(1e-12, 1e12, 101), 1 + np.geomspace(1e-6, 1e-3, 9)]
    )
    with localcontext() as context:
        context.prec = 50

        def worst(found: np.ndarray, true: list[Decimal]) -> float:
            pairs = zip(found.tolist(), true, strict=True)
            return max(float(abs(Decimal(own) / one - 1)) for own, one in pairs if one)

        assert worst(exp(exponents), [Decimal(x).exp() for x in exponents.tolist()]) < 2.3e-16
        assert worst(log(numbers), [Decimal(x).ln() for x in numbers.tolist()]) < 3.4e-16


def test_exp_and_log_have_the_same_bits_on_every_machine() -> None:
    values = np.concatenate([exp(np.arange(-400, 400) / 16.0), log(np.arange(1, 2001) / 128.0)])
    assert (
        hashlib.sha256(values.astype("<f8").tobytes()).hexdigest()
        == "4eed7e272d68ef9a2a09a69bc344b3c8eac9fd5a80a0b2f1116a4a930efce0c7"
    )
    assert [value.hex() for value in exp(np.array([1.0, -2.5])).tolist()] == [
        "0x1.5bf0a8b14576ap+1",
        "0x1.50385c094f425p-4",
    ]
