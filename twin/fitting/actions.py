"""What one number can do to a modelled test: the vocabulary of healthy differences and of candidate causes alike."""

from __future__ import annotations

from dataclasses import dataclass

from twin.motor.network import NOBODY
from twin.motor.sensor_laws import Lag, Misreading

Terms = tuple[int, ...]  # places in `features.terms`


@dataclass(frozen=True)
class Scale:
    """The terms times exp(p)."""

    terms: Terms


@dataclass(frozen=True)
class Power:
    """The terms times the feature to the power p."""

    terms: Terms
    feature: str


@dataclass(frozen=True)
class Tent:
    """The terms times 1 + p hat(speed) [current], hat the tent on knot `knot` of `speeds` (dimensionless)."""

    terms: Terms
    speeds: tuple[float, ...]
    knot: int
    current: bool


@dataclass(frozen=True)
class Course:
    """The terms times exp(p f), f one number a test: the count of its kind so far (`session`) or a dose in 100 h."""

    terms: Terms
    by: str


@dataclass(frozen=True)
class InputGain:
    """An input reads exp(p) times the truth: (1 + p) times, as a bench file says it, to first order."""

    name: str


@dataclass(frozen=True)
class InputBias:
    """An input reads p [its stored unit] too much."""

    name: str
    scale: float


@dataclass(frozen=True)
class Place:
    """A node, or two ends of a link: indices as in `Network.names`."""

    a: int
    b: int = NOBODY


@dataclass(frozen=True)
class Added:
    """p [W or W/K] * feature / rms at every place; `own`: the heat goes with copper (+1) or its inverse (-1)."""

    places: tuple[Place, ...]
    feature: str
    rms: float
    own: int = 0


@dataclass(frozen=True)
class Tilt:
    """To the terms, all at one of `places`, comes p (T - reference) times what they carry without copper's and their
    own temperature factor; T of the node, or the mean of the link's ends."""

    places: tuple[Place, ...]
    terms: tuple[Terms, ...]
    references: tuple[float, ...]


@dataclass(frozen=True)
class Capacity:
    """The nodes' capacities times exp(p)."""

    nodes: tuple[int, ...]


@dataclass(frozen=True)
class Attached:
    """A mass of p [J/K] behind each node, following it with a time constant."""

    nodes: tuple[int, ...]
    lag_s: float


@dataclass(frozen=True)
class Start:
    """A node is p [K] hotter at the start."""

    node: int


@dataclass(frozen=True)
class BoundaryBias:
    """A boundary reads p [K] too much."""

    boundary: int


@dataclass(frozen=True)
class Beside:
    """A channel follows p of a node (an index) and 1 - p of its own place:
    a thermocouple reads a mixture of what it touches."""

    channel: str
    node: int


@dataclass(frozen=True)
class Late:
    """The stamps of the channels are late by p [s], or by p [ppm] of the time run where `drifts`. `sign` -1: it is the
    inputs' stamps that are late, as if all channels were early. Of a drift that neglects p of the motor's own time."""

    channels: tuple[str, ...]
    drifts: bool
    sign: float = 1.0

    @property
    def law(self) -> str:
        """The law of a clock, as cause ids write it."""
        return "drift" if self.drifts else "offset"

    @property
    def unit(self) -> str:
        return "ppm" if self.drifts else "s"


@dataclass(frozen=True)
class Slowed:
    """All channels of a logger follow p [s] more slowly than stated: to the delay of each, its sensor's first-order lag
    and the logger's are one whose time constant is their sum."""

    channels: tuple[str, ...]
    law = "lag"
    unit = "s"


@dataclass(frozen=True)
class HeatTent:
    """p [W] * tent into a node: one of those that make up a free heat, at `time_s` of its test."""

    node: int
    time_s: float
    spacing_s: float


@dataclass(frozen=True)
class HeatMap:
    """p [W] times a map over speed and load into a node: one of those that add up to a free loss map. `heights` at the
    knots `speeds` and `loads` (dimensionless, rising; of `Test.load`, which is the `load` "torque" or "current"), load
    by load within speed, linear between: of 9 and 5 the second is that of the lowest speed and the second lowest
    load."""

    node: int
    speeds: tuple[float, ...]
    loads: tuple[float, ...]
    load: str
    heights: tuple[float, ...]

    @property
    def sayable(self) -> bool:
        """Whether a motor file's map can be so: over the torque, or over a current of a motor that does not brake."""
        return self.load == "torque" or self.loads[0] >= 0


PartOfHeat = HeatTent | HeatMap  # that is free
OnTerms = Scale | Power | Tent | Course | InputGain | InputBias
OnTemperatures = Added | Tilt | Capacity | Attached | Start | BoundaryBias | PartOfHeat
OnReading = Misreading | Lag | Beside | Late | Slowed
OnBench = Misreading | Lag | Late | Slowed | BoundaryBias | InputGain | InputBias  # what a bench file corrects
Action = OnTerms | OnTemperatures | OnReading


@dataclass(frozen=True)
class Parameter:
    """One number with its prior, mean 0 unless `mean` says else. `test`: the one it belongs to, None for all.
    `low`, `high`: where it is held."""

    name: str
    action: Action
    sd: float
    test: int | None = None
    low: float = -float("inf")
    high: float = float("inf")
