"""What a fact follows from: the chain from an answer down to sealed bytes, each link an event of the ledger."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from ingest.facts.events import (
    AgeingAssessed,
    BenchRegistered,
    CalibrationCompleted,
    DecodeCompleted,
    DiagnosisCompleted,
    Event,
    InspectionRecorded,
    LogCorrected,
    ModelExtended,
    ModelPublished,
    RawFileSealed,
    ReplayCompleted,
    SessionRecorded,
    SignalDatabaseRegistered,
)
from ingest.facts.facts import Facts
from ingest.facts.ledger_row import Recorded
from ingest.facts.standing import records
from ingest.texts.names import handle

ID: dict[type[Event], str] = {  # the field that links name an event by
    RawFileSealed: "sha256",
    SignalDatabaseRegistered: "sha256",
    BenchRegistered: "sha256",
    ModelPublished: "model",
    DecodeCompleted: "decode",
    LogCorrected: "raw",
    SessionRecorded: "session",
    ReplayCompleted: "run",
    CalibrationCompleted: "calibration",
    DiagnosisCompleted: "diagnosis",
    AgeingAssessed: "assessment",
    InspectionRecorded: "inspection",
}
NO_KEY: Mapping[str, Any] = MappingProxyType({})  # of what is no answer


@dataclass(frozen=True)
class FactLink:
    """One fact of a chain. `id`: whole; `says`: what it is and how it came out; `command`: what makes it again, None
    where it follows from the link before; `event`, `recorded` and `code`: its number, time and the program that wrote
    it, None where the ledger has no event of it."""

    kind: str
    id: str
    says: str
    command: str | None = None
    event: int | None = None
    recorded: str | None = None
    code: str | None = None


class Chains:
    """The chains of a ledger: `of_run`, `of_session` ... give the links from the answer down to the bytes."""

    def __init__(self, recorded: Iterable[Recorded], facts: Facts) -> None:
        self.facts = facts
        self.last: dict[tuple[type[Event], str], Recorded] = {}
        self.extended: dict[str, str] = {}  # model or bench file -> the diagnosis that made it
        self.parents: dict[str, str] = {}  # bench file -> the one that a diagnosis made it from
        for one in recorded:
            if key := _key(one.event):
                self.last[type(one.event), key] = one
            if isinstance(one.event, ModelExtended):
                made = (one.event.model, one.event.bench)
                self.extended |= {file: one.event.diagnosis for file in made if file}
                if one.event.bench and one.event.parent_bench:
                    self.parents[one.event.bench] = one.event.parent_bench

    def of_run(self, run: str) -> list[FactLink]:
        event = self.facts.runs[run]
        code, bench = handle(str(event.key.get("code", ""))), event.bench
        words = ["whyhot", "replay", handle(event.session), "--model", handle(event.model), "--level", event.level]
        says = f"of session {self._name(event.session)} with {event.motor}, digest {handle(event.digest)}, code {code}"
        return [
            self._link("replay", ReplayCompleted, run, says, words),
            *self.of_model(event.model),
            *self.of_session(event.session, event.key, bench),
        ]

    def of_diagnosis(self, diagnosis: str) -> list[FactLink]:
        event = self.facts.diagnoses[diagnosis]
        train, kept, model = event.key.get("train", []), event.key.get("kept", []), event.key.get("model")
        words = ["whyhot", "diagnose", "--on", *map(self._name, train)]
        words += ["--hold-out", *map(self._name, kept)] if kept else []
        causes, code = ", ".join(event.summary.get("causes", ())), handle(str(event.key.get("code", "")))
        link = self._link("diagnosis", DiagnosisCompleted, diagnosis, f"{causes or 'no cause'}, code {code}", words)
        return [link, *(self.of_model(model) if model else []), *self._of_sessions([*train, *kept], event.key)]

    def of_calibration(self, calibration: str) -> list[FactLink]:
        event = next(one for one in self.facts.calibrations.values() if one.calibration == calibration)
        words = ["whyhot", "calibrate", "--on", *map(self._name, event.sessions), "--model", handle(event.parent)]
        says = f"made model {handle(event.model)} of {event.motor}"
        link = self._link("calibration", CalibrationCompleted, calibration, says, words)
        return [link, *self.of_model(event.parent), *self._of_sessions(event.sessions, event.key)]

    def of_ageing(self, assessment: str) -> list[FactLink]:
        event = self.facts.assessments[assessment]
        count, named = event.count or len(event.sessions), len(event.sessions)
        first = f", the first {named} of which follow" if count > named else ""
        says, words = f"from {count:,} sessions with checks{first}", ["whyhot", "ageing"]
        return [self._link("ageing", AgeingAssessed, assessment, says, words), *self._of_sessions(event.sessions, {})]

    def of_model(self, model: str) -> list[FactLink]:
        """The motor file, and those that it was made from."""
        links: list[FactLink] = []
        while model in self.facts.models and all(model != link.id for link in links):
            event = self.facts.models[model]
            by = f", made by diagnosis d-{handle(self.extended[model])}" if model in self.extended else ""
            made = self.facts.calibrations.get(model)
            by = f", made by calibration {handle(made.calibration)}" if made else by
            from_ = f", from model {handle(event.parent)}" if event.parent else ""
            links.append(self._link("motor file", ModelPublished, model, f"{event.file} of {event.motor}{from_}{by}"))
            model = event.parent or ""
        return links

    def of_bench(self, bench: str) -> list[FactLink]:
        """The bench file, and those that it was made from."""
        return [link for one in self._versions(bench) for link in self._bench(one)]

    def of_session(self, session: str, key: Mapping[str, Any] = NO_KEY, bench: str | None = None) -> list[FactLink]:
        """The session, its bench file (`bench`: the version that was taken), its logs and what they were read with, now
        or for the answer of this key."""
        if back := self.facts.taken_back(session):
            return [FactLink("session", session, back)]
        found = self.facts.session(session)
        kind = f"{found.name}: {found.kind}, specimen {found.specimen or 'not given'}"
        links = [self._link("session", SessionRecorded, found.session, kind)]
        files = [self._as_read(file, key) for file in found.files]
        first = self.facts.decodes[files[0]["decode"]].bench if files else found.bench
        links += self._bench(bench or self._taken(first, key))
        return links + [
            link
            for now, file in zip(found.files, files, strict=True)
            for link in self.of_log(file, corrected=file == now)
        ]

    def _as_read(self, file: dict[str, Any], key: Mapping[str, Any]) -> dict[str, Any]:
        """An entry of `SessionRecorded.files` as the answer of this key took it, who may have had another decode."""
        decodes = self.facts.decodes_of(file["raw"])
        now = self.facts.decodes[file["decode"]]
        took = next((one for one in (now, *reversed(decodes)) if self._took(one, key)), now)
        return file | {"decode": took.decode}

    def _took(self, decode: DecodeCompleted, key: Mapping[str, Any]) -> bool:
        if "decodes" in key:
            return decode.decode in key["decodes"]
        benches = [one for taken in key.get("benches", [key.get("bench")]) for one in self._versions(taken)]
        files = {*decode.databases} <= {*key.get("databases", ())} and decode.decoder in key.get("decoder", ())
        return files and (decode.bench in benches or not decode.bench)

    def _taken(self, bench: str | None, key: Mapping[str, Any]) -> str | None:
        """The version of a log's bench file that stands in the key of an answer, else the current one."""
        versions = [one for one in key.get("benches", ()) if bench in self._versions(one)]
        return (versions or [self.facts.current(bench)])[0] if bench else None

    def _versions(self, bench: str | None) -> list[str]:
        """A bench file, and those that it was made from."""
        found: list[str] = []
        while bench and bench not in found:
            found.append(bench)
            bench = self.parents.get(bench)
        return found

    def of_log(self, file: dict[str, Any], corrected: bool = True) -> list[FactLink]:
        """The log of an entry of `SessionRecorded.files`, and how it was read; `corrected`: as its correction says."""
        sealed, decode = self.facts.files[file["raw"]], self.facts.decodes[file["decode"]]
        bench = self.facts.benches.get(decode.bench or "")
        databases = [self.facts.databases[sha256] for sha256 in decode.databases]
        words = ["whyhot", "ingest", sealed.name, *(["--bench", bench.name] if bench else [])]
        words += [word for database in databases for word in ("--dbc", database.name)]
        links = [
            self._link(
                "log", RawFileSealed, sealed.sha256, f"{sealed.name}, {sealed.size:,} bytes, {records(file)}", words
            )
        ]
        if corrected and (correction := self.last.get((LogCorrected, sealed.sha256))):
            event = correction.event
            why = event.why if isinstance(event, LogCorrected) else ""
            links.append(self._link("correction", LogCorrected, sealed.sha256, why))
        how = "; since ".join([f"{decode.outcome} by {decode.decoder}", *decode.settings.get("changes", ())])
        links.append(self._link("decode", DecodeCompleted, decode.decode, how))
        links += self._bench(decode.bench)
        for one in databases:
            links.append(self._link("signal database", SignalDatabaseRegistered, one.sha256, one.name))
        return links

    def of_inspection(self, inspection: str) -> list[FactLink]:
        event = self.facts.inspections[inspection]
        says = f"{event.name} of {event.specimen}: {event.finding}"
        return [self._link("inspection", InspectionRecorded, inspection, says)]

    def _of_sessions(self, sessions: Iterable[str], key: Mapping[str, Any]) -> list[FactLink]:
        """Sessions of an answer, each as the answer's key says that it was read."""
        return [link for session in sessions for link in self.of_session(session, key)]

    def _bench(self, bench: str | None) -> Iterator[FactLink]:
        if bench in self.facts.benches and bench is not None:
            by = f", made by diagnosis d-{handle(self.extended[bench])}" if bench in self.extended else ""
            yield self._link("bench file", BenchRegistered, bench, f"{self.facts.benches[bench].name}{by}")

    def _name(self, session: str) -> str:
        gone = self.facts.gone_sessions.get(session)
        return (gone or self.facts.session(session)).name

    def _link(self, kind: str, of: type[Event], key: str, says: str, words: Sequence[str] = ()) -> FactLink:
        command = shlex.join(words) or None
        one = self.last.get((of, key))
        if one is None:
            return FactLink(kind, key, says, command)
        return FactLink(kind, key, says, command, one.position, one.recorded, one.code)


def distinct(links: Iterable[FactLink]) -> list[FactLink]:
    """Each fact once, where it is first met."""
    found: dict[tuple[str, str], FactLink] = {}
    for link in links:
        found.setdefault((link.kind, link.id), link)
    return list(found.values())


def _key(event: Event) -> str | None:
    """The id that links name an event by."""
    return str(getattr(event, ID[type(event)])) if type(event) in ID else None
