"""What every coefficient, capacity and initial temperature does to what thermometers read in an open-loop run, block
by block.

All columns go through the run once, side by side (`twin.run.sparse_march`): the derivatives of its discrete scheme
itself, for a network of any size, with nothing compiled a motor. They come a few blocks at a
time, so that the memory that they need does not grow with the run; whoever takes them sums them up. A candidate is a
term whose coefficient is 0: its column is what it would bring.

The derivatives of one number by everything are a task for `twin.run.gradients`; fits take those of all that may
differ in a test (`twin.fitting.heats`) from the same march.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from twin.compiled.laid_out import laid_out
from twin.compiled.laws import psi
from twin.compiled.structure import CONSTANT, Structure
from twin.motor import features
from twin.motor.network import NOBODY, Network
from twin.motor.outputs import Blocks, blocks
from twin.run.simulate import Frame, check_frame
from twin.run.sparse_march import ColumnSensor, Loads, MarchedColumns, run

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

HELD = 2**17  # numbers of steps and columns at a time, where not one block alone has more


@dataclass(frozen=True)
class Thermometer:
    """`weights` (n,) of the nodes; first-order lag [s]; `blocks` of its readings."""

    weights: Floats
    time_constant_s: float
    blocks: Blocks


def of_every_node(network: Network, frame: Frame) -> list[Thermometer]:
    """One at each node, always there, where a step counts as the mean of its ends."""
    ones = np.ones(len(frame.features))
    cut = blocks(ones, ones / 2, frame.step_s)
    return [Thermometer(weights, 0.0, cut) for weights in np.eye(len(network.nodes))]


def of_motor(network: Network) -> tuple[list[int], Floats]:
    """The places (P,) of the coefficients of the network's terms, then of its capacities, among all columns of
    `block_columns`; and their values: a column times its value is the derivative by the logarithm. What a fluid
    carries is no parameter."""
    values = np.array([*(t.coefficient for t in features.terms(network)), *(node.capacity for node in network.nodes)])
    behind = sum(len(circuit.nodes) for circuit in network.circuits)
    size = len(values) - len(network.nodes)
    return [i + (behind if i >= size else 0) for i in range(len(values))], values


def block_columns(
    network: Network,
    frame: Frame,
    initial: Floats,
    thermometers: Sequence[Thermometer],
    wanted: Sequence[int] | None = None,
) -> Iterator[Floats]:
    """Derivatives (b, m, P) of the means of m thermometers over b blocks, for some blocks at a time, of a run from
    `initial` (n,).

    The columns are, in this order: coefficients, those of `features.terms`, then of `features.streams` [K per W or
    W/K]; capacities [K per J/K]; initial temperatures [K/K]; or the `wanted` ones of these places. The blocks of all
    thermometers have one length. Steps behind the last whole block do not count; a block without readings has zeros.
    Raises `FrameError` where the frame does not fit the network, `DivergedError` where its run leaves the finite
    numbers or ten thousand degrees.
    """
    shape, values, program, laws, table = laid_out(network)
    check_frame(network, frame, initial, shape.monomials)
    affine, names = all(law.affine for law in laws), [node.name for node in network.nodes]
    size = len(values.coefficients)
    places = range(size + 2 * shape.n) if wanted is None else wanted
    node_of = np.array(places, dtype=np.int64) - size - shape.n  # whose start a column is, below 0 where of none
    begin = (np.arange(shape.n)[:, None] == node_of).astype(np.float64)
    heat, feature, loads = _loads(shape, places)
    sensors = [ColumnSensor.thermometer(one.weights, one.time_constant_s, frame.step_s) for one in thermometers]
    length, cuts = thermometers[0].blocks.length, [one.blocks for one in thermometers]
    of_block = length * (shape.n + 2 * len(program.edge_to)) + len(thermometers) * len(places)
    at_once = max(1, min(HELD // of_block, len(frame.features) // length)) * length
    columns = MarchedColumns(program, 2 * values.capacities / frame.step_s, sensors, loads, begin, at_once)
    whole = len(frame.features) // length * length
    for first in range(0, whole, at_once):
        some = slice(first, min(first + at_once, whole))
        phi, around = frame.features[some], frame.boundaries[some]
        ran = run(program, affine, values, frame.step_s, phi, around, initial, names)
        initial = ran.edges[-1]
        driven, _ = psi(table, ran.means, around)
        heats = np.concatenate([driven, 2 / frame.step_s * (ran.edges[:-1] - ran.means).T])
        driving = np.vstack([phi.T, np.ones(len(phi))])  # the last: what is constant
        old, new = (np.array(rows) for rows in zip(*((c.old[some], c.new[some]) for c in cuts), strict=True))
        found = [_means(old, new, length, shown) for shown in columns.through(ran, heats[heat] * driving[feature])]
        yield np.concatenate(found, axis=2)[:, :, : len(places)]


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _means(old: Floats, new: Floats, length: int, shown: Floats) -> Floats:
    """The means (B, m, W) over blocks of `length` steps, of readings `shown` (m, K + 1 or more, W) by the weights `old`
    and `new` (m, K) of each step's start and end."""
    found = np.zeros((old.shape[1] // length, len(shown), shown.shape[2]))
    for r in range(len(shown)):
        for k in range(old.shape[1]):
            first, last = old[r, k], new[r, k]
            for c in range(shown.shape[2]):
                found[k // length, r, c] += first * shown[r, k, c] + last * shown[r, k + 1, c]
    return found


def _loads(shape: Structure, places: Sequence[int]) -> tuple[Index, Index, Loads]:
    """What each of the columns at `places` brings into nodes. Its heat is one of a list: psi of every group, then
    what 1 J/K of each node takes up; its feature is a monomial, or behind these the constant 1."""
    size, groups = sum(len(group.terms) for group in shape.groups), list(enumerate(shape.groups))
    own = [
        (i, g, shape.monomials if j == CONSTANT else j, group.a, group.taken_from(shape.n))
        for g, group in groups
        for i, j in group.terms
    ]
    own += [(size + node, len(groups) + node, shape.monomials, node, NOBODY) for node in range(shape.n)]
    column = {place: c for c, place in enumerate(places)}
    found = [(heat, feature, a, b, column[place]) for place, heat, feature, a, b in own if place in column]
    heat, feature, a, b, of = np.array(found, dtype=np.int64).reshape(-1, 5).T
    return heat, feature, Loads(a, b, of)
