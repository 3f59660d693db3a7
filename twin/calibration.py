"""Calibration: a motor's coefficients from recorded sessions, with what is known beforehand and what a session brings along.

The mode of the posterior under Gaussian noise (`twin.noise`) and Gaussian priors: ln coefficient and ln capacity about the
motor file's values with the file's `sd`; a session's initial temperatures about where its run starts; a bias a session and
channel. Levenberg-Marquardt on the whitened block means: K. Levenberg, Quart. Appl. Math. 2 (1944); D. W. Marquardt,
J. SIAM 11 (1963), doi:10.1137/0111030; damping in the metric of J. J. More, LNM 630 (1978), doi:10.1007/BFb0067700.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from twin.errors import DivergedError
from twin.features import product, terms
from twin.kernel import Compiled, Load, compile_network, load_in_memory
from twin.network import Network
from twin.noise import ChannelNoise, Series, whiten
from twin.outputs import Output, blocks, reading
from twin.sensitivities import (
    ColumnKernel,
    InitialTemperature,
    Parameter,
    compile_columns,
    own_parameters,
    sensitivities,
)
from twin.simulate import Frame, simulate
from twin.structure import Parameters, parameters

Floats = NDArray[np.float64]
Index = NDArray[np.intp]

BROAD = ChannelNoise(ar_sd=0.25, ar_tau_s=60.0, ou_sd=0.4, ou_tau_s=600.0)
BOUND = math.log(4.0)  # of a logarithm: a quarter to four times, the +-300 % of the field in a form that keeps the sign
ENOUGH = 0.01  # what is left to gain in ln posterior, by the quadratic model, when the search ends
ITERATIONS = 60
LEFT_FREE = 0.9  # a parameter whose sd is still this share of its prior sd was not seen by the data


@dataclass(frozen=True)
class Channel:
    """An observed channel of one session. `measured` (N,) [degC]: means over the steps, any value where `output.samples` is 0;
    `white_sd`, `resolution` [K] of one sample; `bias_sd` [K] constant within the session."""

    name: str
    output: Output
    measured: Floats
    white_sd: float
    resolution: float
    bias_sd: float


@dataclass(frozen=True)
class Recorded:
    """One session. `initial`, `initial_sd` (n,) [degC], [K]: where its run starts, and how well that is known; `extra`: features
    (N,) that candidates use beyond the network's."""

    frame: Frame
    initial: Floats
    initial_sd: Floats
    channels: tuple[Channel, ...]
    extra: Mapping[str, Floats] = field(default_factory=dict)


@dataclass(frozen=True)
class Problem:
    """What is to be explained, and by which motor. `noise`: channel -> its noise; a channel that is not there has `BROAD`.

    The vector of a problem: ln coefficients, ln capacities (as offsets from the network's), then for each session its
    initial temperatures (offsets from `initial`) and its channels' biases.
    """

    network: Network
    sessions: tuple[Recorded, ...]
    noise: Mapping[str, ChannelNoise] = field(default_factory=dict)

    @property
    def own(self) -> int:
        """How many parameters belong to the motor; they come first."""
        return len(own_parameters(self.network))

    @property
    def sd(self) -> Floats:
        """Prior standard deviation of every entry of the vector."""
        motor = [term.sd for term in terms(self.network)] + [node.sd for node in self.network.nodes]
        nuisance = [[*s.initial_sd, *(c.bias_sd for c in s.channels)] for s in self.sessions]
        return np.array([*motor, *(sd for session in nuisance for sd in session)], dtype=np.float64)

    def at(self, session: int) -> Index:
        """Places in the vector of what a session depends on: the motor, then its own nuisances."""
        sizes = [s.initial.size + len(s.channels) for s in self.sessions]
        start = self.own + sum(sizes[:session])
        return np.concatenate([np.arange(self.own), np.arange(start, start + sizes[session])])

    def values(self, beta: Floats) -> Parameters:
        """The motor's values at a vector."""
        own = parameters(self.network)
        split = own.coefficients.size
        return replace(
            own,
            coefficients=own.coefficients * np.exp(beta[:split]),
            capacities=own.capacities * np.exp(beta[split : self.own]),
        )


@dataclass(frozen=True)
class Kernels:
    """A network's compiled run and its compiled sensitivities."""

    run: Compiled
    columns: ColumnKernel


@dataclass(frozen=True)
class Linear:
    """One channel of one session about a vector: `series` of the residual, `at` the places in the vector that it depends on,
    `columns` (B, at) d(modelled + bias)/d(vector), and `candidates` (B, C) of terms at zero."""

    series: Series
    at: Index
    columns: Floats
    candidates: Floats


@dataclass(frozen=True)
class Estimate:
    """A parameter of the motor. `value`, `before` in its unit (W, W/K, J/K); `log_change`, `sd`, `prior_sd` of the logarithm."""

    name: str
    before: float
    value: float
    log_change: float
    sd: float
    prior_sd: float
    held: bool  # at its bound

    @property
    def prior_left(self) -> float:
        """Posterior over prior standard deviation: 1 where the data say nothing."""
        return self.sd / self.prior_sd

    @property
    def free(self) -> bool:
        """Whether the data leave it as free as it was."""
        return self.prior_left > LEFT_FREE


