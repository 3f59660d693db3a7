"""The next bench day: within limits and hours, by what it adds, and refused in words where no bench could run it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from twin.diagnosis.told_apart import STANDS_OUT
from twin.errors import PlanError
from twin.motor.outputs import BLOCK_S
from twin.planning import chain
from twin.planning import courses as planned_courses
from twin.planning.chain import Day, DayStep, Wanted, plan_day
from twin.planning.courses import BenchRange, blocks, courses, cut
from twin.planning.detectable import Prospect
from twin.planning.limits import first_over, heated

HOURS = 2.0
WANTED = "loss.magnet.speed3"


def _quiet(_: str) -> None: ...


@pytest.fixture(scope="module", autouse=True)
def _short_menu() -> Iterator[None]:
    """Three speeds and two lengths: every kind of test is there, in a quarter of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(planned_courses, "SPEEDS", (0.25, 0.5, 1.0))
        for module in (planned_courses, chain):
            patch.setattr(module, "MINUTES", (15, 30))
        yield


@pytest.fixture(scope="module")
def day(found: Prospect) -> Day:
    return plan_day(found, HOURS, (), _quiet)


def test_the_menu_stays_within_what_was_recorded(found: Prospect) -> None:
    base = found.ground.fit.model
    bench = BenchRange.of(base.network, base.tests)
    menu = list(courses(bench))
    assert len({one.words for one in menu}) == len(menu) > 20
    for start in ("S1 at", "S2 pulses", "spin-downs", "DC at standstill", "flow halved", "coolant 20 K colder"):
        assert any(one.words.startswith(start) for one in menu), start
    for one in menu:
        assert one.speed.max() <= bench.top
        assert one.load.max() <= bench.loads.max()
        assert one.speed[0] == one.load[0] == 0.0


def test_a_day_has_its_hours_and_crosses_no_limit(day: Day) -> None:
    assert 0 < sum(step.hours for step in day.steps) <= HOURS
    rests = len(day.steps) * blocks(day.rest_min)
    assert len(day.course.speed) == sum(len(step.proposed.speed) for step in day.steps) + rests
    assert (day.heated.high <= day.heated.limits.degC).all()
    assert (day.heated.sd_K > 0.0).all()
    assert day.heated.limits.nodes == ("winding",)
    assert len(day.heated.degC) * BLOCK_S == len(day.course.speed) * BLOCK_S


def test_what_each_step_adds_adds_up_and_first_comes_what_adds_most_an_hour(found: Prospect, day: Day) -> None:
    wanted = Wanted.of(found, ())
    base = found.ground.fit.model
    bench, known = BenchRange.of(base.network, base.tests), found.ground.known
    before = wanted.told(known)
    for step in day.steps:
        (told,) = found.ground.untried(bench.test(step.proposed)).would_tell([len(step.proposed.speed)])
        known += told
    assert sum(step.gain_nat for step in day.steps) == pytest.approx(wanted.told(known) - before, rel=1e-6)
    rates = [step.gain_nat / step.hours for step in day.steps]
    assert rates[0] == max(rates)


def test_a_day_promises_no_less_than_there_was(day: Day) -> None:
    assert (day.promise.after >= day.promise.before * (1 - 1e-9)).all()
    assert (day.promise.after >= STANDS_OUT).sum() > (day.promise.before >= STANDS_OUT).sum()


def test_what_is_not_observed_yet_is_proposed(found: Prospect, day: Day) -> None:
    seen = {c.sensor.node for t in found.ground.fit.model.tests for c in t.channels}
    assert day.observed
    assert not seen & {step.node for step in day.observed}
    assert all(step.gain_nat > 0 for step in day.observed)


def test_the_best_test_and_the_best_observation_of_a_cause_show_it_better(day: Day) -> None:
    for best, without in ((day.promise.best_test, day.promise.before), (day.promise.best_observed, day.promise.after)):
        raised = np.array([bool(what) for what in best.what])
        assert raised.any()
        assert (best.d[raised] > without[raised]).all()
        assert best.d[~raised] == pytest.approx(without[~raised], rel=1e-5)


def test_all_observations_together_show_no_less_than_the_best_of_them(day: Day) -> None:
    assert (day.promise.all_observed >= day.promise.best_observed.d * (1 - 1e-5)).all()


