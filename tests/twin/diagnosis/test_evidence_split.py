"""Where a ln BF comes from, against the same numbers written out with dense matrices."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import log_ndtr
from threadpoolctl import threadpool_limits

from made.motor import CHANNELS, SINGLE, every_law, pulses, recorded
from twin.diagnosis import naming, rounds
from twin.diagnosis.naming import Naming
from twin.diagnosis.rounds import Refit
from twin.differences.candidates import InputChannel, added_monomials, generate
from twin.differences.everyday import everyday
from twin.differences.proposals import Proposals
from twin.fitting.fit import Fit, fit
from twin.fitting.model import Model
from twin.fitting.noise import ChannelNoise, Series
from twin.motor.network import Network, Term
from twin.motor.sensor import Sensor

Floats = NDArray[np.float64]

INITIAL = np.array([45.0, 42.0, 41.0, 35.0])
SENSORS = [Sensor(name, weights, "can1") for name, (weights, _) in CHANNELS.items()]
INPUTS = [InputChannel(name, "can1") for name in (*SINGLE, "coolant", "ambient")]
CANDIDATES = {str(c.cause): c for c in generate(every_law(), SENSORS, INPUTS) if c.cause.kind in ("loss", "sensor")}
HIDDEN, FALSE = "loss.magnet.speed2_current2", "loss.yoke.speed2"


@pytest.fixture(scope="module", autouse=True)
def _one_thread() -> Iterator[None]:
    """The matrices are small: more threads only wait for each other."""
    with threadpool_limits(1, user_api="blas"):
        yield


def _with_loss() -> Network:
    network, term = every_law(), Term(80.0, {"speed": 2.0, "current": 2.0})
    sources = tuple(replace(s, terms=(*s.terms, term)) if s.node == "magnet" else s for s in network.sources)
    return replace(network, name="with-loss", sources=sources)


@pytest.fixture(scope="module")
def base() -> Fit:
    more = added_monomials(tuple(CANDIDATES.values()))
    test = recorded(every_law(), pulses(900.0, seed=0), INITIAL, true=_with_loss(), more=more, seed=3)
    model = Model(every_law(), [test], everyday(every_law(), [test]))
    return fit(model, np.zeros(len(model.parameters)))


def _refit(base: Fit, cause: str) -> Refit:
    parameter = Proposals(base.model, base.beta).parameter(CANDIDATES[cause])
    found = rounds.refitted(base, CANDIDATES[cause], parameter)
    assert found is not None
    return found


@pytest.mark.parametrize("cause", [HIDDEN, FALSE, "sensor.winding.gain"])
def test_a_bayes_factor_is_fit_and_priors_relieved_and_a_rest(base: Fit, cause: str) -> None:
    refit = _refit(base, cause)
    split = refit.evidence
    assert split.fit + split.priors_relieved + split.rest == pytest.approx(refit.log_bayes_factor, abs=1e-9)
    assert split.fit == pytest.approx((_misfit(base) - _misfit(refit.fit)) / 2, abs=1e-6)
    charges, before = (refit.fit.beta / refit.fit.model.sd) ** 2, (base.beta / base.model.sd) ** 2
    np.testing.assert_allclose(split.relieved, (before - charges[:-1]) / 2, atol=1e-9)
    volumes = [
        np.linalg.slogdet(one.hessian)[1] + 2 * np.sum(np.log([p.sd for p in one.model.parameters]))
        for one in (base, refit.fit)
    ]
    sign = np.log(2) + log_ndtr(abs(refit.amplitude) / refit.sd) if refit.parameter.low == 0 else 0.0
    rest = (volumes[0] - volumes[1] - charges[-1]) / 2 + sign
    assert split.rest == pytest.approx(rest, abs=1e-6)


def test_a_true_cause_fits_better_or_relieves_and_what_it_relieves_is_told_by_parameter(base: Fit) -> None:
    refit = _refit(base, HIDDEN)
    assert refit.log_bayes_factor > 6
    assert refit.evidence.fit + refit.evidence.priors_relieved > refit.log_bayes_factor
    assert len(refit.evidence.relieved) == len(base.model.parameters)
    bent = int(np.argmax(refit.evidence.relieved))
    assert base.model.parameters[bent].name.split(".")[1] in ("magnet", "yoke-magnet")


def test_a_term_that_is_left_out_splits_alike_wherever_it_stands(base: Fit) -> None:
    """Of two terms the first is left out: what the second is relieved of counts among the priors."""
    two = _refit(_refit(base, FALSE).fit, HIDDEN).fit
    place = len(base.model.parameters)
    accepted = [(CANDIDATES[p.name], p) for p in two.model.parameters[place:]]
    searched = (rounds.scored(base, [CANDIDATES[FALSE]]),)
    found = naming._eliminated(Naming(searched, (), (), two, (), -np.inf), accepted)
    first = found.accepted[0]
    without = naming.without_term(two, place, base.beta)
    split = first.evidence
    assert split.fit == pytest.approx((_misfit(without) - _misfit(two)) / 2, abs=1e-6)
    np.testing.assert_allclose(
        split.relieved,
        ((without.beta / without.model.sd) ** 2 - np.delete((two.beta / two.model.sd) ** 2, place)) / 2,
        atol=1e-9,
    )
    assert split.fit + split.priors_relieved + split.rest == pytest.approx(first.log_bayes_factor, abs=1e-9)


def _misfit(found: Fit) -> float:
    """r' R^-1 r of all series at the mode."""
    total = 0.0
    for series in found.model.residuals(found.beta):
        covariance = _covariance(series, found.model.noise_of(series.channel))
        total += float(series.y @ np.linalg.solve(covariance, series.y))
    return total


def _covariance(series: Series, noise: ChannelNoise) -> Floats:
    apart = np.abs(series.t_s[:, None] - series.t_s[None, :])
    fast = noise.ar_sd**2 * np.exp(-apart / noise.ar_tau_s)
    slow = noise.ou_sd**2 * np.exp(-apart / noise.ou_tau_s)
    result: Floats = fast + slow + np.diag(series.white_variance)
    return result
