"""What a person can take back, found by name or id."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from typing import NamedTuple

from ingest.errors import CorrectionError, UnknownSessionError
from ingest.facts.facts import NAMED, Facts
from ingest.facts.standing import KINDS
from ingest.texts.names import first_of, handle, is_called
from ingest.texts.nearest import hint

LISTED = ' `whyhot sessions` lists sessions, `whyhot sql "SELECT name FROM files"` logs'


class NamedFact(NamedTuple):
    """A fact by its stream ("file-12ab..."), and as people call it."""

    stream: str
    name: str
    specimen: str | None = None

    @property
    def kind(self) -> str:
        return KINDS[self.stream.partition("-")[0]]

    @property
    def key(self) -> str:
        return self.stream.partition("-")[2]

    @property
    def called(self) -> str:
        return f"{self.kind} {self.name}"


def retractable(facts: Facts) -> list[NamedFact]:
    """All logs, sessions, diagnoses and inspections that stand."""
    of: dict[str, str | None] = {}  # log -> its specimen, None of a table with several
    for one in facts.sessions:
        of |= {
            file["raw"]: one.specimen if of.get(file["raw"], one.specimen) == one.specimen else None
            for file in one.files
        }
    return [
        *(NamedFact(f"file-{sha256}", file.name, of.get(sha256)) for sha256, file in facts.files.items()),
        *(NamedFact(f"session-{one.session}", one.name, one.specimen) for one in facts.sessions),
        *(NamedFact(f"diagnosis-{key}", f"d-{handle(key)}") for key in facts.diagnoses),
        *(NamedFact(f"inspection-{key}", found.name) for key, found in facts.inspections.items()),
    ]


def find(facts: Facts, text: str) -> NamedFact:
    """What stands under this name, id or beginning of an id. Raises CorrectionError where it is not one thing."""
    there = retractable(facts)
    if one := _only(there, text):
        return one
    if session := _session(facts, text):
        return session
    gone = [line for line in (_gone(facts, text), facts.taken_back(text), _other(facts, text)) if line]
    near = hint(text, [one.name for one in there]) or LISTED
    raise CorrectionError(gone[0] if gone else f"{text}: is not in this store.{near}")


def find_log(facts: Facts, text: str) -> NamedFact:
    """The log of this name or id, whether it stands, was taken back or was forgotten. Raises CorrectionError."""
    logs = [one for one in (*retractable(facts), *_retracted(facts)) if one.kind == "log"]
    if one := _only(logs, text):
        return one
    other = find(facts, text)
    says = f"{text}: is no log but {other.called}: only whole logs are forgotten"
    if other.kind != "session":
        raise CorrectionError(f"{says}: `whyhot retract {shlex.quote(text)} --reason TEXT` takes it back")
    its = dict.fromkeys(facts.files[file["raw"]].name for file in facts.session(other.key).files)
    raise CorrectionError(f"{says}: name those that it is of: {', '.join(its)}")


def find_retracted(facts: Facts, text: str) -> NamedFact:
    """What was taken back under this name or id. Raises CorrectionError, for what was forgotten too."""
    there = _retracted(facts)
    if one := _only(there, text):
        if forgotten := _forgotten(facts, one):
            raise CorrectionError(forgotten)
        return one
    if went := facts.taken_back(text):  # a session, with its log
        raise CorrectionError(went)
    standing = _only(retractable(facts), text)
    why = f"{standing.called} stands: there is nothing to undo" if standing else f"{text}: was not taken back"
    raise CorrectionError(f"{why}. Taken back: {', '.join(one.called for one in there) or 'nothing'}")


def _retracted(facts: Facts) -> list[NamedFact]:
    return [NamedFact(stream, one.event.name) for stream, one in facts.retractions.items()]


def _forgotten(facts: Facts, one: NamedFact) -> str | None:
    """The line of the log that something stood on and that was forgotten, None where anything of it is left."""
    logs = [facts.retractions.get(f"file-{row['raw']}") for row in facts.retractions[one.stream].event.rows]
    lines = [log.line for log in logs if log and log.forgotten]
    return lines[0] if lines and len(lines) == len(logs) else None


def _only(there: Iterable[NamedFact], text: str) -> NamedFact | None:
    """The one of this name, else of this id, None where there is none. Raises CorrectionError for several."""
    there, key = list(there), text.lower().removeprefix("d-")
    by_id = [one for one in there if is_called(one.key, key)]
    found = [one for one in there if one.name == text] or by_id
    if len(found) > 1:
        which = [f"{one.kind} {handle(one.key)}{f' ({one.specimen})' if one.specimen else ''}" for one in found]
        raise CorrectionError(f"{text}: is more than one: {first_of(which, NAMED)}: give its id")
    return found[0] if found else None


def _session(facts: Facts, text: str) -> NamedFact | None:
    """The session that an old id or name leads to."""
    try:
        session = facts.session(text)
    except UnknownSessionError:
        return None
    return NamedFact(f"session-{session.session}", session.name)


def _gone(facts: Facts, text: str) -> str | None:
    back = _only(_retracted(facts), text)
    return facts.retractions[back.stream].line if back else None


def _other(facts: Facts, text: str) -> str | None:
    """A line for what others need: it is not taken back but replaced."""
    benches = {one.name: sha256 for sha256, one in facts.benches.items()}
    databases = {one.name: sha256 for sha256, one in facts.databases.items()}
    for what, flag, known in (("bench file", "--bench", benches), ("signal database", "--dbc", databases)):
        for name, sha256 in known.items():
            if _is(text, name, sha256):
                return (
                    f"{text}: is a {what} that logs are read with: `whyhot correct LOG {flag} FILE` gives them another"
                )
    for model, published in facts.models.items():
        if _is(text, published.file, model) or text == published.motor:
            return f"{text}: is a motor file: take back the diagnosis that made it, or replay with another (--model)"
    if run := next((run for run in facts.runs if _is(text, run, run)), None):
        session = facts.runs[run].session
        return f"{text}: is a replay: it follows from its session ({handle(session)}) and its model: take back these"
    return None


def _is(text: str, name: str, key: str) -> bool:
    return text == name or is_called(key, text)
