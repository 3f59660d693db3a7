"""Two models that explain the same readings: where they are apart, and what would tell which is right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from made.motor import compiled, every_law, law, recorded, smooth
from twin.diagnosis.next_tests import Proposed
from twin.diagnosis.two_models import HOTTER_K, foreseen, inside, points, relieved, unseen, usual_floor
from twin.differences.everyday import laws
from twin.fitting.actions import Added, Parameter, Place
from twin.fitting.fit import Fit, fit
from twin.fitting.model import Floats, Model
from twin.motor.features import evaluate, monomials
from twin.motor.network import Network, Source, Term
from twin.run.simulate import Frame, simulate

INITIAL = np.array([60.0, 50.0, 55.0, 45.0])
CASE = 3  # the node that no sensor follows
HEAT = Parameter("loss.case.speed2", Added((Place(CASE),), "speed2", 1.0), 30.0)


def _true() -> Network:
    """The motor with a heat of 80 W at full speed in the case."""
    network = every_law()
    heat = Source("case", (Term(80.0, {"speed": 2.0}),))
    return replace(network, name="with a heat", sources=(*network.sources, heat))


@pytest.fixture(scope="module")
def fits() -> tuple[Fit, Fit]:
    """Without the heat and with it, fitted to a test that shows winding, yoke and magnet alone."""
    network = every_law()
    test = recorded(network, smooth(1800.0), INITIAL, true=_true(), more=[law(speed=2.0)])
    model = Model(network, [test], list(laws(network)))
    before = fit(model, np.zeros(len(model.parameters)))
    return before, fit(before.model.plus([HEAT]), np.append(before.beta, 0.0))


def test_what_stood_in_for_the_heat_is_relieved_first(fits: tuple[Fit, Fit]) -> None:
    before, after = fits
    found = relieved(before, after, before.model.parameters)
    assert len(found) == len(before.model.parameters)
    back = [abs(one.before) - abs(one.after) for one in found]
    assert back == sorted(back, reverse=True) and back[0] > 0.1
    i = before.model.parameters.index(found[0].parameter)
    assert found[0].before == before.beta[i] / before.model.sd[i]
    assert found[0].after == after.beta[i] / before.model.sd[i]


def test_widths_that_a_fit_was_given_later_do_not_count(fits: tuple[Fit, Fit]) -> None:
    before, after = fits
    wider = before.model.with_priors([replace(p, sd=3 * p.sd) for p in before.model.parameters])
    assert relieved(replace(before, model=wider), after, before.model.parameters)[0].before == pytest.approx(
        relieved(before, after, before.model.parameters)[0].before
    )


def test_the_node_without_a_sensor_is_as_far_apart_as_two_runs_are(fits: tuple[Fit, Fit]) -> None:
    before, after = fits
    test = before.model.tests[0]
    names = [node.name for node in every_law().nodes]
    assert unseen([test], names) == ["case"]
    (found,) = inside(before, after, [test])
    apart = np.abs(after.model.course(0, after.beta)[1] - before.model.course(0, before.beta)[1])[:, CASE]
    assert (found.node, found.test) == ("case", 0)
    assert found.mean_K == pytest.approx(apart.mean()) and found.max_K == pytest.approx(apart.max())
    assert found.t_s == (int(apart.argmax()) + 0.5) * test.frame.step_s
    seen = np.abs(after.model.course(0, after.beta)[1] - before.model.course(0, before.beta)[1])[:, :CASE]
    assert found.mean_K > 2 * seen.mean(), "the sensors see less of it"


def _after_an_hour(network: Network, start: Floats, speed: float, current: float, flow: float) -> Floats:
    drive = {name: np.full(7200, value) for name, value in {"speed": speed, "current": current, "flow": flow}.items()}
    frame = Frame(0.5, evaluate(monomials(network), drive, 7200), np.tile([40.0, 25.0], (7200, 1)))
    found: Floats = simulate(compiled(network), frame, start)[-1]
    return found


def test_a_point_is_the_end_of_an_hour_at_it(fits: tuple[Fit, Fit]) -> None:
    before, _ = fits
    with_heat = replace(before, model=before.model.plus([HEAT]), beta=np.append(np.zeros(before.beta.size), 80.0))
    none = replace(before, beta=np.zeros(before.beta.size))
    found = points(none, with_heat)
    assert found and len({point.words for point in found}) == len(found)
    test = before.model.tests[0]
    for point in found:
        flow = float(np.median(test.inputs["flow"]))
        ends = [_after_an_hour(one, test.initial, point.speed, point.load, flow) for one in (every_law(), _true())]
        assert list(point.nodes.values()) == pytest.approx((ends[1] - ends[0]).tolist(), abs=0.02)
        (winding,) = (one for one in point.readings if one.name == "W_1")
        assert winding.differ_K == pytest.approx(point.nodes["winding"], abs=0.02)
        assert winding.times == pytest.approx(abs(winding.differ_K) / usual_floor(before), rel=0.3)


def test_points_are_where_the_motor_was_and_heat_no_node_much_more(fits: tuple[Fit, Fit]) -> None:
    before, after = fits
    test = before.model.tests[0]
    assert max(point.load for point in points(before, after)) <= test.inputs["current"].max()
    assert max(point.speed for point in points(before, after)) <= test.inputs["speed"].max()
    hottest = before.model.course(0, before.beta)[1].max(axis=0)
    hot = replace(after, beta=np.append(after.beta[:-1], 2000.0))
    left = points(before, hot)
    flow = float(np.median(test.inputs["flow"]))
    assert len(left) < len(points(before, after))
    for point in left:
        end = _after_an_hour(every_law(), test.initial, point.speed, point.load, flow)[CASE] + point.nodes["case"]
        assert end < hottest[CASE] + HOTTER_K + 10.0  # the fit's own end is near that of the file


def test_tests_that_know_no_load_have_no_points(fits: tuple[Fit, Fit]) -> None:
    before, after = fits
    test = before.model.tests[0]
    blind = replace(test, inputs={name: u for name, u in test.inputs.items() if name != "current"})
    model = Model(every_law(), [blind], before.model.parameters)
    assert points(replace(before, model=model), after) == []


def test_a_test_that_was_not_run_is_foreseen_as_each_model_runs_it(fits: tuple[Fit, Fit]) -> None:
    before, _ = fits
    with_heat = replace(before, model=before.model.plus([HEAT]), beta=np.append(np.zeros(before.beta.size), 80.0))
    none, test = replace(before, beta=np.zeros(before.beta.size)), before.model.tests[0]
    ones = np.ones(round(3600 / test.frame.step_s))
    found = foreseen({"without": none, "with": with_heat}, Proposed("an hour", 0.8 * ones, 0.5 * ones, ones))
    assert [one.name for one in found] == [channel.name for channel in test.channels]
    assert all(one.floor_K == pytest.approx(usual_floor(before), rel=0.3) for one in found)
    (winding,) = (one for one in found if one.name == "W_1")
    flow = float(np.median(test.inputs["flow"]))
    for name, network in {"without": every_law(), "with": _true()}.items():
        (end, *_) = _after_an_hour(network, test.initial, 0.8, 0.5, flow)
        assert winding.reads[name][-1] == pytest.approx(end, abs=0.1), "its last block ends with the hour"
