"""What a diagnosis gains: mean error by node on kept sessions, before and after, as bars."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from replay.show.plots.compare import MODELS
from replay.show.plots.plots import WIDTH
from replay.show.reports.verdict import change
from replay.show.words import words
from replay.show.words.figure import KEY_ABOVE, FigureTable, Plot, inline_svg, style
from replay.show.words.palette import INK
from replay.studies.diagnosis.answer import Diagnosis, KeptGain

ROW, MARGIN = 0.55, 0.75  # inches: height of a node's bars, of what is above and below
READING = (
    "Whisker: 95 % interval of what the cause takes away, {}. Bars that do not differ by more than it are not told "
    "apart."
)


def gain_bars(diagnosis: Diagnosis) -> Plot | None:
    """Bars by node, furthest off first: as published, recalibrated, with a cause that was named. None without kept
    data."""
    gains = sorted(diagnosis.gain, key=lambda g: -g.published_mae_K)
    if not gains:
        return None
    named = bool(diagnosis.causes)
    title = _title(gains, named)
    with style(f"{diagnosis.diagnosis} gain"):
        svg = inline_svg(_draw(gains, named), title)
    return Plot(title, svg, READING.format(gains[0].interval) if named else "", _table(gains, named))


def _title(gains: Sequence[KeptGain], named: bool) -> str:
    better = [gain for gain in gains if change(gain) == "better"]
    best = max(better or gains, key=lambda g: g.mae_before_K - g.mae_after_K)
    if not named:
        most = gains[0]
        figures = f"{words.kelvin(most.published_mae_K)} as published, {words.kelvin(most.mae_before_K)} recalibrated"
        return f"{words.capital(words.name(most.node))} on kept sessions: mean error {figures}"
    if change(best) != "better":
        return "No node is predicted better on the kept sessions by more than chance"
    node = words.capital(words.name(best.node))
    low, high = sorted(best.ci95_K)
    fall = f"{words.kelvin(best.mae_before_K)} to {words.kelvin(best.mae_after_K)}"
    return f"{node}: mean error on kept sessions falls from {fall} ({low:.1f} to {high:.1f} K better)"


def _draw(gains: Sequence[KeptGain], named: bool) -> Figure:
    height = ROW * len(gains) + MARGIN
    figure = Figure(figsize=(WIDTH, height))
    axes = figure.add_axes((0.2, 0.42 / height, 0.72, ROW * len(gains) / height))
    rows = np.arange(len(gains))
    bars = {"published": [g.published_mae_K for g in gains], "recalibrated": [g.mae_before_K for g in gains]}
    bars |= {"extended": [g.mae_after_K for g in gains]} if named else {}
    for i, (key, values) in enumerate(bars.items()):
        drawn, places = MODELS[key], rows + 0.27 * (i - (len(bars) - 1) / 2)
        axes.barh(places, values, height=0.22, color=drawn.colour, label=drawn.label)
        tips = [max(g.mae_before_K - min(g.ci95_K), v) for g, v in zip(gains, values, strict=True)]
        for place, value, tip in zip(places, values, tips if key == "extended" else values, strict=True):
            axes.annotate(
                words.kelvin(value), (tip, place), xytext=(4, 0), textcoords="offset points", va="center", fontsize=7
            )
    if named:
        _draw_intervals(axes, gains, rows + 0.27)
    axes.set_yticks(rows, [words.capital(words.name(g.node)) for g in gains])
    axes.invert_yaxis()
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0)
    axes.set_xlim(0, None)
    axes.set_xlabel("mean error on kept sessions [K]")
    axes.legend(**KEY_ABOVE, ncols=3, handlelength=1.2)
    return figure


def _draw_intervals(axes: Axes, gains: Sequence[KeptGain], places: np.ndarray) -> None:
    for gain, place in zip(gains, places, strict=True):
        low, high = (max(gain.mae_before_K - end, 0.0) for end in sorted(gain.ci95_K, reverse=True))
        axes.plot(
            [low, high], [place, place], color=INK[0], linewidth=0.9, solid_capstyle="butt", marker="|", markersize=5
        )


def _table(gains: Sequence[KeptGain], named: bool) -> FigureTable:
    head = ("node", "as published [K]", "recalibrated [K]", *(("with the cause [K]",) if named else ()))
    head += ("rms at trained points [K]", "rms outside them [K]")
    rows = [
        (
            words.name(g.node),
            f"{g.published_mae_K:.2f}",
            f"{g.mae_before_K:.2f}",
            *((f"{g.mae_after_K:.2f}",) if named else ()),
            _fall(g.rms_inside_K, named),
            _fall(g.rms_outside_K, named),
        )
        for g in gains
    ]
    return FigureTable(head, tuple(rows))


def _fall(rms_K: Sequence[float], named: bool) -> str:
    """ "6.20 -> 0.90", recalibrated without a cause to with it; "-" where no kept time was there."""
    return " -> ".join(f"{value:.2f}" for value in rms_K[: 2 if named else 1]) or "-"
