"""The diagnosis of stored sessions: shown, named, extended, measured; the answer sealed, each step a fact."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ingest.facts.events import (
    BenchRegistered,
    CauseNamed,
    DiagnosisCompleted,
    Event,
    GainMeasured,
    HeldOutOpened,
    ModelExtended,
    ModelPublished,
    SessionRecorded,
)
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from ingest.texts.names import handle
from replay.engine.files.benches import MADE, with_bench_of
from replay.engine.files.models import published
from replay.engine.runs.identity import run_id
from replay.engine.runs.sources import code_of
from replay.errors import ReplayDataError
from replay.studies.characterise.calibrate import common_model
from replay.studies.diagnosis.accept import sealed_diagnosis
from replay.studies.diagnosis.answer import Diagnosis, calibration_is_worse, document
from replay.studies.diagnosis.answer_parts import (
    doubtful,
    judged_by,
    named,
    rivals,
    shown,
    suspected_test,
    unknown_heat,
)
from replay.studies.diagnosis.as_recorded import measured_as_recorded, said_wrong
from replay.studies.diagnosis.beyond_usual import beyond_usual
from replay.studies.diagnosis.chain import chain
from replay.studies.diagnosis.comparable import comparable
from replay.studies.diagnosis.contradicting import contradicting
from replay.studies.diagnosis.data_faults import data_faults
from replay.studies.diagnosis.named_faults import left_out, masked, named_fault, named_swap
from replay.studies.diagnosis.offered import offered
from replay.studies.diagnosis.pictured import foreseen_test, laws
from replay.studies.diagnosis.question import Question, campaign_of, check, kept_of, key_of
from replay.studies.diagnosis.search import find
from replay.studies.diagnosis.two_models import two_models
from replay.studies.sessions.fitting import fitting
from twin.diagnosis.late_clocks import late_clocks
from twin.diagnosis.refined import Tell
from twin.diagnosis.rounds import EVIDENT
from twin.diagnosis.swaps import misread, scan


def diagnose(
    store: Store,
    facts: Facts,
    train: Sequence[SessionRecorded],
    kept: Sequence[SessionRecorded],
    model: str | None,
    level: str,
    tell: Tell = lambda _: None,
) -> Diagnosis:
    """Name what the model gets wrong on `train`, and measure on `kept` what the extended model gains.

    The same question again reads the sealed answer. Raises ReplayDataError where sessions are too few, too short, of
    different motors, kept and learnt from at once, or lack what the model needs.
    """
    check(train, kept)
    model = model or common_model(facts, [*train, *kept])
    question = Question(store, with_bench_of(facts, model), train, kept, model, level)
    key = key_of(question, code_of(__name__))
    identity = run_id(key)
    if identity in facts.diagnoses:
        return sealed_diagnosis(store, facts.diagnoses[identity])
    with fitting(f"diagnosis with model {handle(question.model)}"):
        answer = _answered(question, identity, tell)
    _keep(question, answer, key)
    return answer


def _answered(question: Question, identity: str, tell: Tell) -> Diagnosis:
    tell("reading the sessions")
    campaign = campaign_of(question)
    model = campaign.healthy
    wrong = shown(model, question.train)
    tell("looking for late clocks, exchanged and misread channels")
    if lines := late_clocks(model) or misread(model):
        raise ReplayDataError(lines[0])
    swaps = scan(model, campaign.candidates)
    contradictory = contradicting(model, question.train)
    kept_at_all = comparable(question.kept, kept_of(question, campaign), campaign.tests)
    question, tests = replace(question, kept=kept_at_all.sessions), list(kept_at_all.tests)
    found = find(campaign, model, swaps, tests, tell)
    naming = found.naming
    tell("writing the models")
    files = offered(question, campaign, found, identity, tests)
    kept = found.kept
    if kept is not None:
        kept = measured_as_recorded(kept, tests, files.runs, said_wrong(found.base, naming.final))
        if kept.improved and files.why_none is not None and "after" not in files.files:
            kept = replace(kept, improved=False, why=f"no file is offered: {files.why_none}")
    tell("weighing the data's own faults")
    faults = data_faults(naming.final, campaign.loaded, campaign.observed, EVIDENT)
    causes = [named(naming, refit, question.train, kept) for refit in naming.accepted]
    causes += [named_swap(swap, kept) for swap in swaps]
    causes += [named_fault(fault, kept) for fault in faults]
    if not naming.judged:  # else they stand in the order of the chain
        causes.sort(key=lambda cause: -cause.log_bayes_factor)
    recalibrated = None if kept and calibration_is_worse(kept.gain) else files.files.get("before")
    extended = files.files.get("after")
    last = naming.rounds[-1]
    next_test = next((c.separating_test for c in causes if c.separating_test), None) or suspected_test(naming)
    apart = two_models(question, found, tests)
    return Diagnosis(
        diagnosis=identity,
        motor=campaign.network.name,
        level=question.level,
        model=question.model,
        train=[s.session for s in question.train],
        held_out=[s.session for s in question.kept],
        train_names=[s.name for s in question.train],
        held_out_names=[s.name for s in question.kept],
        opened_before=any(question.facts.opened.get(s.session) for s in question.kept),
        shown=wrong,
        causes=causes,
        rivals=rivals(naming, found.refused),
        unknown=[unknown_heat(heat, naming, kept) for heat in found.unknown],
        masked=[*masked(question, faults), *left_out(question, campaign), *kept_at_all.left_out],
        recalibrated_model=recalibrated.motor if recalibrated else None,
        recalibrated_bench=recalibrated.bench if recalibrated else None,
        extended_model=extended.motor if extended and extended.motor != question.model else None,
        extended_bench=extended.bench if extended else None,
        recalibrated_benches=dict(recalibrated.benches) if recalibrated else {},
        extended_benches=dict(extended.benches) if extended else {},
        gain=list(kept.gain) if kept else [],
        log_score_gain=kept.log_score_gain if kept else None,
        log_score_gain_lower=kept.log_score_gain_lower if kept else None,
        few_kept_data=bool(kept and kept.few),
        candidates=len(campaign.candidates),
        dropped=sorted({name for one in naming.rounds for name in one.dropped}),
        steps=sum(len(t.frame.features) for t in campaign.tests),
        null_log_bayes_factor=last.null,
        threshold=naming.threshold,
        next_test=next_test,
        why_no_files=files.why_none,
        findings=beyond_usual(naming, [s.session for s in question.train]),
        contradicting=contradictory,
        two_models=apart,
        chain=chain(question, campaign, found, files, causes, tests, identity),
        laws=laws(campaign, found, causes),
        foreseen=foreseen_test(campaign, found, next_test, apart),
        judged_by=judged_by(naming),
        crudeness=doubtful(naming, kept),
    )


def _keep(question: Question, answer: Diagnosis, key: dict[str, Any]) -> None:
    """Seal the answer and append its facts: what was named, extended, measured."""
    store, facts, name = question.store, question.facts, f"diagnosis-{answer.diagnosis}"
    artefact = store.archive.seal(json.dumps(document(answer, {})).encode())  # in order: the largest first
    facts_of: list[tuple[str, Event]] = []
    if answer.held_out:  # with the answer: where there is none, nobody saw what the kept sessions say
        facts_of.append((name, HeldOutOpened(diagnosis=answer.diagnosis, sessions=answer.held_out)))
    terms = [step for step in answer.chain if step.step > 0]  # the files before these are offered as recalibrated
    offers = [answer.recalibrated_model, answer.extended_model, *(step.model for step in terms)]
    for model in dict.fromkeys(m for m in offers if m):
        facts_of += published(facts, question.model, model)
    stepwise = [pair for step in terms for pair in step.benches.items()]
    for old, new in dict.fromkeys([*answer.recalibrated_benches.items(), *answer.extended_benches.items(), *stepwise]):
        if new not in facts.benches:
            facts_of.append((f"bench-{new}", replace(question.benches[old], sha256=new)))
    for cause in answer.causes:
        one = CauseNamed(
            diagnosis=answer.diagnosis,
            cause=cause.id,
            estimate=cause.estimate,
            unit=cause.unit,
            log_bayes_factor=cause.log_bayes_factor,
            probability=cause.probability,
        )
        facts_of.append((name, one))
    benches: list[tuple[str | None, str | None]] = [*answer.extended_benches.items()]
    for number, (parent, bench) in enumerate(benches or [(None, None)] * bool(answer.extended_model)):
        own = answer.extended_model if number == 0 else None  # the model stands in the first of them
        extended = ModelExtended(
            diagnosis=answer.diagnosis,
            parent=question.model if own else None,
            model=own,
            parent_bench=parent,
            bench=bench,
        )
        facts_of.append((name, extended))
    if answer.gain:
        gain = [vars(one) for one in answer.gain]
        facts_of.append((name, GainMeasured(diagnosis=answer.diagnosis, gain=gain)))
    summary: dict[str, Any] = {"motor": answer.motor, "causes": [c.id for c in answer.causes]}
    if question.benches:
        summary[MADE] = {"of_model": _benches(answer, question)}
    completed = DiagnosisCompleted(
        diagnosis=answer.diagnosis, key=key, artefact=artefact, summary=summary, files=_tried(question, facts_of)
    )
    facts_of.append((name, completed))
    store.ledger.append_all(facts_of)


def _tried(question: Question, facts_of: Sequence[tuple[str, Event]]) -> list[str]:
    """The files that were written and are of no fact: neither of one of `facts_of` nor of an earlier one."""
    offered = {event.model for _, event in facts_of if isinstance(event, ModelPublished)}
    offered |= {event.sha256 for _, event in facts_of if isinstance(event, BenchRegistered)}
    known = offered | question.facts.models.keys() | question.facts.benches.keys()
    return [sha256 for sha256 in dict.fromkeys(question.written) if sha256 not in known]


def _benches(answer: Diagnosis, question: Question) -> dict[str, dict[str, str]]:
    """Model -> the versions of the bench files that go with it."""
    as_they_were = {sha256: sha256 for sha256 in question.benches}
    made = {answer.model: as_they_were}
    if answer.recalibrated_model:
        made[answer.recalibrated_model] = as_they_were | answer.recalibrated_benches
    if answer.extended_model:
        made[answer.extended_model] = as_they_were | answer.extended_benches
    return made
