"""What changes from session to session: a motor of the plant whose slot insulation ages in ovens between three
sessions of one kind."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from ingest.facts import facts as ledger_facts
from ingest.facts.store import Store
from plant import Effect, Plant, drives, points, record, write_campaign
from plant.drives import COURSES, Drive
from replay.cli import main
from replay.engine.files.models import model_of
from replay.studies.diagnosis.question import Campaign, Question, campaign_of
from replay.studies.sessions.history import course_of
from twin.diagnosis.posterior_mode import linearised
from twin.diagnosis.refined import under_its_noise
from twin.diagnosis.rounds import THRESHOLD, scored, uncalibrated, with_refits
from twin.differences.everyday import everyday
from twin.fitting.fit import NEAR_ENOUGH, fit
from twin.fitting.model import Model, Test

SEED, SHARE_PER_100H = 92, -0.35
HOURS = (60.0, 120.0)  # in the oven, before the second and the third session
DAYS = (0, 1, 5, 6, 12)  # on which a session begins
SESSIONS = ("1_s2", "6_s2", "13_s2")
HIDDEN = "ageing.teeth-winding.hours_above_180degC"
WARM_UP_H = 1.0  # by which the copper is behind the oven, each time


@pytest.fixture(scope="module")
def question(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Question]:
    folder = tmp_path_factory.mktemp("history")
    plant = Plant(SEED, Effect("ageing.winding-teeth.hours_above_180degC", SHARE_PER_100H))
    pulses = points.s2(plant, 7000.0, 6.0, 0)
    plan = [
        (pulses, 0.0),
        (_oven(HOURS[0]), 0.0),
        (pulses, HOURS[0]),
        (_oven(HOURS[1]), HOURS[0]),
        (pulses, sum(HOURS)),
    ]
    recordings = [record(plant, plant.run(drive, day, dose)) for day, (drive, dose) in zip(DAYS, plan, strict=True)]
    logs = [str(log) for log in write_campaign(folder, plant, recordings)]
    words = ["ingest", *logs, "--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")]
    assert main([*words, "--store", str(folder / "store")]) == 0
    with Store.open(folder / "store") as store:
        facts = ledger_facts.at(store.ledger)
        train = [facts.session(name) for name in SESSIONS]
        yield Question(store, facts, train, [], model_of(facts, train[0]), "testing")


def _oven(hours: float) -> Drive:
    """Logged every 50 s: an oven changes slowly."""
    drive = drives.oven(seconds=3600.0 * hours)
    courses = {name: getattr(drive, name)[::10] for name in COURSES}
    return replace(drive.with_courses(courses), rate_hz=drive.rate_hz / 10, step_s=50.0)


@pytest.fixture(scope="module")
def campaign(question: Question) -> Campaign:
    return campaign_of(question)


def _model(campaign: Campaign, tests: tuple[Test, ...]) -> Model:
    return Model(campaign.network, tests, everyday(campaign.network, tests))


def test_a_session_knows_how_many_of_its_kind_and_how_many_hot_hours_came_before(campaign: Campaign) -> None:
    courses = [test.course for test in campaign.tests]
    assert [course["session"] for course in courses] == [0.0, 1.0, 2.0]
    hours = [100.0 * course["hours_above_180degC"] for course in courses]
    assert hours == pytest.approx([0.0, HOURS[0], sum(HOURS)], abs=len(HOURS) * WARM_UP_H)


def test_what_another_specimen_went_through_does_not_count(question: Question) -> None:
    third = question.train[2]
    for other, session, hours in (("1_s2", 1.0, sum(HOURS)), ("2_ageing", 2.0, HOURS[1])):
        sessions = [replace(s, specimen="another") if s.name == other else s for s in question.facts.sessions]
        facts = replace(question.facts, sessions=sessions)
        course = course_of(question.store, facts, third, ["session", "hours_above_180degC"])
        assert course["session"] == session
        assert 100.0 * course["hours_above_180degC"] == pytest.approx(hours, abs=len(HOURS) * WARM_UP_H)


def test_ageing_is_found_from_three_sessions_of_one_kind(campaign: Campaign) -> None:
    with threadpool_limits(1, user_api="blas"):
        model = _model(campaign, campaign.tests)
        current = fit(model, np.zeros(len(model.parameters)), NEAR_ENOUGH)
        found = scored(under_its_noise(current, campaign.candidates), campaign.candidates)
        refit = with_refits(found, lambda _: None, uncalibrated(found.base, len(model.parameters))).best
    assert refit is not None
    assert str(refit.candidate.cause) == HIDDEN
    assert refit.log_bayes_factor > THRESHOLD
    assert refit.amplitude < 0  # it conducts less


def test_it_is_not_weighed_where_each_kind_is_there_once(campaign: Campaign) -> None:
    kinds = ("s2", "drive", "other")
    apart = tuple(replace(test, kind=kind) for test, kind in zip(campaign.tests, kinds, strict=True))
    for tests, weighed in ((campaign.tests, True), (apart, False), (campaign.tests[:1], False)):
        model = _model(campaign, tests)
        current = fit(model, np.zeros(len(model.parameters)), linearisations=1)
        chosen, *_ = linearised(current, [c for c in campaign.candidates if c.repeated])
        assert bool(chosen) is weighed
