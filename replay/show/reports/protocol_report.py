"""The report of a protocol: one HTML file that needs no other, reads in light and dark and prints on A4."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ingest.facts import facts as ledger_facts
from ingest.facts.store import Store
from replay.engine.results.run import Run
from replay.engine.results.sealed import load_run
from replay.show.plots.compare import compare
from replay.show.plots.influence_plots import influence_map, points_curve
from replay.show.reports.diagnosis_report import filter_section
from replay.show.reports.documents import context, latest_run
from replay.show.reports.report import COLUMNS
from replay.show.verbs.protocol import answer, checked, filter_notes, next_points
from replay.show.words.figure import Plot
from replay.show.words.page import template
from replay.studies.characterise.protocol import Protocol
from replay.written import write


def write_protocol_report(store: Store, found: Protocol, target: Path, command: str) -> None:
    """Write the report to `target`. The same outcome gives the same bytes."""
    runs = {session.session: _runs(store, found, session.session) for session in found.drives}
    event = found.calibration.event
    page = template("protocol.html.j2").render(
        found=found,
        event=event,
        answer=answer(found),
        influence=influence_map(found),
        points=points_curve(found),
        next_points=next_points(found) if found.proposals else "",
        errors=sorted(checked(found).items(), key=lambda one: -one[1][0]),
        notes=list(filter_notes(found)),
        drives=[(session, _plots(runs[session.session])) for session in found.drives],
        context=context(store, command),
    )
    write(target, page)


def _runs(store: Store, found: Protocol, session: str) -> Mapping[str, Run]:
    facts = ledger_facts.at(store.ledger)
    models = {"published": found.calibration.event.parent, "recalibrated": found.calibration.event.model}
    events = {key: latest_run(facts, facts.session(session), model) for key, model in models.items()}
    return {key: load_run(store, facts, event) for key, event in events.items() if event}


def _plots(runs: Mapping[str, Run]) -> list[Plot]:
    filtered = filter_section(runs["recalibrated"], None, COLUMNS) if "recalibrated" in runs else None
    return [*compare(runs, COLUMNS // 2), *([filtered] if filtered else [])]
