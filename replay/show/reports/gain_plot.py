"""What a diagnosis gains: mean error by node on kept sessions, before and after: bars as recorded, marks as fitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from replay.show.plots.compare import MODELS
from replay.show.plots.plots import WIDTH
from replay.show.reports.kept_errors import STAGES, change, errors, fitted, furthest_first, how, moved, on_kept, stages
from replay.show.words import words
from replay.show.words.figure import BEHIND, KEY_ABOVE, FigureTable, Plot, inline_svg, style
from replay.show.words.palette import INK
from replay.studies.diagnosis.answer import Diagnosis, KeptGain

DRAWN = dict(zip(STAGES, MODELS.values(), strict=True))  # stage -> how it is drawn
ROW, MARGIN = 0.55, 0.75  # inches: height of a node's bars, of what is above and below
ROOM = 1.2  # of the longest bar: its figures stand behind it
INTERVAL = (
    " Whisker: 95 % interval of what the cause takes away, fitted, {}. Dots that do not differ by more than it are not "
    "told apart."
)


def gain_bars(diagnosis: Diagnosis) -> Plot | None:
    """Bars by node, furthest off first: as published, recalibrated, with a cause that was named. None without kept
    data."""
    gains, named = furthest_first(diagnosis.gain), diagnosis.learnt
    if not gains:
        return None
    title = _title(diagnosis)
    with style(f"{diagnosis.diagnosis} gain"):
        svg = inline_svg(_draw(gains, named), title)
    note = f"Bars: {how(gains).replace('; fitted', '; dots')}." + (INTERVAL.format(gains[0].interval) if named else "")
    return Plot(title, svg, note, _table(gains, named))


def _title(diagnosis: Diagnosis) -> str:
    told = words.capital(on_kept(diagnosis))
    if diagnosis.learnt and all(change(gain) != "better" for gain in diagnosis.gain):
        return f"{told}; no node is predicted better with the cause by more than chance"
    return told


def _draw(gains: Sequence[KeptGain], named: bool) -> Figure:
    height = ROW * len(gains) + MARGIN
    figure = Figure(figsize=(WIDTH, height))
    axes = figure.add_axes((0.23, 0.42 / height, 0.72, ROW * len(gains) / height))
    rows = np.arange(len(gains))
    for i, stage in enumerate(stages(named)):
        places = rows + 0.27 * (i - named / 2 - 0.5)
        _draw_stage(axes, gains, stage, places)
        if stage == "after":
            _draw_intervals(axes, gains, places)
    axes.set_yticks(rows, ["\n".join(filter(None, [words.capital(words.name(g.node)), moved(g)])) for g in gains])
    axes.invert_yaxis()
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0)
    axes.set_xlim(0, ROOM * axes.get_xlim()[1])
    axes.set_xlabel("mean error on kept sessions [K]")
    axes.plot([], [], "o", color=INK[0], markersize=3.5, label="fitted")
    axes.legend(**KEY_ABOVE, ncols=4, handlelength=1.2)
    return figure


def _draw_stage(axes: Axes, gains: Sequence[KeptGain], stage: str, places: np.ndarray) -> None:
    """A bar of the error as recorded and a mark of the fitted one a node, with both in figures."""
    drawn = DRAWN[stage]
    recorded = [gain.mae_recorded_K.get(stage, 0.0) for gain in gains]
    marks = [fitted(gain)[stage] for gain in gains]
    axes.barh(places, recorded, height=0.22, color=drawn.colour, label=drawn.label)
    axes.plot(marks, places, "o", color=INK[0], markersize=3.5)
    for gain, place, bar, mark in zip(gains, places, recorded, marks, strict=True):
        tip = max(bar, mark, gain.mae_before_K - min(gain.ci95_K) if stage == "after" else 0.0)
        axes.annotate(errors(gain, [stage]), (tip, place), **BEHIND)


def _draw_intervals(axes: Axes, gains: Sequence[KeptGain], places: np.ndarray) -> None:
    for gain, place in zip(gains, places, strict=True):
        low, high = (max(gain.mae_before_K - end, 0.0) for end in sorted(gain.ci95_K, reverse=True))
        axes.plot(
            [low, high], [place, place], color=INK[0], linewidth=0.9, solid_capstyle="butt", marker="|", markersize=5
        )


def _table(gains: Sequence[KeptGain], named: bool) -> FigureTable:
    of = stages(named)
    head = ("node", *(f"{STAGES[stage]} [K]" for stage in of), *(f"fitted {STAGES[stage]} [K]" for stage in of))
    head += ("reading moved by [K]", "fitted rms at trained points [K]", "fitted rms outside them [K]")
    rows = [
        (
            words.name(g.node),
            *(cell(g.mae_recorded_K.get(stage)) for stage in of),
            *(cell(fitted(g)[stage]) for stage in of),
            "0.00" if abs(g.reading_moved_K) < 0.005 else f"{g.reading_moved_K:+.2f}".replace("-", "−"),
            _fall(g.rms_inside_K, named),
            _fall(g.rms_outside_K, named),
        )
        for g in gains
    ]
    return FigureTable(head, tuple(rows))


def cell(error_K: float | None) -> str:
    """An error in a table; a dash where there is none."""
    return "–" if error_K is None else f"{error_K:.2f}"


def _fall(rms_K: Sequence[float], named: bool) -> str:
    """ "6.20 → 0.90", recalibrated without a cause to with it; "–" where no kept time was there."""
    return " → ".join(f"{value:.2f}" for value in rms_K[: 2 if named else 1]) or "–"
