"""The smallest amplitude of each cause is the one that stands out, costs what a run with it says, and is in the unit
that it is told in."""

from __future__ import annotations

import numpy as np
import pytest

from twin.diagnosis.posterior_mode import linearised, stacked
from twin.diagnosis.told_apart import STANDS_OUT
from twin.differences.candidates import Candidate
from twin.fitting.actions import Added, Scale
from twin.motor.causes import OF_THE_MOTOR
from twin.planning.detectable import Prospect


def test_the_smallest_amplitude_is_d_5_in_the_readings(found: Prospect, candidates: tuple[Candidate, ...]) -> None:
    fit = found.ground.fit
    chosen, parameters, parts, _ = linearised(fit, candidates)
    projector, v, _ = stacked(fit, parts)
    of = {str(one.candidate.cause): one for one in found.detectable}
    assert len(of) == len(chosen) > 50
    for i in range(0, len(chosen), 7):
        amplitude = of[str(chosen[i].cause)].times * parameters[i].sd
        reading = amplitude * v[:, i]
        d = float(projector.inner(v[:, i], reading)) / float(projector.inner(v[:, i], v[:, i])) ** 0.5
        assert d == pytest.approx(STANDS_OUT)


def test_heats_are_told_in_watts_paths_in_watts_per_kelvin_and_errors_cost_no_kelvin(found: Prospect) -> None:
    units = {"loss": {"W", "1/session"}, "conductance": {"W/K", "1/session"}}
    for one in found.detectable:
        kind = one.candidate.cause.kind
        if kind in units:
            assert one.unit in units[kind], one.candidate.cause
        assert (one.hot_spot_K is None) == (kind not in OF_THE_MOTOR)


def test_the_smallest_heat_costs_what_a_run_with_it_says(found: Prospect) -> None:
    fit = found.ground.fit
    model, place = fit.model, [n.name for n in fit.model.network.nodes].index("winding")
    before = model.course(0, fit.beta)[1][:, place]
    seen = 0
    for one in found.detectable:
        parameter = found.ground.candidates[found.candidates.index(one.candidate)]
        if isinstance(parameter.action, Added) and one.smallest and one.hot_spot_K and one.unit == "W":
            size = 0.1 * one.times * parameter.sd  # small, as a heat in copper makes more of itself
            after = model.plus([parameter]).course(0, np.append(fit.beta, size))[1][:, place]
            at_the_hottest = float((after - before)[int(before.argmax())])
            assert 0.1 * one.hot_spot_K == pytest.approx(at_the_hottest, rel=0.08, abs=0.02)
            assert one.smallest == pytest.approx(one.times * parameter.sd)
            seen += 1
    assert seen > 10


def test_a_factor_of_a_heat_is_told_as_its_mean_watts(found: Prospect) -> None:
    one = next(o for o in found.detectable if str(o.candidate.cause) == "loss.magnet.scale")
    parameter = found.ground.candidates[found.candidates.index(one.candidate)]
    assert isinstance(parameter.action, Scale)
    fit = found.ground.fit
    mean = float(fit.model.course(0, fit.beta)[2][:, list(parameter.action.terms)].sum(axis=1).mean())
    assert one.smallest == pytest.approx(one.times * parameter.sd * mean)


def test_laws_that_differ_by_the_speed_alone_look_alike_at_one_speed(found: Prospect) -> None:
    """The motor ran at one speed: what grows with speed in one place has one course."""
    of = {str(one.candidate.cause): one for one in found.detectable}
    at_case = [cause for cause in of if cause.startswith("loss.case.")]
    assert "loss.case.speed2" in at_case
    assert set(of["loss.case.speed2"].alike) & set(at_case)
    for one in found.detectable:
        assert str(one.candidate.cause) not in one.alike
