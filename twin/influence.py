"""How far what is not known of a motor's coefficients and capacities moves the temperature of each node over recorded tests.

The paper's sensitivities (its section 3.1): the exact derivative of every node's temperature by every parameter's logarithm,
here times the parameter's prior standard deviation, so that a well-known loss and a guessed film are measured with one scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.actions import Parameter
from twin.calibration import freedom
from twin.model import Channel, Model, Test
from twin.network import Network
from twin.outputs import Output

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Influence:
    """`parameters` (P,) of the motor; `per_sd_K` (P, n): root mean square over all blocks of the tests by which one prior standard
    deviation of each moves each node; `columns` (B, n, P): d temperature / d ln parameter in each block of 10 s [K]."""

    parameters: tuple[Parameter, ...]
    nodes: tuple[str, ...]
    per_sd_K: Floats
    columns: Floats

    def order(self, nodes: Sequence[int]) -> list[int]:
        """The parameters, those that move one of these nodes most first."""
        return [int(i) for i in np.argsort(-self.per_sd_K[:, list(nodes)].max(axis=1), kind="stable")]


def influence(network: Network, tests: Sequence[Test]) -> Influence:
    """Of every coefficient and capacity on every node. Raises `DivergedError` where the network's own run leaves the finite numbers."""
    parameters = freedom(network, ())
    model = Model(network, [with_every_node(network, test) for test in tests], parameters)
    parts = model.linearise(np.zeros(len(parameters)))
    nodes = tuple(node.name for node in network.nodes)
    of_test: dict[int, list[Floats]] = {}
    for part in parts:
        whole = np.zeros((len(part.columns), len(parameters)))
        whole[:, part.at] = part.columns
        of_test.setdefault(part.series.session, []).append(whole)
    columns = np.concatenate([np.stack(own, axis=1) for own in of_test.values()])
    sd = np.array([p.sd for p in parameters])
    per_sd = np.sqrt((columns**2).mean(axis=0)).T * sd[:, None]
    return Influence(parameters, nodes, per_sd, columns)


def with_every_node(network: Network, test: Test) -> Test:
    """The test as if every node had a thermometer that is always there and shows nothing but its node."""
    steps = len(test.frame.features)
    always, middle = np.ones(steps), np.full(steps, 0.5)
    channels = tuple(
        Channel(node.name, "", Output({node.name: 1.0}, 0.0, always, middle), np.zeros(steps), 0.1, 0.0, 0.0)
        for node in network.nodes
    )
    return replace(test, channels=channels, meters=())