@dataclass(frozen=True)
class Calibration:
    """`beta` the mode, `covariance` about it, both in the order of `Problem`; `log_posterior` up to a constant; `mae_before`,
    `mae_after`: (session, channel) -> mean absolute residual [K] of block means, of runs without any nuisance; `bias`:
    what the channel reads too much in that session [K]."""

    network: Network
    estimates: tuple[Estimate, ...]
    beta: Floats
    covariance: Floats
    log_posterior: float
    iterations: int
    converged: bool
    mae_before: Mapping[tuple[int, str], float]
    mae_after: Mapping[tuple[int, str], float]
    bias: Mapping[tuple[int, str], float]

    @property
    def correlation(self) -> Floats:
        """Of the motor's parameters."""
        own = len(self.estimates)
        sd = np.sqrt(np.diag(self.covariance))[:own]
        result: Floats = self.covariance[:own, :own] / np.outer(sd, sd)
        return result


def kernels(network: Network, load: Load = load_in_memory) -> Kernels:
    """Compile once a motor; values are arguments."""
    return Kernels(compile_network(network, load=load), compile_columns(network, load=load))


def calibrate(problem: Problem, kernel: Kernels, start: Floats | None = None) -> Calibration:
    """The mode and what is known about it. `start`: a vector to search from (default: the prior mean).

    Raises `DivergedError` where the run from the start leaves the finite numbers, `FrameError` where shapes do not fit.
    """
    sd = problem.sd
    beta = np.zeros(sd.size) if start is None else start.copy()
    bound = np.where(np.arange(sd.size) < problem.own, BOUND, np.inf)
    cost, hessian, slope = _quadratic(problem, kernel, beta, sd)
    damping, left, iteration = 1e-3, np.inf, 0
    while iteration < ITERATIONS:
        full = _step(hessian, slope, 0.0, beta, bound)
        left = float(slope @ full - full @ hessian @ full / 2)
        if left < ENOUGH or damping > 1e8:
            break
        iteration += 1
        trial = beta + _step(hessian, slope, damping, beta, bound)
        if _cost(problem, kernel, trial, sd) < cost:
            beta, damping = trial, max(damping / 10, 1e-9)
            cost, hessian, slope = _quadratic(problem, kernel, beta, sd)
        else:
            damping *= 10
    covariance = np.linalg.inv(hessian).astype(np.float64)
    return Calibration(
        network=with_values(problem.network, problem.values(beta)),
        estimates=_estimates(problem, beta, np.sqrt(np.diag(covariance))),
        beta=beta,
        covariance=covariance,
        log_posterior=-cost,
        iterations=iteration,
        converged=left < ENOUGH,
        mae_before=_mae(problem, kernel, np.zeros(sd.size)),
        mae_after=_mae(problem, kernel, np.where(np.isfinite(bound), beta, 0.0)),
        bias=_biases(problem, beta),
    )


def linearise(
    problem: Problem, kernel: Kernels, beta: Floats, candidates: Sequence[Parameter] = ()
) -> Iterator[Linear]:
    """Every session's channels in turn, not whitened: residual and columns about a vector; candidates are terms at zero."""
    nodes = [node.name for node in problem.network.nodes]
    wanted = (*own_parameters(problem.network), *map(InitialTemperature, nodes), *candidates)
    own = problem.own + len(nodes)
    for s, session in enumerate(problem.sessions):
        at = problem.at(s)
        initial, biases = np.split(beta[at[problem.own :]], [len(nodes)])
        found = sensitivities(
            kernel.columns,
            session.frame,
            session.initial + initial,
            wanted,
            [channel.output for channel in session.channels],
            problem.values(beta),
            session.extra,
        )
        for k, channel in enumerate(session.channels):
            series = _series(s, session, channel, found.temperatures, nodes, float(biases[k]))
            columns = np.hstack([found.columns[k][:, :own], np.ones((series.y.size, 1))])
            yield Linear(series, np.append(at[:own], at[own + k]), columns, found.columns[k][:, own:])


def _series(
    s: int, session: Recorded, channel: Channel, temperatures: Floats, nodes: Sequence[str], bias: float
) -> Series:
    """Measured minus modelled block means of a channel."""
    step_s = session.frame.step_s
    cut = blocks(channel.output, step_s)
    modelled = cut.means(reading(channel.output, temperatures, nodes, step_s)) + bias
    return Series(
        session=s,
        channel=channel.name,
        t_s=cut.times_s(step_s),
        y=cut.measured(channel.measured) - modelled,
        samples=cut.samples,
        white_sd=channel.white_sd,
        resolution=channel.resolution,
    )


def whitened(problem: Problem, series: Series, columns: Floats) -> Floats:
    """Columns (B, k) of a channel under the problem's noise."""
    return whiten(series, problem.noise.get(series.channel, BROAD), columns)


