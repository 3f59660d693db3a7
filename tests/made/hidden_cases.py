"""Motors of `plant` that hide one thing each, through logs, store and search, each in a process of its own.

Of the search its first round; exchanged channels and faults of the data need no search at all.
"""

from __future__ import annotations

import gc
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.trial.audit import Spread, spreads
from ingest.facts import facts as ledger_facts
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import take_in
from ingest.intake.setup import prepare
from plant import Effect, Plant, drives, points, sessions, write_campaign
from plant.forms import FORMS
from replay.engine.files.models import for_intake
from replay.studies.characterise.calibrate import common_model
from replay.studies.diagnosis.data_faults import data_faults
from replay.studies.diagnosis.question import Campaign, Question, campaign_of
from twin.diagnosis.free_heats import free_heats
from twin.diagnosis.refined import calibrated
from twin.diagnosis.rounds import EVIDENT, THRESHOLD, scored, uncalibrated, with_refits
from twin.diagnosis.swaps import scan
from twin.diagnosis.told_apart import told_apart
from twin.fitting.fit import NEAR_ENOUGH, fit
from twin.fitting.model import Model

LAYOUT = "six"


@dataclass(frozen=True)
class Case:
    """A specimen and what it hides, "" for nothing; `size` in the unit of its kind (plant/README.md); the form of its
    motor (plant.forms) and the rule that its file was made by (plant.rules); how long its sessions are, as a share of
    20, 20 and 30 min."""

    seed: int
    cause: str = ""
    size: float = 0.0
    form: str = "jacketed"
    rule: str = "fitted"
    length: float = 1.0


@dataclass(frozen=True)
class Answer:
    """What enters first, "" for nothing; `same`: what the data cannot tell from it; ln BF against the model without
    it; `amplitude` in the unit of its prior; `leading`: ln BF of all that were refitted; `audit` where nothing enters:
    how far each family of everyday parameters is from its priors."""

    first: str
    same: tuple[str, ...] = ()
    log_bf: float = 0.0
    amplitude: float = 0.0
    leading: tuple[tuple[str, float], ...] = ()
    audit: Mapping[str, Spread] = field(default_factory=dict)


def _campaign(case: Case) -> Campaign:
    """An S1 point, S2 pulses and a WLTC, as BLF with motor, bench and DBC file, ingested and read back as the verb
    reads them."""
    form = FORMS[case.form]
    plant = Plant(case.seed, *([Effect(case.cause, case.size)] if case.cause else []), form=form)
    top_rpm, minutes, cycle = form.machine.top_rpm, 20.0 * case.length, drives.wltp(1, form.vehicle)
    plan = [points.s1(plant, 0.5625 * top_rpm, minutes, 0), points.s2(plant, 0.4375 * top_rpm, minutes, 1)]
    plan.append(cycle.first(case.length * cycle.seconds))
    with TemporaryDirectory() as name:
        folder = Path(name)
        logs = write_campaign(folder, plant, sessions(plant, plan, LAYOUT), layout=LAYOUT, rule=case.rule)
        setup = prepare(logs, folder / "bench.toml", [folder / "bench.dbc"], for_intake)
        with Store.open(folder / "store", create=True) as store:
            take_in(store, logs, setup, Override())
            known = ledger_facts.at(store.ledger)
            stored = [known.session(log.stem) for log in logs]
            return campaign_of(Question(store, known, stored, [], common_model(known, stored), "testing"))


def keep_imports() -> None:
    """In a process that will answer several cases: what it imported is not looked through for garbage each time."""
    gc.freeze()


def diagnosed(case: Case) -> Answer:
    """What the first round of the search says of a case; for exchanged channels the scan, for a fault of the data its
    evidence."""
    with threadpool_limits(1, user_api="blas"):
        campaign = _campaign(case)
        model = campaign.healthy
        swaps = scan(model, campaign.candidates)
        if swaps:
            return Answer(str(swaps[0].candidate.cause), log_bf=swaps[0].log_bayes_factor)
        if case.cause.endswith(".stuck"):
            return _fault(campaign, model)
        return _first_term(campaign, model)


def _fault(campaign: Campaign, model: Model) -> Answer:
    current = fit(model, np.zeros(len(model.parameters)), enough=NEAR_ENOUGH)
    found = data_faults(current, campaign.loaded, campaign.observed, EVIDENT)
    return Answer(str(found[0].cause), log_bf=found[0].log_bayes_factor) if found else Answer("")


def _first_term(campaign: Campaign, model: Model) -> Answer:
    """What the search lets in first."""
    base = calibrated(model, campaign.candidates, _quietly)
    weighed, heat = scored(base, campaign.candidates), free_heats(base)[0].log_bayes_factor
    if heat > max(EVIDENT, float(weighed.scores.log_bayes_factor.max())):
        return Answer("unknown", log_bf=heat)
    found = with_refits(weighed, _quietly, uncalibrated(base, len(model.parameters)))
    leading = tuple((str(r.candidate.cause), r.log_bayes_factor) for r in found.refits)
    best = found.best
    if best is None or best.log_bayes_factor <= max(THRESHOLD, found.null):
        return Answer("", leading=leading, audit=spreads(found.base))
    same = tuple(str(m.candidate.cause) for m in told_apart(found, best.candidate, heat).others)
    return Answer(str(best.candidate.cause), same, best.log_bayes_factor, best.amplitude, leading)


def _quietly(line: str) -> None:
    """Of where the search is nothing is told."""
