"""Many sessions through one network at once, side by side in the lanes of vector instructions.

Each has the bits that it has alone, in about half of the time (docs/integrator.md).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numba
import numpy as np
from numpy.typing import NDArray

from twin.codegen_lanes import LANES
from twin.kernel import Compiled
from twin.simulate import Frame, check_finite, check_frame, simulate

Floats = NDArray[np.float64]

CHUNK = 256  # steps that are laid side by side at a time: they fit the second level cache
NEAR = 8  # of them that fit the nearest one
ENOUGH = 9  # sessions that are worth a pass of all lanes


def simulate_all(compiled: Compiled, frames: Sequence[Frame], initials: Sequence[Floats]) -> list[Floats]:
    """What `simulate` gives for each frame and initial temperatures (n,), to the bit: (N + 1, n) [degC] each.

    Frames may have any number of steps; those with the same `step_s` go together. Raises as `simulate` does.
    """
    edges = np.cumsum([0, *(len(frame.features) + 1 for frame in frames)])
    every = np.empty((edges[-1], len(compiled.network.nodes)))  # one piece of memory is had faster than many
    found = [every[a:b] for a, b in itertools.pairwise(edges)]
    for group in _groups(frames):
        if compiled.together is None or len(group) < ENOUGH or not len(frames[group[0]].features):
            for s in group:
                found[s] = simulate(compiled, frames[s], initials[s])
        else:
            _together(compiled, [frames[s] for s in group], [initials[s] for s in group], [found[s] for s in group])
    return found


def _groups(frames: Sequence[Frame]) -> Iterator[list[int]]:
    """Sessions that go together, at most `LANES`: of one step, and about as long as each other."""
    order = sorted(range(len(frames)), key=lambda s: (frames[s].step_s, len(frames[s].features)))
    for _, equal in itertools.groupby(order, key=lambda s: (frames[s].step_s, len(frames[s].features) > 0)):
        group = list(equal)
        yield from (group[i : i + LANES] for i in range(0, len(group), LANES))


def _together(compiled: Compiled, frames: Sequence[Frame], initials: Sequence[Floats], out: Sequence[Floats]) -> None:
    """Fill `out`, an array a session; lanes that are left over run the last session once more."""
    for frame, initial in zip(frames, initials, strict=True):
        check_frame(compiled.network, frame, initial, compiled.monomials)
    assert compiled.together is not None
    run, n, step_s = compiled.together(), len(compiled.network.nodes), float(frames[0].step_s)
    for own, initial in zip(out, initials, strict=True):
        own[0] = initial
    lane = [min(c, len(frames) - 1) for c in range(LANES)]
    phi, around = (
        tuple(np.ascontiguousarray(arrays[c], dtype=np.float64) for c in lane)
        for arrays in ([frame.features for frame in frames], [frame.boundaries for frame in frames])
    )
    into, longest = tuple(out[c] for c in lane), max(len(frame.features) for frame in frames)
    m, b = phi[0].shape[1], around[0].shape[1]
    rows, states = np.empty((CHUNK, m + b, LANES)), np.empty((CHUNK, n, LANES))
    state = np.stack([initials[c] for c in lane], axis=1)
    for first in range(0, longest, CHUNK):
        many = min(CHUNK, longest - first)
        _take_in(phi, first, 0, rows[:many])
        _take_in(around, first, m, rows[:many])
        run(compiled.parameters, rows[:many], step_s, state, states[:many])
        _give_out(states[:many], first, into)
    for frame, own in zip(frames, out, strict=True):
        check_finite(compiled.network, frame, own)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _take_in(inputs: tuple[Floats, ...], first: int, row: int, rows: Floats) -> None:
    """Features or boundaries of some steps side by side, from this row on; of its last step where a session is over."""
    for near in range(0, rows.shape[0], NEAR):
        for c in range(0, LANES, 4):  # four at once: twice as fast as one
            a0, a1, a2, a3 = inputs[c], inputs[c + 1], inputs[c + 2], inputs[c + 3]
            for k in range(near, min(near + NEAR, rows.shape[0])):
                k0, k1 = min(first + k, a0.shape[0] - 1), min(first + k, a1.shape[0] - 1)
                k2, k3 = min(first + k, a2.shape[0] - 1), min(first + k, a3.shape[0] - 1)
                for j in range(a0.shape[1]):
                    rows[k, row + j, c] = a0[k0, j]
                    rows[k, row + j, c + 1] = a1[k1, j]
                    rows[k, row + j, c + 2] = a2[k2, j]
                    rows[k, row + j, c + 3] = a3[k3, j]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _give_out(states: Floats, first: int, out: tuple[Floats, ...]) -> None:
    for near in range(0, states.shape[0], NEAR):
        for c in range(LANES):
            own = out[c]
            for k in range(near, min(near + NEAR, states.shape[0], own.shape[0] - 1 - first)):
                for i in range(own.shape[1]):
                    own[first + 1 + k, i] = states[k, i, c]
