"""Which version of a bench file goes with a model: what its sensors follow was fitted together with the motor."""

from __future__ import annotations

from dataclasses import replace

from ingest.facts.facts import Facts

MADE = "benches"  # in the summary of a DiagnosisCompleted: {"of_model": {model: {bench file: its version}}}


def with_bench_of(facts: Facts, model: str) -> Facts:
    """The facts as a run with `model` takes them: where a diagnosis began from this model or made it, sessions have the
    version of their bench file that this had then or that was made beside the model, accepted or not."""
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
