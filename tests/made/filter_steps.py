"""The filters' step and readings one at a time, as vectors and matrices: what peers are given and derivatives are
taken of."""

from __future__ import annotations

from typing import Any

import numpy as np

from twin.filters.ekf import FilterRun, run_of
from twin.filters.inputs import Inputs
from twin.filters.readings import meter
from twin.filters.step import derive, move

Floats = np.ndarray[Any, Any]


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
