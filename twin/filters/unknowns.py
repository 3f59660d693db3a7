"""What a filter is to find besides temperatures: heats, factors of the motor file's own coefficients, constant errors
of sensors; each is a random walk.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from twin.compiled.once import once_a_network
from twin.errors import FrameError
from twin.motor import features
from twin.motor.causes import link_place, parse
from twin.motor.check import meant
from twin.motor.network import Network

Index = NDArray[np.int64]


@dataclass(frozen=True)
class UnknownHeat:
    """Heat [W] into `node` beside the model's own: 0 at the start with standard deviation `sd_W`, then a random walk
    of `walk_W` [W / sqrt(s)]."""

    node: str
    sd_W: float
    walk_W: float

    @property
    def name(self) -> str:
        """As answers call it: the node."""
        return self.node


@dataclass(frozen=True)
class UnknownFactor:
    """The natural logarithm of what multiplies coefficients: 0 at the start with standard deviation `sd`, then a
    random walk of `walk` [1 / sqrt(s)]. `of` is written as a cause: `conductance.rotor_surface-teeth.scale` for every
    term of the link, `loss.magnet.scale` for every term of the source, `loss.magnet.speed2` for the term with that
    law. `also`: others that it multiplies alike, as where a part is cut into slices."""

    of: str
    sd: float
    walk: float
    also: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """As answers call it: the cause."""
        return self.of


@dataclass(frozen=True)
class UnknownBias:
    """What a channel reads too much [K, of a meter of heat W]: 0 at the start with standard deviation `sd_K`, then a
    random walk of `walk_K` [K / sqrt(s)], 0 for an error that does not drift."""

    channel: str
    sd_K: float
    walk_K: float = 0.0

    @property
    def name(self) -> str:
        """As answers call it: the channel."""
        return self.channel


Unknown = UnknownHeat | UnknownFactor | UnknownBias


@dataclass(frozen=True)
class Places:
    """Where unknowns are in a network and its readings, heats before factors before biases: `order` (u,) of the
    unknowns as given, `heats` (o,) the node of each, `factor_of` (K,) which of the `factors` multiplies each
    coefficient, `bias_of` (channels,) which bias each channel has; -1 for none."""

    order: tuple[int, ...]
    heats: Index
    factor_of: Index
    bias_of: Index
    factors: int


def places(network: Network, unknowns: Sequence[Unknown], coefficients: int, channels: Sequence[str]) -> Places:
    """Where unknowns are in a network of so many `coefficients` whose `channels` are read.

    Raises `FrameError` for a node, link, source or law that the network has not, a channel that is not read, a start
    without spread, a walk below 0, and for two unknowns of one place; `CauseError` for a factor that is not written
    as a cause.
    """
    nodes = [node.name for node in network.nodes]
    heats: list[int] = []
    factors: list[int] = []
    biases: list[int] = []
    bias_of = np.full(len(channels), -1, dtype=np.int64)
    factor_of = np.full(coefficients, -1, dtype=np.int64)
    for i, unknown in enumerate(unknowns):
        sd, walk = _spread(unknown)
        if not (sd > 0 and walk >= 0):
            raise FrameError(f'unknown "{unknown.name}": give a start with an sd above 0 and a walk of at least 0')
        if isinstance(unknown, UnknownHeat):
            heats.append(i)
            continue
        if isinstance(unknown, UnknownBias):
            if unknown.channel not in channels:
                raise FrameError(f'no channel "{unknown.channel}" is read: its error cannot be found; name a reading')
            if bias_of[channels.index(unknown.channel)] >= 0:
                raise FrameError(f'two unknown errors of channel "{unknown.channel}": name it once')
            bias_of[channels.index(unknown.channel)] = len(biases)
            biases.append(i)
            continue
        terms = [term for cause in (unknown.of, *unknown.also) for term in terms_of(network, cause)]
        if (factor_of[terms] >= 0).any():
            raise FrameError(f'unknown "{unknown.of}": another unknown multiplies the same coefficient; name it once')
        factor_of[terms] = len(factors)
        factors.append(i)
    at = [node_place(network, unknowns[i].name) for i in heats]
    if len(set(at)) < len(at):
        raise FrameError(f"two unknown heats at {nodes[max(at, key=at.count)]}: name the node once")
    return Places((*heats, *factors, *biases), np.array(at, dtype=np.int64), factor_of, bias_of, len(factors))


def _spread(unknown: Unknown) -> tuple[float, float]:
    """Standard deviation at the start, and the random walk."""
    match unknown:
        case UnknownHeat():
            return unknown.sd_W, unknown.walk_W
        case UnknownBias():
            return unknown.sd_K, unknown.walk_K
        case UnknownFactor():
            return unknown.sd, unknown.walk
        case _:
            assert_never(unknown)


def variances(unknowns: Sequence[Unknown], order: Sequence[int], step_s: float) -> tuple[list[float], list[float]]:
    """Variances of the unknowns, in `order`: at the start, and what a step adds."""
    spreads = [_spread(unknowns[i]) for i in order]
    return [sd**2 for sd, _ in spreads], [walk**2 * step_s for _, walk in spreads]


def node_place(network: Network, name: str) -> int:
    """The index of a node. Raises `FrameError` where there is none of that name."""
    nodes = [node.name for node in network.nodes]
    if name not in nodes:
        raise FrameError(f'network "{network.name}" has no node "{name}": name one of {", ".join(sorted(nodes))}')
    return nodes.index(name)


def terms_of(network: Network, cause: str) -> list[int]:
    """Places in `features.terms` of the coefficients that a cause id names. Raises `CauseError` for what is no id,
    `FrameError` for what the network has not."""
    asked = parse(cause)
    link = len(asked.ends) == 2 and set(asked.ends) <= set(network.names)
    place = link_place(network, *asked.ends) if link else asked.place
    listed = _listed(network).get((asked.kind, place), [])
    laws = [law for law, _ in listed]
    found = [i for law, i in listed if asked.law in ("scale", law)]
    if not found:
        known = [f"{kind}.{where}" for kind, where in _listed(network)]
        there = f"its laws are {', '.join(laws)}" if laws else meant(f"{asked.kind}.{place}", known)
        raise FrameError(f'network "{network.name}" has no coefficient "{cause}": {there}')
    return found


@once_a_network
def _listed(network: Network) -> dict[tuple[str, str], list[tuple[str, int]]]:
    """(kind, place) of each link and source -> the names of its laws, each with the place of its coefficient."""
    found: dict[tuple[str, str], list[tuple[str, int]]] = {}
    for i, (place, term) in enumerate(features.placed_terms(network)):
        kind = "conductance" if "-" in place else "loss"
        found.setdefault((kind, place), []).append((features.product(term).name, i))
    return found
