"""The diagnosis of stored sessions: shown, named, extended, measured; the answer sealed, each step a fact."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
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
from replay.engine.bench_text import corrected
from replay.engine.identity import run_id, source_hash
from replay.engine.motor_file import read_motor
from replay.engine.motor_text import written
from replay.engine.residuals import where
from replay.errors import ReplayDataError
from replay.studies.calibrate import common_model
from replay.studies.diagnosis import Diagnosis, Named, Rival, Shown, document, read
from replay.studies.formulas import formula
from replay.studies.kept_sessions import Measured, measured
from replay.studies.recorded import STEP_S, test_of
from twin.candidates import Candidate, added_monomials, generate
from twin.causes import says
from twin.columns import AddedTerms, InputChannel, ObservedChannel
from twin.errors import TwinError
from twin.everyday import everyday
from twin.features import Monomial
from twin.fit import Fit, fit
from twin.learned import network_of, size
from twin.model import Model, Test
from twin.naming import Naming, Refit, search
from twin.network import Network
from twin.noise import floor_variance

Floats = NDArray[np.float64]
Tell = Callable[[str], None]

LEAST_S = 1200.0  # of training: below, hardly anything of a motor's slow modes is in the data
RIVALS = 5
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
            answer, events = _answered(question, identity, tell)
        except TwinError as error:
            raise ReplayDataError(f"diagnosis with model {question.model[:12]}: {error}") from None
    answer = replace(answer, seconds=round(time.monotonic() - started, 1))
    _keep(question, answer, key, events)
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
    }


@dataclass(frozen=True)
class _Campaign:
    """The training sessions as the twin takes them."""

    network: Network
    tests: tuple[Test, ...]
    candidates: tuple[Candidate, ...]
    monomials: tuple[Monomial, ...]
    observed: tuple[ObservedChannel, ...]


def _campaign(question: Question) -> _Campaign:
    network = read_motor(question.store.archive.read(question.model), question.facts.models[question.model].file)
    loaded = [load(question.store, question.facts, session) for session in question.train]
    observed, inputs = _channels(loaded, network, question.level)
    candidates = generate(network, observed, inputs)
    given = {i.name for i in inputs}
    monomials = tuple(dict.fromkeys([*added_monomials(candidates), *([RIPPLE] if "current" in given else [])]))
    tests = tuple(
        test_of(question.store, question.facts, session, network, monomials, question.level)
        for session in question.train
    )
    return _Campaign(network, tests, candidates, monomials, observed)


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


def _answered(question: Question, identity: str, tell: Tell) -> tuple[Diagnosis, list[Event]]:
    tell("reading the sessions")
    campaign = _campaign(question)
    model = Model(campaign.network, campaign.tests, everyday(campaign.network, campaign.tests))
    shown = _shown(question, model)
    naming = search(model, campaign.candidates, tell)
    base = _baseline(naming)
    kept = None
    events: list[Event] = []
    if question.kept:
        tell("predicting the kept sessions")
        events.append(HeldOutOpened(diagnosis=identity, sessions=[s.session for s in question.kept]))
        tests = [
            test_of(question.store, question.facts, s, campaign.network, campaign.monomials, question.level)
            for s in question.kept
        ]
        kept = measured(base, naming.final, campaign.tests, tests, len(naming.accepted) > 0)
    named = [_named(question, campaign, naming, refit, kept) for refit in naming.accepted]
    improved = kept is not None and kept.improved and bool(named)
    tell("writing the models")
    recalibrated = _sealed_model(
        question, network_of(base, campaign.monomials), f"Recalibrated by diagnosis {identity}."
    )
    extended, bench = None, None
    if improved:
        extended = _extended_model(question, campaign, naming, identity)
        bench = _extended_bench(question, naming, identity)
    last = naming.rounds[-1]
    answer = Diagnosis(
        diagnosis=identity,
        motor=campaign.network.name,
        level=question.level,
        model=question.model,
        train=[s.session for s in question.train],
        held_out=[s.session for s in question.kept],
        train_names=[s.name for s in question.train],
        held_out_names=[s.name for s in question.kept],
        opened_before=any(question.facts.opened.get(s.session) for s in question.kept),
        shown=shown,
        causes=named,
        rivals=_rivals(naming),
        unknown=[],
        masked=[],
        recalibrated_model=recalibrated,
        extended_model=extended,
        extended_bench=bench,
        gain=list(kept.gain) if kept else [],
        log_score_gain=kept.log_score_gain if kept else None,
        log_score_gain_lower=kept.log_score_gain_lower if kept else None,
        few_kept_data=bool(kept and kept.few),
        candidates=len(campaign.candidates),
        dropped=sorted({name for found in naming.rounds for name in found.dropped}),
        steps=sum(len(t.frame.features) for t in campaign.tests),
        null_log_bayes_factor=last.null,
        threshold=naming.threshold,
        next_test=None,
        seconds=0.0,
    )
    return answer, events


def _shown(question: Question, model: Model) -> list[Shown]:
    """What the file's own model gets wrong on the training sessions."""
    shown = []
    for series in model.residuals(np.zeros(len(model.parameters))):
        test, session = model.tests[series.session], question.train[series.session]
        channel = next(c for c in test.channels if c.name == series.channel)
        at = np.minimum((series.t_s / test.frame.step_s).astype(np.intp), len(test.frame.features) - 1)
        size_K = np.abs(series.y)
        network = model.network
        places = {
            f"{_unit(f)}": values[at] * network.scale[f] for f, values in test.inputs.items() if f in network.scale
        }
        floor = float(np.hypot(np.sqrt(floor_variance(series, model.noise_of(series.channel))), channel.bias_sd))
        shown.append(
            Shown(
                session=session.session,
                session_name=session.name,
                channel=series.channel,
                node=" + ".join(channel.output.weights),
                mae_K=float(size_K.mean()),
                max_K=float(size_K.max()),
                bias_K=float(series.y.mean()),
                floor_K=floor,
                white=_white(series.y),
                where={name: span for name, value in places.items() if (span := where(value, size_K)) is not None},
            )
        )
    return shown


