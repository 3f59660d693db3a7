"""What every coefficient, capacity and initial temperature does to what thermometers read in an open-loop run, block
by block.

All columns go through the run once, side by side (`twin.run.sparse_march`): the derivatives of the discrete scheme of
`twin.fitting.march` itself, for a network of any size, with nothing compiled a motor. They come a few blocks at a
time, so that the memory that they need does not grow with the run; whoever takes them sums them up. A candidate is a
term whose coefficient is 0: its column is what it would bring.

`twin.fitting.responses` goes backwards, for few sensors and many kinds of parameters; the derivatives of one number
by everything are a task for `twin.run.gradients`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.lanes import width
from twin.arithmetic.vectors import LANES
from twin.compiled.laid_out import laid_out
from twin.compiled.laws import psi
from twin.compiled.structure import CONSTANT, Structure
from twin.errors import DivergedError
from twin.motor import features
from twin.motor.network import Network
from twin.motor.outputs import Blocks, blocks, lag_factors
from twin.run import sparse_march
from twin.run.simulate import Frame, check_frame
from twin.run.sparse_march import STRIP

Floats = NDArray[np.float64]

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
    affine = all(law.affine for law in laws)
    storage, size = 2 * values.capacities / frame.step_s, len(values.coefficients)
    places = range(size + 2 * shape.n) if wanted is None else wanted
    begin = _at_start(shape.n, [place - size - shape.n for place in places])
    length = thermometers[0].blocks.length
    sensors, loads = _sensors(thermometers, frame.step_s), _loads(shape, places, begin.shape[2])
    of_block = length * (shape.n + 2 * len(program.edge_to)) + len(thermometers) * len(places)
    blocks_at_once = max(1, min(HELD // of_block, len(frame.features) // length))
    plan, numbers, indices, weighed = sparse_march.planned(
        program, storage, sensors, blocks_at_once * length, blocks_at_once, begin
    )
    sensor, weight = weighed[:, 0].astype(np.int64), -weighed[:, 1]
    now = np.array(initial, dtype=np.float64)
    whole = len(frame.features) // length * length
    for first in range(0, whole, blocks_at_once * length):
        some = slice(first, min(first + blocks_at_once * length, whole))
        steps = some.stop - first
        shares = numbers[plan.shares : plan.shares + steps * plan.size].reshape(steps, plan.size)
        mean, rise = np.empty((steps, shape.n)), np.empty((steps, shape.n))
        sparse_march.run(
            program, affine, storage, values.coefficients, values.copper, values.factors,
            _in_lanes(frame.features[some]), _in_lanes(frame.boundaries[some]), now, shares, mean, rise,
        )  # fmt: skip
        if not (np.abs(now) < 1e4).all():
            raise DivergedError("temperatures run away: a loss grows faster with temperature than its links carry away")
        driven, _ = psi(table, mean, frame.boundaries[some])
        heats = np.concatenate([driven, -2 / frame.step_s * rise.T])
        driving = np.vstack([frame.features[some].T, np.ones(steps)])  # the last: what is constant
        begins, ends = _weights_of_edges([one.blocks for one in thermometers], some)
        for first_of, weights in ((plan.begins, begins), (plan.weights, ends)):
            taken = weights[:, sensor] * weight
            numbers[first_of : first_of + taken.size] = taken.ravel()
        means = np.empty((steps // length, len(thermometers), *begin.shape[1:]))
        sparse_march.carry(plan, numbers, indices, loads, heats, driving, length, means)
        yield means.reshape(*means.shape[:2], -1)[:, :, : len(places)]


def _weights_of_edges(cuts: Sequence[Blocks], some: slice) -> tuple[Floats, Floats]:
    """The weights of readings in the means of blocks: (B, m) of those at the start of each block, (K, m) of those at
    the end of each of some steps. An edge within a block is the end of one step and the start of the next."""
    old, new = (np.array(rows) for rows in zip(*((cut.old[some], cut.new[some]) for cut in cuts), strict=True))
    begins, ends = (rows.reshape(len(cuts), -1, cuts[0].length) for rows in (old, new))
    ends[:, :, :-1] += begins[:, :, 1:]
    return begins[:, :, 0].T, new.T


def _in_lanes(rows: Floats) -> Floats:
    """Rows (N, m) as (N / LANES, m, LANES); the last row again where there are too few of them."""
    full = np.concatenate([rows, np.repeat(rows[-1:], -len(rows) % LANES, axis=0)])
    return np.ascontiguousarray(full.reshape(len(full) // LANES, LANES, rows.shape[1]).transpose(0, 2, 1))


def _at_start(n: int, nodes: Sequence[int]) -> Floats:
    """The columns at the start of the run, (n, S, W) in S strips of W: 1 at the node whose initial temperature a
    column is. `nodes`: that node of each column, below 0 where it is something else."""
    strips = -(-len(nodes) // STRIP)
    found = np.zeros((n, strips, width(-(-len(nodes) // strips))))
    for column, node in enumerate(nodes):
        if node >= 0:
            found[node].flat[column] = 1.0
    return found


def _sensors(thermometers: Sequence[Thermometer], step_s: float) -> sparse_march.Sensors:
    taus = [one.time_constant_s for one in thermometers]
    nodes = [np.flatnonzero(one.weights) for one in thermometers]
    return sparse_march.Sensors(
        [own.tolist() for own in nodes],
        [one.weights[own].tolist() for one, own in zip(thermometers, nodes, strict=True)],
        [lag_factors(tau, step_s) if tau > 0 else (0.0, 0.0, 1.0) for tau in taus],
    )


def _loads(shape: Structure, places: Sequence[int], wide: int) -> sparse_march.Loads:
    """What each of the columns at `places` brings into nodes. Its heat is one of a list: psi of every group, then
    what 1 J/K of each node takes up; its feature is a monomial, or behind these the constant 1."""
    size, column = sum(len(group.terms) for group in shape.groups), {place: c for c, place in enumerate(places)}
    found = []  # strip, place, heat, feature, sign

    def add(parameter: int, node: int, heat: int, feature: int, sign: int) -> None:
        if parameter in column:
            strip, c = divmod(column[parameter], wide)
            found.append((strip, wide * node + c, heat, feature, sign))

    for g, group in enumerate(shape.groups):
        for i, j in group.terms:
            feature = shape.monomials if j == CONSTANT else j
            add(i, group.a, g, feature, 1)
            if 0 <= group.b < shape.n and not group.one_way:
                add(i, group.b, g, feature, -1)
    for node in range(shape.n):
        add(size + node, node, len(shape.groups) + node, shape.monomials, 1)
    rows = np.array(sorted(found), dtype=np.int64).reshape(-1, 5)
    start = np.searchsorted(rows[:, 0], np.arange(-(-len(places) // wide) + 1))
    place, heat, product = np.ascontiguousarray(rows[:, 1:4].T)
    return sparse_march.Loads(start, place, heat, product, rows[:, 4].astype(np.float64))
