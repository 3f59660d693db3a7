from __future__ import annotations

import hashlib
from decimal import Decimal, localcontext

import numba
import numpy as np
import pytest

from twin.arithmetic.powers import exp, exp_of_number, log, power


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
    assert digest == "6ee6a066e97da51d6c442f554424c747f0630cf02377d40a1be989a126290aec"


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

        assert worst(exp(exponents), [Decimal(x).exp() for x in exponents.tolist()]) < 1.5e-16
        assert worst(log(numbers), [Decimal(x).ln() for x in numbers.tolist()]) < 3.4e-16


def test_exp_and_log_have_the_same_bits_on_every_machine() -> None:
    values = np.concatenate([exp(np.arange(-400, 400) / 16.0), log(np.arange(1, 2001) / 128.0)])
    assert (
        hashlib.sha256(values.astype("<f8").tobytes()).hexdigest()
        == "74279d7e3f211ab0273d1d75f55d48cf058eb99476f99b663c121934af54ade4"
    )
    assert [value.hex() for value in exp(np.array([1.0, -2.5])).tolist()] == [
        "0x1.5bf0a8b14576ap+1",
        "0x1.50385c094f425p-4",
    ]


@numba.njit(error_model="numpy")
def each(x: np.ndarray) -> np.ndarray:
    found = np.empty_like(x)
    for i in range(x.size):
        found[i] = exp_of_number(x[i])
    return found


def test_exp_of_a_number_has_the_bits_of_that_of_an_array() -> None:
    rng = np.random.default_rng(2)
    borders = [0.0, -0.0, 709.782712893384, 709.7827128933841, -708.4, -745.1, -745.2, 1e300, np.inf, -1e300, -np.inf]
    x = np.concatenate([rng.uniform(-1, 1, 50_000), rng.uniform(-760, 760, 50_000), borders])
    np.testing.assert_array_equal(each(x).view(np.int64), exp(x).view(np.int64))


def test_exp_goes_to_nothing_and_to_infinity_and_passes_what_is_no_number() -> None:
    found = each(np.array([-746.0, -1e9, -745.0, 710.0, 1e9, np.nan]))
    np.testing.assert_array_equal(found, [0.0, 0.0, 5e-324, np.inf, np.inf, np.nan])


def test_no_product_and_sum_of_exp_are_rounded_at_once() -> None:
    """A processor that can, would: but not all of them can."""
    each(np.zeros(1))
    (code,) = each.inspect_llvm().values()
    assert "fmul double" in code or "fmul <" in code
    assert not any(word in code for word in ("llvm.fma", "fmuladd", "fmul fast", "fmul contract", "fadd fast"))
    assert "call double @exp" not in code and "llvm.exp" not in code
