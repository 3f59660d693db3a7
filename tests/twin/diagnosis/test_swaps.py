"""Exchanged channels and misread units, found on the uncalibrated simulation."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal

from made import motor as made
from twin.diagnosis import swaps
from twin.differences.candidates import Candidate
from twin.differences.everyday import everyday
from twin.differences.sizes import Sigma
from twin.fitting.actions import Capacity
from twin.fitting.model import Model, Test
from twin.fitting.noise import ChannelNoise
from twin.motor.causes import Cause
from twin.motor.network import Link, Network, Source, Term
from twin.motor.sensor_laws import Exchange

Floats = NDArray[np.float64]

INITIAL = np.array([60.0, 50.0, 55.0, 45.0])


def _swap(a: str, b: str) -> Candidate:
    place = {"W_1": "winding", "Y_1": "yoke", "R_1": "magnet"}
    return Candidate(Cause("sensor", place[a], f"swap_{place[b]}"), "1", Sigma(1.0), 1, Exchange(a, b))


PAIRS = (_swap("W_1", "Y_1"), _swap("W_1", "R_1"), _swap("Y_1", "R_1"))


def _true_motor(network: Network) -> Network:
    """Ten per cent off the file."""
    rng = np.random.default_rng(5)

    def off(terms: tuple[Term, ...]) -> tuple[Term, ...]:
        return tuple(replace(t, coefficient=t.coefficient * float(np.exp(rng.normal(0, 0.1)))) for t in terms)

    links = tuple(Link(link.a, link.b, off(link.terms)) for link in network.links)
    return replace(network, links=links, sources=tuple(Source(s.node, off(s.terms)) for s in network.sources))


def _tests(network: Network, samples: dict[str, Floats] | None = None) -> tuple[Test, ...]:
    true = _true_motor(network)
    drives = (made.smooth(1800.0), made.pulses(1200.0))
    return tuple(
        made.recorded(network, drive, INITIAL, true=true, seed=i, samples=samples if i == 0 else None)
        for i, drive in enumerate(drives)
    )


def _model(network: Network, tests: tuple[Test, ...]) -> Model:
    return Model(network, tests, everyday(network, tests))


def _covariance(t_s: Floats, white: float, noise: ChannelNoise) -> Floats:
    apart = np.abs(t_s[:, None] - t_s)
    slow = noise.ou_sd**2 * np.exp(-apart / noise.ou_tau_s) + noise.ar_sd**2 * np.exp(-apart / noise.ar_tau_s)
    return np.asarray(white * np.eye(len(t_s)) + slow)


def test_the_evidence_of_an_exchange_is_the_gaussian_one() -> None:
    network = made.every_law()
    (test,) = tests = _tests(network)[1:]
    model = _model(network, tests)
    parts = model.linearise(np.zeros(len(model.parameters)))
    a = np.zeros((sum(len(p.columns) for p in parts), len(model.parameters)))
    measured, modelled, noise, row = {}, [], [], 0
    for part, channel in zip(parts, test.channels, strict=True):
        a[row : row + len(part.columns), part.at] = part.columns
        row += len(part.columns)
        measured[channel.name] = channel.blocks(2.0).measured(channel.measured)
        modelled.append(measured[channel.name] - part.series.y)
        noise.append(_covariance(part.series.t_s, made.WHITE_SD**2 + made.RESOLUTION**2 / 12, swaps.COARSE))
    law = multivariate_normal(np.concatenate(modelled), block_diag(*noise) + (a * model.sd**2) @ a.T)
    as_recorded, crossed = (
        float(law.logpdf(np.concatenate([measured[name] for name in order])))
        for order in (("W_1", "Y_1", "R_1"), ("Y_1", "W_1", "R_1"))
    )
    uncalibrated = swaps._Uncalibrated(model)
    straight = {name: name for name in ("W_1", "Y_1", "R_1")}
    found = uncalibrated.log_evidence({**straight, "W_1": "Y_1", "Y_1": "W_1"}) - uncalibrated.log_evidence(straight)
    assert found == pytest.approx(crossed - as_recorded, rel=1e-5)


@pytest.mark.parametrize("pair", PAIRS, ids=lambda c: str(c.cause))
def test_an_exchanged_pair_is_found_and_no_other(pair: Candidate) -> None:
    network = made.every_law()
    assert isinstance(pair.action, Exchange)
    tests = swaps.exchanged(_tests(network), pair.action.channel, pair.action.other)
    (found,) = swaps.scan(_model(network, tests), PAIRS)
    assert found.candidate == pair
    assert found.log_bayes_factor > swaps.MARGIN


def test_nothing_is_exchanged_in_a_motor_ten_per_cent_off_its_file() -> None:
    network = made.every_law()
    assert swaps.scan(_model(network, _tests(network)), PAIRS) == []


def test_an_exchange_is_found_where_the_channels_have_different_gaps() -> None:
    network = made.every_law()
    gap = np.ones(900)
    gap[300:420] = 0.0
    tests = swaps.exchanged(_tests(network, {"W_1": gap}), "W_1", "Y_1")
    (found,) = swaps.scan(_model(network, tests), PAIRS)
    assert found.candidate == PAIRS[0]


def test_an_exchange_is_found_where_one_test_lacks_one_of_the_channels() -> None:
    network = made.every_law()
    first, second = _tests(network)
    second = replace(second, channels=tuple(c for c in second.channels if c.name != "W_1"))
    tests = swaps.exchanged((first, second), "W_1", "Y_1")
    assert {c.name for c in tests[1].channels} == {"W_1", "R_1"}
    (found,) = swaps.scan(_model(network, tests), PAIRS)
    assert found.candidate == PAIRS[0]


def test_exchanging_twice_gives_the_tests_back() -> None:
    tests = _tests(made.every_law())
    again = swaps.exchanged(swaps.exchanged(tests, "W_1", "R_1"), "W_1", "R_1")
    for before, after in zip(tests, again, strict=True):
        for a, b in zip(before.channels, after.channels, strict=True):
            assert a.name == b.name
            np.testing.assert_array_equal(a.measured, b.measured)


def test_an_exchange_leaves_place_and_lag_with_the_name_and_takes_the_record_along() -> None:
    network = made.every_law()
    tests = _tests(network, {"W_1": np.r_[np.zeros(100), np.ones(800)]})
    before = {c.name: c for c in tests[0].channels}
    after = {c.name: c for c in swaps.exchanged(tests, "W_1", "Y_1")[0].channels}
    assert after["Y_1"].sensor.weights == {"yoke": 1.0}
    assert after["Y_1"].sensor.time_constant_s == 3.0
    np.testing.assert_array_equal(after["Y_1"].measured, before["W_1"].measured)
    np.testing.assert_array_equal(after["Y_1"].samples, before["W_1"].samples)


def test_the_start_that_was_measured_goes_along_with_the_record() -> None:
    first, second = _tests(made.every_law())
    at_winding, at_yoke = np.array([1.0, 0.3, 0.1, 0.0]), np.array([0.0, 1.0, 0.4, 0.2])
    measured = replace(first, begins={"W_1": at_winding, "Y_1": at_yoke})
    found = swaps.exchanged((measured, second), "W_1", "R_1")[0].begins
    assert found == {"R_1": at_winding, "Y_1": at_yoke}, "what is called R_1 now was read at the winding"


def _showing(test: Test, channel: str, factor: float, offset: float) -> Test:
    return replace(
        test,
        channels=tuple(
            replace(c, measured=factor * c.measured + offset) if c.name == channel else c for c in test.channels
        ),
    )


@pytest.mark.parametrize(("factor", "offset", "says"), [(1.8, 32.0, "degF"), (-1.0, 0.0, "sign reversed")])
def test_a_channel_in_another_unit_or_of_the_other_sign_is_told(factor: float, offset: float, says: str) -> None:
    network = made.every_law()
    tests = tuple(_showing(test, "Y_1", factor, offset) for test in _tests(network))
    (line,) = swaps.misread(_model(network, tests))
    assert line.startswith('channel "Y_1": ')
    assert says in line


def test_channels_in_degc_are_not_called_misread() -> None:
    network = made.every_law()
    assert swaps.misread(_model(network, _tests(network))) == []


def test_a_channel_whose_clock_is_late_by_half_a_minute_is_not_in_another_unit() -> None:
    """In pulses it fits no reading; all that counts is that as degF it would be further off still."""
    network = made.every_law()
    drive = made.pulses(1200.0)
    (test,) = [made.recorded(network, {**drive, "current": 1.7 * drive["current"]}, INITIAL, seed=0)]
    late = tuple(replace(c, measured=np.r_[np.full(18, c.measured[0]), c.measured[:-18]]) for c in test.channels)
    assert swaps.misread(_model(network, (replace(test, channels=(late[0], *test.channels[1:])),))) == []


def test_what_another_cause_explains_better_is_no_exchange(monkeypatch: pytest.MonkeyPatch) -> None:
    """The pair stands out before calibration and after it, and not beside a candidate that explains as much."""
    network = made.every_law()
    tests = swaps.exchanged(_tests(network), "W_1", "Y_1")
    other = Candidate(Cause("capacity", "yoke", "scale"), "1", Sigma(0.3), 0, Capacity((made.YOKE,)))
    assert [swap.candidate for swap in swaps.scan(_model(network, tests), (*PAIRS, other))] == [PAIRS[0]]

    def explains_all(*_: object) -> SimpleNamespace:
        return SimpleNamespace(scores=SimpleNamespace(log_bayes_factor=np.array([1e6])))

    monkeypatch.setattr(swaps, "weighed", explains_all)
    assert swaps.scan(_model(network, tests), (*PAIRS, other)) == []


def test_a_pair_that_calibration_puts_right_is_no_exchange(monkeypatch: pytest.MonkeyPatch) -> None:
    """Calibrated to the tests as recorded it fits as well: nothing is left that an exchange would explain."""
    network = made.every_law()
    tests = swaps.exchanged(_tests(network), "W_1", "Y_1")

    def as_good(*_: object) -> SimpleNamespace:
        return SimpleNamespace(log_evidence=7.0)

    monkeypatch.setattr(swaps, "fit_from_file", as_good)
    assert swaps.scan(_model(network, tests), PAIRS) == []
