"""What `retract`, `forget`, `correct` and `stale` answer: what was put right, what went with it, and what is stale."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ingest.texts.names import handle
from replay.show.verbs.backup import removed
from replay.show.words.terminal import labelled
from replay.show.words.words import counted, joined, short

if TYPE_CHECKING:
    from ingest.facts.facts import Facts
    from ingest.intake.retractions import ForgottenLogs, PutRight
    from replay.studies.again.redo import Redone
    from replay.studies.again.stale import StaleAnswers

REDO = "whyhot stale --redo"
BACKUPS = "whyhot backup DIR, of each backup that there is: it holds these bytes until then"


def put_right_json(done: PutRight, reason: str, stale: StaleAnswers) -> dict[str, Any]:
    """Ids are whole; `stale` holds all that became stale by it, asked again since or not."""
    return {
        "facts": [{"fact": one.stream, "kind": one.kind, "name": one.name} for one in done.named],
        "reason": reason,
        "changes": done.said,
        "sessions_gone": [one.session for one in _gone(done)],
        "sessions_came": [one.session for one in done.after.sessions if one not in done.before.sessions],
        "runs_gone": sorted(done.before.runs.keys() - done.after.runs.keys()),
        "stale": stale_json(_all(stale)),
        "stale_in_use": list(stale.in_use),
    }


def put_right_text(label: str, done: PutRight, reason: str, stale: StaleAnswers) -> str:
    """`label`: "Taken back", "Brought back" or "Corrected"."""
    next_step = _next(stale) or ["", *labelled("Next", "whyhot sessions")]
    return "\n".join([*_put_right(label, done, reason), *_stale_lines(stale), *_there_again(stale), *next_step])


def forgotten_json(found: ForgottenLogs, reason: str, stale: StaleAnswers) -> dict[str, Any]:
    """As `put_right_json`; `removed`: what is gone now, `before`: of logs that were forgotten already."""
    put_right = put_right_json(found.done, reason, stale)
    return {**put_right, "removed": found.swept._asdict(), "before": list(found.before)}


def forgotten_text(found: ForgottenLogs, reason: str, stale: StaleAnswers) -> str:
    lines = [line for says in found.before for line in labelled("Already", says)]
    lines += _put_right("Forgotten", found.done, reason) if found.done.named else []
    lines += [*removed(found.swept), *_stale_lines(stale), *_there_again(stale)]
    steps = labelled("Then", BACKUPS) if stale.answers else ["", *labelled("Next", BACKUPS)]
    return "\n".join([*lines, *_next(stale), *steps])


def _put_right(label: str, done: PutRight, reason: str) -> list[str]:
    lines = labelled(label, *(one.called + _changes(done, done.said.get(one.key, {})) for one in done.named))
    lines += labelled("Reason", reason.strip())
    if gone := _what_is_gone(done):
        lines += labelled("Gone", gone)
    before = {session.session: session for session in done.before.sessions}
    for session in done.after.sessions:
        if (old := before.get(session.session)) != session:
            said = {"specimen": session.specimen, "batch": session.batch, "kind": session.kind}
            of = ", ".join(f"{what} {value}" for what, value in said.items() if value)
            there = "is another now" if old else "is there now"
            lines += labelled("Session", f"{session.name} ({short(session.session)}) {there}: {of}")
    for parent in {**done.before.successors, **done.after.successors}:
        was, now = (facts.current(parent) for facts in (done.before, done.after))
        if was != now:
            lines += labelled("Current", f"{_value(done.after, now)} in place of {_value(done.after, was)}")
    return lines


def _all(stale: StaleAnswers) -> StaleAnswers:
    """With what was asked again before: it was built on what is put right too."""
    return stale._replace(answers=[*stale.answers, *stale.answered])


def stale_json(stale: StaleAnswers) -> list[dict[str, Any]]:
    return [{"kind": one.kind, "name": one.name, "why": one.why, "sessions": [*one.sessions]} for one in stale.answers]


def stale_text(stale: StaleAnswers) -> str:
    if lines := [*_stale_lines(stale)]:
        return "\n".join([*lines, *_next(stale)])
    return "Nothing is stale: every answer uses the current sessions, files and version."


def redone_text(done: Sequence[Redone], left: StaleAnswers) -> str:
    lines: list[str] = []
    for one in done:
        if one.new:
            lines += labelled("Again", f"{one.old.name} ({one.old.why}): {_called(one)}")
    return "\n".join([*lines, *_stale_lines(left), *_next(left)]) if lines else stale_text(left)


def _called(one: Redone) -> str:
    own = handle(str(one.new))
    return f"diagnosis d-{own}" if one.old.kind == "diagnosis" else f"{one.old.kind} {own}"


def _stale_lines(stale: StaleAnswers) -> Iterator[str]:
    yield from labelled("Stale", *(f"{one.name}: {one.why}" for one in stale.answers))
    for line in stale.in_use:
        yield from labelled("In use", f"{line}. Accept another, or take it back")


def _there_again(stale: StaleAnswers) -> list[str]:
    return labelled("There again", *(f"{one.name}, of what is current now ({one.why})" for one in stale.answered))


def _next(stale: StaleAnswers) -> list[str]:
    """What to do now where something is stale."""
    return ["", *labelled("Next", REDO)] if stale.answers else []


def _gone(done: PutRight) -> list[Any]:
    now = {one.session for one in done.after.sessions}
    return [one for one in done.before.sessions if done.after.became(one.session) not in now]


def _what_is_gone(done: PutRight) -> str:
    runs = len(done.before.runs.keys() - done.after.runs.keys())
    parts = [f"session {one.name} ({short(one.session)})" for one in _gone(done)]
    parts += [counted(runs, "replay")] * bool(runs)
    parts += ["the assessment of the ageing"] * (len(done.after.assessments) < len(done.before.assessments))
    return joined(parts)


def _changes(done: PutRight, said: Mapping[str, Sequence[Any]]) -> str:
    """ ": specimen S2 in place of S1"."""
    told = [
        f"{what} {_value(done.after, new)} in place of {_value(done.after, old)}" for what, (old, new) in said.items()
    ]
    return f": {joined(told)}" if told else ""


def _value(facts: Facts, value: Any) -> str:
    """A file by its name and the beginning of its SHA-256."""
    if isinstance(value, list):
        return joined([_value(facts, one) for one in value]) or "none"
    file = facts.benches.get(value) or facts.databases.get(value)
    model = facts.models.get(value)
    name = file.name if file else model.file if model else None
    return f"{name} {short(value)}" if name else str(value) if value is not None else "none"
