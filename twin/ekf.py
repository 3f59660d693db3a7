"""Extended Kalman filter: unknown heats and coefficients, estimated from measured temperatures while the motor runs.

The paper's filter (its section 4) estimates the magnets' loss from endwindings and rotor surface; its state is z, dz/dt and
the unknown input, of size 2p + o (`twin.ekf_paper`). This is the small form of the same: the network's own step
(`twin.integrators`, with the inputs held) on [temperatures, unknowns, readings].

Extended: each step is linearised about the estimate at its start. For losses linear in temperature (copper) that is exact;
of resistances, temperature factors and unknown factors the second derivative is left out of the covariance, never of the
estimate (`twin.ukf` keeps it). Readings of a step are independent and taken one after the other; a missing one is left out.

A filter is told where the unknown heat is. Told the wrong node it still finds a history that fits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from twin.ekf_step import run, work
from twin.filter_inputs import AnyReading, Inputs, Start, inputs_of
from twin.network import Network
from twin.simulate import Frame, check_finite
from twin.unknowns import Unknown, UnknownFactor, UnknownHeat

Floats = NDArray[np.float64]
U = TypeVar("U", bound=Unknown)

PACES = (1 / 30, 30.0)  # within which the walks of the unknowns are sought, as factors of what is given
PACE_ENOUGH = 0.3  # of the logarithm of a pace: the likelihood is flat there, and Brent's last parabola is nearer


@dataclass(frozen=True)
class Estimate:
    """What a filter knows at each edge from all readings up to it, with standard deviations: `temperatures` (N + 1, n) [degC] and
    `found` (N + 1, u) of `unknowns` (heat [W] beside the model's own, logarithm of a factor, error [K]); row k + 1 after step k.
    `innovations`, `variances` (N, m) [K, K^2 or W, W^2] of each channel given those before it in the step, heats last, NaN where it
    says nothing;
    `covariance` (S, S) after the last step."""

    unknowns: tuple[Unknown, ...]
    temperatures: Floats
    temperatures_sd: Floats
    found: Floats
    found_sd: Floats
    innovations: Floats
    variances: Floats
    covariance: Floats
    log_likelihood: float

    @property
    def nis(self) -> float:
        """Mean squared innovation over its variance: 1 where noise and model are as said; NaN without a reading. It hardly
        sees the unknowns' random walks, which is why those are chosen by likelihood."""
        there = np.isfinite(self.innovations)
        return float(np.mean(self.innovations[there] ** 2 / self.variances[there])) if there.any() else float("nan")


def filter_unknowns(
    network: Network, frame: Frame, start: Start, unknowns: Sequence[Unknown], readings: Sequence[AnyReading]
) -> Estimate:
    """Temperatures and unknowns from the readings. Without a reading the temperatures are those of `simulate` to rounding.

    Raises as `twin.filter_inputs.inputs_of`, and `DivergedError` where the temperatures leave the finite numbers.
    """
    inputs = inputs_of(network, frame, start, unknowns, readings)
    x, covariance = inputs.x.copy(), inputs.covariance.copy()
    steps, m = inputs.values.shape
    states, innovations = np.empty((2, steps + 1, inputs.parts.last)), np.empty((steps, m, 2))
    likelihood = run(
        inputs.parts,
        inputs.features,
        inputs.boundaries,
        inputs.values,
        inputs.places,
        inputs.variances,
        x,
        covariance,
        states[0],
        states[1],
        innovations,
        work(inputs.parts, inputs.boundaries.shape[1]),
    )
    return estimate_of(inputs, states, innovations, covariance, float(likelihood))


def estimate_of(
    inputs: Inputs, states: Floats, innovations: Floats, covariance: Floats, log_likelihood: float
) -> Estimate:
    """From `states` (2, N + 1, n + u), estimates and variances in the order of the state. Raises `DivergedError`."""
    n, unknown = len(inputs.network.nodes), np.argsort(inputs.order)
    check_finite(inputs.network, inputs.frame, states[0, :, :n])
    sd = np.sqrt(states[1])
    return Estimate(
        unknowns=inputs.unknowns,
        temperatures=states[0, :, :n],
        temperatures_sd=sd[:, :n],
        found=states[0, :, n:][:, unknown],
        found_sd=sd[:, n:][:, unknown],
        innovations=innovations[:, list(inputs.channels), 0],
        variances=innovations[:, list(inputs.channels), 1],
        covariance=covariance,
        log_likelihood=log_likelihood,
    )


def at_their_pace(
    network: Network, frame: Frame, start: Start, unknowns: Sequence[U], readings: Sequence[AnyReading]
) -> tuple[U, ...]:
    """The unknowns, the random walks of heats and factors times the one number, within `PACES`, that makes the readings most likely
    (marginal likelihood, by Brent's bounded search over its logarithm). Raises as `filter_unknowns`."""

    def surprise(log_pace: float) -> float:
        return -filter_unknowns(network, frame, start, _paced(unknowns, np.exp(log_pace)), readings).log_likelihood

    best = minimize_scalar(surprise, bounds=np.log(PACES), method="bounded", options={"xatol": PACE_ENOUGH})
    return _paced(unknowns, float(np.exp(best.x)))


def _paced(unknowns: Sequence[U], pace: float) -> tuple[U, ...]:
    return tuple(_at_pace(unknown, pace) for unknown in unknowns)


def _at_pace(unknown: U, pace: float) -> U:
    match unknown:
        case UnknownHeat():
            return replace(unknown, walk_W=unknown.walk_W * pace)
        case UnknownFactor():
            return replace(unknown, walk=unknown.walk * pace)
        case _:
            return unknown
