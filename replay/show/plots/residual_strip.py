"""What a model leaves of every channel over a session, as a row of colour each, above what drove the motor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from replay.engine.results.run import Observed, Run
from replay.show.plots.error_maps import residual_colours
from replay.show.plots.plots import STRIP, WIDTH, draw_driving, driving, over_session, time_axis
from replay.show.words import words
from replay.show.words.figure import BOTTOM, LEFT, MOVING, RIGHT, FigureTable, Plot, fitting, inline_svg, style
from replay.show.words.findings import direction, mean_error, worst_first
from replay.show.words.palette import SOFT

Floats = NDArray[np.float64]

FEW = 5  # channels: below, the plots over time show as much at a glance
MOST = 12  # rows; of more channels those that are furthest off
COLUMNS = 60  # equal parts of the session
ROW, BAR = 0.19, 0.62  # inches: height of a channel's row, of the scale above
TABLE_ROWS = 20
READING = "Orange: measured hotter than the model. Blue: colder. Hatched: no sample that may be used. Means of {}."


def column_means(run: Run, observed: Observed, columns: int) -> Floats:
    """The residual [K] of a channel in equal parts of the session (columns,), NaN where no step may be used."""
    usable = observed.usable
    share = (observed.t_ns[usable] - run.t_ns[0]) / (run.t_ns[-1] - run.t_ns[0])
    column = np.clip((share * columns).astype(np.int64), 0, columns - 1)
    count = np.bincount(column, minlength=columns)
    total = np.bincount(column, observed.residual[usable], minlength=columns)
    means: Floats = np.divide(total, count, out=np.full(columns, np.nan), where=count > 0)
    return means


def residual_strip(run: Run, columns: int) -> Plot | None:
    """The residuals of a run, the channel that is furthest off first; None below `FEW` channels. `columns`: of the
    inputs."""
    channels = {one.channel: one for one in run.observed}
    errors = worst_first(run.summary)
    if len(errors) < FEW:
        return None
    shown = [channels[error.channel] for error in errors[:MOST]]
    means = np.array([column_means(run, one, COLUMNS) for one in shown])
    worst = errors[0]
    off = "as a mean within its sensor's uncertainty" if worst.within_floor else f"the model {direction(worst)}"
    title = f"Furthest off: {words.name(worst.node)}, {mean_error(worst)} on average, {off}"
    with style(f"{run.session} strip"):
        svg = inline_svg(_draw(run, shown, means, columns), title)
    part = words.duration(float(run.t_ns[-1] - run.t_ns[0]) / 1e9 / COLUMNS)
    left = len(errors) - len(shown)
    note = READING.format(part) + (f" {words.counted(left, 'channel')} less far off not drawn." if left else "")
    return Plot(title, svg, note, _table(run, shown, means))


def _draw(run: Run, shown: Sequence[Observed], means: Floats, columns: int) -> Figure:
    below = STRIP * bool(driving(run))
    height = BAR + ROW * len(shown) + below + BOTTOM + 0.08
    figure = Figure(figsize=(WIDTH, height))
    left = LEFT + 0.07  # names stand before the rows
    box = (left, (BOTTOM + below + 0.08) / height, RIGHT - left, ROW * len(shown) / height)
    axes = figure.add_axes(box)
    colours = residual_colours(float(np.nanmax(np.abs(means))))
    edges = time_axis(run).of(np.linspace(run.t_ns[0], run.t_ns[-1], COLUMNS + 1))
    known = np.ma.masked_invalid(means)
    drawn = axes.pcolormesh(edges, np.arange(len(shown) + 1), known, cmap=colours.cmap)
    drawn.set_clim(*colours.get_clim())
    drawn.set_gid(MOVING)
    drawn.set_edgecolor("face")
    drawn.set_linewidth(0.2)
    _rows(axes, shown)
    lowest = axes
    if below:
        lowest = figure.add_axes((left, BOTTOM / height, RIGHT - left, below / height), sharex=axes)
        draw_driving([lowest], run, columns)
        lowest.yaxis.label.set_visible(False)
        axes.tick_params(labelbottom=False)
    over_session(lowest, run)
    place = figure.add_axes((left, 1 - 0.14 / height, 0.34, 0.09 / height))
    bar = figure.colorbar(colours, cax=place, orientation="horizontal")
    bar.set_label("measured − model [K]", labelpad=1)
    bar.outline.set_visible(False)
    return figure


def _rows(axes: Axes, shown: Sequence[Observed]) -> None:
    names = [words.name(one.node) for one in shown]
    names = [name if names.count(name) == 1 else one.channel for name, one in zip(names, shown, strict=True)]
    axes.set_yticks(np.arange(len(shown)) + 0.5, [fitting(name, 19) for name in names], fontsize=7.5)
    axes.tick_params(axis="y", length=0)
    axes.invert_yaxis()
    axes.grid(False)
    axes.patch.set(hatch="////", facecolor="none", edgecolor=SOFT[0], linewidth=0)


def _table(run: Run, shown: Sequence[Observed], means: Floats) -> FigureTable:
    time = time_axis(run)
    edges = time.of(np.linspace(run.t_ns[0], run.t_ns[-1], COLUMNS + 1))
    head = (f"{time.label}, from", *(f"{words.name(one.node)} {one.channel} [K]" for one in shown))
    every = COLUMNS // TABLE_ROWS
    rows = [
        (f"{edges[i]:.1f}", *("–" if np.isnan(value) else words.signed(value) for value in means[:, i]))
        for i in range(0, COLUMNS, every)
    ]
    return FigureTable(head, tuple(rows))
