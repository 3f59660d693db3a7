"""How hot a planned course becomes, with a band, and which node is at its limit first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from twin.diagnosis.next_tests import read_throughout
from twin.diagnosis.two_models import HOTTER_K
from twin.fitting.model import Floats, Model
from twin.fitting.recorded import RecordedChannel
from twin.motor.network import Network
from twin.motor.sensor import Sensor
from twin.planning.gathered import Untried

Z95 = 1.96


@dataclass(frozen=True)
class NodeLimits:
    """What may become how hot: `nodes` with their limits (n,) [degC]. `stated`: by the motor file; else each as hot as
    it ever was, and `HOTTER_K` more."""

    nodes: tuple[str, ...]
    degC: Floats
    stated: bool

    @classmethod
    def of(cls, network: Network, model: Model, beta: Floats) -> NodeLimits:
        limited = [(node.name, node.limit_degC) for node in network.nodes if node.limit_degC is not None]
        if limited:
            return cls(tuple(name for name, _ in limited), np.array([degC for _, degC in limited]), True)
        hottest = np.max([model.course(s, beta)[1].max(axis=0) for s in range(len(model.tests))], axis=0)
        return cls(tuple(node.name for node in network.nodes), hottest + HOTTER_K, False)


@dataclass(frozen=True)
class Heated:
    """How hot limited nodes become (B, n) by blocks [degC], and the standard deviation of that [K]."""

    limits: NodeLimits
    degC: Floats
    sd_K: Floats

    @property
    def high(self) -> Floats:
        """The upper end of the 95 % band (B, n)."""
        upper: Floats = self.degC + Z95 * self.sd_K
        return upper

    def first_over(self) -> tuple[int, int] | None:
        """The first block in which a node may be above its limit, and the node's place; None where none is."""
        over = self.high > self.limits.degC
        if not over.any():
            return None
        block = int(over.any(axis=1).argmax())
        return block, int((self.high - self.limits.degC)[block].argmax())


def heated(limits: NodeLimits, untried: Untried) -> Heated:
    """How hot the limited nodes, `watched` as the supposed thermometers of a new test, become by the fitted model, and
    how sure that is by what its tests leave unknown of it: to the end, or to the first block in which one is above its
    limit without the band. Raises `DivergedError` where the model runs away."""
    degC, columns = _inside(limits, untried)
    return Heated(limits, degC, _sd(untried, columns))


def first_over(limits: NodeLimits, untried: Untried) -> tuple[int, int] | None:
    """`first_over` of what is `heated`. Most of a band is never looked at: what is below its limit as unsure as the
    priors are is so by the fit, which is surer."""
    degC, columns = _inside(limits, untried)
    at_most = np.sqrt(columns**2 @ untried.model.sd**2)
    unclear = degC + Z95 * at_most > limits.degC
    sd = np.zeros_like(degC)
    sd[unclear] = _sd(untried, columns[unclear])
    return Heated(limits, degC, sd).first_over()


def _inside(limits: NodeLimits, untried: Untried) -> tuple[Floats, Floats]:
    """Temperatures of the limited nodes (B, n), and what the vector changes them by (B, n, P)."""
    inside = [one for one in untried.model.linearise(untried.beta) if not one.series.measured]
    degC = np.column_stack([-one.series.y for one in inside])
    over = (degC > limits.degC).any(axis=1)
    blocks = int(over.argmax()) + 1 if over.any() else len(degC)
    return degC[:blocks], np.stack([one.columns[:blocks] for one in inside], axis=1)


def _sd(untried: Untried, columns: Floats) -> Floats:
    """How unsure what has these columns (..., P) is by the fit (...)."""
    size = len(untried.ground.shared)
    rows = columns.reshape(-1, columns.shape[-1])
    shared = solve_triangular(untried.ground.lower, rows[:, :size].T, lower=True)
    own = rows[:, size:] * untried.model.sd[size:]
    variance = np.einsum("ij,ij->j", shared, shared) + np.einsum("ij,ij->i", own, own)
    found: Floats = np.sqrt(variance).reshape(columns.shape[:-1])
    return found


def watched(nodes: Sequence[str], length: int) -> tuple[RecordedChannel, ...]:
    """A perfect sensor at each node, read throughout so many steps, showing 0."""
    nothing = np.zeros(length)
    sensors = [Sensor(f"inside {node}", {node: 1.0}) for node in nodes]
    return read_throughout([RecordedChannel(sensor, nothing, nothing, nothing) for sensor in sensors], length)
