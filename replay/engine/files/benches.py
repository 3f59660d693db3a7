"""Bench files in a store: found by what people call them, and in the version that goes with a model."""

from __future__ import annotations

from dataclasses import replace

from ingest.errors import UnknownSessionError
from ingest.facts.events import BenchRegistered
from ingest.facts.facts import Facts
from ingest.texts.names import handle, is_called
from replay.errors import ReplayDataError

MADE = "benches"  # in the summary of a DiagnosisCompleted: {"of_model": {model: {bench file: its version}}}


def current_bench(facts: Facts, text: str) -> BenchRegistered:
    """The bench file by its own name, of a session (name or id), or by the beginning of its id; by the first two as
    accepted since. Raises ReplayDataError, which lists all."""
    used = {session.bench for session in facts.sessions if session.bench}
    named = {facts.current(sha256) for sha256 in used if facts.benches[sha256].name == text}
    its = {facts.current(one.bench) for one in facts.sessions if one.bench and text in (one.name, one.session)}
    found = sorted(named or its or {sha256 for sha256 in facts.benches if is_called(sha256, text)})
    if not found:
        try:
            bench = facts.bench_of(facts.session(text))
        except UnknownSessionError:
            bench = None
        found = [bench.sha256] if bench else []
    if len(found) == 1:
        return facts.benches[found[0]]
    known = ", ".join(f"{one.name} {handle(sha256)}" for sha256, one in facts.benches.items()) or "none"
    why = "is not one bench file" if found else "is no bench file, nor a session that has one,"
    raise ReplayDataError(f'bench file "{text}" {why} of this store. Known: {known}. Or name a session.')


def with_bench_of(facts: Facts, model: str) -> Facts:
    """The facts as a run with `model` takes them: where a diagnosis began from this model or made it, sessions have the
    version of their bench file that this had then or that was made beside the model, accepted or not: what its sensors
    follow was fitted together with the motor."""
    for completed in reversed(list(facts.diagnoses.values())):
        made = completed.summary.get(MADE, {})
        if model in made.get("of_model", {}):
            versions = made["of_model"][model]
            if isinstance(versions, str):  # as it was written while all sessions had one bench file
                versions = {made["parent"]: versions}
            concerned = {*versions, *versions.values()}
            successors = {old: new for old, new in facts.successors.items() if old not in concerned}
            return replace(facts, successors=successors | {a: b for a, b in versions.items() if a != b})
    return facts
