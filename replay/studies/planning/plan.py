"""What sessions, or tests that have not been run, could show of every candidate cause, and the bench day that would
show most besides."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from ingest.texts.names import handle
from replay.engine.files.benches import with_bench_of
from replay.errors import ReplayDataError
from replay.studies.characterise.calibrate import common_model
from replay.studies.diagnosis.question import Campaign, Question, campaign_of, check
from replay.studies.planning.listed import Listed, listed_campaign, unfitted
from replay.studies.sessions.fitting import fitting
from twin.diagnosis.refined import Tell, calibrated
from twin.fitting.fit import Fit
from twin.motor.network import Network
from twin.planning.chain import Day, plan_day
from twin.planning.courses import BenchRange
from twin.planning.detectable import Prospect, prospect


@dataclass(frozen=True)
class Planned:
    """What the sessions, or the `listed` tests that have not been run, could show (`prospect`) and the next `day`; the
    motor's `network`, the `model` by its id, and the `bench` as far as they show it."""

    network: Network
    model: str
    sessions: tuple[SessionRecorded, ...]
    listed: tuple[str, ...]
    bench: BenchRange
    prospect: Prospect
    day: Day


def plan(
    store: Store,
    facts: Facts,
    sessions: Sequence[SessionRecorded],
    model: str | None,
    level: str,
    hours: float,
    only: Sequence[str],
    tell: Tell,
) -> Planned:
    """The next bench day of at most so many hours for the causes `only` (ids; all where it is empty), after a fit of
    the sessions as a diagnosis begins with, under the noise that they show.

    Raises ReplayDataError where sessions are too short or of different motors, lack what the model needs, or where no
    test can be planned from them.
    """
    check(sessions, [])
    model = model or common_model(facts, sessions)
    with fitting(f"plan with model {handle(model)}"):
        tell("reading the sessions")
        campaign = campaign_of(Question(store, with_bench_of(facts, model), sessions, [], model, level))
        tell("fitting everything healthy")
        mode = calibrated(campaign.healthy, campaign.candidates, tell)
        return _planned(campaign, mode, model, sessions, (), hours, only, tell)


def refuse_other_bench(facts: Facts, sessions: Sequence[SessionRecorded], file: Path) -> None:
    """Raises ReplayDataError where a session is read with another bench file than this one."""
    sha256 = hashlib.sha256(file.read_bytes()).hexdigest()
    for session in sessions:
        if session.bench is None or sha256 not in (session.bench, facts.current(session.bench)):
            correct = shlex.join(["whyhot", "correct", session.name, "--bench", str(file), "--reason"])
            raise ReplayDataError(
                f"session {session.name} is read with another bench file than {file}: leave --bench out, or "
                f"`{correct} TEXT` changes that."
            )


def plan_listed(listed: Listed, level: str, hours: float, only: Sequence[str], tell: Tell) -> Planned:
    """As `plan`, with tests that have not been run in place of sessions: nothing is fitted, and everything that a
    healthy motor may do is as wide as its prior. Raises ReplayDataError where no bench can run them, too."""
    with fitting(f"plan with {listed.network.name}"):
        campaign = listed_campaign(listed, level)
        mode = unfitted(campaign)
        return _planned(campaign, mode, listed.model, (), tuple(listed.tests), hours, only, tell)


def _planned(
    campaign: Campaign,
    mode: Fit,
    model: str,
    sessions: Sequence[SessionRecorded],
    listed: tuple[str, ...],
    hours: float,
    only: Sequence[str],
    tell: Tell,
) -> Planned:
    tell("weighing what the sessions show")
    found = prospect(mode, campaign.candidates)
    day = plan_day(found, hours, only, tell, campaign.beyond)
    bench = BenchRange.of(campaign.network, campaign.tests)
    return Planned(campaign.network, model, tuple(sessions), listed, bench, found, day)
