"""Facts taken back by a person's word, and brought back, each with a reason; and logs that must go for good.

Nothing is deleted from the archive but the bytes of a log that was forgotten.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ingest.facts import facts as ledger_facts
from ingest.facts.cited import forgotten
from ingest.facts.events import Event, FactReinstated, FactRetracted, LogForgotten, RawFileSealed
from ingest.facts.facts import Facts
from ingest.facts.named import NamedFact, find, find_log, find_retracted
from ingest.facts.standing import runs, whole
from ingest.facts.store import Store
from ingest.facts.sweeping import Swept, sweep
from ingest.intake.attachments import in_words
from ingest.intake.grouping import group_files

Batch = list[tuple[str, Event]]
REASON = '"the wrong motor was mounted"'


@dataclass(frozen=True)
class PutRight:
    """What was put right; the facts before and after; a line for each session that could not be recorded."""

    named: Sequence[NamedFact]
    before: Facts
    after: Facts
    said: Mapping[str, Mapping[str, Sequence[Any]]]  # of a correction: SHA-256 of the log -> what -> before, now
    left: Sequence[str] = ()


@dataclass(frozen=True)
class ForgottenLogs:
    """Logs that went for good: what was put right, for those that were there; `before`: what became of those that were
    forgotten already, a line each; how much was removed now."""

    done: PutRight
    before: Sequence[str]
    swept: Swept


def retract(store: Store, texts: Sequence[str], why: str) -> PutRight:
    """Take back logs, sessions, diagnoses or inspections, named by name or id, all or none.

    Raises CorrectionError where one is not there, was taken back before or is nothing of the kind.
    """
    why, facts = in_words(why, "--reason", REASON), ledger_facts.at(store.ledger)
    named = list(dict.fromkeys(find(facts, text) for text in texts))
    return _grouped(store, facts, named, [(one.stream, _retraction(store, facts, one, why)) for one in named])


def reinstate(store: Store, texts: Sequence[str], why: str) -> PutRight:
    """Bring back what was taken back, all or none. Raises CorrectionError where that was not taken back."""
    why, facts = in_words(why, "--reason", REASON), ledger_facts.at(store.ledger)
    named = list(dict.fromkeys(find_retracted(facts, text) for text in texts))
    return _grouped(store, facts, named, [(one.stream, FactReinstated(fact=one.stream, why=why)) for one in named])


def forget(store: Store, texts: Sequence[str], why: str) -> ForgottenLogs:
    """Take logs back for good, all or none, and remove their bytes and what was made of them, with what a forget that
    was stopped left of any.

    Raises CorrectionError where one is no log, OSError where bytes cannot be removed: the same again goes on.
    """
    why, facts = in_words(why, "--reason", REASON), ledger_facts.at(store.ledger)
    backs = {one: facts.retractions.get(one.stream) for one in (find_log(facts, text) for text in texts)}
    before = [back.says for back in backs.values() if back and back.forgotten]
    batch: Batch = []
    for one, back in backs.items():
        if back is None:
            batch.append((one.stream, _retraction(store, facts, one, why)))
        if back is None or not back.forgotten:
            batch.append((one.stream, LogForgotten(raw=one.key, name=one.name, size=_size(store, one), why=why)))
    named = [one for one in backs if any(stream == one.stream for stream, _ in batch)]
    done = _grouped(store, facts, named, batch)
    return ForgottenLogs(done, before, sweep(store, forgotten(store.ledger.events())))


def _size(store: Store, log: NamedFact) -> int:
    """The bytes of a log, taken back or not, as they were sealed."""
    sealed = [one.event for one in store.ledger.events(stream=log.stream)]
    return next(event.size for event in sealed if isinstance(event, RawFileSealed))


def _retraction(store: Store, facts: Facts, one: NamedFact, why: str) -> FactRetracted:
    rows, models = _rows(facts, one), _models(store, facts, one)
    return FactRetracted(fact=one.stream, name=one.name, why=why, rows=rows, models=models)


def _rows(facts: Facts, one: NamedFact) -> list[dict[str, Any]]:
    """The records that go with what is taken back."""
    if one.kind == "log":
        return [whole(one.key)]
    if one.kind == "session":
        held = [(file["raw"], run) for file in facts.session(one.key).files for run in runs(file)]
        return [{"raw": raw, "first_record": first, "last_record": last} for raw, (first, last) in held]
    return []


def _models(store: Store, facts: Facts, one: NamedFact) -> list[str]:
    """The models that a diagnosis offers."""
    if one.kind != "diagnosis":
        return []
    document = json.loads(store.archive.read(facts.diagnoses[one.key].artefact))
    offered = [document.get("recalibrated_model"), document.get("extended_model")]
    offered += [step.get("model") for step in document.get("chain", ())]
    return sorted({model for model in offered if model} - {document["model"]})


def _grouped(store: Store, before: Facts, named: Sequence[NamedFact], batch: Batch) -> PutRight:
    """Append the batch, with what it makes of the sessions."""
    left: Sequence[str] = ()
    if any(one.kind in ("log", "session") for one in named):
        left = group_files(store, (), {}, batch).left
    else:
        store.ledger.append_all(batch)
    return PutRight(named, before, ledger_facts.at(store.ledger), {}, left)
