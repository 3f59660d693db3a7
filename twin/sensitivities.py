"""Forward sensitivities: what every output would change by if a parameter did, for all parameters in one pass.

The columns are the exact derivative of the discrete scheme (`twin.codegen_columns`), read through each sensor's lag and
averaged over blocks as the measurement is; their trajectory is never stored. A parameter of a term that the network does
not have is that term at zero: its column is the response to 1 W or 1 W/K.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import features
from twin.codegen_columns import TILE, copper_nodes, generate, places
from twin.errors import FrameError
from twin.integrators import DEFAULT, Tableau
from twin.kernel import Load, load_in_memory
from twin.network import Network, TemperatureFactor
from twin.outputs import Blocks, Output, blocks, lag_factors
from twin.simulate import Frame, check_finite, check_frame
from twin.structure import NOBODY, Parameters, Structure, parameters, structure

Floats = NDArray[np.float64]
CONSTANT = "constant"
ONE = 0  # the place of 1 in a stage's state


@dataclass(frozen=True)
class LogCoefficient:
    """ln of the magnitude of a term's coefficient; `term`: its place in `features.terms`."""

    term: int


@dataclass(frozen=True)
class Modulation:
    """A term's product of features phi becomes phi + p * `feature`: with phi ln(speed) its exponent, with a hat its map."""

    term: int
    feature: str


@dataclass(frozen=True)
class LogCapacity:
    """ln of a node's heat capacity."""

    node: str


@dataclass(frozen=True)
class InitialTemperature:
    """A node's temperature at the start [K]."""

    node: str


@dataclass(frozen=True)
class BoundaryBias:
    """A boundary is p * `feature` [K] hotter than the frame says."""

    boundary: str
    feature: str = CONSTANT


@dataclass(frozen=True)
class Heat:
    """p [W] * `feature` into a node, times its temperature factor, or divided by its copper's resistance factor."""

    node: str
    feature: str = CONSTANT
    temperature: TemperatureFactor | None = None
    resistance: bool = False


@dataclass(frozen=True)
class Conductance:
    """p [W/K] * `feature` between any node and any other node or boundary."""

    a: str
    b: str
    feature: str = CONSTANT


Parameter = LogCoefficient | Modulation | LogCapacity | InitialTemperature | BoundaryBias | Heat | Conductance


@dataclass(frozen=True)
class ColumnKernel:
    """A network whose sensitivities are compiled; its values may change between runs, its topology not."""

    network: Network
    structure: Structure
    tableau: Tableau
    run: Callable[..., None]


@dataclass(frozen=True)
class Sensitivities:
    """`temperatures` (N + 1, n) [degC], the bits of `simulate`; `columns`: per output (B, P), d(block mean)/dp."""

    temperatures: Floats
    columns: tuple[Floats, ...]


@dataclass(frozen=True)
class _Item:
    """`scale * feature * state[place]` [W] into node `into` and, where it is one, out of node `out_of`."""

    place: int
    into: int
    out_of: int = NOBODY
    feature: str = CONSTANT
    scale: float = 1.0


def compile_columns(network: Network, load: Load = load_in_memory) -> ColumnKernel:
    """Compile the columns kernel of a checked network; `load` as in `twin.kernel.compile_network`.

    Straight-line code for any size: some 15 s for 21 nodes the first time, minutes above 40.
    """
    indices = structure(network)
    return ColumnKernel(network, indices, DEFAULT, load(generate(indices, DEFAULT)))


def own_parameters(network: Network) -> tuple[Parameter, ...]:
    """What calibration estimates of a motor: every coefficient, then every capacity."""
    coefficients = [LogCoefficient(i) for i, _ in enumerate(features.terms(network))]
    return (*coefficients, *(LogCapacity(node.name) for node in network.nodes))


