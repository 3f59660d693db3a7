"""Which version of a bench file goes with a model: what its sensors follow was fitted together with the motor."""

from __future__ import annotations

from dataclasses import replace

from ingest.facts.facts import Facts

MADE = "benches"  # in the summary of a DiagnosisCompleted: {"parent": bench, "of_model": {model: bench}}


def with_bench_of(facts: Facts, model: str) -> Facts:
    """The facts as a run with `model` takes them: where a diagnosis began from this model or made it, sessions have the
    version of their bench file that this had then or that was made beside the model, accepted or not."""
    for completed in reversed(list(facts.diagnoses.values())):
        made = completed.summary.get(MADE, {})
        if model in made.get("of_model", {}):
            parent, own = made["parent"], made["of_model"][model]
            successors = {old: new for old, new in facts.successors.items() if old not in (parent, own)}
            return replace(facts, successors=successors | ({parent: own} if own != parent else {}))
    return facts
