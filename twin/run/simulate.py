"""Open-loop runs, and the heat that a network makes in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.compiled.kernel import Compiled
from twin.compiled.laid_out import laid_out
from twin.compiled.laws import psi
from twin.compiled.structure import CONSTANT
from twin.errors import DivergedError, FrameError
from twin.motor import features
from twin.motor.network import Network


@dataclass(frozen=True)
class Frame:
    """Inputs of N steps of `step_s` [s], constant within each. `features` (N, m): the step's mean of each monomial,
    in the order of `features.monomials(network)`. `boundaries` (N, b) [degC]: the step's mean of each boundary, in
    the network's order.
    """

    step_s: float
    features: NDArray[np.float64]
    boundaries: NDArray[np.float64]


def simulate(compiled: Compiled, frame: Frame, initial: NDArray[np.float64]) -> NDArray[np.float64]:
    """Temperatures (N + 1, n) [degC] of every node, from `initial` (n,) on; row k is the start of step k.

    The same bits on every repetition. Raises `FrameError` where shapes do not fit or an input is not finite, and
    `DivergedError` where the temperatures leave the finite numbers.
    """
    check_frame(compiled.network, frame, initial, compiled.monomials)
    steps, n = len(frame.features), len(compiled.network.nodes)
    out = np.empty((steps + 1, n))
    out[0] = initial
    phi, boundaries = writable(frame.features), writable(frame.boundaries)
    compiled.run(compiled.parameters, phi, boundaries, float(frame.step_s), out)
    check_finite(compiled.network, frame, out)
    return out


def writable(array: NDArray[np.float64]) -> NDArray[np.float64]:
    """The array as compiled functions ask for it, row by row in memory and free to be written: itself where it is
    such, else a copy."""
    return np.require(array, np.float64, ("C", "A", "W"))


def check_frame(network: Network, frame: Frame, initial: NDArray[np.float64], monomials: int | None = None) -> None:
    """Raise `FrameError` where shapes do not fit the network or a number is not finite.

    `monomials`: how many the network has, where that is known: to count them takes longer than a short run.
    """
    check_shapes(network, frame, initial, monomials)
    for name, array in (("features", frame.features), ("boundaries", frame.boundaries), ("initial", initial)):
        if not _surely_finite(array) and not np.isfinite(array).all():
            first = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
            raise FrameError(f"{name} are not finite first at {first}: fill or cut the gap before the run")


def check_shapes(network: Network, frame: Frame, initial: NDArray[np.float64], monomials: int | None = None) -> None:
    """The part of `check_frame` that does not look at every number."""
    steps = len(frame.features)
    expected = {
        "features": (frame.features, (steps, len(features.monomials(network)) if monomials is None else monomials)),
        "boundaries": (frame.boundaries, (steps, len(network.boundaries))),
        "initial": (initial, (len(network.nodes),)),
    }
    for name, (array, shape) in expected.items():
        if array.shape != shape:
            raise FrameError(f'{name} of shape {array.shape} do not fit network "{network.name}": give {shape}')
    if not frame.step_s > 0:
        raise FrameError(f"step_s {frame.step_s:g} is not above 0: give the length of a step in s")


def _surely_finite(array: NDArray[np.float64]) -> bool:
    """Whether the sum is finite, which takes a fraction of the time; it may overflow where every number is finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(array.sum()))


def check_finite(network: Network, frame: Frame, temperatures: NDArray[np.float64]) -> None:
    """Raise `DivergedError` where the temperatures left the finite numbers."""
    if np.isfinite(temperatures[-1]).all():  # what is not finite stays so
        return
    step, node = (int(i) for i in np.argwhere(~np.isfinite(temperatures))[0])
    raise DivergedError(
        f'node "{network.nodes[node].name}" leaves the finite numbers at {step * frame.step_s:g} s: its loss grows'
        " faster with temperature than its links can carry away; check its coefficients and temperature slopes"
    )


def heat_of_terms(network: Network, frame: Frame, psi_of_groups: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heat (S, N) [W] that each term of the sources makes in N steps, in the order of the sources and their terms;
    psi (G, N) of each group of laws as `twin.compiled.laws` has it."""
    shape, values, *_ = laid_out(network)
    place = {i: (g, j) for g, group in enumerate(shape.groups) for i, j in group.terms}
    first = sum(len(link.terms) for link in network.links)
    own = [place[i] for i in range(first, first + sum(len(source.terms) for source in network.sources))]
    heats = [values.coefficients[first + i] * of_monomial(j, frame) * psi_of_groups[g] for i, (g, j) in enumerate(own)]
    return np.array(heats).reshape(-1, len(frame.features))


def of_monomial(monomial: int, frame: Frame) -> NDArray[np.float64] | float:
    """The course (N,) of a column of the features; 1 for `CONSTANT`, a term without features."""
    return 1.0 if monomial == CONSTANT else frame.features[:, monomial]


def source_heat(network: Network, frame: Frame, temperatures: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean loss (N, sources) [W] of every source in each step, at the mean of the step's two end temperatures.

    `temperatures` (N + 1, n) as `simulate` gives them.
    """
    own, _ = psi(laid_out(network).table, (temperatures[:-1] + temperatures[1:]) / 2, frame.boundaries)
    heats, found = iter(heat_of_terms(network, frame, own)), np.zeros((len(frame.features), len(network.sources)))
    for s, source in enumerate(network.sources):
        for _ in source.terms:
            found[:, s] += next(heats)
    return found