def sensitivities(
    kernel: ColumnKernel,
    frame: Frame,
    initial: Floats,
    wanted: Sequence[Parameter],
    outputs: Sequence[Output],
    values: Parameters | None = None,
    extra: Mapping[str, Floats] | None = None,
) -> Sensitivities:
    """One run with `values` (default: the network's own) and its columns, one a parameter, as block means of each output.

    `extra`: features that the network does not use, by the name that parameters give them, (N,) means over the steps.
    Raises `FrameError` as `simulate`, or where a parameter names what is not there; `DivergedError` as `simulate`.
    """
    network = kernel.network
    check_frame(network, frame, initial)
    values = parameters(network) if values is None else values
    table = _Table(kernel, values)
    temperatures = np.empty((len(frame.features) + 1, len(network.nodes)))
    temperatures[0] = initial
    columns = _initial_columns(table, wanted)
    cut = [blocks(output, frame.step_s) for output in outputs]
    forcing = _forcing(table, frame, wanted, extra or {})
    means, observing = _observing(table, frame, outputs, cut, columns)
    kernel.run(
        np.ascontiguousarray(frame.features, dtype=np.float64),
        np.ascontiguousarray(frame.boundaries, dtype=np.float64),
        float(frame.step_s),
        values.coefficients,
        values.capacities,
        values.copper,
        values.factors,
        temperatures,
        *forcing,
        *_scratch(kernel, frame, columns, len(forcing[1])),
        *observing,
        means,
    )
    check_finite(network, frame, temperatures)
    flat = means.reshape(*means.shape[:2], columns.shape[0] * TILE)
    return Sensitivities(temperatures, tuple(flat[o, c.there, : len(wanted)] for o, c in enumerate(cut)))


class _Table:
    """Parameters as items: where each puts its heat, and what of the stage's state that heat follows."""

    def __init__(self, kernel: ColumnKernel, values: Parameters) -> None:
        self.kernel = kernel
        self.values = values
        self.at = places(kernel.structure)
        self.n = len(kernel.network.nodes)
        self._index = {name: i for i, name in enumerate(kernel.network.names)}
        self._terms = [features.monomial(term).name for term in features.terms(kernel.network)]
        self._group = {i: g for g, group in enumerate(kernel.structure.groups) for i, _ in group.terms}

    def place(self, name: str) -> int:
        """A node, or n + boundary. Raises `FrameError` where there is neither."""
        if name not in self._index:
            raise FrameError(
                f'network "{self.kernel.network.name}" has no node or boundary "{name}": name one that it has'
            )
        return self._index[name]

    def items(self, parameter: Parameter) -> Iterator[_Item]:
        """The heat that a parameter itself adds, at one unit of it."""
        match parameter:
            case LogCoefficient(term):
                yield self._term(term, None)
            case Modulation(term, feature):
                yield self._term(term, feature)
            case LogCapacity(node):
                yield _Item(self.at.charge + self.place(node), self.place(node))
            case BoundaryBias(boundary, feature):
                for g, group in enumerate(self.kernel.structure.groups):
                    if group.b == self.place(boundary):
                        yield _Item(self.at.bias + g, group.a, feature=feature)
            case Heat():
                yield from self._heat(parameter)
            case Conductance():
                yield from self._conductance(parameter)

    def _term(self, term: int, feature: str | None) -> _Item:
        """`feature`: None for the term's own product."""
        if term not in self._group:
            raise FrameError(f'network "{self.kernel.network.name}" has no term {term}: count from 0, links first')
        g = self._group[term]
        group, scale = self.kernel.structure.groups[g], float(self.values.coefficients[term])
        out_of = group.b if group.b < self.n else NOBODY
        return _Item(self.at.group + g, group.a, out_of, feature or self._terms[term], scale)

    def _heat(self, heat: Heat) -> Iterator[_Item]:
        node = self.place(heat.node)
        if heat.resistance:
            if node not in copper_nodes(self.kernel.structure):
                raise FrameError(f'node "{heat.node}" has no loss in copper: its resistance is not known')
            yield _Item(self.at.resistance + node, node, feature=heat.feature)
            return
        factor = heat.temperature
        if factor is None:
            yield _Item(ONE, node, feature=heat.feature)
            return
        yield _Item(ONE, node, feature=heat.feature, scale=1.0 - factor.slope_per_K * factor.reference_degC)
        other = self.at.node + self.place(factor.node)
        yield _Item(other, node, feature=heat.feature, scale=factor.slope_per_K)

    def _conductance(self, link: Conductance) -> Iterator[_Item]:
        a, b = sorted((self.place(link.a), self.place(link.b)))
        out_of = b if b < self.n else NOBODY
        far = self.at.node + b if b < self.n else self.at.boundary + b - self.n
        yield _Item(far, a, out_of, link.feature)
        yield _Item(self.at.node + a, a, out_of, link.feature, scale=-1.0)


