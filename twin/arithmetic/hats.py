"""Hats: what the knots of a piecewise linear function add to it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def hat(values: Floats, knots: Sequence[float], place: int) -> Floats:
    """1 at knot number `place` of the rising `knots`, down to 0 at its neighbours; outside, as at the last knot.

    >>> import numpy as np
    >>> hat(np.array([0.0, 0.75, 1.5, 9.0]), (0.0, 1.0, 2.0), 1)
    array([0.  , 0.75, 0.5 , 0.  ])
    """
    return np.asarray(np.interp(values, knots, np.eye(len(knots))[place]))


def hats(values: Floats, knots: Sequence[float]) -> Floats:
    """(N, q): how near each value is to each knot; a row adds up to 1.

    >>> import numpy as np
    >>> hats(np.array([0.75, 9.0]), (0.0, 1.0, 2.0))
    array([[0.25, 0.75, 0.  ],
           [0.  , 0.  , 1.  ]])
    """
    return np.column_stack([hat(values, knots, place) for place in range(len(knots))])


def surface(x: Floats, y: Floats, at_x: Sequence[float], at_y: Sequence[float], heights: Floats) -> Floats:
    """What is linear between the knots `at_x` and `at_y`, with these heights (x, y) there, at the points x, y (N,).

    >>> import numpy as np
    >>> surface(np.array([0.5]), np.array([2.0]), (0.0, 1.0), (0.0, 1.0), np.array([[0.0, 4.0], [0.0, 8.0]]))
    array([6.])
    """
    return np.asarray(((hats(x, at_x) @ heights) * hats(y, at_y)).sum(axis=1))