def test_a_day_for_one_cause_begins_with_what_tells_most_of_it(found: Prospect, day: Day) -> None:
    own, wanted, base = plan_day(found, HOURS, [WANTED], _quiet), Wanted.of(found, [WANTED]), found.ground.fit.model
    test = BenchRange.of(base.network, base.tests).test(day.steps[0].proposed)
    (told,) = found.ground.untried(test).would_tell([len(day.steps[0].proposed.speed)])
    of_the_other = wanted.told(found.ground.known + told) - wanted.told(found.ground.known)
    assert own.steps[0].gain_nat / own.steps[0].hours >= of_the_other / day.steps[0].hours
    assert own.steps[0].proposed.words != day.steps[0].proposed.words


def _at(limit_degC: float) -> Callable[[Prospect], Prospect]:
    return lambda found: replace(found, limits=replace(found.limits, degC=np.array([limit_degC])))


def test_where_no_test_stays_below_the_limits_it_is_said_which_and_what_would_relax_it(found: Prospect) -> None:
    with pytest.raises(PlanError, match=r"the winding may be above its 50 °C after 0 min.*colder coolant"):
        plan_day(_at(50.0)(found), HOURS, (), _quiet)


def test_a_day_too_short_for_any_test_is_refused(found: Prospect) -> None:
    with pytest.raises(PlanError, match=r"0\.2 h are too few .*: give 0\.59 h or more"):
        plan_day(found, 0.2, (), _quiet)


def test_a_cause_that_is_none_is_refused(found: Prospect) -> None:
    with pytest.raises(PlanError, match=r"loss\.magnet\.speed9: no candidate.*; the nearest is loss\.magnet\.speed"):
        plan_day(found, HOURS, ["loss.magnet.speed9"], _quiet)


def test_a_test_is_looked_at_until_it_is_above_its_limit_and_its_band_is_what_is_unknown(found: Prospect) -> None:
    base = found.ground.fit.model
    bench = BenchRange.of(base.network, base.tests)
    hottest = max((one for one in courses(bench) if one.words.startswith("S1")), key=lambda one: one.load.max())
    untried = chain._untried(found, bench, hottest)
    whole = heated(_at(500.0)(found).limits, untried)
    limits = _at(float(whole.degC.mean()))(found).limits
    until = heated(limits, untried)
    assert len(until.high) < len(whole.high) == len(hottest.speed)
    np.testing.assert_array_equal(until.degC, whole.degC[: len(until.degC)])
    assert until.first_over() == replace(whole, limits=limits).first_over()
    (inside,) = (one for one in untried.model.linearise(untried.beta) if not one.series.measured)
    unknown = np.diag(untried.model.sd**2)
    known = len(found.ground.shared)
    unknown[:known, :known] = np.linalg.inv(found.ground.known.gram)
    expected = np.sqrt(np.diag(inside.columns @ unknown @ inside.columns.T))
    np.testing.assert_allclose(whole.sd_K[:, 0], expected, rtol=1e-6)


@pytest.mark.parametrize("share", [0.2, 0.6, 1.1])
def test_the_block_in_which_a_limit_is_crossed_is_that_of_the_whole_band(found: Prospect, share: float) -> None:
    bench = BenchRange.of(found.ground.fit.model.network, found.ground.fit.model.tests)
    course = next(one for one in courses(bench) if one.words.startswith("S2") and one.load.max() > 0.0)
    untried = chain._untried(found, bench, course)
    whole = heated(_at(500.0)(found).limits, untried)
    limits = _at(float(whole.degC.min() + share * np.ptp(whole.high)))(found).limits
    over = first_over(limits, untried)
    assert over == replace(whole, limits=limits).first_over()
    assert (over is None) == (share > 1.0)


def test_rests_grow_until_the_whole_day_stays_below_its_limits(
    found: Prospect, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Twice a test that heats, and a limit just below what the second becomes after the shortest rest."""
    base = found.ground.fit.model
    bench = BenchRange.of(base.network, base.tests)
    hot_test = next(one for one in courses(bench) if one.words.startswith("S1") and one.load.max() == bench.loads.max())
    steps = [DayStep(cut(hot_test, blocks(15)), 0.0, 0.0)] * 2
    monkeypatch.setattr(chain, "RESTS_MIN", (1,))
    hot = chain._within_limits(_at(500.0)(found), bench, steps)[3].high.max()
    monkeypatch.setattr(chain, "RESTS_MIN", (1, 120))
    cool = chain._within_limits(_at(hot - 1e-6)(found), bench, steps)
    assert cool[1] == 120
    monkeypatch.setattr(chain, "RESTS_MIN", (1,))
    with pytest.raises(PlanError, match="even with rests of 1 min"):
        chain._within_limits(_at(hot - 1e-6)(found), bench, steps)
