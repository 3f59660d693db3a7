"""Motor files in a store: published, found again, and handed to an intake."""

from __future__ import annotations

import hashlib
from pathlib import Path

from ingest.facts import facts as ledger_facts
from ingest.facts.events import ModelPublished, SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from ingest.intake.setup import MotorFile, Setup, keep_setup, mend_setup
from ingest.texts.names import handle
from ingest.texts.nearest import hint
from replay.engine.files.motor_file import read_motor
from replay.engine.files.motor_maps import whole
from replay.errors import ReplayDataError
from twin.motor.configured import configured


def for_intake(path: Path) -> MotorFile:
    """A motor file as far as an intake needs it, its maps written into it. Raises MotorFileError."""
    data = whole(path)
    network = read_motor(data, path.name)
    return MotorFile(
        data=data,
        file=path.name,
        motor=network.name,
        regions={node.name: node.region for node in network.nodes},
        boundaries=[boundary.name for boundary in network.boundaries],
        configurations={one.name: configured(network, one.name).names for one in network.configurations},
    )


def publish_model(store: Store, path: Path) -> str:
    """Seal a motor file, made whole, and make it known; returns the model id (its SHA-256). Raises MotorFileError."""
    motor, known = for_intake(path), ledger_facts.at(store.ledger)
    setup = Setup(None, b"", (), motor, motor.model)
    mend_setup(store, known, setup)
    keep_setup(store, known, setup)
    return motor.model


def published(facts: Facts, parent: str, model: str) -> list[tuple[str, ModelPublished]]:
    """The fact that `model` was made from `parent`, with the stream that it belongs to; none where it holds already."""
    of = facts.models[parent]
    event = ModelPublished(model=model, motor=of.motor, file=of.file, parent=parent)
    return [] if model in facts.models else [(f"motor-{of.motor}", event)]


def find_model(facts: Facts, text: str, or_file: bool = True) -> str:
    """A model by id, unique beginning of an id, or motor name (its latest). Raises ReplayDataError, which lists all;
    `or_file`: a motor file may be given as well."""
    named = [event.model for event in facts.models.values() if event.motor == text]
    if named:
        return named[-1]
    found = [model for model in facts.models if model.startswith(text)]
    if len(found) == 1:
        return found[0]
    known = ", ".join(f"{event.motor} {handle(model)}" for model, event in facts.models.items()) or "none"
    near = hint(text, {event.motor for event in facts.models.values()}) if not found else ""
    why = "is not one model" if found else "is no model"
    more = " Or give a motor file (ends in .toml)." if or_file else ""
    raise ReplayDataError(f'model "{text}" {why} of this store.{near} Known: {known}.{more}')


def current_model(facts: Facts, text: str) -> str:
    """As `find_model`; a motor's name stands for its latest file that was not made from another, or for what was
    accepted in its place."""
    named = [event.model for event in facts.models.values() if event.motor == text and event.parent is None]
    return facts.current(named[-1]) if named else find_model(facts, text, or_file=False)


def known_model(facts: Facts, text: str) -> str:
    """As `find_model`; a motor file (ends in .toml) stands for the model with its bytes. Raises ReplayDataError."""
    if not text.endswith(".toml"):
        return find_model(facts, text)
    path = Path(text)
    if not path.is_file():
        raise ReplayDataError(f"--model {text}: there is no such file: correct the path, or give a model id.")
    model = hashlib.sha256(whole(path)).hexdigest()
    if model not in facts.models:
        raise ReplayDataError(
            f"--model {text}: nothing was replayed with this motor file: whyhot replay --model {text}"
        )
    return model


def model_of(facts: Facts, session: SessionRecorded) -> str:
    """The model that a session's bench file names, or the one accepted in its place. Raises ReplayDataError where there
    is none."""
    bench, lead = facts.bench_of(session), f"session {session.name}:"
    if bench is None:
        raise ReplayDataError(f"{lead} was ingested without a bench file: ingest it again with --bench.")
    if bench.model is None:
        raise ReplayDataError(
            f'{lead} {bench.name} names no motor file: add motor = "motor.toml" to it and ingest again, or say --model '
            "motor.toml."
        )
    return facts.current(bench.model)


def model_named(store: Store, text: str | None) -> str | None:
    """The model that a flag says: a motor file (published if new), an id or a motor name; None for None."""
    if text is None or not text.endswith(".toml"):
        return None if text is None else find_model(ledger_facts.at(store.ledger), text)
    return publish_model(store, Path(text))
