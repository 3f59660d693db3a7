"""What a plan promised beside what came, as JSON and as paragraphs of a diagnosis' text."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from replay.engine.results.as_json import to_json
from replay.studies.diagnosis.answer import Diagnosis
from replay.studies.planning.promised import Came, PlanFile, came, unlike_the_plan


def document(plan: PlanFile, diagnosis: Diagnosis) -> dict[str, Any]:
    """`planned` of `whyhot.diagnosis/1`."""
    note = unlike_the_plan(plan, diagnosis)
    return {"sessions": list(plan.sessions), "causes": to_json(came(plan, diagnosis)), "note": note}


def paragraphs(plan: PlanFile, diagnosis: Diagnosis) -> Iterator[str]:
    """A line for each cause and rival, and what was not as planned."""
    told = came(plan, diagnosis)
    yield (
        "d of the size that was found: promised before the day and with it, and what came" if told else "no size found"
    )
    yield from map(_line, told)
    if note := unlike_the_plan(plan, diagnosis):
        yield note


def _line(one: Came) -> str:
    """ "loss.magnet.speed2: promised 2.1, with the day 7.5; came 6.8 (named, ln BF 18.2)"."""
    as_what = f"{'named' if one.named else 'rival'}, ln BF {one.log_bayes_factor:.1f}"
    if one.promised_d is None or one.promised_d_before is None:
        return f"{one.id}: no candidate of the plan; came {one.came_d:.1f} ({as_what})"
    promised = f"promised {one.promised_d_before:.1f}, with the day {one.promised_d:.1f}"
    return f"{one.id}: {promised}; came {one.came_d:.1f} ({as_what})"
