"""The network as data: nodes, boundaries, links and sources, every law linear in its coefficients.

The state is the temperature of each node [degC]; `C dT/dt = sum_links G (T_other - T) + P` (paper Eq. 1-4, reduced
form). A conductance [W/K] or a loss [W] is a sum of terms, `coefficient * product of features ** exponent`, times the
optional factors of the term. A circuit is fluid that flows through nodes in order and carries heat one way.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

LOADS = {"current": "A", "torque": "Nm"}  # how hard a motor works: what is known of it first, and its unit
NOBODY = -1  # the index of no node: of a source's other end, of the node of a temperature factor that is not there


@dataclass(frozen=True)
class TemperatureFactor:
    """Multiply by `1 + slope_per_K * (T_node - reference_degC)`."""

    node: str
    slope_per_K: float
    reference_degC: float


MOST_CURRENT = 1.5  # in units of the scale: short peaks go beyond 1, and up to this a loss must keep its sign
LEAST_FACTOR = 0.05  # of a loss that is left where a calibration lets it fall


@dataclass(frozen=True)
class Shape:
    """Multiply by `1 + sum_k hat_k(speed) (factor_k + current_slope_k current)`, features dimensionless.

    `hat_k` are the tent functions over the rising knots `speed`, 1 at their own knot and 0 at the others, the outermost
    constant beyond the ends: between knots the deviations are interpolated, and 0 changes nothing. Losses only.
    """

    speed: tuple[float, ...]
    factor: tuple[float, ...]
    current_slope: tuple[float, ...]

    @staticmethod
    def least_slope(factor: float) -> float:
        """The least slope beside a factor at which `LEAST_FACTOR` of a loss is left up to `MOST_CURRENT`."""
        return (LEAST_FACTOR - 1 - factor) / MOST_CURRENT


@dataclass(frozen=True)
class Map:
    """Multiply by a table over speed and a load, the torque or the current (`over`), all dimensionless: `values[i][j]`
    at `speed[i]`, `load[j]`, rising knots. Speed and current are magnitudes. Torque is negative while the motor brakes
    where its knots begin below 0, a magnitude else. Bilinear between the knots, constant beyond the outermost."""

    speed: tuple[float, ...]
    load: tuple[float, ...]
    values: tuple[tuple[float, ...], ...]
    over: str = "torque"


@dataclass(frozen=True)
class Term:
    """`coefficient` [W/K in a link, W in a source] times each feature to its exponent, times the optional factors."""

    coefficient: float
    exponents: Mapping[str, float] = field(default_factory=dict)  # feature -> exponent, features dimensionless
    sd: float = 0.4  # prior standard deviation of ln coefficient
    copper: bool = False  # times 1 + alpha (T_node - reference)
    resistance: int = 0  # -1: divided by the same factor
    temperature: TemperatureFactor | None = None
    shape: Shape | Map | None = None
    law: str | None = None  # of a link: one of `twin.motor.heat_laws.NAMED`; None: the difference itself


@dataclass(frozen=True)
class Node:
    """A lump of the motor: `capacity` [J/K], with `sd` the prior standard deviation of its logarithm; `limit_degC`
    that it must not pass, None for none. `along`, `radius`: where it is drawn in the motor's cut, from and to: along
    the shaft, the stack from -1 to 1, and outwards from 0 to 1; None where its name and region say it."""

    name: str
    capacity: float  # J/K
    region: str
    sd: float = 0.15
    limit_degC: float | None = None
    along: tuple[float, float] | None = None
    radius: tuple[float, float] | None = None


@dataclass(frozen=True)
class Boundary:
    """A temperature that is given: a coolant, the air."""

    name: str


@dataclass(frozen=True)
class Link:
    """A conductance [W/K] between two places, each a node or a boundary: the sum of its terms."""

    a: str  # node or boundary
    b: str
    terms: tuple[Term, ...]


@dataclass(frozen=True)
class Source:
    """A loss [W] in a node: the sum of its terms."""

    node: str
    terms: tuple[Term, ...]


@dataclass(frozen=True)
class Property:
    """A property of a fluid over its temperature: `value` at the rising `degC`, linear between, constant beyond the
    ends. One entry is a constant."""

    degC: tuple[float, ...]
    value: tuple[float, ...]

    def at(self, degC: float) -> float:
        """The value at a temperature [degC]."""
        return float(np.interp(degC, self.degC, self.value))


@dataclass(frozen=True)
class Fluid:
    """What a circuit carries."""

    density: Property  # kg/m3
    heat_capacity: Property  # J/(kg K)

    def at(self, degC: float) -> float:
        """Heat capacity of a volume [J/(m3 K)]."""
        return self.density.at(degC) * self.heat_capacity.at(degC)


@dataclass(frozen=True)
class FluidCircuit:
    """Fluid from the boundary `inlet` through `nodes` in order: node i takes rho cp V (T_{i-1} - T_i), the first from
    the inlet.

    `flow`: the feature of the volume flow V, a magnitude: a flow that reverses goes the same way round. rho cp is
    that of the fluid that comes, at the temperature T_{i-1}.
    """

    name: str
    inlet: str
    nodes: tuple[str, ...]
    fluid: Fluid
    flow: str = "flow"


@dataclass(frozen=True)
class Copper:
    """The resistance of copper grows by `1 + alpha_per_K * (T - reference_degC)`."""

    alpha_per_K: float = 0.00393
    reference_degC: float = 20.0


@dataclass(frozen=True)
class Configuration:
    """Another rig of the same motor (`twin.motor.configured`): `remove` names nodes and boundaries; links and sources
    replace those of the same place, or are added."""

    name: str
    remove: tuple[str, ...] = ()
    links: tuple[Link, ...] = ()
    sources: tuple[Source, ...] = ()


@dataclass(frozen=True)
class Network:
    """A motor. `scale`: feature quantity -> what 1 means, in the stored unit ({"speed": 16000.0, "current": 450.0})."""

    name: str
    nodes: tuple[Node, ...]
    boundaries: tuple[Boundary, ...]
    links: tuple[Link, ...]
    sources: tuple[Source, ...]
    copper: Copper = field(default_factory=Copper)
    scale: Mapping[str, float] = field(default_factory=dict)
    circuits: tuple[FluidCircuit, ...] = ()
    configurations: tuple[Configuration, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Nodes, then boundaries: the order of every index of a temperature."""
        return (*(node.name for node in self.nodes), *(boundary.name for boundary in self.boundaries))
