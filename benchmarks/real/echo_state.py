"""An echo state network: a recurrent network whose inner weights are drawn once and stay, and whose read-out is learnt.

H. Jaeger, The "echo state" approach to analysing and training recurrent neural networks, GMD report 148 (2001), with
leaky units (H. Jaeger, M. Lukoševičius, D. Popovici, U. Siewert, Neural Networks 20 (2007) 335, DOI
10.1016/j.neunet.2007.04.016) from seconds to an hour, as temperatures have both. The read-out is a ridge regression of
units and inputs. The measured start sets the first state.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.real.recordings import Recording
from twin.motor.outputs import BLOCK_S

Floats = NDArray[np.float64]

UNITS = 300
RADIUS = 0.3  # spectral: how strongly the units drive each other
FASTEST_s, SLOWEST_s = 10.0, 3600.0  # time constants of the units
START_K = 30.0  # rise at the start that moves a unit by about 1


@dataclass(frozen=True)
class Size:
    """How strongly inputs drive the units, and the ridge of the read-out."""

    inputs: float
    ridge: float


SIZES = tuple(Size(inputs, ridge) for inputs in (0.03, 0.1) for ridge in (1.0, 10.0, 100.0))


@dataclass(frozen=True)
class EchoState:
    """The network's `weights` by which a read-out follows units and inputs: (f, nodes), and what inputs are scaled by
    (mean and sd, (k,))."""

    size: Size
    mean: Floats
    sd: Floats
    nodes: Sequence[str]
    weights: Floats

    def rises(self, recording: Recording) -> dict[str, Floats]:
        """Node -> the rise over the coolant (B,) [K]."""
        found = _states(recording, self.mean, self.sd, self.size) @ self.weights
        return dict(zip(self.nodes, found.T, strict=True))


def learnt(recordings: Sequence[Recording], size: Size) -> EchoState:
    """A network of some recordings."""
    inputs = np.concatenate([recording.inputs for recording in recordings])
    mean, sd = inputs.mean(axis=0), np.maximum(inputs.std(axis=0), 1e-9)
    states = [_states(recording, mean, sd, size) for recording in recordings]
    nodes = list(recordings[0].readings)
    weights = []
    for node in nodes:
        seen = np.concatenate([s[one.blocks[node].there] for s, one in zip(states, recordings, strict=True)])
        rises = np.concatenate([one.rises[node] for one in recordings])
        square = seen.T @ seen + size.ridge * np.eye(seen.shape[1])
        weights.append(np.linalg.solve(square, seen.T @ rises))
    return EchoState(size, mean, sd, nodes, np.column_stack(weights))


def _states(recording: Recording, mean: Floats, sd: Floats, size: Size) -> Floats:
    """One, the inputs and the units, (B, f)."""
    given = np.clip((recording.inputs - mean) / sd, -5.0, 5.0)
    draws = np.random.default_rng(0)
    inner = draws.normal(size=(UNITS, UNITS)) * RADIUS / np.sqrt(UNITS)
    driven = given @ draws.normal(size=(given.shape[1], UNITS)) * size.inputs + draws.uniform(-1, 1, UNITS)
    slow = np.exp(draws.uniform(math.log(FASTEST_s), math.log(SLOWEST_s), UNITS))
    share = 1 - np.exp(-BLOCK_S / slow)
    unit = np.tanh(recording.start / START_K @ draws.normal(size=(recording.start.size, UNITS)))
    units = np.empty((len(given), UNITS))
    for k, drive in enumerate(driven):
        unit = unit + share * (np.tanh(inner @ unit + drive) - unit)
        units[k] = unit
    return np.column_stack([np.ones(len(given)), given, units])
