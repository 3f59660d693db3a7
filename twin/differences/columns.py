"""What a bench observes and drives, and what a candidate's column is the derivative of: data for the sensitivities."""

from __future__ import annotations

from dataclasses import dataclass

from twin.motor.network import Term
from twin.motor.paths import Place


@dataclass(frozen=True)
class InputChannel:
    """What drives the model: a quantity such as `speed`, `current`, `flow`, or a boundary's name; and the bus that stamps it."""

    name: str
    bus: str


@dataclass(frozen=True)
class AddedTerms:
    """A term of coefficient 0 at each place, all with one amplitude; its product of features is divided by its root mean
    square over training, so that the amplitude is W (node) or W/K (link) in root mean square."""

    terms: tuple[tuple[Place, Term], ...]


@dataclass(frozen=True)
class EntryFactor:
    """The whole law at each place times exp(amplitude f). `by`, what f is: `one`; `temperature` (T of the node, mean of a
    link's two ends, less its training mean; the product normalised as in `AddedTerms`); `session` (0, 1, 2 ... of its
    kind); `hours_above_<T>degC` (in 100 h)."""

    places: tuple[Place, ...]
    by: str


@dataclass(frozen=True)
class AttachedMass:
    """Capacity `amplitude` [J/K] behind each node, following it with time constant `lag_s`: heat -a d/dt (T filtered)."""

    nodes: tuple[str, ...]
    lag_s: float


@dataclass(frozen=True)
class CapacityFactor:
    """Each node's capacity times exp(amplitude)."""

    nodes: tuple[str, ...]


@dataclass(frozen=True)
class Reading:
    """An observed channel reads wrong: `law` is bias, gain (of the reading in degC), lag, drift, stem (reading plus amplitude
    times ambient minus reading) or swap with the channel `other`."""

    channel: str
    law: str
    other: str = ""


@dataclass(frozen=True)
class ClockError:
    """The stamps of all channels and inputs of a bus are late by the amplitude: `offset` [s] or `drift` [ppm of time run]."""

    bus: str
    law: str


@dataclass(frozen=True)
class InputError:
    """An input or boundary reads too much: `gain` (reading = truth (1 + amplitude)) or `bias`."""

    name: str
    law: str


Column = AddedTerms | EntryFactor | AttachedMass | CapacityFactor | Reading | ClockError | InputError
