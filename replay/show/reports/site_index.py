"""The first page of a folder over a store: sessions with their worst node, diagnoses by sentence, stators; links."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.results.summary import Summary, read
from replay.show.reports import sentences
from replay.show.reports.diagnosis_text import diagnosis_name
from replay.show.reports.documents import context, last_assessment
from replay.show.reports.report import moment
from replay.show.reports.site import Course
from replay.show.reports.site_pages import AGEING, COMMAND, diagnosis_path, session_path
from replay.show.verbs import ageing
from replay.show.words import words
from replay.show.words.findings import direction, mean_error, worst_first
from replay.show.words.page import template
from replay.studies.ageing.assess import is_of_now
from replay.studies.ageing.assessment import Assessment
from replay.studies.diagnosis.accept import sealed_diagnosis

WIDE, HIGH = 140, 24  # of a course, in points
MOST = 200  # sessions without a report that are listed: a fleet has one a motor


@dataclass(frozen=True)
class SessionRow:
    """A session in the index. `link`, `course`: of its report and its residual as SVG, "" where there is none;
    `without`: why there is no `worst`."""

    name: str
    kind: str
    specimen: str
    start: str
    length: str
    link: str
    worst: str
    without: str
    wrong: bool
    course: str


@dataclass(frozen=True)
class DiagnosisRow:
    """A diagnosis in the index; `link` is "" where its report could not be made."""

    name: str
    link: str
    motor: str
    headline: str
    learnt: Sequence[str]
    kept: Sequence[str]


def index_page(store: Store, facts: Facts, pages: Mapping[str, Course]) -> str:
    """The text of the page; `pages`: path of each report that is there -> the residual over its session [K]."""
    scale = max((abs(value) for course in pages.values() for value in course if value is not None), default=0.0)
    every, diagnoses = list(_sessions(facts, pages, scale)), list(_diagnoses(store, facts, pages))
    sessions = listed(every)
    found = last_assessment(store, facts)
    return template("index.html.j2").render(
        answer=_answer(every, len(diagnoses), found),
        sessions=sessions,
        unlisted=len(every) - len(sessions),
        scale=words.kelvin(scale) if scale else "",
        diagnoses=diagnoses,
        ageing=ageing,
        insulation=found,
        insulation_link=AGEING if AGEING in pages else "",
        outdated=found is not None and not is_of_now(facts, list(facts.assessments.values())[-1]),
        context=context(store, COMMAND),
    )


def _answer(sessions: Sequence[SessionRow], diagnoses: int, found: Assessment | None) -> str:
    """What there is, and how much of it was looked at."""
    replayed = sum(bool(row.worst) for row in sessions)
    off = sum(row.wrong for row in sessions)
    told = [f"{words.counted(len(sessions), 'session')}, {replayed} replayed"]
    told += [f"in {off} of these the model is off by more than its sensors leave open"] if off else []
    told += [f"{diagnoses} {'diagnosis' if diagnoses == 1 else 'diagnoses'}"] if diagnoses else []
    told += [words.counted(found.whole.specimens, "specimen") + " followed through ageing"] if found else []
    return "; ".join(told) + "."


def _sessions(facts: Facts, pages: Mapping[str, Course], scale: float) -> Iterator[SessionRow]:
    for session in facts.sessions:
        last, path = facts.current_run(session), session_path(session.session)
        summary = read(last.summary) if last else None
        course = pages.get(path, ())
        yield SessionRow(
            name=session.name,
            kind=session.kind,
            specimen=session.specimen or "",
            start=moment(session.start_ns, session.absolute),
            length=words.duration((session.end_ns - session.start_ns) / 1e9),
            link=path if path in pages else "",
            worst=_worst(summary) if summary else "",
            without="no motor file" if session.model is None else "not replayed yet",
            wrong=summary is not None and any(not one.within_floor for one in summary.channels),
            course=course_svg(course, scale) if any(value is not None for value in course) else "",
        )


def listed(every: Sequence[SessionRow]) -> list[SessionRow]:
    """The rows that the page shows, in order: all with a report, and the last `MOST` of the others."""
    others = [row for row in every if not row.link]
    left = {id(row) for row in others[: max(len(others) - MOST, 0)]}
    return [row for row in every if id(row) not in left]


def _worst(summary: Summary) -> str:
    """ "magnet 6.1 K, too cold"."""
    errors = worst_first(summary)
    if not errors:
        return "no node is observed"
    off = "on average within its sensor's uncertainty" if errors[0].within_floor else direction(errors[0])
    return f"{words.name(errors[0].node)} {mean_error(errors[0])}, {off}"


def course_svg(course: Course, scale: float) -> str:
    """A residual over a session as a line beside zero, drawn in numbers alone; `scale` [K] fills half the height."""
    step, middle = WIDE / max(len(course) - 1, 1), HIGH / 2
    strokes, broken = [], True
    for i, value in enumerate(course):
        if value is not None:
            y = middle - value / (scale or 1.0) * (middle - 1)
            strokes.append(f"{'M' if broken else 'L'}{i * step:.1f} {y:.1f}")
        broken = value is None
    known = [value for value in course if value is not None]
    says = f"residual from {words.signed_kelvin(min(known))} to {words.signed_kelvin(max(known))}"
    return (
        f'<svg viewBox="0 0 {WIDE} {HIGH}" role="img" aria-label="{says}">'
        f'<path d="M0 {middle}H{WIDE}" stroke="var(--soft)" stroke-width=".6"/>'
        f'<path d="{"".join(strokes)}" fill="none" stroke="var(--vermillion)" stroke-width="1.2"/></svg>'
    )


def _diagnoses(store: Store, facts: Facts, pages: Mapping[str, Course]) -> Iterator[DiagnosisRow]:
    """The last one first."""
    for event in reversed(list(facts.diagnoses.values())):
        found, path = sealed_diagnosis(store, event), diagnosis_path(event.diagnosis)
        yield DiagnosisRow(
            name=diagnosis_name(found),
            link=path if path in pages else "",
            motor=found.motor,
            headline=sentences.headline(found),
            learnt=found.train_names,
            kept=found.held_out_names,
        )
