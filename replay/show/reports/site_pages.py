"""Which pages there are over a store: of each session with its current motor file, of each diagnosis, and of ageing."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache, partial
from hashlib import sha256
from importlib.resources import files
from pathlib import Path

import numpy as np

from ingest.facts.events import DiagnosisCompleted, ReplayCompleted
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from ingest.texts.names import handle
from replay.engine.results.run import Run
from replay.engine.results.sealed import load_run
from replay.engine.runs.sources import code_of
from replay.show.plots.residual_strip import column_means
from replay.show.reports.ageing_report import write_ageing_report
from replay.show.reports.documents import context, corrected, last_assessment, write_sealed_diagnosis
from replay.show.reports.report import write_report
from replay.show.reports.site import Course, PageWanted
from replay.studies.diagnosis.accept import sealed_diagnosis

AGEING = "ageing.html"
COMMAND = "whyhot index"
COLUMNS = 80  # of a course in the index


def session_path(session: str) -> str:
    """Where the report of a session's replay with its current motor file lies."""
    return f"sessions/{session}.html"


def diagnosis_path(diagnosis: str) -> str:
    """Where the report of a diagnosis lies."""
    return f"diagnoses/d-{handle(diagnosis)}.html"


def wanted(store: Store, facts: Facts) -> dict[str, PageWanted]:
    """All pages but the index, by path."""
    return dict(_pages(store, facts))


def _pages(store: Store, facts: Facts) -> Iterator[tuple[str, PageWanted]]:
    for session in facts.sessions:
        if last := facts.current_run(session):
            write = partial(_replay, store, facts, last)
            yield session_path(session.session), PageWanted(_key(last.run, session.name, session.kind), write)
    for event in facts.diagnoses.values():
        asked = {*event.key.get("train", ()), *event.key.get("kept", ())}
        runs = [run.run for run in facts.runs.values() if run.session in asked]
        write = partial(_diagnosis, store, facts, event)
        yield diagnosis_path(event.diagnosis), PageWanted(_key(event.diagnosis, *runs), write)
    for assessed in list(facts.assessments.values())[-1:]:
        yield AGEING, PageWanted(_key(assessed.assessment), partial(_insulation, store, facts))


def _key(*made_of: str) -> str:
    """A page is another where what it is made of, or what draws it, is another."""
    return sha256(json.dumps([_drawn_by(), *made_of]).encode()).hexdigest()


@cache
def _drawn_by() -> str:
    """The code of all pages and the templates that it fills."""
    sha = sha256(code_of(__name__).encode())
    for template in sorted(files("replay.show").iterdir(), key=lambda one: one.name):
        if template.name.endswith((".j2", ".js")):
            sha.update(template.read_bytes())
    return sha.hexdigest()


def _replay(store: Store, facts: Facts, event: ReplayCompleted, target: Path) -> Course:
    run = load_run(store, facts, event)
    write_report([run], target, context(store, COMMAND), {event.session: corrected(store, facts, event)})
    return residual_course(run)


def _diagnosis(store: Store, facts: Facts, event: DiagnosisCompleted, target: Path) -> Course:
    write_sealed_diagnosis(store, facts, sealed_diagnosis(store, event), target, COMMAND)
    return ()


def _insulation(store: Store, facts: Facts, target: Path) -> Course:
    found = last_assessment(store, facts)
    assert found is not None, "a page is wanted where there is one"
    write_ageing_report(found, target, context(store, COMMAND))
    return ()


def residual_course(run: Run) -> Course:
    """The residual [K] of the channel that is furthest off, as means over equal parts of the session; empty where no
    node is observed."""
    errors = {one.channel: one.mae_K for one in run.summary.channels}
    if not errors:
        return ()
    worst = max((one for one in run.observed if one.channel in errors), key=lambda one: errors[one.channel])
    means = column_means(run, worst, COLUMNS)
    return [None if np.isnan(value) else round(float(value), 2) for value in means]
