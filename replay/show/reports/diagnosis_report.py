"""The report of a diagnosis: one HTML file that needs no other, reads in light and dark and prints on A4."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from replay.engine.results.run import Run
from replay.show.plots.calendar_plot import calendar
from replay.show.plots.compare import MODELS, compare, lines_drawn
from replay.show.plots.error_maps import error_map
from replay.show.plots.filter_plots import READING, estimated_loss
from replay.show.reports import beyond_usual, kept_errors, sentences, two_models, verdict
from replay.show.reports.chain_plot import chain_bars
from replay.show.reports.cut_plot import cut_plot
from replay.show.reports.diagnosis_text import diagnosis_name, gain_notes, looked_at, next_commands
from replay.show.reports.foreseen_plot import foreseen_plot
from replay.show.reports.gain_plot import gain_bars
from replay.show.reports.heat_map_plot import heat_maps
from replay.show.reports.law_plot import law_plots
from replay.show.reports.ranking import ranking
from replay.show.reports.report import COLUMNS, LINES, ReportContext, started
from replay.show.reports.waterfall_plot import waterfall
from replay.show.words import words
from replay.show.words.figure import Plot
from replay.show.words.page import template
from replay.studies.diagnosis.answer import Diagnosis
from replay.written import write
from twin.motor.network import Network

DIFF = {"+++": "file", "---": "file", "+": "added", "-": "removed"}  # start of a line -> its class


@dataclass(frozen=True)
class SessionModels:
    """One session's part of the report: one of its runs for name and kind, and whether it was kept from learning."""

    run: Run
    start: str
    kept: bool
    plots: Sequence[Plot]


def write_diagnosis_report(
    diagnosis: Diagnosis,
    runs: Mapping[str, Mapping[str, Run]],
    network: Network,
    diff: str,
    target: Path,
    context: ReportContext,
) -> None:
    """Write the report of a diagnosis to `target`. The same input gives the same bytes. `runs`: session id -> key of
    MODELS -> its sealed run, where there is one; `network`: of the model as published; `diff`: unified diff of the
    motor or bench file, "" where there is none."""
    shown = {session: runs[session] for session in (*diagnosis.train, *diagnosis.held_out) if runs.get(session)}
    sessions = _sessions(diagnosis, shown)
    page = template("diagnosis.html.j2").render(
        diagnosis=diagnosis,
        name=diagnosis_name(diagnosis),
        verdict=verdict,
        beyond_usual=beyond_usual,
        unusual=beyond_usual.of_last_fit(diagnosis),
        far=beyond_usual.how_many(diagnosis),
        taken_away=beyond_usual.taken_away(diagnosis),
        answer=sentences.answer(diagnosis),
        chain_plot=chain_bars(diagnosis),
        gain_plot=gain_bars(diagnosis),
        waterfall=waterfall(diagnosis, shown),
        gain_notes=gain_notes(diagnosis),
        gains=kept_errors.furthest_first(diagnosis.gain),
        kept_errors=kept_errors,
        stages=kept_errors.stages(diagnosis.learnt),
        apart=two_models.paragraphs(diagnosis),
        looked_at=looked_at(diagnosis),
        commands=next_commands(diagnosis),
        calendar=calendar([session.run for session in sessions], diagnosis.held_out) if sessions else None,
        sessions=sessions,
        map=error_map([models["published"] for models in shown.values() if "published" in models]) if shown else None,
        cut=_cut(diagnosis, shown, network),
        ranking=ranking(diagnosis),
        foreseen=foreseen_plot(diagnosis),
        laws=law_plots(diagnosis),
        heat_maps=heat_maps(diagnosis),
        filtered=list(_filtered(diagnosis, shown)),
        filter_reading=READING,
        changed=_changed(diff),
        diff=marked(diff),
        replays=[(MODELS[key].label, models[key]) for models in shown.values() for key in MODELS if key in models],
        context=context,
    )
    write(target, page)


def marked(diff: str) -> list[tuple[str, str]]:
    """The lines of a unified diff, each behind its class."""
    return [(_diff_class(line), line) for line in diff.splitlines()]


def _changed(diff: str) -> str:
    """ "3 lines added, 2 taken out"."""
    kinds = [_diff_class(line) for line in diff.splitlines()]
    return f"{words.counted(kinds.count('added'), 'line')} added, {kinds.count('removed')} taken out"


def _diff_class(line: str) -> str:
    return next((kind for start, kind in DIFF.items() if line.startswith(start)), "same")


def _columns(shown: Mapping[str, Mapping[str, Run]]) -> int:
    """Pixel columns a line, so that the page stays under 5 MB."""
    return min(COLUMNS, COLUMNS * LINES // max(sum(map(lines_drawn, shown.values())), 1))


def _sessions(diagnosis: Diagnosis, shown: Mapping[str, Mapping[str, Run]]) -> list[SessionModels]:
    return [
        SessionModels(run, started(run), session in diagnosis.held_out, compare(models, _columns(shown)))
        for session, models in shown.items()
        for run in [next(iter(models.values()))]
    ]


def _cut(diagnosis: Diagnosis, shown: Mapping[str, Mapping[str, Run]], network: Network) -> Plot | None:
    """The motor cut open in the session that the model as published is furthest off in."""
    runs = [models["published"] for models in shown.values() if "published" in models]
    worst = max(runs, key=lambda run: max(run.summary.max_K.values(), default=0.0), default=None)
    return cut_plot(diagnosis, worst, network) if worst else None


def _filtered(diagnosis: Diagnosis, shown: Mapping[str, Mapping[str, Run]]) -> Iterator[tuple[str, str, Plot]]:
    """Session, model, plot: before and after, of the kept sessions, or of all where none is kept."""
    sessions = [session for session in shown if session in diagnosis.held_out] or list(shown)
    for models in (shown[session] for session in sessions):
        known = [key for key in MODELS if key in models]
        for key in dict.fromkeys((known[0], known[-1])):
            plot = filter_section(models[key], diagnosis if key == "published" else None, _columns(shown))
            if plot is not None:
                own = replace(plot, svg=_own_ids(plot.svg, f"{key}-"))
                yield models[key].session_name, MODELS[key].label, own


def filter_section(run: Run, diagnosis: Diagnosis | None, columns: int) -> Plot | None:
    """The heat that a filter finds in a run, beside what the model says; None where the run was not filtered. The title
    says where a `diagnosis` names something else than a loss of the filtered node."""
    if run.filtered is None:
        return None
    blamed = [cause for cause in diagnosis.causes if verdict.is_loss_at(cause, run.filtered.node)] if diagnosis else []
    elsewhere = diagnosis.causes[0].id if diagnosis and diagnosis.causes and not blamed else None
    return estimated_loss(run, columns, elsewhere)


def _own_ids(svg: str, prefix: str) -> str:
    """Two drawings of one session are made with the same ids: on one page each needs its own."""
    return re.sub(r"( id=\"|href=\"#|url\(#)", rf"\g<1>{prefix}", svg)