def _residuals(problem: Problem, kernel: Kernels, beta: Floats) -> Iterator[Series]:
    """Measured minus modelled of every session and channel: runs alone, without columns."""
    nodes = [node.name for node in problem.network.nodes]
    run = replace(kernel.run, parameters=problem.values(beta))
    for s, session in enumerate(problem.sessions):
        initial, biases = np.split(beta[problem.at(s)[problem.own :]], [len(nodes)])
        temperatures = simulate(run, session.frame, session.initial + initial)
        for channel, bias in zip(session.channels, biases, strict=True):
            yield _series(s, session, channel, temperatures, nodes, float(bias))


def _cost(problem: Problem, kernel: Kernels, beta: Floats, sd: Floats) -> float:
    """- ln posterior; infinite where the model runs away."""
    try:
        white = [whitened(problem, series, series.y[:, None]) for series in _residuals(problem, kernel, beta)]
    except DivergedError:
        return math.inf
    return float(sum(np.sum(w**2) for w in white) + np.sum((beta / sd) ** 2)) / 2


def _quadratic(problem: Problem, kernel: Kernels, beta: Floats, sd: Floats) -> tuple[float, Floats, Floats]:
    """- ln posterior, its Gauss-Newton Hessian, and the downhill slope, summed channel by channel."""
    hessian = np.diag(1.0 / sd**2)
    slope = -beta / sd**2
    cost = float(np.sum((beta / sd) ** 2)) / 2
    for part in linearise(problem, kernel, beta):
        white = whitened(problem, part.series, np.column_stack([part.series.y, part.columns]))
        residual, columns = white[:, 0], white[:, 1:]
        hessian[np.ix_(part.at, part.at)] += columns.T @ columns
        slope[part.at] += columns.T @ residual
        cost += float(residual @ residual) / 2
    return cost, hessian, slope


def _step(hessian: Floats, slope: Floats, damping: float, beta: Floats, bound: Floats) -> Floats:
    """The damped step; entries that would leave their bounds are held there and the others solved again."""
    damped = hessian + damping * np.diag(np.diag(hessian))
    step = np.zeros(beta.size)
    held = np.zeros(beta.size, dtype=np.bool_)
    while True:
        free = ~held
        right = slope[free] - damped[np.ix_(free, held)] @ step[held]
        step[free] = np.linalg.solve(damped[np.ix_(free, free)], right)
        leaving = free & (np.abs(beta + step) > bound)
        if not leaving.any():
            return step
        step[leaving] = np.copysign(bound[leaving], step[leaving]) - beta[leaving]
        held |= leaving


def _estimates(problem: Problem, beta: Floats, sd: Floats) -> tuple[Estimate, ...]:
    before, after, prior = parameters(problem.network), problem.values(beta), problem.sd
    old = np.concatenate([before.coefficients, before.capacities])
    new = np.concatenate([after.coefficients, after.capacities])
    return tuple(
        Estimate(
            name=name,
            before=float(old[i]),
            value=float(new[i]),
            log_change=float(beta[i]),
            sd=float(sd[i]),
            prior_sd=float(prior[i]),
            held=bool(abs(beta[i]) >= BOUND),
        )
        for i, name in enumerate(names(problem.network))
    )


def names(network: Network) -> tuple[str, ...]:
    """The motor's parameters as `kind.place.law`; a law that stands twice at a place is counted from its second on."""
    places = [(f"conductance.{link.a}-{link.b}", link.terms) for link in network.links]
    places += [(f"loss.{source.node}", source.terms) for source in network.sources]
    found = [f"{place}.{product(term).name}" for place, group in places for term in group]
    again = [found[:i].count(name) for i, name in enumerate(found)]
    laws = [f"{name}#{count + 1}" if count else name for name, count in zip(found, again, strict=True)]
    return (*laws, *(f"capacity.{node.name}.scale" for node in network.nodes))


def with_values(network: Network, values: Parameters) -> Network:
    """The network with other coefficients and capacities."""
    coefficient = iter(values.coefficients.tolist())
    links = tuple(
        replace(k, terms=tuple(replace(t, coefficient=next(coefficient)) for t in k.terms)) for k in network.links
    )
    sources = tuple(
        replace(k, terms=tuple(replace(t, coefficient=next(coefficient)) for t in k.terms)) for k in network.sources
    )
    nodes = tuple(replace(n, capacity=c) for n, c in zip(network.nodes, values.capacities.tolist(), strict=True))
    return replace(network, nodes=nodes, links=links, sources=sources)


def _mae(problem: Problem, kernel: Kernels, beta: Floats) -> dict[tuple[int, str], float]:
    found = _residuals(problem, kernel, beta)
    return {(series.session, series.channel): float(np.abs(series.y).mean()) for series in found if series.y.size}


def _biases(problem: Problem, beta: Floats) -> dict[tuple[int, str], float]:
    found: dict[tuple[int, str], float] = {}
    for s, session in enumerate(problem.sessions):
        names = [channel.name for channel in session.channels]
        own = beta[problem.at(s)[problem.own + session.initial.size :]]
        found |= {(s, name): float(value) for name, value in zip(names, own, strict=True)}
    return found
