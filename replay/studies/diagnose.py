"""The diagnosis of stored sessions: shown, named, extended, measured; the answer sealed, each step a fact."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import twin
from ingest.catalogue.channels import ChannelData, load
from ingest.events import (
    CauseNamed,
    DiagnosisCompleted,
    Event,
    GainMeasured,
    HeldOutOpened,
    ModelExtended,
    ModelPublished,
    SessionRecorded,
)
from ingest.facts import Facts
from ingest.store import Store
from replay.engine.identity import run_id, source_hash
from replay.engine.motor_file import read_motor
from replay.errors import ReplayDataError
from replay.studies.answer_parts import Context, named, place_of, rivals, shown, unknown_heat
from replay.studies.calibrate import common_model
from replay.studies.data_faults import DataFault, data_faults
from replay.studies.diagnosis import Diagnosis, Masked, Named, document, read
from replay.studies.extension import sealed_bench, sealed_motor
from replay.studies.kept_sessions import Measured, measured
from replay.studies.recorded import STEP_S, test_of
from twin.candidates import Candidate, added_monomials, generate
from twin.causes import says
from twin.columns import InputChannel, ObservedChannel, Reading
from twin.errors import TwinError
from twin.everyday import everyday
from twin.features import Monomial
from twin.fit import NEAR_ENOUGH, Fit, fit
from twin.free_heats import Unknown, describe, free_heats
from twin.learned import size
from twin.model import Model, Test
from twin.naming import Naming, Refit, search
from twin.network import Network
from twin.swaps import Swap, exchanged, misread, scan

Tell = Callable[[str], None]

LEAST_S = 900.0  # of training: below, hardly anything of a motor's slow modes is in the data
RIPPLE = Monomial((("current", 2.0),))  # the law of the rotor's everyday heat at standstill
MOTOR_KINDS = ("loss", "conductance", "capacity", "ageing")


@dataclass(frozen=True)
class Question:
    """What is asked: the sessions to learn from and the kept ones, the model and level."""

    store: Store
    facts: Facts
    train: Sequence[SessionRecorded]
    kept: Sequence[SessionRecorded]
    model: str
    level: str


@dataclass(frozen=True)
class Result:
    """The answer, and whether the ledger had it already."""

    diagnosis: Diagnosis
    known: bool


def diagnose(
    store: Store,
    facts: Facts,
    train: Sequence[SessionRecorded],
    kept: Sequence[SessionRecorded],
    model: str | None,
    level: str,
    tell: Tell = lambda _: None,
) -> Result:
    """Name what the model gets wrong on `train`, and measure on `kept` what the extended model gains.

    The same question again reads the sealed answer. Raises ReplayDataError where sessions are too few, too short, of
    different motors, kept and learnt from at once, or lack what the model needs.
    """
    _check(train, kept)
    question = Question(store, facts, train, kept, model or common_model(facts, [*train, *kept]), level)
    key = _key(question)
    identity = run_id(key)
    if identity in facts.diagnoses:
        return Result(read(json.loads(store.archive.read(facts.diagnoses[identity].artefact))), True)
    started = time.monotonic()
    with threadpool_limits(1, user_api="blas"):  # the matrices are small: more threads only wait for each other
        try:
            answer = _answered(question, identity, tell)
        except TwinError as error:
            raise ReplayDataError(f"diagnosis with model {question.model[:12]}: {error}") from None
        except np.linalg.LinAlgError as error:
            raise ReplayDataError(
                f"diagnosis with model {question.model[:12]}: the fit broke off numerically ({error}): check the motor file with "
                "`whyhot motor check`, and leave out the session that is furthest off (`whyhot replay` says which)."
            ) from None
    answer = replace(answer, seconds=round(time.monotonic() - started, 1))
    _keep(question, answer, key)
    return Result(answer, False)


def _check(train: Sequence[SessionRecorded], kept: Sequence[SessionRecorded]) -> None:
    if not train:
        raise ReplayDataError("no session to learn from: name some with --on. `whyhot sessions` lists them.")
    both = {s.session for s in train} & {s.session for s in kept}
    if both:
        named = ", ".join(s.name for s in kept if s.session in both)
        raise ReplayDataError(
            f"{named}: learnt from and kept at once: a kept session must be one that --on does not name."
        )
    length_s = sum(s.end_ns - s.start_ns for s in train) / 1e9
    if length_s < LEAST_S:
        raise ReplayDataError(
            f"too little to tell: {length_s / 60:.0f} min to learn from, at least {LEAST_S / 60:.0f} are needed. "
            "Add an S1 or S2 point or a drive cycle with --on."
        )


def _key(question: Question) -> dict[str, Any]:
    """Everything that the answer may depend on, but for the environment."""
    facts, every = question.facts, [*question.train, *question.kept]
    decodes = [facts.decodes[file["decode"]] for session in every for file in session.files]
    return {
        "train": [session.session for session in question.train],
        "kept": [session.session for session in question.kept],
        "raw": sorted({d.raw for d in decodes}),
        "databases": sorted({sha for d in decodes for sha in d.databases}),
        "benches": sorted({facts.current(session.bench) for session in every if session.bench}),
        "decoder": sorted({d.decoder for d in decodes}),
        "model": question.model,
        "level": question.level,
        "settings": {"step_s": STEP_S},
        "twin": source_hash(Path(twin.__file__).parent),
        "studies": source_hash(Path(__file__).parent),
    }


@dataclass(frozen=True)
class _Campaign:
    """The training sessions as the twin takes them."""

    network: Network
    tests: tuple[Test, ...]
    candidates: tuple[Candidate, ...]
    monomials: tuple[Monomial, ...]
    observed: tuple[ObservedChannel, ...]
    loaded: Sequence[Sequence[ChannelData]]
    starts_ns: tuple[int, ...]


def _campaign(question: Question) -> _Campaign:
    network = read_motor(question.store.archive.read(question.model), question.facts.models[question.model].file)
    loaded = [load(question.store, question.facts, session) for session in question.train]
    observed, inputs = _channels(loaded, network, question.level)
    candidates = generate(network, observed, inputs)
    given = {i.name for i in inputs}
    monomials = tuple(
        dict.fromkeys(
            [*added_monomials(candidates), *([RIPPLE] if "current" in given and "current" in network.scale else [])]
        )
    )
    tests = tuple(
        test_of(question.store, question.facts, session, network, monomials, question.level)
        for session in question.train
    )
    starts = tuple(test.start_ns for test in tests)
    return _Campaign(network, tests, candidates, monomials, observed, loaded, starts)


def _channels(
    loaded: Sequence[Sequence[ChannelData]], network: Network, level: str
) -> tuple[tuple[ObservedChannel, ...], tuple[InputChannel, ...]]:
    """What is observed and what drives, over all sessions."""
    nodes = {node.name for node in network.nodes}
    observed: dict[str, ObservedChannel] = {}
    inputs: dict[str, InputChannel] = {}
    for channel in (c for channels in loaded for c in channels):
        spec = channel.spec
        weights = dict(spec.weights) or {spec.node or "": 1.0}
        if spec.role == "observed" and spec.quantity == "temperature" and set(weights) <= nodes:
            if level in ("testing", spec.level):
                observed.setdefault(spec.name, ObservedChannel(spec.name, weights, channel.buses[0]))
        elif spec.role != "ignored":
            name = spec.node or spec.quantity if spec.quantity == "temperature" else spec.quantity
            inputs.setdefault(name, InputChannel(name, channel.buses[0]))
    return tuple(observed.values()), tuple(inputs.values())


@dataclass(frozen=True)
class _Found:
    """What the search left: its naming, terms that kept sessions spoke against, exchanged channels, and free heats."""

    naming: Naming
    refused: list[tuple[Refit, str]]
    swaps: list[Swap]
    unknown: list[Unknown]
    log_bf_unknown: float
    kept: Measured | None
    base: Fit


def _answered(question: Question, identity: str, tell: Tell) -> Diagnosis:
    tell("reading the sessions")
    campaign = _campaign(question)
    network = campaign.network
    model = Model(network, campaign.tests, everyday(network, campaign.tests))
    wrong = shown(model, question.train)
    tell("looking for exchanged and misread channels")
    if lines := misread(model):
        raise ReplayDataError(lines[0])
    swaps = scan(model, campaign.candidates)
    tests = _kept_tests(question, campaign)
    if tests:  # a fact before anything is predicted: who stops here has looked all the same
        opened = HeldOutOpened(diagnosis=identity, sessions=[s.session for s in question.kept])
        question.store.ledger.append(f"diagnosis-{identity}", opened)
    found = _find(campaign, model, swaps, tests, tell)
    naming, kept = found.naming, found.kept
    tell("weighing the data's own faults")
    faults = data_faults(naming.final, campaign.loaded, campaign.starts_ns, campaign.observed, naming.threshold)
    context = Context(network, question.train, naming, kept, found.log_bf_unknown)
    causes = [named(context, refit) for refit in naming.accepted]
    causes += [_named_swap(swap, kept) for swap in swaps]
    causes += [_named_fault(fault, kept) for fault in faults]
    causes.sort(key=lambda cause: -cause.log_bayes_factor)
    tell("writing the models")
    note = f"Recalibrated by diagnosis {identity}."
    recalibrated = sealed_motor(question.store, question.facts, question.model, found.base, campaign.monomials, note)
    extended, bench = _extended(question, campaign, found, identity)
    last = naming.rounds[-1]
    return Diagnosis(
        diagnosis=identity,
        motor=network.name,
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
        unknown=[unknown_heat(heat, network) for heat in found.unknown],
        masked=[*_masked(question, faults), *_left_out(question, campaign)],
        recalibrated_model=recalibrated,
        extended_model=extended,
        extended_bench=bench,
        gain=list(kept.gain) if kept else [],
        log_score_gain=kept.log_score_gain if kept else None,
        log_score_gain_lower=kept.log_score_gain_lower if kept else None,
        few_kept_data=bool(kept and kept.few),
        candidates=len(campaign.candidates),
        dropped=sorted({name for one in naming.rounds for name in one.dropped}),
        steps=sum(len(t.frame.features) for t in campaign.tests),
        null_log_bayes_factor=last.null,
        threshold=naming.threshold,
        next_test=next((c.separating_test for c in causes if c.separating_test), None),
        seconds=0.0,
    )


def _kept_tests(question: Question, campaign: _Campaign) -> list[Test]:
    return [
        test_of(question.store, question.facts, s, campaign.network, campaign.monomials, question.level)
        for s in question.kept
    ]


def _find(campaign: _Campaign, model: Model, swaps: list[Swap], kept: list[Test], tell: Tell) -> _Found:
    """Search, ask whether an unknown heat explains more, and let the kept sessions speak against what makes them worse."""
    straight, straight_kept = campaign.tests, kept
    for swap in swaps:
        column = swap.candidate.column
        assert isinstance(column, Reading)
        straight = exchanged(straight, column.channel, column.other)
        straight_kept = list(exchanged(straight_kept, column.channel, column.other))
    if swaps:
        model = Model(campaign.network, straight, everyday(campaign.network, straight))
    naming = search(model, campaign.candidates, tell)
    best, unknown = naming.heats[0], list[Unknown]()
    if naming.is_unknown:
        unknown = [describe(naming.final, best)]
    elif naming.accepted:
        after = free_heats(naming.final)[0]
        if after.log_bayes_factor > naming.threshold:
            unknown = [describe(naming.final, after)]
    refused: list[tuple[Refit, str]] = []
    base = _baseline(naming)
    result = None
    while kept:
        tell("predicting the kept sessions")
        result = measured(base, naming.final, straight, straight_kept, bool(naming.accepted))
        if not naming.accepted or not result.worse:
            break
        weakest = min(naming.accepted, key=lambda r: r.log_bayes_factor)
        refused.append((weakest, "it makes the kept sessions worse: form error of the sessions learnt from"))
        final = naming.final
        place = place_of(final, weakest)
        final = fit(final.model.without(place), np.delete(final.beta, place), enough=NEAR_ENOUGH)
        naming = replace(naming, accepted=tuple(r for r in naming.accepted if r is not weakest), final=final)
    if kept and swaps:
        crossed = Model(campaign.network, campaign.tests, model.parameters, naming.final.model.noise)
        base = fit(crossed, np.zeros(len(model.parameters)), enough=NEAR_ENOUGH)
        result = measured(base, naming.final, campaign.tests, kept, True, straight_kept)
    return _Found(naming, refused, swaps, unknown, best.log_bayes_factor, result, base)


def _baseline(naming: Naming) -> Fit:
    """The fit without any named term, under the noise of the final one."""
    first = naming.rounds[0].base
    if not naming.accepted:
        return naming.final
    return fit(first.model.with_noise(naming.final.model.noise), first.beta, enough=NEAR_ENOUGH)


def _extended(question: Question, campaign: _Campaign, found: _Found, identity: str) -> tuple[str | None, str | None]:
    """The extended motor and bench files, where the kept sessions got better."""
    kept, final = found.kept, found.naming.final
    if kept is None or not kept.improved:
        return None, None
    store, facts = question.store, question.facts
    motor = [r for r in found.naming.accepted if r.candidate.cause.kind in MOTOR_KINDS]
    amounts = {str(swap.candidate.cause): 1.0 for swap in found.swaps}
    for refit in found.naming.accepted:
        if refit not in motor:
            amounts[str(refit.candidate.cause)] = size(final, place_of(final, refit), refit.candidate.unit).value
    extended = bench = None
    if motor:
        note = f"Extended by diagnosis {identity}: {', '.join(str(r.candidate.cause) for r in motor)}."
        extended = sealed_motor(store, facts, question.model, final, campaign.monomials, note)
    parent = facts.bench_of(question.train[0])
    if amounts and parent:
        bench = sealed_bench(store, parent.sha256, parent.name, amounts, f"Found by diagnosis {identity}")
    return extended, bench


def _named_swap(swap: Swap, kept: Measured | None) -> Named:
    improved = kept is not None and kept.improved
    return _plain(
        str(swap.candidate.cause), says(swap.candidate.cause), 1.0, "1", swap.log_bayes_factor, improved, kept
    )


def _named_fault(fault: DataFault, kept: Measured | None) -> Named:
    improved = kept is not None and kept.masked_better.get(fault.channel, False)
    return _plain(str(fault.cause), says(fault.cause), fault.masked_share, "1", fault.log_bayes_factor, improved, kept)


def _plain(
    name: str, words: str, estimate: float, unit: str, log_bf: float, improved: bool, kept: Measured | None
) -> Named:
    """A fault of the data: it has no term, and nothing else looks like it."""
    why = "the kept sessions do not show it" if kept else "no session was kept: say --hold-out"
    return Named(
        id=name,
        says=words,
        members=[],
        estimate=estimate,
        ci95=[estimate, estimate],
        unit=unit,
        typical_W=None,
        largest_effect_K=0.0,
        largest_effect_node=name.split(".")[1].partition("@")[0],
        largest_effect_session="",
        largest_effect_t_s=0.0,
        formula="",
        log_bayes_factor=log_bf,
        probability=probability_against_none(log_bf),
        member_probability=1.0,
        indistinguishable_from=[],
        separating_test=None,
        significant=True,
        identified=True,
        improved=improved,
        why_not_improved=None if improved else why,
    )


def probability_against_none(log_bf: float) -> float:
    """Of a fault that stands alone against no fault, even odds before."""
    return float(1 / (1 + np.exp(-min(log_bf, 700.0))))


def _left_out(question: Question, campaign: _Campaign) -> list[Masked]:
    """Sensors of the motor that say nothing usable in a whole session."""
    found = []
    for session, test, channels in zip(question.train, campaign.tests, campaign.loaded, strict=True):
        there = {c.spec.name for c in channels}
        used = {c.name for c in test.channels}
        for observed in campaign.observed:
            if observed.name in there - used:
                found.append(
                    Masked(
                        session=session.session,
                        session_name=session.name,
                        channel=observed.name,
                        says=f"{observed.name} has no usable sample in this session: left out",
                    )
                )
    return found


def _masked(question: Question, faults: Sequence[DataFault]) -> list[Masked]:
    return [
        Masked(
            session=question.train[s].session,
            session_name=question.train[s].name,
            channel=fault.channel,
            says=f"{fault.channel} {words}",
        )
        for fault in faults
        for s, words in sorted(fault.says.items())
    ]


def _keep(question: Question, answer: Diagnosis, key: dict[str, Any]) -> None:
    """Seal the answer and append its facts: what was named, extended, measured."""
    store, facts, name = question.store, question.facts, f"diagnosis-{answer.diagnosis}"
    parent_bench = facts.bench_of(question.train[0])
    artefact = store.archive.seal(json.dumps(document(answer, {}), sort_keys=True).encode())
    facts_of: list[tuple[str, Event]] = []
    for model in dict.fromkeys(m for m in (answer.recalibrated_model, answer.extended_model) if m):
        if model not in facts.models:
            file = facts.models[question.model].file
            published = ModelPublished(model=model, motor=answer.motor, file=file, parent=question.model)
            facts_of.append((f"motor-{answer.motor}", published))
    if answer.extended_bench and parent_bench:
        registered = replace(parent_bench, sha256=answer.extended_bench)
        facts_of.append((f"bench-{answer.extended_bench}", registered))
    for cause in answer.causes:
        facts_of.append(
            (
                name,
                CauseNamed(
                    diagnosis=answer.diagnosis,
                    cause=cause.id,
                    estimate=cause.estimate,
                    unit=cause.unit,
                    log_bayes_factor=cause.log_bayes_factor,
                    probability=cause.probability,
                ),
            )
        )
    if answer.extended_model or answer.extended_bench:
        facts_of.append(
            (
                name,
                ModelExtended(
                    diagnosis=answer.diagnosis,
                    parent=question.model if answer.extended_model else None,
                    model=answer.extended_model,
                    parent_bench=parent_bench.sha256 if answer.extended_bench and parent_bench else None,
                    bench=answer.extended_bench,
                ),
            )
        )
    if answer.gain:
        gain = [vars(one) for one in answer.gain]
        facts_of.append((name, GainMeasured(diagnosis=answer.diagnosis, gain=gain)))
    summary = {"motor": answer.motor, "causes": [c.id for c in answer.causes]}
    facts_of.append((name, DiagnosisCompleted(diagnosis=answer.diagnosis, key=key, artefact=artefact, summary=summary)))
    store.ledger.append_all(facts_of)
