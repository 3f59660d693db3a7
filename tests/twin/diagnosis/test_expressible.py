"""What files can say of a fit: the conditional mode against brute force, shares of sensors, and slopes as one node's
line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from made.motor import every_law, pulses, recorded
from twin.calibration.learned import network_of
from twin.diagnosis.expressible import COMMON_FROM, WORTH_A_LINE, expressible, readings
from twin.fitting import actions
from twin.fitting.actions import Parameter, Place
from twin.fitting.fit import NEAR_ENOUGH, Fit, fit
from twin.fitting.model import Model, Test
from twin.fitting.noise import ChannelNoise
from twin.motor import sensor_laws
from twin.motor.features import terms
from twin.motor.network import Shape, Term

Floats = NDArray[np.float64]

NETWORK = every_law()
NAMES = NETWORK.names
INITIAL = np.array([45.0, 42.0, 41.0, 35.0])


def at(*names: str) -> Place:
    return Place(*sorted(NAMES.index(name) for name in names))


@pytest.fixture(scope="module")
def tests() -> list[Test]:
    return [recorded(NETWORK, pulses(600.0, seed=s), INITIAL, name=str(s)) for s in range(COMMON_FROM)]


def fit_at(tests: list[Test], numbers: list[tuple[Parameter, float]], known: float = 10.0) -> Fit:
    """A fit whose mode and curvature are given, each number `known` so many times better than its prior: what follows
    from them needs no data."""
    model = Model(NETWORK, tests, [parameter for parameter, _ in numbers])
    hessian = np.diag((known / model.sd) ** 2)
    return Fit(model, np.array([value for _, value in numbers]), 0.0, hessian, (), 0.0, True, 1)


@pytest.fixture(scope="module")
def fitted(tests: list[Test]) -> Fit:
    """To a motor whose thermocouple sits beyond its node, and that lacks a path which another one has too much of."""
    far = {"W_1": {"winding": 1.1, "yoke": -0.1}}
    found = [recorded(NETWORK, pulses(600.0, seed=s), INITIAL, name=str(s), seed=s) for s in range(COMMON_FROM)]
    names = [node.name for node in NETWORK.nodes]
    moved = [
        replace(
            test,
            channels=tuple(
                replace(c, measured=c.measured + 0.1 * _apart(test, names)) if c.name in far else c
                for c in test.channels
            ),
        )
        for test in found
    ]
    parameters = [
        *(Parameter(f"term{i}", actions.Scale((i,)), 0.4) for i in range(len(list(terms(NETWORK))))),
        Parameter("conductance.winding-case", actions.Added((at("winding", "case"),), "constant", 1.0), 0.5, low=-0.5),
        *(Parameter(f"sensor.W_1.beside.{n}", actions.Beside("W_1", names.index(n)), 0.1) for n in ("yoke", "case")),
        Parameter("clock.can1.offset", actions.Late(("W_1", "Y_1", "R_1"), False), 0.5),
        *(Parameter("sensor.W_1.bias", sensor_laws.Bias("W_1"), 0.3, number) for number in range(COMMON_FROM)),
        Parameter("named", actions.Scale((3,)), 0.7),
    ]
    return fit(Model(NETWORK, moved, parameters), np.zeros(len(parameters)))


def _apart(test: Test, names: list[str]) -> Floats:
    """Step means of winding minus yoke in the model of the file (N,)."""
    means = Model(NETWORK, [test], []).course(0, np.zeros(0))[1]
    return means[:, names.index("winding")] - means[:, names.index("yoke")]


def test_what_files_cannot_say_is_left_out_and_the_others_follow(fitted: Fit) -> None:
    names = [p.name for p in fitted.model.parameters]
    clock, share, named = (names.index(n) for n in ("clock.can1.offset", "sensor.W_1.beside.yoke", "named"))
    assert fitted.beta[share] < -0.05
    assert fitted.beta[clock] != 0
    found = expressible(fitted, [named], {"W_1", "Y_1", "R_1"})
    shares = [i for i, n in enumerate(names) if "beside" in n or n.startswith("conductance")]
    assert found.beta[clock] == found.beta[share] == 0.0
    assert (found.beta[shares] >= 0).all()
    assert found.beta[named] == fitted.beta[named]
    # the rest is where it fits best, and that is another place than before
    clipped = fitted.beta.copy()
    clipped[shares] = np.maximum(clipped[shares], 0.0)
    clipped[clock] = 0.0
    assert found.cost < cost(fitted.model, clipped) - 1.0
    assert fit(found.model, found.beta, enough=0.01).cost > found.cost - NEAR_ENOUGH


def cost(model: Model, beta: Floats) -> float:
    """- ln posterior up to a constant."""
    white = [model.whitened(s, s.y[:, None])[:, 0] for s in model.residuals(beta)]
    return float(sum(w @ w for w in white) + np.sum((beta / model.sd) ** 2)) / 2


@pytest.mark.parametrize(("load", "written"), [("current", 0.0), ("torque", 5.0)])
def test_a_map_over_the_current_of_a_motor_that_brakes_is_said_by_no_file(
    tests: list[Test], load: str, written: float
) -> None:
    part = actions.HeatMap(NAMES.index("case"), (0.0, 1.0), (-1.0, 1.0), load, (1.0, 0.0, 0.0, 0.0))
    found = fit_at([replace(one, load=one.inputs["current"]) for one in tests], [(Parameter("heat", part, 5.0), 5.0)])
    assert expressible(found, [], ()).beta == pytest.approx([written])


def test_what_is_not_worth_a_line_goes_unless_it_is_named(fitted: Fit) -> None:
    names = [p.name for p in fitted.model.parameters]
    gains = [Parameter(f"gain{i}", sensor_laws.Gain(c), 0.01) for i, c in enumerate(("Y_1", "R_1"))]
    beta = np.append(fitted.beta, [0.5 * WORTH_A_LINE * 0.01] * 2)
    hessian = np.diag(np.append(np.diag(fitted.hessian), [1e4, 1e4]))
    small = replace(fitted, model=fitted.model.plus(gains), beta=beta, hessian=hessian)
    found = expressible(small, [len(names)], ())
    assert found.beta[len(names)] == beta[-1]
    assert found.beta[-1] == 0.0


@pytest.mark.parametrize(("known", "named", "stays"), [(1.1, False, False), (10.0, False, True), (1.1, True, True)])
def test_an_error_of_a_sensor_is_written_where_it_is_known(
    tests: list[Test], known: float, named: bool, stays: bool
) -> None:
    """A gain of 1.5 prior sds, as far as most that a fit pushes its own errors into."""
    healthy = Parameter("sensor.Y_1.gain", sensor_laws.Gain("Y_1"), 0.01)
    cause = Parameter("named", sensor_laws.Gain("Y_1" if named else "W_1"), 0.05)
    numbers = [(healthy, 0.015), (cause, 0.04), (Parameter("loss", actions.Scale((8,)), 0.1), 0.0)]
    found = expressible(fit_at(tests, numbers, known), [1], ())
    assert bool(found.beta[0]) == stays
    assert found.beta[1] == 0.04


def test_where_the_form_is_wrong_only_a_named_error_of_a_reading_is_written(tests: list[Test]) -> None:
    gain = Parameter("sensor.W_1.gain", sensor_laws.Gain("W_1"), 0.01)
    named = Parameter("sensor.Y_1.gain", sensor_laws.Gain("Y_1"), 0.05)
    lag = Parameter("sensor.W_1.lag", sensor_laws.Lag("W_1"), 0.8)
    bias, coolant = sensor_laws.Bias("R_1"), actions.BoundaryBias(0)
    shared = [(Parameter("b", bias, 0.3, number), 0.5 + 0.01 * number) for number in range(3)]
    around = [(Parameter("c", coolant, 0.5, number), 0.4 + 0.01 * number) for number in range(3)]
    starts = [(Parameter("s", actions.Start(0), 3.0, number), 0.4) for number in range(3)]
    known = fit_at(tests, [(gain, 0.02), (named, 0.1), (lag, 2.0), *shared, *around, *starts], 100.0)
    far = replace(known, model=known.model.with_noise({"W_1": ChannelNoise(1.0, 60.0, 5.0, 600.0)}))
    for found, written in ((known, {gain.action, lag.action, bias, coolant}), (far, {lag.action})):
        said = expressible(found, [1], ())
        assert set(readings(found, said, [1]).errors) == written
        assert said.beta[1] == 0.1, "what is named stays"
        assert said.beta[-3:].all(), "every test starts where it starts"
        assert bool(said.beta[3:-3].any()) == (found is known), "what a test is off by on its own, no other has"


def test_an_error_that_all_tests_share_may_still_be_the_models(tests: list[Test]) -> None:
    biases = [Parameter("bias", sensor_laws.Bias("W_1"), 0.5, number) for number in range(COMMON_FROM)]
    known, guessed = (fit_at(tests, [(one, 0.5) for one in biases], known) for known in (10.0, 1.2))
    said = fit_at(tests, [(one, 0.6) for one in biases])
    assert readings(known, said, ()).errors == {sensor_laws.Bias("W_1"): pytest.approx(0.6)}
    assert readings(guessed, said, ()).errors == {}, "an offset that takes over what a gain did"


def test_where_files_can_say_all_nothing_moves(tests: list[Test]) -> None:
    fit = fit_at(tests, [(Parameter("term0", actions.Scale((0,)), 0.4), 0.3)])
    assert expressible(fit, (), ()) is fit


def test_an_exponent_that_would_be_below_0_is_held_there(tests: list[Test]) -> None:
    own = list(terms(NETWORK))
    film = next(i for i, term in enumerate(own) if term.exponents == {"speed": 0.5})
    exponent = Parameter("conductance.ambient-case.speed", actions.Power((film,), "speed"), 0.1, low=-0.8, high=0.8)
    found = fit_at(tests, [(exponent, -0.7)])
    said = expressible(found, (), ())
    assert said.model.low == pytest.approx([-0.5])
    assert list(terms(network_of(said, ())))[film].exponents["speed"] >= 0.0


def test_a_loss_that_falls_too_fast_with_current_is_held_above_0_and_the_others_follow() -> None:
    yoke = tuple(k for k, term in enumerate(terms(NETWORK)) if term.exponents.get("speed") == 1.5)
    speeds = (0.0, 0.5, 1.0)
    falls = Term(-170.0, {"speed": 1.5, "current": 1.0})  # of 200 W: nothing is left at 1.2 times the scale
    sources = [replace(s, terms=(*s.terms, falls)) if s.node == "yoke" else s for s in NETWORK.sources]
    true = replace(NETWORK, name="falling", sources=tuple(sources))
    drives = [pulses(2400.0, seed=s) for s in range(2)]
    own = [recorded(NETWORK, drive, INITIAL, true=true, name=str(s)) for s, drive in enumerate(drives)]
    numbers = [
        Parameter(f"map.{knot}{current}", actions.Tent(yoke, speeds, knot, current), 0.5)
        for knot in range(3)
        for current in (False, True)
    ]
    scale = Parameter("term", actions.Scale(yoke), 0.4)
    model = Model(NETWORK, own, [*numbers, scale])
    found = fit(model, np.zeros(7), NEAR_ENOUGH)
    said = expressible(found, (), ())
    written = list(terms(network_of(said, ())))[yoke[0]].shape
    assert isinstance(written, Shape)
    assert found.beta[3] < Shape.least_slope(float(found.beta[2])), "what this test is about"
    np.testing.assert_array_equal(written.factor, said.beta[0:6:2])
    np.testing.assert_array_equal(written.current_slope, said.beta[1:6:2])
    cut = replace(found, beta=np.append(np.ravel(np.column_stack(_held(found.beta))), found.beta[6]))
    assert cost(model, said.beta) < cost(model, cut.beta), "the others took over what was cut"


def _held(beta: Floats) -> tuple[Floats, Floats]:
    """Factors and slopes at the knots, each slope at its least where it is below."""
    factor, slope = beta[0:6:2], beta[1:6:2]
    return factor, np.maximum(slope, [Shape.least_slope(f) for f in factor])


def test_shares_come_on_top_of_what_the_file_says_and_add_up(tests: list[Test]) -> None:
    beside = [(Parameter(f"beside{i}", actions.Beside("R_1", i), 0.1), share) for i, share in ((1, 0.1), (3, 0.2))]
    found = fit_at(tests, beside)
    weights = readings(found, found, ()).weights
    assert weights == {"R_1": {"magnet": 0.49, "yoke": 0.1, "case": pytest.approx(0.41)}}
    assert sum(weights["R_1"].values()) == pytest.approx(1.0, abs=1e-9)


def test_an_error_that_all_tests_share_is_one_of_the_bench(tests: list[Test]) -> None:
    def errors(values: tuple[float, ...]) -> Mapping[actions.OnBench, float]:
        biases = [Parameter("bias", sensor_laws.Bias("W_1"), 0.5, number) for number in range(len(values))]
        found = fit_at(tests, list(zip(biases, values, strict=True)))
        return readings(found, found, ()).errors

    assert errors((0.5, 0.52, 0.54)) == {sensor_laws.Bias("W_1"): pytest.approx(0.52)}
    for apart in ((0.5, -0.5, 0.6), (0.01, 0.011, 0.012), (0.2, 0.9, 0.1)):
        assert errors(apart) == {}


def test_what_a_named_cause_holds_already_is_not_said_twice(tests: list[Test]) -> None:
    numbers = [
        (Parameter("sensor.W_1.lag", sensor_laws.Lag("W_1"), 0.8), 0.5),
        (Parameter("sensor.winding.lag", sensor_laws.Lag("W_1"), 20.0), 9.0),
        (Parameter("sensor.Y_1.lag", sensor_laws.Lag("Y_1"), 0.8), -0.25),
    ]
    found = fit_at(tests, numbers)
    assert readings(found, found, [1]).errors == {sensor_laws.Lag("Y_1"): -0.25}


@pytest.mark.parametrize("place", [("winding",), ("yoke", "case"), ("case", "ambient"), ("yoke", "magnet")])
def test_a_slope_with_temperature_is_written_so_that_the_run_stays(tests: list[Test], place: tuple[str, ...]) -> None:
    of_place: dict[frozenset[str], list[int]] = {}
    links = [frozenset((link.a, link.b)) for link in NETWORK.links for _ in link.terms]
    sources = [frozenset((source.node,)) for source in NETWORK.sources for _ in source.terms]
    for i, ends in enumerate([*links, *sources]):
        of_place.setdefault(ends, []).append(i)
    own = tuple(of_place[frozenset(place)])
    tilt = actions.Tilt((at(*place),), (own,), (45.0,))
    fit = fit_at(tests, [(Parameter("slope", tilt, 0.003), 0.008)])
    wanted, none = (fit.model.course(0, beta)[0] for beta in (fit.beta, np.zeros(1)))
    network = network_of(fit, ())
    found = Model(network, tests, []).course(0, np.zeros(0))[0]
    moved = np.abs(wanted - none).max()
    assert moved > 0.1
    assert np.abs(found - wanted).max() < 0.25 * moved  # two ends, one node
