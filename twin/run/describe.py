"""A network in numbers: size, heat capacity, time constants, and where its losses would turn negative."""

from __future__ import annotations

import itertools
import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.compiled.kernel import STATEMENTS, generate, statements
from twin.motor import features
from twin.motor.configured import configured
from twin.motor.network import LOADS, Configuration, FluidCircuit, Map, Network, Source, Term
from twin.run.initial import conductances

_GRID = np.linspace(0.0, 1.0, 11)


@dataclass(frozen=True)
class Description:
    """What a network is. Time constants [s] are the slowest and fastest mode with the boundaries held, losses aside,
    at all features 0 (`at_rest`) and all features 1 (`at_full`); `unknowns`: coefficients and capacities. `circuits`,
    `laws`, `maps` and `configurations` are in words, one entry each.
    """

    name: str
    nodes: int
    boundaries: int
    links: int
    sources: int
    coefficients: int
    unknowns: int
    features: tuple[str, ...]
    capacity_J_per_K: float
    at_rest_s: tuple[float, float]
    at_full_s: tuple[float, float]
    statements: int
    kernel: str
    circuits: tuple[str, ...]
    laws: tuple[str, ...]
    maps: tuple[str, ...]
    configurations: tuple[str, ...]
    warnings: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """The same for JSON: an infinite time constant is null."""
        values = asdict(self)
        for key in ("at_rest_s", "at_full_s"):
            values[key] = [None if math.isinf(constant) else constant for constant in values[key]]
        return values

    def text(self) -> str:
        """Lines for a person."""
        lines = [
            f"{self.name}: {_counts(self.nodes, self.boundaries, self.links, self.sources)}",
            (
                f"coefficients   {self.coefficients}; with {_count(self.nodes, 'capacity')} "
                f"{_count(self.unknowns, 'unknown')}"
            ),
            f"features       {', '.join(self.features) or 'none'}",
            f"heat capacity  {self.capacity_J_per_K:,.0f} J/K",
            f"time constants {_span(self.at_rest_s)} at rest, {_span(self.at_full_s)} with all features at 1",
            f"kernel         {self.kernel}, {self.statements} statements a step",
        ]
        more = (
            ("circuit", self.circuits),
            ("law", self.laws),
            ("map", self.maps),
            ("configuration", self.configurations),
        )
        lines += [f"{kind:<14} {entry}" for kind, entries in more for entry in entries]
        return "\n".join([*lines, *(f"warning: {warning}" for warning in self.warnings)])


def _span(constants: tuple[float, float]) -> str:
    slowest, fastest = ("without end" if math.isinf(c) else f"{_three_digits(c)} s" for c in constants)
    return f"{slowest} to {fastest}"


def _three_digits(value: float) -> str:
    """ "1,260", "52.7": three digits count, thousands are written out."""
    return f"{float(f'{value:.3g}'):,.12g}"


def _count(number: int, what: str) -> str:
    """ "1 boundary", "2 boundaries"."""
    several = f"{what[:-1]}ies" if what.endswith("y") else f"{what}s"
    return f"{number:,} {what if number == 1 else several}"


def _counts(*numbers: int) -> str:
    """ "3 nodes, 1 boundary, 3 links, 2 sources"."""
    kinds = ("node", "boundary", "link", "source")
    return ", ".join(_count(number, what) for number, what in zip(numbers, kinds, strict=True))


