"""Powers that give the same bits on every machine.

numpy's `**`, `exp` and `log` change in the last place with the SIMD level of the processor, libm's with FMA; a run
that used them would not verify on other hardware. Multiplication, addition and square root are exact by IEEE 754, so
everything here is made of them. Reduction: W. J. Cody, W. Waite, Software Manual for the Elementary Functions (1980).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.lanes import within

_LN2_HIGH = 0.6931471803691238  # its last 20 bits are 0: k * _LN2_HIGH is exact for every exponent k
_LN2_LOW = 1.9082149292705877e-10
_LN2_INVERSE = 1.4426950408889634
_WHOLE = 1.5 * 2.0**52  # what is added to it is rounded to a whole number
_LEAST, _MOST = -746.0, 710.0  # beyond them e^x is 0 and infinite
_C2, _C3, _C4, _C5, _C6, _C7, _C8, _C9, _C10, _C11, _C12, _C13 = (1 / math.factorial(n) for n in range(2, 14))


def power(base: NDArray[np.float64], exponent: float) -> NDArray[np.float64]:
    """`base ** exponent`, both not negative, base (N,), within 1e-14 of it; 0 ** 0 is 1."""
    whole = int(exponent)
    result = _integer_power(base, whole)
    return result if exponent == whole else result * _root(base, exponent - whole)


def _root(base: NDArray[np.float64], exponent: float) -> NDArray[np.float64]:
    """`base ** exponent` for an exponent between 0 and 1."""
    if exponent == 0.5:
        return np.sqrt(base)
    positive = np.where(base > 0, base, 1.0)
    return np.where(base > 0, exp(exponent * log(positive)), 0.0)


def _integer_power(base: NDArray[np.float64], exponent: int) -> NDArray[np.float64]:
    """`base ** exponent` by squaring."""
    result = np.ones_like(base)
    while exponent:
        if exponent & 1:
            result = result * base
        base = base * base
        exponent >>= 1
    return result


def log(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """ln x (N,) of positive numbers, within 3e-16 of it.

    It is k ln 2 + 2 artanh((m - 1) / (m + 1)) for x = m 2^k, m within sqrt(1/2)..sqrt(2); the series ends below
    2^-53.
    """
    mantissa, exponent = np.frexp(x)
    low = mantissa < np.sqrt(0.5)
    m = np.where(low, 2 * mantissa, mantissa)
    k = (exponent - low).astype(np.float64)
    s = (m - 1) / (m + 1)
    square = s * s
    series = np.zeros_like(s)
    for odd in range(23, 1, -2):
        series = (series + 1 / odd) * square
    result: NDArray[np.float64] = k * _LN2_HIGH + (2 * s + (2 * s * series + k * _LN2_LOW))
    return result


def exp(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """e^x (N,), within 1.5e-16 of it where it is a normal number: 2^k e^r, |r| <= ln 2 / 2, Taylor series by Estrin's
    scheme."""
    k, series = _split(np.clip(x, _LEAST, _MOST))
    with np.errstate(over="ignore"):
        result: NDArray[np.float64] = np.ldexp(series, k.astype(np.int32))
    return result


def _split(x: Any) -> Any:
    """k and e^r of x = k ln 2 + r, of an array, or in compiled functions of a number."""
    k = (x * _LN2_INVERSE + _WHOLE) - _WHOLE
    r = (x - k * _LN2_HIGH) - k * _LN2_LOW
    square = r * r
    fourth = square * square
    low = (_C2 + _C3 * r) + square * (_C4 + _C5 * r)
    middle = (_C6 + _C7 * r) + square * (_C8 + _C9 * r)
    high = (_C10 + _C11 * r) + square * (_C12 + _C13 * r)
    return k, 1.0 + (r + square * ((low + fourth * middle) + fourth * fourth * high))


_split_of_number = within(_split)


@within
def exp_of_number(x: float) -> float:
    """`exp` of one number, with the same bits, for compiled functions, into which it is compiled."""
    k, series = _split_of_number(x)
    if x > _MOST:
        return np.inf
    if x < _LEAST:
        return 0.0
    half = int(k) >> 1  # 2^k itself may be no normal number
    result: float = series * _power_of_two(half) * _power_of_two(int(k) - half)
    return result


@within
def _power_of_two(k: int) -> float:
    """2^k for k of a normal number."""
    result: float = np.int64((k + 1023) << 52).view(np.float64)
    return result
