"""Where the heat of a session comes from and where it goes: two bars of one length, and the course over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from replay.engine.results.run import Run
from replay.engine.results.summary import HeatBalance, HeatPart, StoredHeat
from replay.show.plots.plots import WIDTH, over_session, time_axis
from replay.show.words import heat_words, words
from replay.show.words.figure import RIGHT, FigureTable, Plot, inline_svg, name_lines, style
from replay.show.words.palette import COLOURS, DASHES, INK, SOFT
from replay.show.words.thin import thin

Floats = NDArray[np.float64]
Parts = list[tuple[str, float]]  # name, mean [W]

HEIGHT = 3.0  # inches
SMOOTH_S = 60.0  # of the course over time: a driving cycle's losses jump every second
CHARACTER = 0.0105  # of the bars' width
NAMED = 0.03  # of the whole: a smaller part has no name


def heat_balance(run: Run, columns: int) -> Plot | None:
    """The account of a run; None where no heat was made or the run was sealed without one."""
    losses = run.summary.losses
    if losses is None or run.heat is None or losses.energy_J <= 0:
        return None
    made, gone = parts_of(losses, run.summary.duration_s)
    title = _title(made, gone)
    with style(f"{run.session} heat"):
        figure = Figure(figsize=(WIDTH, HEIGHT))
        place = {"left": 0.1, "right": RIGHT, "bottom": 0.14, "top": 0.97, "hspace": 0.42}
        grid = figure.add_gridspec(2, 1, height_ratios=(1.0, 1.5), **place)
        _draw_bars(figure.add_subplot(grid[0]), made, gone, _colours(losses))
        _draw_course(figure.add_subplot(grid[1]), run, columns)
        svg = inline_svg(figure, title)
    note = f"Bars: means over the session; what came in is what went out. Below: means over {SMOOTH_S:.0f} s."
    return Plot(title, svg, note, _table(losses))


def parts_of(losses: HeatBalance, duration_s: float) -> tuple[Parts, Parts]:
    """What brought heat, boundaries that warm and nodes that cool too, and what took it: means [W], alike in sum."""
    made = [(heat_words.KINDS[kind], part.mean_W) for kind, part in losses.kinds.items()]
    gone = [(words.name(name), part.mean_W) for name, part in losses.boundaries.items()]
    gone.append(("stored", losses.stored_J / duration_s))
    brought = [(f"from {'store' if name == 'stored' else name}", -watts) for name, watts in gone if watts < 0]
    taken = [(f"less {name}", -watts) for name, watts in made if watts < 0]
    return (
        [*((name, watts) for name, watts in made if watts >= 0), *brought],
        [*((name, watts) for name, watts in gone if watts >= 0), *taken],
    )


def _title(made: Parts, gone: Parts) -> str:
    total = sum(watts for _, watts in made)
    source, place = (max(parts, key=lambda part: part[1]) for parts in (made, gone))
    goes = "stored" if place[0] == "stored" else f"into {place[0]}"
    return (
        f"{total:,.0f} W of heat on average: {100 * source[1] / total:.0f} % from {source[0]}, "
        f"{100 * place[1] / total:.0f} % {goes}"
    )


def _colours(losses: HeatBalance) -> dict[str, str]:
    """Name of a part -> its colour, alike in every session: kinds from the palette's front, boundaries from its end."""
    kinds = dict(zip(heat_words.KINDS.values(), COLOURS, strict=False))
    return kinds | dict(zip(map(words.name, losses.boundaries), COLOURS[::-1], strict=False))


def _draw_bars(axes: Axes, made: Parts, gone: Parts, colours: Mapping[str, str]) -> None:
    total = sum(watts for _, watts in made)
    for row, parts in enumerate((made, gone)):
        left = 0.0
        for name, watts in sorted(parts, key=lambda part: -part[1]):
            colour = colours.get(name.removeprefix("from ").removeprefix("less "), SOFT[0])
            axes.barh(-row, watts, left=left, height=0.62, color=colour, linewidth=0)
            _name_part(axes, name, watts, left + watts / 2, row, total)
            left += watts
    axes.set_xlim(0, total)
    axes.set_ylim(-1.45, 0.45)
    axes.set_yticks([0, -1], ["comes\nfrom", "goes\nto"])
    axes.tick_params(axis="y", length=0)
    axes.grid(False)
    axes.spines["left"].set_visible(False)
    axes.xaxis.set_major_formatter(lambda value, _: words.number(value))
    axes.text(1.035, -0.12, "W", transform=axes.transAxes, va="top")


def _name_part(axes: Axes, name: str, watts: float, middle: float, row: int, total: float) -> None:
    for text in (f"{name} {100 * watts / total:.0f} %", name):
        if watts / total > max(NAMED, CHARACTER * len(text)):
            axes.text(middle, -row, text, ha="center", va="center", color="#000000", fontsize=7.5)
            return


def _draw_course(axes: Axes, run: Run, columns: int) -> None:
    assert run.heat is not None
    time, ends = time_axis(run), []
    step_s = float(run.t_ns[1] - run.t_ns[0]) / 1e9
    middle = time.of((run.t_ns[:-1] + run.t_ns[1:]) // 2)
    made = np.sum([np.zeros(middle.size), *run.heat.kinds.values()], axis=0)
    lines = {"made": made, **{f"into {words.name(name)}": taken for name, taken in run.heat.boundaries.items()}}
    for (name, watts), colour, dashes in zip(lines.items(), (INK[0], *COLOURS[::-1]), ("-", *DASHES), strict=False):
        smooth = _smoothed(watts, round(SMOOTH_S / step_s))
        axes.plot(*thin(middle, smooth, columns), color=colour, linestyle=dashes, linewidth=1.1)
        ends.append((float(smooth[-1]), name, colour))
    over_session(axes, run)
    axes.set_ylabel("heat [W]")
    axes.yaxis.set_label_coords(-0.085, 0.5)
    axes.yaxis.set_major_formatter(lambda value, _: words.number(value))
    name_lines(axes, ends)


def _smoothed(values: Floats, width: int) -> Floats:
    """Means over the `width` steps about each step; at the ends over those that are there."""
    ones = np.ones(max(1, min(width, values.size)))
    return np.convolve(values, ones, "same") / np.convolve(np.ones(values.size), ones, "same")


def _table(losses: HeatBalance) -> FigureTable:
    rows = [("made", "all", losses.energy_J), *_rows("made, by kind", losses.kinds, heat_words.KINDS)]
    rows += _rows("made, by node", losses.nodes)
    rows += _rows("taken by", losses.boundaries)
    rows += _rows("stored in", losses.stored)
    rows.append(("left over: rounding", "", losses.left_J))
    whole = losses.energy_J
    shown = tuple((kind, what, f"{energy / 1e3:,.3g}", f"{100 * energy / whole:.1f}") for kind, what, energy in rows)
    return FigureTable(("heat", "where", "energy [kJ]", "share [%]"), shown)


def _rows(
    kind: str, parts: Mapping[str, HeatPart] | Mapping[str, StoredHeat], named: Mapping[str, str] | None = None
) -> Sequence[tuple[str, str, float]]:
    return [(kind, (named or {}).get(name) or words.name(name), part.energy_J) for name, part in parts.items()]
