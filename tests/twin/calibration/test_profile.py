"""Profile likelihood against the parabola where it is one, and where the data say nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from made.motor import every_law, pulses, recorded
from twin.calibration.calibrate import calibrate, freedom
from twin.calibration.profile import NO_PRIOR, RISE, profile
from twin.fitting.fit import Fit, fit
from twin.fitting.model import Model, Test
from twin.motor.network import Source, Term

Floats = NDArray[np.float64]

INITIAL = np.array([45.0, 42.0, 41.0, 35.0])


def _more_magnet_loss() -> list[Test]:
    network = every_law()
    sources = tuple(
        Source(s.node, (Term(160.0, {"speed": 2.0}),)) if s.node == "magnet" else s for s in network.sources
    )
    true = replace(network, name="lossy", sources=sources)
    return [recorded(network, pulses(900.0, seed=i), INITIAL, true=true, seed=i) for i in range(2)]


@pytest.fixture(scope="module")
def found() -> Fit:
    return calibrate(every_law(), _more_magnet_loss()).fit


def _place(found: Fit, name: str) -> int:
    return [p.name for p in found.model.parameters].index(name)


def test_its_interval_holds_the_truth_and_its_misfit_is_least_at_the_best(found: Fit) -> None:
    one = profile(found, _place(found, "loss.magnet.speed2"))
    assert one.low is not None
    assert one.high is not None
    assert one.low < np.log(2.0) < one.high
    assert one.low < one.best < one.high
    assert one.rise.min() == 0.0
    assert abs(one.values[one.rise.argmin()] - one.best) < (one.high - one.low) / 4
    for end in (one.low, one.high):
        assert one.rise[np.argmin(np.abs(one.values - end))] == pytest.approx(RISE, rel=0.25)


def test_a_well_seen_parameter_has_the_interval_of_the_parabola_without_its_prior(found: Fit) -> None:
    place = _place(found, "capacity.winding.scale")
    one = profile(found, place)
    free = [replace(p, sd=NO_PRIOR) if i == place else p for i, p in enumerate(found.model.parameters)]
    sd = np.sqrt(fit(found.model.with_priors(free), found.beta).covariance_diagonal[place])
    assert one.low is not None
    assert one.high is not None
    assert one.high - one.low == pytest.approx(2 * 1.96 * sd, rel=0.25)


def test_what_the_data_say_nothing_of_has_no_ends() -> None:
    """A test at rest says nothing of a loss that grows with speed."""
    network = every_law()
    drive = {"speed": np.zeros(1200), "current": np.full(1200, 0.5), "flow": np.full(1200, 0.8)}
    test = recorded(network, drive, INITIAL, seed=1)
    model = Model(network, [test], freedom(network, [test]))
    rest = fit(model, np.zeros(len(model.parameters)))
    one = profile(rest, _place(rest, "loss.magnet.speed2"))
    assert (one.low, one.high) == (None, None)
