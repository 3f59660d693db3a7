"""The network as data: nodes, boundaries, links and sources, every law linear in its coefficients.

The state is the temperature of each node [degC]; `C dT/dt = sum_links G (T_other - T) + P` (paper Eq. 1-4, reduced form).
A conductance [W/K] or a loss [W] is a sum of terms, `coefficient * product of features ** exponent`, times the optional
factors of the term.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class TemperatureFactor:
    """Multiply by `1 + slope_per_K * (T_node - reference_degC)`."""

    node: str
    slope_per_K: float
    reference_degC: float


@dataclass(frozen=True)
class Shape:
    """Multiply by `1 + sum_k hat_k(speed) (factor_k + current_slope_k current)`, features dimensionless.

    `hat_k` are the tent functions over the rising knots `speed`, 1 at their own knot and 0 at the others, the outermost
    constant beyond the ends: between knots the deviations are interpolated, and 0 changes nothing. Losses only.
    """

    speed: tuple[float, ...]
    factor: tuple[float, ...]
    current_slope: tuple[float, ...]


@dataclass(frozen=True)
class Term:
    """`coefficient` [W/K in a link, W in a source] times each feature to its exponent, times the optional factors."""

    coefficient: float
    exponents: Mapping[str, float] = field(default_factory=dict)  # feature -> exponent, features dimensionless
    sd: float = 0.4  # prior standard deviation of ln coefficient
    copper: bool = False  # times 1 + alpha (T_node - reference)
    resistance: int = 0  # -1: divided by the same factor
    temperature: TemperatureFactor | None = None
    shape: Shape | None = None


@dataclass(frozen=True)
class Node:
    name: str
    capacity: float  # J/K
    region: str
    sd: float = 0.15
    limit_degC: float | None = None


@dataclass(frozen=True)
class Boundary:
    name: str


@dataclass(frozen=True)
class Link:
    a: str  # node or boundary
    b: str
    terms: tuple[Term, ...]


@dataclass(frozen=True)
class Source:
    node: str
    terms: tuple[Term, ...]


@dataclass(frozen=True)
class Copper:
    alpha_per_K: float = 0.00393
    reference_degC: float = 20.0


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

    @property
    def names(self) -> tuple[str, ...]:
        """Nodes, then boundaries: the order of every index of a temperature."""
        return (*(node.name for node in self.nodes), *(boundary.name for boundary in self.boundaries))
