"""Powers, logarithms and right-angled sums with the same bits on every machine: derived channels end in a run's digest.

numpy's `hypot`, `float_power`, `exp` and `log` are the system library's: their last place changes with its version and
with the processor. Everything here is made of the four operations and square root, which IEEE 754 rounds exactly.
"""

from __future__ import annotations

from typing import Any

import numpy as np

LN_2, LN_10 = 0.6931471805599453, 2.302585092994046
LN_2_HIGH, LN_2_LOW = float.fromhex("0x1.62e42feep-1"), float.fromhex("0x1.a39ef35793c76p-33")  # their sum is ln 2
FAR = 2.0**64  # squares so far before the point have left float64, roots so far behind it are 1


def hypot(x: Any, y: Any) -> Any:
    """sqrt(x^2 + y^2) of arrays or numbers, within 2.3e-16 of it; no square overflows on the way."""
    _, exponent = np.frexp(np.maximum(np.abs(x), np.abs(y)))
    a, b = np.ldexp(x, -exponent), np.ldexp(y, -exponent)
    return np.ldexp(np.sqrt(a * a + b * b), exponent)


def power(base: Any, exponent: Any) -> Any:
    """`base ** exponent` of arrays or numbers, by the binary digits of the exponent.

    Those before the point take squares of the base, those behind it square roots. Within (1.2e-16 |exponent| + 2e-14)
    of it where it and its inverse are normal numbers; exact where all products are. NaN where an input is, and for a
    negative base with a fraction; 0 ** 0 is 1.
    """
    size = np.minimum(np.abs(exponent), FAR)
    whole = np.floor(size)
    fraction, square, root = np.floor((size - whole) * FAR) / FAR, base, base
    result = np.ones(np.broadcast(base, exponent).shape)
    while np.any(whole > 0):
        result = np.where(np.fmod(whole, 2) == 1, result * square, result)
        whole, square = np.floor(whole / 2), square * square
    while np.any(fraction > 0):
        root, fraction = np.sqrt(root), 2 * fraction
        result = np.where(fraction >= 1, result * root, result)
        fraction = np.where(fraction >= 1, fraction - 1, fraction)
    result = np.where(np.less(exponent, 0), 1 / result, result)
    return np.where(np.isnan(base) | np.isnan(exponent), np.nan, result)


def exp(x: Any) -> Any:
    """e ** x of arrays or numbers, within 4e-16 of it where it is a normal number."""
    near = np.clip(x, -800.0, 800.0)  # beyond it is 0, or no number of float64
    twos = np.rint(near / LN_2)
    rest = (near - twos * LN_2_HIGH) - twos * LN_2_LOW
    series = np.ones(np.shape(x))
    for n in range(14, 0, -1):
        series = 1 + rest / n * series
    return np.ldexp(series, np.nan_to_num(twos).astype(np.int32))


def ln(x: Any) -> Any:
    """The natural logarithm of arrays or numbers, within 4e-16 of it; NaN from 0 down and for infinity."""
    size, twos = np.frexp(np.where(np.greater(x, 0), x, np.nan))
    small = size < np.sqrt(0.5)
    size, twos = np.where(small, 2 * size, size), twos - small
    z = (size - 1) / (size + 1)
    series = np.zeros(np.shape(x))
    for n in range(23, 0, -2):
        series = 1 / n + z * z * series
    return twos * LN_2 + 2 * z * series


def log10(x: Any) -> Any:
    """The logarithm to base 10 of arrays or numbers, within 6e-16 of it; NaN as `ln`."""
    return ln(x) / LN_10
