"""Many sessions through one network at once, side by side in the lanes of vector instructions.

Each has the bits that it has alone, in about a third of the time (docs/integrator.md).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.interleaving import at_a_border, interleave, separate
from twin.arithmetic.vectors import LANES
from twin.compiled.kernel import Compiled, Run
from twin.run.simulate import Frame, check_finite, check_frame, check_shapes, simulate, writable

Floats = NDArray[np.float64]

CHUNK = 256  # steps that are laid side by side at a time, a multiple of LANES: they fit the second level cache
ENOUGH = 3  # sessions that are worth a pass of all lanes


def simulate_all(compiled: Compiled, frames: Sequence[Frame], initials: Sequence[Floats]) -> list[Floats]:
    """What `simulate` gives for each frame and initial temperatures (n,), to the bit: (N + 1, n) [degC] each.

    Frames may have any number of steps; those with the same `step_s` go together. Raises as `simulate` does.
    """
    network, n = compiled.network, len(compiled.network.nodes)
    for frame, initial in zip(frames, initials, strict=True):
        check_shapes(network, frame, initial, compiled.monomials)
    found = at_a_border([(len(frame.features) + 1, n) for frame in frames])
    chunk = at_a_border([(CHUNK + 1, count, LANES) for count in (compiled.monomials, len(network.boundaries), n)])
    for group in _groups(frames):
        if compiled.together is None or len(group) < ENOUGH:
            for s in group:
                found[s] = simulate(compiled, frames[s], initials[s])
        else:
            own = [frames[s] for s in group], [initials[s] for s in group], [found[s] for s in group]
            _together(compiled, compiled.together(), *own, chunk)
    return found


def _groups(frames: Sequence[Frame]) -> Iterator[list[int]]:
    """Indices of sessions that go together, at most `LANES`: with one step size, and about as long as each other, the
    longest last."""
    order = sorted(range(len(frames)), key=lambda s: (frames[s].step_s, len(frames[s].features)))
    for _, equal in itertools.groupby(order, key=lambda s: frames[s].step_s):
        group = list(equal)
        yield from (group[i : i + LANES] for i in range(0, len(group), LANES))


def _together(
    compiled: Compiled,
    run: Run,
    frames: Sequence[Frame],
    initials: Sequence[Floats],
    out: Sequence[Floats],
    chunk: Sequence[Floats],
) -> None:
    """Fill `out`, an array for each session, by way of `chunk`: features, boundaries and temperatures of some steps
    side by side.

    A lane without a session, or whose session is over, does what the longest one does: that is written more than
    once.
    """
    steps, longest, n = [len(frame.features) for frame in frames], len(frames) - 1, len(compiled.network.nodes)
    features, boundaries, found = (
        [writable(array).ravel() for array in arrays]
        for arrays in ([frame.features for frame in frames], [frame.boundaries for frame in frames], out)
    )
    phi, around, states = chunk
    m, b, step_s = phi.shape[1], around.shape[1], float(frames[0].step_s)
    states[0] = np.stack([initials[min(c, longest)] for c in range(LANES)], axis=1)
    finite, first, own = bool(np.isfinite(states[0]).all()), 0, [-1]
    for stop in sorted({*range(CHUNK, steps[-1], CHUNK), *steps}):
        if own != (now := [c if c < longest and steps[c] >= stop else longest for c in range(LANES)]):
            own = now
            inputs, edges, results = (tuple(arrays[s] for s in own) for arrays in (features, boundaries, found))
            states[0] = states[0][:, [c if s < longest else LANES - 1 for c, s in enumerate(own)]]
        many = stop - first
        finite &= interleave(inputs, first * m, phi[:many].reshape(-1, LANES))
        finite &= interleave(edges, first * b, around[:many].reshape(-1, LANES))
        if not finite:
            break
        run(compiled.parameters, phi[:many], around[:many], step_s, states[: many + 1])
        separate(states[: many + 1].reshape(-1, LANES), results, first * n)
        states[0] = states[many - stop % LANES]
        first = stop - stop % LANES  # rows from a border of vectors on; a few steps are run once more
    if not finite:  # this raises: nothing is in `out` then that could be looked at
        for frame, initial in zip(frames, initials, strict=True):
            check_frame(compiled.network, frame, initial, compiled.monomials)
    for frame, course in zip(frames, out, strict=True):
        check_finite(compiled.network, frame, course)
