"""Facts taken back by a person's word, and brought back, each with a reason. Nothing is deleted from the archive."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ingest.facts import facts as ledger_facts
from ingest.facts.events import Event, FactReinstated, FactRetracted
from ingest.facts.facts import Facts
from ingest.facts.named import NamedFact, find, find_retracted
from ingest.facts.standing import whole
from ingest.facts.store import Store
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


def _retraction(store: Store, facts: Facts, one: NamedFact, why: str) -> FactRetracted:
    rows, models = _rows(facts, one), _models(store, facts, one)
    return FactRetracted(fact=one.stream, name=one.name, why=why, rows=rows, models=models)


def _rows(facts: Facts, one: NamedFact) -> list[dict[str, Any]]:
    """The records that go with what is taken back."""
    if one.kind == "log":
        return [whole(one.key)]
    if one.kind == "session":
        files = facts.session(one.key).files
        return [{key: file[key] for key in ("raw", "first_record", "last_record")} for file in files]
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
