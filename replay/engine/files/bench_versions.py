"""Which version of a bench file goes with a model: thermocouples are fitted together with the motor, and belong
together."""

from __future__ import annotations

from dataclasses import replace

from ingest.facts.facts import Facts

MADE = "benches"  # in the summary of a DiagnosisCompleted: {"parent": bench, "of_model": {model: bench}}


def with_bench_of(facts: Facts, model: str) -> Facts:
    """The facts as a run with `model` takes them: where a diagnosis began from this model or made it, sessions of its
    bench file have the version that it had then or made beside it, accepted or not. All other sessions and models: as
    they are."""
    for completed in reversed(list(facts.diagnoses.values())):
        made = completed.summary.get(MADE, {})
        if model in made.get("of_model", {}):
            parent, own = made["parent"], made["of_model"][model]
            successors = {old: new for old, new in facts.successors.items() if old not in (parent, own)}
            return replace(facts, successors=successors | ({parent: own} if own != parent else {}))
    return facts