def _unit(feature: str) -> str:
    from ingest.quantities import column_suffix

    return feature + column_suffix(feature)


def _white(residual: Floats) -> bool:
    """Whether neighbouring blocks say nothing of each other: lag-1 autocorrelation within two sigma (Bartlett)."""
    centred = residual - residual.mean()
    total = float(centred @ centred)
    return bool(total == 0.0 or abs(float(centred[1:] @ centred[:-1])) / total < 2 / np.sqrt(len(residual)))


def _baseline(naming: Naming) -> Fit:
    """The fit without any named term, under the noise of the final one."""
    first = naming.rounds[0].base
    if not naming.accepted:
        return naming.final
    return fit(first.model.with_noise(naming.final.model.noise), first.beta, enough=0.5)


def _named(question: Question, campaign: _Campaign, naming: Naming, refit: Refit, kept: Measured | None) -> Named:
    final, cause = naming.final, refit.candidate.cause
    place = next(i for i, p in enumerate(final.model.parameters) if p == refit.parameter)
    found = size(final, place, refit.candidate.unit)
    effect_K, node, test, t_s = _largest_effect(final, place)
    improved = kept is not None and kept.improved
    return Named(
        id=str(cause),
        says=says(cause),
        members=list(refit.candidate.members),
        estimate=found.value,
        ci95=sorted([found.low, found.high]),
        unit=found.unit,
        typical_W=found.typical_W,
        largest_effect_K=effect_K,
        largest_effect_node=node,
        largest_effect_session=question.train[test].session,
        largest_effect_t_s=t_s,
        formula=_formula(refit, found.value, campaign.network),
        log_bayes_factor=refit.log_bayes_factor,
        probability=1.0,
        member_probability=1.0,
        indistinguishable_from=[],
        separating_test=None,
        significant=True,
        identified=True,
        improved=improved,
        why_not_improved=None if improved else (kept.why if kept else "no session was kept: say --hold-out"),
    )


