"""The report of a replay: one HTML file that needs no other, reads in light and dark and prints on A4."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType

from replay.engine.results.run import Observed, Run
from replay.engine.results.summary import Summary
from replay.show.plots.calendar_plot import calendar
from replay.show.plots.derating_plot import derating_over_time
from replay.show.plots.error_maps import error_along, error_map
from replay.show.plots.filter_plots import READING, filter_over_time
from replay.show.plots.heat_plots import heat_balance
from replay.show.plots.meter_plots import meter_over_time
from replay.show.plots.plots import groups, inputs_over_time, over_time
from replay.show.plots.residual_strip import residual_strip
from replay.show.words import heat_words, words
from replay.show.words.figure import Plot
from replay.show.words.filter_words import filter_says
from replay.show.words.findings import answer, power_balance, worst_first
from replay.show.words.onward import DEFAULT_STORE
from replay.show.words.page import template
from replay.show.words.terminal import integrator_says
from replay.written import write

COLUMNS = 600  # pixel columns that a line is thinned to ...
FILTER_LINES = 11  # of a plot of filter and smoother, its band as two
LINES = 120  # ... up to this many lines; above, each gets fewer, so that the file stays under 5 MB


@dataclass(frozen=True)
class ReportContext:
    """Where the report comes from: the command typed, the store's head, versions of what computed it by name, and the
    folder of the store."""

    command: str
    store_head: str
    versions: Mapping[str, str]
    store: Path = DEFAULT_STORE


@dataclass(frozen=True)
class SessionPlots:
    """One session's part of the report."""

    run: Run
    start: str
    plots: Sequence[Plot]


def write_report(
    runs: Sequence[Run], target: Path, context: ReportContext, corrected: Mapping[str, str] = MappingProxyType({})
) -> None:
    """Write the report of runs, one a session, to `target`. The same runs give the same bytes. `corrected`: session ->
    what the bench file took off its readings and times, as a sentence."""
    summaries = [run.summary for run in runs]
    page = template("report.html.j2").render(
        answer=answer(summaries),
        runs=runs,
        errors={run.session: worst_first(run.summary) for run in runs},
        calendar=calendar(runs) if len(runs) > 1 else None,
        sessions=_sessions(runs),
        filter_reading=READING if any(run.filtered for run in runs) else "",
        maps=[plot for plot in (error_map(runs), error_along(runs)) if plot is not None],
        balances=power_balance(summaries),
        mixed=mixed(runs),
        heats=[(run.session_name, said) for run in runs if (said := [*map(words.capital, heat_says(run.summary))])],
        limits=[(run.session_name, said) for run in runs if (said := heat_words.above_limits(run.summary))],
        meters=[(run.session_name, one) for run in runs for one in run.summary.meters],
        notes=[(run.session_name, note) for run in runs for note in _notes(run, corrected)],
        context=context,
    )
    write(target, page)


def _notes(run: Run, corrected: Mapping[str, str]) -> list[str]:
    return [note for note in (run.summary.note, corrected.get(run.session)) if note]


def mixed(runs: Sequence[Run]) -> str:
    """Which sessions were replayed with which model, or from channels of which level; "" where all are alike."""
    alike: dict[tuple[str, str], list[str]] = {}
    for run in runs:
        alike.setdefault((run.model, run.level), []).append(run.session_name)
    if len(alike) <= 1:
        return ""
    of = (f"{words.joined(names)} with {words.short(model)} (level {level})" for (model, level), names in alike.items())
    return f"Not all of one model and level: {'; '.join(of)}. Say --model M, after whyhot replay --model M, to compare."


def heat_says(summary: Summary) -> list[str]:
    """What a run says of its integrator, ageing, heat, hot spots, filter, limits and derating, a sentence each."""
    by_model = [
        integrator_says(summary),
        *heat_words.aged(summary),
        heat_words.heat(summary),
        heat_words.hottest(summary),
    ]
    told = [*by_model, *filter_says(summary), *heat_words.above_limits(summary), *heat_words.derating(summary)]
    return [text for text in told if text]


def _sessions(runs: Sequence[Run]) -> list[SessionPlots]:
    grouped = [(run, groups(run)) for run in runs]
    lines = sum(3 * len(group) for _, of_run in grouped for group in of_run) + sum(len(run.inputs) for run in runs)
    lines += FILTER_LINES * sum(run.filtered is not None for run in runs)
    columns = min(COLUMNS, COLUMNS * LINES // max(lines, 1))
    return [SessionPlots(run, started(run), _plots(run, of_run, columns)) for run, of_run in grouped]


def _plots(run: Run, of_run: Sequence[Sequence[Observed]], columns: int) -> list[Plot]:
    inputs = inputs_over_time(run, columns)
    deratings = (derating_over_time(run, course, columns) for course in run.summary.derating)
    filtered = filter_over_time(run, columns)
    strip = residual_strip(run, columns)
    return [
        *([strip] if strip is not None else []),
        *(over_time(run, group, columns) for group in of_run),
        *([filtered] if filtered is not None else []),
        *(meter_over_time(run, metered, columns) for metered in run.meters),
        *(plot for plot in (heat_balance(run, columns), *deratings, inputs) if plot is not None),
    ]


def started(run: Run) -> str:
    """When a session began."""
    return moment(int(run.t_ns[0]), run.absolute)


def moment(t_ns: int, absolute: bool) -> str:
    """ "2025-10-09 08:53 UTC": a run begins with its first step, within a second of its session."""
    return f"{datetime.fromtimestamp(t_ns // 10**9, UTC):%Y-%m-%d %H:%M} UTC" if absolute else "no absolute time"
