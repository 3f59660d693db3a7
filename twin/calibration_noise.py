"""The noise under which a calibration is repeated: what the first one left over says how far the model may be trusted."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin.calibration import BROAD, Kernels, Problem, linearise, whitened, with_values
from twin.initial import conductances
from twin.noise import ChannelNoise
from twin.reml import Observed, reml

Floats = NDArray[np.float64]


def widened_noise(problem: Problem, kernel: Kernels, beta: Floats) -> dict[str, ChannelNoise]:
    """The problem's noise, wider by the factor by which each channel's whitened residual about a vector is above 1 in root
    mean square (R. T. Birge, Phys. Rev. 40 (1932) 207), in all its parts but the white one; never narrower.

    A model without everyday freedom misfits in its form, fast and slow. Fitted variances (`fitted_noise`) call nearly all of
    that slow, trust the fast part too much, and predict kept sessions of a real motor worse.
    """
    left: defaultdict[str, list[Floats]] = defaultdict(list)
    for part in linearise(problem, kernel, beta):
        left[part.series.channel].append(whitened(problem, part.series, part.series.y[:, None])[:, 0])
    noise = {}
    for channel, parts in left.items():
        residual = np.concatenate(parts)
        factor = max(1.0, float(np.sqrt(np.mean(residual**2)))) if residual.size else 1.0
        own = problem.noise.get(channel, BROAD)
        noise[channel] = replace(own, ar_sd=factor * own.ar_sd, ou_sd=factor * own.ou_sd)
    return noise


def fitted_noise(problem: Problem, kernel: Kernels, beta: Floats) -> dict[str, ChannelNoise]:
    """The channels' noise by restricted maximum likelihood about a vector, every parameter integrated out."""
    observed = []
    for part in linearise(problem, kernel, beta):
        columns = np.zeros((part.series.y.size, beta.size))
        columns[:, part.at] = part.columns
        observed.append(Observed(part.series, part.series.y + columns @ beta, columns))
    return dict(reml(observed, 1.0 / problem.sd**2, _slowest_mode_s(problem, beta), _rise_K(problem)).noise)


def _slowest_mode_s(problem: Problem, beta: Floats) -> float:
    """The longest time constant of the network at the mean features of all sessions."""
    network = with_values(problem.network, problem.values(beta))
    mean = np.mean([session.frame.features.mean(axis=0) for session in problem.sessions], axis=0)
    between = conductances(network, mean)
    n = len(network.nodes)
    rate = (np.diag(between.sum(axis=1)) - between)[:n, :n] / np.array([node.capacity for node in network.nodes])[
        :, None
    ]
    return float(1.0 / np.linalg.eigvals(rate).real.min())


def _rise_K(problem: Problem) -> dict[str, float]:
    """Channel -> how far it rises over the coldest boundary, at least 1 K."""
    rise: dict[str, float] = {}
    for session in problem.sessions:
        coldest = float(session.frame.boundaries.mean(axis=0).min())
        for channel in session.channels:
            hottest = channel.measured[channel.output.samples > 0].max(initial=coldest)
            rise[channel.name] = max(rise.get(channel.name, 1.0), float(hottest) - coldest)
    return rise