def _largest_effect(final: Fit, place: int) -> tuple[float, str, int, float]:
    """What a term moves at most: K, the node, the test and the time [s]."""
    without = final.beta.copy()
    without[place] = 0.0
    best = (0.0, final.model.network.nodes[0].name, 0, 0.0)
    for s, test in enumerate(final.model.tests):
        moved = final.model.course(s, final.beta)[1] - final.model.course(s, without)[1]
        k, node = (int(i) for i in np.unravel_index(np.argmax(np.abs(moved)), moved.shape))
        if abs(moved[k, node]) > best[0]:
            name = final.model.network.nodes[node].name
            best = (float(abs(moved[k, node])), name, s, (k + 0.5) * test.frame.step_s)
    return best


def _formula(refit: Refit, value: float, network: Network) -> str:
    cause, column = refit.candidate.cause, refit.candidate.column
    if isinstance(column, AddedTerms):
        return formula(replace(column.terms[0][1], coefficient=value), cause.place, network)
    if cause.law == "scale":
        return f"{cause.kind} of {cause.place} times {value:.3g}"
    return f"{cause}: {value:.4g} {refit.candidate.unit}".rstrip(" 1")


def _rivals(naming: Naming) -> list[Rival]:
    """The best candidates that were not named, and why."""
    chosen = {str(refit.candidate.cause) for refit in naming.accepted}
    found: dict[str, Rival] = {}
    for candidate, value in naming.left_out:
        why = f"let in first, then left out: without it the fit is no worse than ln BF {value:.1f}"
        found[str(candidate.cause)] = Rival(
            id=str(candidate.cause), says=says(candidate.cause), log_bayes_factor=value, why_not=why
        )
    for number, one in enumerate(naming.rounds):
        best = max((r.log_bayes_factor for r in one.refits), default=0.0)
        for refit in sorted(one.refits, key=lambda r: -r.log_bayes_factor):
            name = str(refit.candidate.cause)
            if name in chosen or name in found:
                continue
            behind = best - refit.log_bayes_factor
            below = number == len(naming.rounds) - 1
            why = (
                f"under the threshold of {naming.threshold:.0f}"
                if below
                else f"{behind:.1f} behind in ln BF after both were refitted"
            )
            found[name] = Rival(
                id=name, says=says(refit.candidate.cause), log_bayes_factor=refit.log_bayes_factor, why_not=why
            )
    return list(found.values())[:RIVALS]


def _sealed_model(question: Question, network: Network, note: str) -> str:
    """The motor file of a network, sealed."""
    data = question.store.archive.read(question.model)
    return question.store.archive.seal(written(data, question.facts.models[question.model].file, network, note))


def _extended_model(question: Question, campaign: _Campaign, naming: Naming, identity: str) -> str | None:
    causes = [str(r.candidate.cause) for r in naming.accepted if r.candidate.cause.kind in MOTOR_KINDS]
    if not causes:
        return None
    note = f"Extended by diagnosis {identity}: {', '.join(causes)}."
    return _sealed_model(question, network_of(naming.final, campaign.monomials), note)


def _extended_bench(question: Question, naming: Naming, identity: str) -> str | None:
    """The bench file with what sensors, clocks, inputs and boundaries are off by, sealed."""
    final = naming.final
    amounts = {
        str(refit.candidate.cause): size(
            final, next(i for i, p in enumerate(final.model.parameters) if p == refit.parameter), refit.candidate.unit
        ).value
        for refit in naming.accepted
        if refit.candidate.cause.kind not in MOTOR_KINDS
    }
    bench = question.facts.bench_of(question.train[0])
    if not amounts or bench is None:
        return None
    data = question.store.archive.read(bench.sha256)
    return question.store.archive.seal(corrected(data, bench.name, amounts, f"Found by diagnosis {identity}"))


def _keep(question: Question, answer: Diagnosis, key: dict[str, Any], events: list[Event]) -> None:
    """Seal the answer and append its facts: what was opened, named, extended, measured."""
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
    facts_of += [(name, event) for event in events]
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
