"""Where a refit starts: what healthy differences did at a place is handed to the candidate, and nothing else moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from made.motor import every_law, pulses, recorded
from twin.diagnosis.taking_over import taken_over
from twin.differences.candidates import Candidate, InputChannel, added_monomials, generate
from twin.differences.everyday import everyday
from twin.differences.proposals import Proposals
from twin.fitting import actions
from twin.fitting.fit import Fit, fit
from twin.fitting.model import Model
from twin.motor.sensor import Sensor

Floats = NDArray[np.float64]

OBSERVED = [Sensor("W_1", {"winding": 1.0}, "can1"), Sensor("R_1", {"magnet": 1.0}, "can2")]
INPUTS = [InputChannel(name, "can1") for name in ("speed", "current", "flow")]
CANDIDATES = {str(c.cause): c for c in generate(every_law(), OBSERVED, INPUTS)}


@pytest.fixture(scope="module")
def at_file() -> Fit:
    """A fit that has not moved from the file yet."""
    more = added_monomials(tuple(CANDIDATES.values()))
    tests = [
        recorded(every_law(), pulses(400.0, seed=i), np.array([45.0, 42.0, 41.0, 35.0]), more=more) for i in range(2)
    ]
    model = Model(every_law(), tests, everyday(every_law(), tests))
    return fit(model, np.zeros(len(model.parameters)), linearisations=1)


def _moved(at_file: Fit, changes: dict[str, float]) -> Fit:
    beta = np.zeros(len(at_file.beta))
    for name, value in changes.items():
        for p, parameter in enumerate(at_file.model.parameters):
            if parameter.name == name:
                beta[p] = value
    return replace(at_file, beta=beta)


def _start(current: Fit, cause: str) -> tuple[Floats, float, Candidate]:
    candidate = CANDIDATES[cause]
    parameter = Proposals(current.model, current.beta).parameter(candidate)
    return *taken_over(current, candidate, parameter), candidate


def _mean_loss(current: Fit, beta: Floats, term: int) -> float:
    return float(np.concatenate([current.model.course(s, beta)[2][:, term] for s in range(2)]).mean())


def test_a_heat_takes_the_mean_of_what_factor_and_map_had_added(at_file: Fit) -> None:
    """Term 12 is the magnet's only loss."""
    current = _moved(at_file, {"term12": 0.9, "map.magnet.2": 0.3, "term9": 0.4})
    beta, amplitude, candidate = _start(current, "loss.magnet.speed2_current2")
    names = [p.name for p in current.model.parameters]
    assert beta[names.index("term12")] == beta[names.index("map.magnet.2")] == 0.0
    assert beta[names.index("term9")] == 0.4, "another place"
    parameter = Proposals(current.model, current.beta).parameter(candidate)
    assert isinstance(parameter.action, actions.Added)
    feature = np.concatenate([t.features["speed2_current2"] for t in current.model.tests])
    lost = _mean_loss(current, current.beta, 12) - _mean_loss(current, beta, 12)
    assert lost > 0
    assert amplitude * feature.mean() / parameter.action.rms == pytest.approx(lost)


def test_a_factor_takes_the_factor_of_its_terms(at_file: Fit) -> None:
    current = _moved(at_file, {"term12": 0.9, "map.magnet.2": 0.3})
    beta, amplitude, _ = _start(current, "loss.magnet.scale")
    assert amplitude == pytest.approx(0.9)
    names = [p.name for p in current.model.parameters]
    assert beta[names.index("term12")] == 0.0
    assert beta[names.index("map.magnet.2")] == 0.3, "it multiplies whatever the factor is"


def test_a_lag_takes_the_lag_and_a_bias_the_mean_of_the_tests(at_file: Fit) -> None:
    current = _moved(at_file, {"sensor.W_1.lag": 3.0})
    beta, amplitude, _ = _start(current, "sensor.winding.lag")
    assert amplitude == 3.0
    assert not beta.any()
    places = [p for p, one in enumerate(current.model.parameters) if one.name == "sensor.R_1.bias"]
    biased = np.zeros(len(current.beta))
    biased[places] = 1.0, 3.0
    beta, amplitude, _ = _start(replace(current, beta=biased), "sensor.magnet.bias")
    assert amplitude == 2.0
    assert beta[places].tolist() == [-1.0, 1.0]


def test_what_is_small_stays_where_it_is(at_file: Fit) -> None:
    current = _moved(at_file, {"term12": 0.01})
    beta, amplitude, _ = _start(current, "loss.magnet.scale")
    assert amplitude == 0.0
    assert beta is current.beta
