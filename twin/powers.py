"""Powers that give the same bits on every machine.

numpy's `**`, `exp` and `log` change in the last place with the SIMD level of the processor, libm's with FMA; a run
that used them would not verify on other hardware. Multiplication, addition and square root are exact by IEEE 754, so
everything here is made of them. Reduction: W. J. Cody, W. Waite, Software Manual for the Elementary Functions (1980).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_LN2_HIGH = 0.6931471803691238  # its last 20 bits are 0: k * _LN2_HIGH is exact for every exponent k
_LN2_LOW = 1.9082149292705877e-10
_LN2_INVERSE = 1.4426950408889634


def power(base: NDArray[np.float64], exponent: float) -> NDArray[np.float64]:
    """`base ** exponent`, base (N,) not negative, exponent not negative; 0 ** 0 is 1. Within 1e-14 of it."""
    whole = int(exponent)
    result = _integer_power(base, whole)
    return result if exponent == whole else result * _root(base, exponent - whole)


def _root(base: NDArray[np.float64], exponent: float) -> NDArray[np.float64]:
    """The power for an exponent between 0 and 1."""
    if exponent == 0.5:
        return np.sqrt(base)
    positive = np.where(base > 0, base, 1.0)
    return np.where(base > 0, exp(exponent * log(positive)), 0.0)


def _integer_power(base: NDArray[np.float64], exponent: int) -> NDArray[np.float64]:
    result = np.ones_like(base)
    while exponent:
        if exponent & 1:
            result = result * base
        base = base * base
        exponent >>= 1
    return result


def log(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """ln x (N,) of positive numbers, within 3e-16 of it: k ln 2 + 2 artanh((m - 1) / (m + 1)), m within sqrt(1/2)..sqrt(2); the series
    ends below 2^-53."""
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
    """e^x (N,) where it is a normal number, within 2e-16 of it: 2^k e^r, |r| <= ln 2 / 2, Taylor series by Horner's rule."""
    k = np.rint(x * _LN2_INVERSE)
    r = (x - k * _LN2_HIGH) - k * _LN2_LOW
    series = np.ones_like(r)
    for n in range(13, 0, -1):
        series = 1 + r * series / n
    result: NDArray[np.float64] = np.ldexp(series, k.astype(np.int32))
    return result
