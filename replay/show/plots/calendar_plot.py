"""Which session ran when, how long, of what kind, and what of it was set aside."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import UTC, datetime

import numpy as np
from matplotlib.figure import Figure

from replay.engine.results.run import Run
from replay.show.plots.plots import WIDTH
from replay.show.words import words
from replay.show.words.figure import KEY_ABOVE, FigureTable, Plot, fitting, inline_svg, style
from replay.show.words.palette import KEPT, LEARNT, SOFT

ROW, MARGIN = 0.165, 0.68  # inches: height of a session's bar, of what is above and below
MOST = 40  # sessions that are drawn; the table holds all
DAY_NS, HOUR_NS = 86_400 * 10**9, 3_600 * 10**9
NOTE = "A row a session{}. Masked: samples that nothing was judged by."
DATED, UNDATED = ", from the midnight (UTC) before it began", "; one without absolute time begins at 0"


def calendar(runs: Sequence[Run], kept: Collection[str] | None = None) -> Plot:
    """A row a run, in the order of time, those without absolute time behind. `kept`: ids of sessions that nothing was
    learnt from; None where nothing is learnt."""
    ordered = sorted(runs, key=lambda run: (not run.absolute, int(run.t_ns[0])))
    title = _title(ordered, kept)
    with style("calendar"):
        svg = inline_svg(_draw(ordered[:MOST], kept), title)
    note = NOTE.format(DATED * ordered[0].absolute + UNDATED * (not ordered[-1].absolute))
    if len(ordered) > MOST:
        note += f" Drawn: the first {MOST} of {len(ordered)}."
    return Plot(title, svg, note, _table(ordered, kept))


def _title(runs: Sequence[Run], kept: Collection[str] | None) -> str:
    days = len({int(run.t_ns[0]) // DAY_NS for run in runs if run.absolute})
    on = f" on {words.counted(days, 'day')}" if days else ""
    whole = words.duration(sum(run.summary.duration_s for run in runs))
    aside = sum(run.session in kept for run in runs) if kept is not None else 0
    return (
        f"{words.counted(len(runs), 'session')}{on}, {whole} in all{f'; {aside} kept from learning' if aside else ''}"
    )


def _draw(runs: Sequence[Run], kept: Collection[str] | None) -> Figure:
    height = ROW * len(runs) + MARGIN
    figure = Figure(figsize=(WIDTH, height))
    axes = figure.add_axes((0.25, 0.42 / height, 0.49, ROW * len(runs) / height))
    uses = [_use(run, kept) for run in runs]
    for use, colour in (("learnt from", LEARNT), ("kept", KEPT), ("", LEARNT)):
        rows = [row for row, one in enumerate(uses) if one == use]
        if rows:
            hours = [runs[row].summary.duration_s / 3600 for row in rows]
            axes.barh(rows, hours, left=[_began_h(runs[row]) for row in rows], height=0.62, color=colour, label=use)
    axes.set_yticks(
        range(len(runs)), [f"{_day(run)} {fitting(run.session_name)}".strip() for run in runs], fontsize=7.5
    )
    axes.set_ylim(len(runs) - 0.4, -0.6)
    ends = [_began_h(run) + run.summary.duration_s / 3600 for run in runs]
    dated = runs[0].absolute  # those without absolute time come last
    axes.set_xlim(0, max(24.0, *ends) if dated else max(ends))
    if axes.get_xlim()[1] == 24.0:
        axes.set_xticks(range(0, 25, 4))
    axes.set_xlabel("time since midnight [h]" if dated else "time since start [h]")
    axes.tick_params(axis="y", length=0)
    axes.grid(False, axis="y")
    for row, run in enumerate(runs):
        axes.text(1.02, row, _said(run), transform=axes.get_yaxis_transform(), va="center", fontsize=7.5, color=SOFT[0])
    if kept is not None:
        axes.legend(**KEY_ABOVE, ncols=2, handlelength=1.2)
    return figure


def _use(run: Run, kept: Collection[str] | None) -> str:
    if kept is None:
        return ""
    return "kept" if run.session in kept else "learnt from"


def _began_h(run: Run) -> float:
    """Hours from midnight to the start."""
    return int(run.t_ns[0]) % DAY_NS / HOUR_NS if run.absolute else 0.0


def _day(run: Run) -> str:
    return f"{datetime.fromtimestamp(int(run.t_ns[0]) // 10**9, UTC):%Y-%m-%d}" if run.absolute else ""


def _said(run: Run) -> str:
    """ "s1, 2 h 40 min, 3 % masked"."""
    masked = f"{100 * _masked(run):.0f} % masked" if _masked(run) >= 0.005 else ""
    return ", ".join(filter(None, [run.kind, words.duration(run.summary.duration_s), masked]))


def _masked(run: Run) -> float:
    """Share of the samples of all observed channels that were not used."""
    used = [observed.used for observed in run.observed]
    return 1.0 - float(np.concatenate(used).mean()) if used else 0.0


def _table(runs: Sequence[Run], kept: Collection[str] | None) -> FigureTable:
    head = ("session", "day", "began [h after midnight]", "length", "kind", "masked [%]", "use")
    rows = [
        (
            run.session_name,
            _day(run) or "no absolute time",
            f"{_began_h(run):.2f}" if run.absolute else "–",
            words.duration(run.summary.duration_s),
            run.kind,
            f"{100 * _masked(run):.1f}",
            _use(run, kept) or "replayed",
        )
        for run in runs
    ]
    return FigureTable(head, tuple(rows))