def _initial_columns(table: _Table, wanted: Sequence[Parameter]) -> Floats:
    """dT/dp at the start (tiles, n TILE)."""
    columns = np.zeros((-(-len(wanted) // TILE), table.n * TILE))
    for c, parameter in enumerate(wanted):
        if isinstance(parameter, InitialTemperature):
            columns[c // TILE, table.place(parameter.node) * TILE + c % TILE] = 1.0
    return columns


def _forcing(
    table: _Table, frame: Frame, wanted: Sequence[Parameter], extra: Mapping[str, Floats]
) -> tuple[NDArray[Any], ...]:
    """The arguments of `run` from `forcing` to `out_of_K`."""
    items = [(c, item) for c, parameter in enumerate(wanted) for item in table.items(parameter)]
    own = [monomial.name for monomial in features.monomials(table.kernel.network)]
    known = {CONSTANT: np.ones(len(frame.features))} | dict(zip(own, frame.features.T, strict=True)) | dict(extra)
    names = list(dict.fromkeys(item.feature for _, item in items))
    if lost := [name for name in names if name not in known]:
        raise FrameError(f'feature "{lost[0]}" is neither of the network nor given: there are {", ".join(known)}')
    forcing = np.stack([known[name] for name in names], axis=1) if names else np.empty((len(frame.features), 0))
    inverse = np.append(table.kernel.tableau.gamma * frame.step_s / table.values.capacities, 0.0)  # the last: nobody's

    def position(column: int, node: int) -> int:
        return (column // TILE * table.n + max(node, 0)) * TILE + column % TILE

    return (
        np.ascontiguousarray(forcing, dtype=np.float64),
        _position([names.index(item.feature) for _, item in items]),
        np.array([item.scale for _, item in items], dtype=np.float64),
        _position([item.place for _, item in items]),
        _position([position(c, item.into) for c, item in items]),
        inverse[_index([item.into for _, item in items])],
        _position([position(c, item.out_of) for c, item in items]),
        inverse[_index([item.out_of for _, item in items])],
    )


def _scratch(kernel: ColumnKernel, frame: Frame, columns: Floats, items: int) -> tuple[Floats, ...]:
    """`state`, `amount`, `values`, `columns`, `stages`, `held`."""
    indices, stages = kernel.structure, len(kernel.tableau.b)
    factors = 2 * indices.n + 2 * indices.pattern.entries + 6 * stages * len(indices.groups)
    return (
        np.zeros((stages, places(indices).boundary + frame.boundaries.shape[1])),
        np.empty(items),
        np.empty(factors),
        columns,
        np.empty((stages - 1, *columns.shape)),
        np.empty(columns.shape),
    )


def _observing(
    table: _Table, frame: Frame, outputs: Sequence[Output], cut: Sequence[Blocks], columns: Floats
) -> tuple[Floats, tuple[NDArray[Any], ...]]:
    """`means`, and the arguments of `run` from `visits` to `lagged`."""
    steps, tiles = len(frame.features), len(columns)
    block = np.arange(steps) // (cut[0].length if cut else 1)
    old, new = (np.zeros((steps, len(outputs))) for _ in range(2))
    lag = np.zeros((len(outputs), 3))
    lagged = np.zeros((2, len(outputs), tiles, TILE))
    for o, output in enumerate(outputs):
        old[:, o], new[:, o] = cut[o].old, cut[o].new
        if output.time_constant_s > 0:
            lag[o] = lag_factors(output.time_constant_s, frame.step_s)
        for name, weight in output.weights.items():
            lagged[:, o] += weight * columns[:, table.place(name) * TILE :][:, :TILE]
    inside = np.append(block[1:] == block[:-1], False)  # an edge within a block is visited once
    new[inside] += old[np.flatnonzero(inside) + 1]
    old[np.flatnonzero(inside) + 1] = 0.0
    shares = [(table.place(name), weight) for output in outputs for name, weight in output.weights.items()]
    start = np.cumsum([0, *(len(output.weights) for output in outputs)])
    means = np.zeros((len(outputs), int(block[-1]) + 1 if steps else 0, tiles, TILE))
    node, share = _index([at for at, _ in shares]), np.array([weight for _, weight in shares], dtype=np.float64)
    visits = np.stack([old.any(axis=1), new.any(axis=1)], axis=1)
    return means, (visits, block, old, new, _index(start), node, share, lag, lagged)


def _position(values: Any) -> NDArray[np.uint64]:
    """Unsigned, so that compiled code need not look for indices that count from the end."""
    return np.array(values, dtype=np.uint64)


def _index(values: Any) -> NDArray[np.int64]:
    return np.array(values, dtype=np.int64)
