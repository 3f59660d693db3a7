"""A sensor: what it follows of a motor, and how far it can be trusted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Sensor:
    """A channel that is compared with the model. `name`: as in the log; `weights`: node -> share of what it follows,
    sum 1; `bus`: what stamps its samples; `level`: "production" where every motor has one, "testing" where only a test
    bench does.

    In K, of a meter in its own unit: `noise` (one standard deviation, white) and `resolution` of one sample, `bias_sd`
    of its error that is constant in a session. `time_constant_s`: of its known first-order lag.
    """

    name: str
    weights: Mapping[str, float]
    bus: str = ""
    level: str = "testing"
    noise: float = 0.0
    resolution: float = 0.0
    bias_sd: float = 0.0
    time_constant_s: float = 0.0

    @property
    def node(self) -> str:
        """The node that it follows most."""
        return max(self.weights, key=lambda node: self.weights[node])

    @property
    def followed(self) -> str | None:
        """The node that makes up more than half of what it follows; None where none does."""
        return self.node if self.weights[self.node] > 0.5 else None

    @property
    def label(self) -> str:
        """The node that it follows by more than half, else "0.5 a + 0.5 b"."""
        return self.followed or " + ".join(f"{share:g} {node}" for node, share in self.weights.items())

    def over(self, names: Sequence[str]) -> Floats:
        """The share (n,) of each of these names. Raises ValueError where one that it follows is not among them."""
        shares = np.zeros(len(names))
        for node, share in self.weights.items():
            shares[names.index(node)] = share
        return shares
