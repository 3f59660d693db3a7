"""filterpy's extended Kalman filter over the same inputs: the independent reference for the filter's own algebra.

It is given the motor's step with its derivative and what each channel reads (`Steps`), and does everything else its own
way: covariances, gains and updates, with dense matrices. (R. R. Labbe, filterpy, github.com/rlabbe/filterpy.)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.filters.ekf import Estimate, FilterRun, run_of
from twin.filters.inputs import Inputs
from twin.filters.readings import meter
from twin.filters.step import derive, move

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Apart:
    """How far filterpy's filter is from ours over all steps, at most: in temperatures [K] and in their standard
    deviations [K]."""

    temperature_K: float
    sd_K: float


def apart(inputs: Inputs, ours: Estimate) -> Apart:
    """How far filterpy is from `ours`, the estimate from these inputs."""
    n, temperature_K, sd_K = len(inputs.network.nodes), 0.0, 0.0
    for k, (x, P) in enumerate(by_filterpy(inputs), 1):
        temperature_K = max(temperature_K, float(np.abs(x[:n] - ours.temperatures[k]).max()))
        sd_K = max(sd_K, float(np.abs(np.sqrt(np.diag(P)[:n]) - ours.temperatures_sd[k]).max()))
    return Apart(temperature_K, sd_K)


def by_filterpy(inputs: Inputs) -> Iterator[tuple[Floats, Floats]]:
    """State (S,) and covariance (S, S) after each step: temperatures, unknowns in the order of `inputs.order`, lagging
    readings."""
    from filterpy.kalman import ExtendedKalmanFilter  # brings all of scipy.stats along, which no other replay needs

    steps = Steps(inputs)
    size, thermometers = steps.size + steps.channels, steps.channels
    places, variances = (np.broadcast_to(rows, inputs.values.shape) for rows in (inputs.places, inputs.variances))
    x, P = steps.start
    for k, values in enumerate(inputs.values):
        seen = np.flatnonzero(np.isfinite(values))
        peer = ExtendedKalmanFilter(dim_x=size, dim_z=max(len(seen), 1))
        peer.x, F = steps.extended(k, x)
        peer.P = F @ P @ F.T
        peer.P[: steps.size, : steps.size] += steps.process
        if len(seen):
            H, read = np.zeros((len(seen), size)), np.zeros(len(seen))
            for i, j in enumerate(seen.tolist()):
                if j < thermometers:
                    H[i] = steps.row(j, places[k, j])
                    read[i] = H[i] @ peer.x
                else:
                    read[i], H[i, : steps.size] = steps.meter(j - thermometers, k, peer.x[: steps.size])
            R = np.diag(variances[k, seen])
            peer.update(values[seen], lambda _, H=H: H, lambda _, read=read: read, R=R)
        x, P = peer.x[: steps.size].copy(), peer.P[: steps.size, : steps.size].copy()
        yield x, P


class Steps:
    """The steps of one run. States (S,) are temperatures, unknowns and lagging readings; extended ones (S + m,) have
    behind them what each channel would have read at the start of the step just made."""

    def __init__(self, inputs: Inputs) -> None:
        self.inputs, self.parts, self.run = inputs, inputs.parts, run_of(inputs)
        self.size, self.channels = len(inputs.x), len(self.parts.weights)
        self.process = np.diag(self.parts.process)
        self.now = np.zeros((self.channels, self.size))  # what each channel reads at an edge
        for j in range(self.channels):
            if self.parts.state[j] >= 0:
                self.now[j, self.parts.state[j]] = 1.0
            else:
                self.now[j, : self.parts.program.n] = self.parts.weights[j]

    @property
    def start(self) -> tuple[Floats, Floats]:
        """State (S,) and covariance (S, S) at the first edge."""
        return self.inputs.x.copy(), self.inputs.covariance.copy()

    def moved(self, k: int, x: Floats) -> Floats:
        """The state (S,) one step on."""
        plan, m, at = self.run.plan, self.run.m, self.run.at
        self.run.state()[:] = 0.0
        self.run.state()[: self.size, self.size] = x
        move(plan, m, at, self.inputs.features[k], self.inputs.boundaries[k], plan.state, plan.moved)
        return np.array(_rows(self.run, plan.moved)[: self.size, self.size])

    def matrix(self, k: int, x: Floats) -> Floats:
        """The derivative (S, S) of the state one step on."""
        self.moved(k, x)
        plan, m, at = self.run.plan, self.run.m, self.run.at
        _rows(self.run, plan.turned)[:] = np.eye(plan.length)
        first = plan.n + plan.heats
        factors = m[plan.stage + first * plan.length :][: plan.factors * plan.length].reshape(-1, plan.length)
        factors[:] = np.eye(plan.length)[first : first + plan.factors]
        derive(plan, m, at, plan.turned, plan.ahead)
        factors[:] = 0.0
        return np.array(_rows(self.run, plan.ahead)[: self.size, : self.size])

    def extended(self, k: int, x: Floats) -> tuple[Floats, Floats]:
        """The state (S,) one step on, with what was read before it (S + m,), and the derivative (S + m, S)."""
        return np.append(self.moved(k, x), self.now @ x), np.concatenate([self.matrix(k, x), self.now])

    def row(self, j: int, place: float) -> Floats:
        """What channel j reads, as shares of the extended state (S + m,)."""
        h = np.append(place * self.now[j], (1 - place) * np.eye(self.channels)[j])
        if self.parts.bias[j] >= 0:
            h[self.parts.bias[j]] = 1.0
        return h

    def meter(self, j: int, k: int, x: Floats) -> tuple[float, Floats]:
        """What meter j of heat reads [W] at the end of step k, and its slopes (S,)."""
        self.moved(k, x)
        self.run.state()[: self.size, self.size] = x
        plan, readings, m, at = self.run.plan, self.run.readings, self.run.m, self.run.at
        at[readings.later.start : readings.later.start + 2] = 0
        reads = meter(plan, readings, m, at, j, self.inputs.boundaries[k], plan.state, 0)
        return float(reads), -np.array(m[readings.later.share :][: self.size])


def _rows(run: FilterRun, place: int) -> Floats:
    length = run.plan.length
    return run.m[place : place + length**2].reshape(length, length)
