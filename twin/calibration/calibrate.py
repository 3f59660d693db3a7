"""Calibration: a motor's coefficients from recorded tests, with what is known beforehand and what a test brings along.

What is sought is the mode (`twin.fitting.fit`) under Gaussian noise (`twin.fitting.noise`) and Gaussian priors: ln
coefficient and ln capacity about the motor file's values with the file's `sd`, a test's initial temperatures about
where its run starts, and a bias of each channel in each test. It is sought twice: under broad noise, then under noise
as wide as what the first mode leaves.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from twin.calibration.learned import network_of
from twin.calibration.outliers import outliers, without
from twin.differences.everyday import BOUND, starts_and_biases
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.fit import NEAR_ENOUGH, Fit, fit
from twin.fitting.model import Floats, Model, Test
from twin.fitting.noise import ChannelNoise
from twin.motor import sensor_laws
from twin.motor.features import placed_terms, product, terms
from twin.motor.network import Network
from twin.motor.outputs import BLOCK_S

LINEARISATIONS = 60  # a valley of conductances and losses that grow together is long
HELD = 0.01  # of its standard deviation: an estimate that near its bound is at it
LEFT_FREE = 0.9  # a parameter whose sd is still this share of its prior sd was not seen by the data


@dataclass(frozen=True)
class FittedParameter:
    """A parameter of the motor: `value` and `before` in its unit (W, W/K, J/K); `log_change`, `sd` and `prior_sd` of
    its logarithm; whether it is `held` at its bound."""

    name: str
    before: float
    value: float
    log_change: float
    sd: float
    prior_sd: float
    held: bool


@dataclass(frozen=True)
class Calibration:
    """A motor with new coefficients and capacities, and how it was found.

    `estimates` are the parameters of the motor, the first ones of `fit`, which holds the mode and all that is known
    about it, covariance included; `iterations` counts the linearisations of both searches. By (test, channel or meter):
    `mae_before` and `mae_after`, the mean absolute residual [K, of meters in their unit] of block means, of runs of the
    motor before and after without bias or gain; `bias`, what it reads too much in that test; `outliers_s` [s], how long
    a channel jumped away and back, which was left out (`twin.calibration.outliers`). By meter: `gain`, the share by
    which it reads too much.
    """

    network: Network
    estimates: tuple[FittedParameter, ...]
    fit: Fit
    iterations: int
    mae_before: Mapping[tuple[int, str], float]
    mae_after: Mapping[tuple[int, str], float]
    bias: Mapping[tuple[int, str], float]
    gain: Mapping[str, float]
    outliers_s: Mapping[tuple[int, str], float]


def calibrate(
    network: Network,
    tests: Sequence[Test],
    only: Container[str] | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> Calibration:
    """Fit a motor's coefficients and capacities to tests. Only parameters of the names in `only` move, all where it is
    None. `tell` hears what is being done.

    Raises `DivergedError` where the network's own run leaves the finite numbers.
    """
    model = Model(network, tests, freedom(network, tests, only))
    tell(f"fitting {len(model.parameters)} numbers to {len(tests)} sessions")
    near = fit(model, np.zeros(len(model.parameters)), NEAR_ENOUGH, LINEARISATIONS)
    if marked := outliers(near):
        tell("fitting without the readings that jump")
        model = Model(network, without(tests, marked), model.parameters)
        near = fit(model, near.beta, NEAR_ENOUGH, LINEARISATIONS)
    tell("fitting under the noise that is left")
    found = fit(model.with_noise(widened_noise(near)), near.beta, linearisations=LINEARISATIONS)
    after = network_of(found, ())
    return Calibration(
        network=after,
        estimates=_estimates(network, after, found),
        fit=found,
        iterations=near.linearisations + found.linearisations,
        mae_before=_mae(network, tests),
        mae_after=_mae(after, tests),
        bias=_biases(found),
        outliers_s={place: BLOCK_S * int(jumps.sum()) for place, jumps in marked.items()},
        gain={
            p.action.channel: float(value)
            for p, value in zip(found.model.parameters, found.beta, strict=True)
            if isinstance(p.action, sensor_laws.Gain)
        },
    )


def freedom(network: Network, tests: Sequence[Test], only: Container[str] | None = None) -> tuple[Parameter, ...]:
    """The parameters of a calibration: every coefficient, every capacity, the gain of every meter, then what each test
    brings along.

    Coefficients and capacities that are not among `only` are held where they are, and stay as uncertain as their
    priors.
    """

    def of_motor(name: str, action: actions.Action, sd: float) -> Parameter:
        bound = BOUND if only is None or name in only else 0.0
        return Parameter(name, action, sd, low=-bound, high=bound)

    laws = zip(_laws(network), terms(network), strict=True)
    coefficients = (of_motor(name, actions.Scale((i,)), term.sd) for i, (name, term) in enumerate(laws))
    capacities = (
        of_motor(f"capacity.{node.name}.scale", actions.Capacity((i,)), node.sd) for i, node in enumerate(network.nodes)
    )
    gains = {m.name: m.what.gain_sd for test in tests for m in test.meters if m.what.gain_sd}
    meters = (Parameter(f"meter.{name}.gain", sensor_laws.Gain(name), sd) for name, sd in gains.items())
    brought = (p for number, test in enumerate(tests) for p in starts_and_biases(network, test, number))
    return (*coefficients, *capacities, *meters, *brought)


def _laws(network: Network) -> tuple[str, ...]:
    """The terms as `kind.place.law`, such as `loss.winding.current2`."""
    placed = ((place, product(term).name) for place, term in placed_terms(network))
    return counted([f"{'conductance' if '-' in place else 'loss'}.{place}.{law}" for place, law in placed])


def counted(names: Sequence[str]) -> tuple[str, ...]:
    """The names of laws; one that stands twice at a place is counted from its second on, as in `loss.yoke.speed#2`."""
    again = [names[:i].count(name) for i, name in enumerate(names)]
    return tuple(f"{name}#{count + 1}" if count else name for name, count in zip(names, again, strict=True))


def widened_noise(found: Fit) -> dict[str, ChannelNoise]:
    """channel -> its noise in a fit, wider by the factor by which its whitened residual is above 1 in root mean square
    (R. T. Birge, Phys. Rev. 40 (1932) 207), in all its parts but the white one; never narrower.

    A model without everyday freedom misfits in its form, fast and slow. Fitted variances (`twin.diagnosis.reml`) call
    nearly all of that slow, trust the fast part too much, and predict kept sessions of a real motor worse.
    """
    left: defaultdict[str, list[Floats]] = defaultdict(list)
    for series in found.series:
        left[series.channel].append(found.model.whitened(series, series.y[:, None])[:, 0])
    noise = {}
    for channel, parts in left.items():
        residual = np.concatenate(parts)
        factor = max(1.0, float(np.sqrt(np.mean(residual**2)))) if residual.size else 1.0
        own = found.model.noise_of(channel)
        noise[channel] = replace(own, ar_sd=factor * own.ar_sd, ou_sd=factor * own.ou_sd)
    return noise


def _estimates(before: Network, after: Network, found: Fit) -> tuple[FittedParameter, ...]:
    old, new = (
        np.array([*(term.coefficient for term in terms(n)), *(node.capacity for node in n.nodes)])
        for n in (before, after)
    )
    sd = np.sqrt(found.covariance_diagonal)
    return tuple(
        FittedParameter(
            name=parameter.name,
            before=float(old[i]),
            value=float(new[i]),
            log_change=float(found.beta[i]),
            sd=float(sd[i]),
            prior_sd=parameter.sd,
            held=bool(abs(found.beta[i]) > BOUND - HELD * sd[i]),
        )
        for i, parameter in enumerate(found.model.parameters[: old.size])
    )


def _mae(network: Network, tests: Sequence[Test]) -> dict[tuple[int, str], float]:
    series = Model(network, tests, ()).residuals(np.zeros(0))
    rows = {(s, meter.name): meter.row for s, test in enumerate(tests) for meter in test.meters}
    return {
        (one.session, one.channel): rows.get((one.session, one.channel), 1.0) * float(np.abs(one.y).mean())
        for one in series
        if one.y.size
    }


def _biases(found: Fit) -> dict[tuple[int, str], float]:
    return {
        (p.test, p.action.channel): float(value)
        for p, value in zip(found.model.parameters, found.beta, strict=True)
        if p.test is not None and isinstance(p.action, sensor_laws.Bias)
    }