def describe(network: Network) -> Description:
    """The description of a checked network."""
    monomials = features.monomials(network)
    source = statements(generate(network))
    coefficients = sum(1 for _ in features.terms(network))
    used = tuple(dict.fromkeys(f for m in monomials for f in m.features))
    rest, full = (features.evaluate(monomials, dict.fromkeys(used, np.array([value])), 1)[0] for value in (0.0, 1.0))
    return Description(
        name=network.name,
        nodes=len(network.nodes),
        boundaries=len(network.boundaries),
        links=len(network.links),
        sources=len(network.sources),
        coefficients=coefficients,
        unknowns=coefficients + len(network.nodes),
        features=used,
        capacity_J_per_K=sum(node.capacity for node in network.nodes),
        at_rest_s=_time_constants(network, rest),
        at_full_s=_time_constants(network, full),
        statements=source,
        kernel="straight-line" if source <= STATEMENTS else "indexed",
        circuits=tuple(_circuit(network, circuit) for circuit in network.circuits),
        laws=tuple(f"{term.law} {place}" for place, term in features.placed_terms(network) if term.law is not None),
        maps=tuple(
            _map(network, place, t.shape) for place, t in features.placed_terms(network) if isinstance(t.shape, Map)
        ),
        configurations=tuple(_configuration(network, one) for one in network.configurations),
        warnings=tuple(warning for s in network.sources for warning in _negative(s)),
    )


def _circuit(network: Network, circuit: FluidCircuit) -> str:
    lpm = features.scale(network, circuit.flow)
    carried = circuit.fluid.at(features.STREAM_DEGC) * lpm / features.LPM_PER_M3_PER_S
    path = " > ".join((circuit.inlet, *circuit.nodes))
    at = f"{lpm:g} l/min of {features.STREAM_DEGC:g} degC"
    return f"{circuit.name}: {path}, {_three_digits(carried)} W/K at {at}"


def _map(network: Network, place: str, table: Map) -> str:
    speed, load = network.scale["speed"], network.scale[table.over]
    over = f"{table.speed[0] * speed:g} to {table.speed[-1] * speed:g} rpm"
    return f"{place}: {over}, {table.load[0] * load:g} to {table.load[-1] * load:g} {LOADS[table.over]}"


def _configuration(network: Network, one: Configuration) -> str:
    there = configured(network, one.name)
    counts = _counts(len(there.nodes), len(there.boundaries), len(there.links), len(there.sources))
    return f"{one.name}: {counts}" + (f", without {', '.join(one.remove)}" if one.remove else "")


def _time_constants(network: Network, features_row: NDArray[np.float64]) -> tuple[float, float]:
    """Slowest and fastest mode [s] of C dT/dt = -L T; infinite where a part is cut off at these features."""
    n = len(network.nodes)
    conductance = conductances(network, features_row)
    balance = (np.diag(conductance.sum(axis=1)) - conductance)[:n, :n]
    root = np.sqrt([node.capacity for node in network.nodes])
    rates = np.linalg.eigvals(balance / np.outer(root, root)).real  # similar to C^-1 L, and symmetric but for circuits
    slowest, fastest = float(rates.min()), float(rates.max())
    return (1 / slowest if slowest > 1e-12 * fastest else math.inf, 1 / fastest if fastest > 0 else math.inf)


def _adds(term: Term) -> bool:
    """Whether a loss is nowhere below 0."""
    falls = isinstance(term.shape, Map) and min(map(min, term.shape.values)) < 0
    return term.coefficient > 0 and not falls


def _negative(source: Source) -> list[str]:
    """A warning where the node's summed loss falls below zero for features within 0..1, factors of temperature
    aside."""
    used = sorted({f for term in source.terms for f in features.monomial(term).features})
    if all(_adds(term) for term in source.terms) or len(used) > 4:
        return []
    lowest, where = 0.0, ""
    for point in itertools.product(_GRID, repeat=len(used)):
        u = {f: np.array([value]) for f, value in zip(used, point, strict=True)}
        phi = [features.evaluate((features.monomial(term),), u, 1)[0, 0] for term in source.terms]
        loss = float(sum(term.coefficient * value for term, value in zip(source.terms, phi, strict=True)))
        if loss < lowest - 1e-9:
            lowest, where = loss, ", ".join(f"{f} {value:.1f}" for f, value in zip(used, point, strict=True))
    return (
        [f'the summed loss of "{source.node}" falls to {lowest:.3g} W at {where}: a negative loss cools']
        if where
        else []
    )
