"""Powers and right-angled sums that give the same bits on every machine: derived channels end in a run's digest.

numpy's `hypot` and `float_power` are the system library's: their last place changes with its version and with the
processor. Everything here is made of multiplication, addition and square root, which IEEE 754 rounds exactly.
"""

from __future__ import annotations

from typing import Any

import numpy as np

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
