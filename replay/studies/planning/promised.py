"""What a plan promised of each cause that a diagnosis tells, beside what came: asked of a finished answer, so that the
same question has the same sealed answer with a plan and without."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.texts.names import handle
from replay.errors import PlanFileError
from replay.studies.characterise.calibrate import common_model
from replay.studies.diagnosis.answer import Diagnosis, Named, Rival

SCHEMA = "whyhot.plan/1"
AGAIN = "`whyhot plan --json plan.json` writes one"


@dataclass(frozen=True)
class PerAmplitude:
    """d of a candidate for a unit of its amplitude (of a factor: of its logarithm), `before` the day and `after`."""

    before: float
    after: float


@dataclass(frozen=True)
class PlanFile:
    """A plan that `whyhot plan --json` wrote: for which motor and version, from which sessions, what it promised."""

    path: Path
    motor: str
    model: str
    sessions: tuple[str, ...]
    promised: Mapping[str, PerAmplitude]

    def refuse_other(self, facts: Facts, sessions: Sequence[SessionRecorded], model: str | None) -> None:
        """Raises PlanFileError where a diagnosis of these sessions is of another motor, or another version of it."""
        model = model or common_model(facts, sessions)
        motor = facts.models[model].motor
        if motor != self.motor:
            raise PlanFileError(f"{self.path}: a plan for {self.motor}, and the sessions are of {motor}: name its own.")
        if model != self.model:
            raise PlanFileError(
                f"{self.path}: made with version {handle(self.model)} of {motor}, and the diagnosis is of "
                f"{handle(model)}: plan again, or say --model {handle(self.model)}."
            )


def read_plan(path: Path) -> PlanFile:
    """Raises PlanFileError where the file cannot be read, is no plan, or one of another version of whyhot."""
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise PlanFileError(f"{path}: {error.strerror or error}: {AGAIN}.") from error
    except (ValueError, RecursionError) as error:
        raise PlanFileError(f"{path}: no JSON, so no plan: {AGAIN}.") from error
    schema = said.get("schema") if isinstance(said, dict) else None
    if not str(schema).startswith("whyhot.plan/"):
        raise PlanFileError(f"{path}: no plan: {AGAIN}.")
    try:
        if schema != SCHEMA:
            raise ValueError(schema)
        promised = dict(map(_per_amplitude, said["candidates"]))
        return PlanFile(path, said["motor"], said["model"], tuple(said["sessions"]), promised)
    except (LookupError, TypeError, ValueError) as error:
        raise PlanFileError(
            f"{path}: a plan that another version of whyhot wrote, or none to its end: {AGAIN}."
        ) from error


def _per_amplitude(one: Mapping[str, Any]) -> tuple[str, PerAmplitude]:
    usual = float(one["usual_amplitude"])
    return str(one["id"]), PerAmplitude(float(one["usual_d"]) / usual, float(one["usual_d_after"]) / usual)


@dataclass(frozen=True, kw_only=True)
class Came:
    """A cause, named or a rival, at the `amplitude` that was found: d that the plan promised of it, of its sessions
    alone and with its day (None: no candidate of the plan), and the d that came."""

    id: str
    named: bool
    amplitude: float
    promised_d_before: float | None
    promised_d: float | None
    came_d: float
    log_bayes_factor: float


def came(plan: PlanFile, diagnosis: Diagnosis) -> list[Came]:
    """The named causes, then the rivals, both as the answer has them; those without a size in the readings are left
    out."""
    return [*_came(plan, diagnosis.causes, True), *_came(plan, diagnosis.rivals, False)]


def _came(plan: PlanFile, told: Sequence[Named | Rival], named: bool) -> Iterator[Came]:
    for one in told:
        if one.stands is None:
            continue
        per, size = plan.promised.get(one.id), abs(one.stands.amplitude)
        yield Came(
            id=one.id,
            named=named,
            amplitude=one.stands.amplitude,
            promised_d_before=per.before * size if per else None,
            promised_d=per.after * size if per else None,
            came_d=one.stands.d,
            log_bayes_factor=one.log_bayes_factor,
        )


def unlike_the_plan(plan: PlanFile, diagnosis: Diagnosis) -> str | None:
    """What the diagnosis learnt from other than the plan counted on, in words; None where it is the plan's sessions and
    more."""
    planned, learnt = set(plan.sessions), set(diagnosis.train)
    if missing := planned - learnt:
        return f"{len(missing)} of the {len(planned)} sessions that the plan counted on are not learnt from"
    if planned == learnt:
        return "no session came after the plan: only what it promised before the day can be held"
    return None
