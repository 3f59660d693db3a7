"""A diagnosis accepted, by a person's word and as a fact of its own: its new files become the current ones."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from ingest.errors import UnknownSessionError
from ingest.facts import facts as ledger_facts
from ingest.facts.events import CauseAccepted, DiagnosisCompleted, ModelExtended, SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from ingest.texts.names import handle
from replay.engine.files.models import model_of
from replay.errors import ReplayDataError
from replay.studies.diagnosis.answer import Diagnosis, read


@dataclass(frozen=True)
class Acceptance:
    """The fact, those of further bench files, and whether they held already (then nothing was written). `elsewhere`:
    name of a session of the diagnosis -> the model that it goes on with, where its bench file names none that the
    accepted one replaces. `others`: specimen that the diagnosis did not ask -> how many of its sessions go on with the
    accepted files too."""

    event: CauseAccepted
    further: Sequence[CauseAccepted]
    known: bool
    elsewhere: Mapping[str, str]
    others: Mapping[str, int]


def find_diagnosis(store: Store, facts: Facts, text: str) -> Diagnosis:
    """A diagnosis by id or unique beginning of an id, with or without `d-` before it.

    Raises ReplayDataError with what there is.
    """
    wanted = text.lower().removeprefix("d-")
    found = [one for one in facts.diagnoses if wanted and one.startswith(wanted)]
    if len(found) == 1:
        return sealed_diagnosis(store, facts.diagnoses[found[0]])
    back = [one.line for stream, one in facts.retractions.items() if stream.startswith(f"diagnosis-{wanted}")]
    if wanted and back and not found:
        raise ReplayDataError(back[0])
    why = "is the beginning of more than one" if found else "is not in this store"
    known = ", ".join(f"d-{handle(one)}" for one in found or facts.diagnoses)
    raise ReplayDataError(
        f'diagnosis "{text}" {why}: '
        + (f"it holds {known}." if known else "it holds none yet: `whyhot diagnose --on S...`")
    )


def sealed_diagnosis(store: Store, event: DiagnosisCompleted) -> Diagnosis:
    """The answer that a diagnosis was sealed with."""
    return read(json.loads(store.archive.read(event.artefact)))


def accept(store: Store, text: str, steps: int | None = None) -> Acceptance:
    """Make the extended model and bench files of a diagnosis the current ones, or those of its first so many `steps`;
    needs a store that may be written.

    Raises ReplayDataError where there is no such diagnosis or step, or it has nothing to accept.
    """
    facts = ledger_facts.at(store.ledger)
    found = find_diagnosis(store, facts, text)
    _refuse_gone(facts, found)
    event, *further = would_accept(store, found, steps)
    replaced = [(event.parent, event.model), *((one.parent_bench, one.bench) for one in (event, *further))]
    known = all(facts.successors.get(parent) == child for parent, child in replaced if parent and child)
    if not known:
        store.ledger.append_all([(f"diagnosis-{event.diagnosis}", one) for one in (event, *further)])
        facts = ledger_facts.at(store.ledger)
    elsewhere = _elsewhere(facts, found, event.model) if event.model else {}
    return Acceptance(event, further, known, elsewhere, _others(facts, found, [event, *further]))


def would_accept(store: Store, found: Diagnosis, steps: int | None = None) -> list[CauseAccepted]:
    """What accepting says: of the motor file with the first bench file, then of each further bench file. Raises
    ReplayDataError where there is nothing to accept."""
    benches: Mapping[str, str]
    if steps is None:
        event, benches = _event(store, found), found.extended_benches
    else:
        event, benches = _first(found, steps)
    others = {old: new for old, new in benches.items() if new != event.bench}
    return [event, *(replace(event, parent=None, model=None, parent_bench=a, bench=b) for a, b in others.items())]


def _refuse_gone(facts: Facts, found: Diagnosis) -> None:
    """Raises ReplayDataError where a session of the diagnosis was taken back."""
    for session in (*found.train, *found.held_out):
        try:
            facts.session(session)
        except UnknownSessionError as error:
            name = f"d-{handle(found.diagnosis)}"
            raise ReplayDataError(f"diagnosis {name}: {error}; `whyhot stale --redo` asks without it") from None


def _first(found: Diagnosis, steps: int) -> tuple[CauseAccepted, Mapping[str, str]]:
    """What accepting the first steps of the chain says, and its bench files."""
    terms = [step for step in found.chain if step.step > 0]
    there = {step.step: step for step in terms if step.model or step.bench}
    if steps not in there:
        known = ", ".join(map(str, there)) or "none"
        raise ReplayDataError(
            f"diagnosis d-{handle(found.diagnosis)}: no files of {steps} steps; steps with files: {known}."
        )
    step, sayable = there[steps], found.said
    model = step.model if step.model != found.model else None
    event = CauseAccepted(
        diagnosis=found.diagnosis,
        causes=[one.id for one in terms[:steps] if one.id in sayable],
        parent=found.model if model else None,
        model=model,
        parent_bench=next((old for old, new in step.benches.items() if new == step.bench), None),
        bench=step.bench,
    )
    return event, step.benches


def _event(store: Store, found: Diagnosis) -> CauseAccepted:
    """What accepting this diagnosis says."""
    if not found.offers:
        raise ReplayDataError(
            f"diagnosis d-{handle(found.diagnosis)}: there is nothing to accept: {_why_nothing(found)}."
        )
    recorded = [one.event for one in store.ledger.events(ModelExtended, stream=f"diagnosis-{found.diagnosis}")]
    extended = (event for event in recorded if isinstance(event, ModelExtended))
    benches = [event.parent_bench for event in extended if event.bench == found.extended_bench]
    return CauseAccepted(
        diagnosis=found.diagnosis,
        causes=found.said,
        parent=found.model if found.extended_model else None,
        model=found.extended_model,
        parent_bench=benches[-1] if found.extended_bench else None,
        bench=found.extended_bench,
    )


def _why_nothing(found: Diagnosis) -> str:
    """Why a diagnosis has no extended files."""
    named = ", ".join(
        [*(cause.id for cause in found.causes), *(heat.extends for heat in found.unknown if heat.extends)]
    )
    if not named:
        return f"it named no cause. {_stay(found)}"
    why = found.why_no_files or f"{named} changes neither motor nor bench file"
    return f"{why}. {_stay(found)}" if found.said else f"no file can say {named}. {_stay(found)}"


def _stay(found: Diagnosis) -> str:
    """That no model becomes current, and how to have the recalibrated one, where there is one."""
    stay = "Models stay as they are"
    if not found.recalibrated_model:
        return stay
    return f"{stay}; the recalibrated motor file: whyhot motor export {handle(found.recalibrated_model)} -o motor.toml"


def _elsewhere(facts: Facts, found: Diagnosis, model: str) -> dict[str, str]:
    sessions = [facts.session(one) for one in (*found.train, *found.held_out)]
    named = [session for session in sessions if (bench := facts.bench_of(session)) and bench.model]
    models = {session.name: model_of(facts, session) for session in named}
    return {name: one for name, one in models.items() if one != model}


def _others(facts: Facts, found: Diagnosis, accepted: Sequence[CauseAccepted]) -> dict[str, int]:
    asked = {facts.session(one).specimen for one in (*found.train, *found.held_out)}
    files = {file for one in accepted for file in (one.model, one.bench) if file}
    whose = [(one.specimen, files & {*_files(facts, one)}) for one in facts.sessions]
    return Counter(specimen for specimen, shared in whose if specimen and shared and specimen not in asked)


def _files(facts: Facts, session: SessionRecorded) -> Iterator[str]:
    """The motor and bench file that a session goes on with."""
    if bench := facts.bench_of(session):
        yield bench.sha256
        if bench.model:
            yield facts.current(bench.model)
