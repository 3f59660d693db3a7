"""Block means of readings whose stamps may be late, as one matrix: for what a channel shows and for its columns."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from twin.motor.outputs import Blocks

Floats = NDArray[np.float64]


def stamped_means(cut: Blocks, late_steps: Floats) -> csr_array:
    """(B, N + 1): the means of the blocks that are there, of readings at the edges of N steps, between which they are
    linear. The stamps at the edges are `late_steps` (N + 1,) late; the first and the last reading hold beyond the
    ends.

    Of two blocks of 2 steps, read at the ends of the steps and 1 step late, it is

        1/2  1/2   0    0    0
         0    0   1/2  1/2   0
    """
    steps, length = cut.old.size, cut.length
    edges = np.arange(0, steps, length)[cut.there, None] + np.arange(length + 1)  # of each block
    weights = np.zeros(edges.shape)
    weights[:, :-1] = cut.old.reshape(-1, length)[cut.there]
    weights[:, 1:] += cut.new.reshape(-1, length)[cut.there]
    at = np.clip(edges - late_steps[edges], 0, steps)
    low = np.minimum(at.astype(np.int32), steps - 1)
    share = at - low
    taken, of = np.stack([weights * (1 - share), weights * share], axis=-1), np.stack([low, low + 1], axis=-1)
    starts = np.arange(len(edges) + 1, dtype=np.int32) * 2 * (length + 1)
    return csr_array((taken.ravel(), of.ravel(), starts), (len(edges), steps + 1))
