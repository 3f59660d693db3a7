"""Plots of where the error lies: by operating cell, along temperature, along the time in a session."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import blended_transform_factory
from numpy.typing import NDArray

from replay.engine.results.run import Run
from replay.show.plots.cells import (
    ENOUGH_S,
    Cells,
    Pool,
    along,
    in_cells,
    load_column,
    pool_by_node,
    round_centres,
    round_edges,
)
from replay.show.plots.plots import WIDTH, time_axis
from replay.show.words import words
from replay.show.words.figure import FigureTable, Plot, inline_svg, name_lines, style, tick
from replay.show.words.palette import COLOURS, DASHES, DIVERGING, SOFT

Floats = NDArray[np.float64]

ACROSS = 3  # maps in a row
SHOWN = 12  # maps at most: the nodes furthest off
LOAD_NAMES = {"current_A": ("current", "A"), "torque_Nm": ("torque", "Nm")}
READING = (
    "Orange: measured hotter than the model. Blue: measured colder. "
    f"Hatched: less than {ENOUGH_S:.0f} s of data, nothing can be said. All sessions together, weighted by time."
)


def error_map(runs: Sequence[Run]) -> Plot | None:
    """Node x operating cell (speed x load), mean residual [K], of nodes with a cell of enough data; None where there is
    none, or where the runs share no speed and load."""
    load = load_column(runs)
    if load is None or not all("speed_rpm" in run.inputs for run in runs):
        return None
    pools = dict(list(pool_by_node(runs, ("speed_rpm", load)).items())[:SHOWN])
    if not pools:
        return None
    maps = {node: cells for node, cells in _maps(pools, load).items() if np.isfinite(cells.mean).any()}
    if not maps:
        return None
    title = _map_title(maps, load)
    with style("error map"):
        svg = inline_svg(_draw_maps(maps, load), title)
    return Plot(title, svg, READING, _map_table(maps, load))


def _maps(pools: Mapping[str, Pool], load: str) -> dict[str, Cells]:
    def edges(column: str) -> Floats:
        values = [pool.inputs[column] for pool in pools.values()]
        return round_centres(max(float(np.max(v, where=np.isfinite(v), initial=0.0)) for v in values), 5)

    speeds, loads = edges("speed_rpm"), edges(load)
    return {n: in_cells(p, p.inputs["speed_rpm"], p.inputs[load], speeds, loads) for n, p in pools.items()}


def _cell_name(cells: Cells, i: int, j: int, load: str) -> str:
    name, unit = LOAD_NAMES[load]
    return f"{_span(cells.x_edges, i)} rpm and {_span(cells.y_edges, j)} {unit} {name}"


def _span(edges: Floats, cell: int) -> str:
    """As they are: a cell from 12.5 to 37.5 A is none from 12 to 38 A."""
    return " to ".join(tick(edge, None) for edge in edges[cell : cell + 2].tolist())


def _off(node: str, value: float) -> str:
    """ "Rotor: model 4.4 K too cold"; where no digit that is shown is left, that."""
    if words.signed(value) == words.signed(0.0):
        return f"{words.capital(words.name(node))}: model within 0.05 K everywhere, worst"
    way = "too cold" if value > 0 else "too hot"
    return f"{words.capital(words.name(node))}: model {words.kelvin(abs(value))} {way}"


def _map_title(maps: Mapping[str, Cells], load: str) -> str:
    node = max(maps, key=lambda n: float(np.nanmax(np.abs(maps[n].mean))))
    cells = maps[node]
    i, j = np.unravel_index(int(np.nanargmax(np.abs(cells.mean))), cells.mean.shape)
    return f"{_off(node, cells.mean[i, j])} at {_cell_name(cells, int(i), int(j), load)}"


def _draw_maps(maps: Mapping[str, Cells], load: str) -> Figure:
    rows = -(-len(maps) // ACROSS)
    height = 1.95 * rows + 0.9
    figure = Figure(figsize=(WIDTH, height))
    place = {"left": 0.085, "right": 0.985, "wspace": 0.12, "hspace": 0.3}
    place |= {"bottom": 1.0 / height, "top": 1 - 0.25 / height}
    axes = figure.subplots(rows, ACROSS, sharex=True, sharey=True, squeeze=False, gridspec_kw=place)
    largest = max(1.0, *(float(np.nanmax(np.abs(cells.mean))) for cells in maps.values()))
    colours = residual_colours(largest)
    for ax, (node, cells) in zip(axes.flat, maps.items(), strict=False):
        _draw_map(ax, node, cells, colours)
    for ax in axes.flat[len(maps) :]:
        ax.set_visible(False)
    for ax in axes[:, 0]:
        _name_y(ax, f"{LOAD_NAMES[load][0]} [{LOAD_NAMES[load][1]}]")
    for ax in axes.flat[max(0, len(maps) - ACROSS) : len(maps)]:
        ax.set_xlabel("speed [rpm]")
        ax.tick_params(labelbottom=True)
    bar = figure.add_axes((0.3, 0.45 / height, 0.4, 0.09 / height))
    scale = figure.colorbar(colours, cax=bar, orientation="horizontal", ticks=MaxNLocator(5))
    scale.set_label("measured − model [K]")
    scale.outline.set_visible(False)
    return figure


def _name_y(axes: Axes, name: str) -> None:
    """The axis' name at the edge of the picture, however wide a browser draws the numbers beside it."""
    axes.set_ylabel(name)
    across = blended_transform_factory(axes.figure.transFigure, axes.transAxes)
    axes.yaxis.set_label_coords(0.026, 0.5, transform=across)


def residual_colours(largest: float) -> ScalarMappable:
    """Blue over white to orange, up to `largest` [K]: so few that their key is no bitmap, which pages do not load."""
    return ScalarMappable(Normalize(-largest, largest), LinearSegmentedColormap.from_list("error", DIVERGING, N=41))


def _draw_map(axes: Axes, node: str, cells: Cells, colours: ScalarMappable) -> None:
    axes.grid(False)
    axes.patch.set(hatch="////", facecolor="none", edgecolor=SOFT[0], linewidth=0)
    axes.set_title(words.capital(words.name(node)), fontsize=8.5, loc="left", pad=3)
    axes.set_xticks(_centres(cells.x_edges)[:: 2 if cells.x_edges.size > 5 else 1])
    axes.set_yticks(_centres(cells.y_edges))
    x_edges = np.r_[-cells.x_edges[1], cells.x_edges[1:]]  # around 0 as wide as elsewhere: room for its number
    axes.set_xlim(x_edges[0], x_edges[-1])
    axes.set_ylim(cells.y_edges[0], cells.y_edges[-1])
    axes.xaxis.set_major_formatter(tick)
    draw_cells(axes, x_edges, cells.y_edges, cells.mean, colours)


def draw_cells(axes: Axes, x_edges: Floats, y_edges: Floats, values: Floats, colours: ScalarMappable) -> None:
    """Draw `values` (X, Y) in the cells of `x_edges` (X + 1,) and `y_edges` (Y + 1,), each with its number; none where
    it is NaN."""
    for i, j in np.argwhere(np.isfinite(values)):
        x, y, value = x_edges[i : i + 2], y_edges[j : j + 2], values[i, j]
        axes.fill([x[0], x[1], x[1], x[0]], [y[0], y[0], y[1], y[1]], facecolor=colours.to_rgba(value), linewidth=0)
        axes.text(x.mean(), y.mean(), words.signed(value), ha="center", va="center", fontsize=7, color="#000000")


def _map_table(maps: Mapping[str, Cells], load: str) -> FigureTable:
    rows = [
        (
            words.name(node),
            _cell_name(cells, int(i), int(j), load),
            words.signed(cells.mean[i, j]),
            words.duration(cells.seconds[i, j]),
        )
        for node, cells in maps.items()
        for i, j in np.argwhere(np.isfinite(cells.mean))
    ]
    return FigureTable(("node", "operating cell", "measured − model [K]", "time"), tuple(rows))


def _centres(edges: Floats) -> Floats:
    return np.concatenate([[0.0], (edges[1:-1] + edges[2:]) / 2])


def error_along(runs: Sequence[Run]) -> Plot | None:
    """Mean residual of each node along its temperature and along the time in a session: the panels, if any, with a cell
    that holds enough data."""
    pools = dict(list(pool_by_node(runs).items())[: len(COLOURS)])
    if not pools:
        return None
    hot = _edges([pool.measured for pool in pools.values()], 10)
    time = time_axis(max(runs, key=lambda run: int(run.t_ns[-1] - run.t_ns[0])))
    late = _edges([pool.since_start / time.unit_s for pool in pools.values()], 12)
    by_temperature = {node: along(pool, pool.measured, hot) for node, pool in pools.items()}
    by_time = {node: along(pool, pool.since_start / time.unit_s, late) for node, pool in pools.items()}
    both = [(by_temperature, hot, "measured temperature [°C]"), (by_time, late, time.label)]
    shown = [panel for panel in both if any(np.isfinite(mean).any() for mean in panel[0].values())]
    if not shown:
        return None
    title = _along_title(by_temperature, hot)
    with style("error along"):
        figure = Figure(figsize=(WIDTH, 2.6))
        place = {"left": 0.085, "right": 0.82, "bottom": 0.18, "top": 0.95, "wspace": 0.1}
        axes = figure.subplots(1, len(shown), sharey=True, squeeze=False, gridspec_kw=place)[0]
        for ax, (lines, edges, label) in zip(axes, shown, strict=True):
            _draw_along(ax, lines, edges)
            ax.set(xlabel=label)
        _name_y(axes[0], "measured − model [K]")
        name_lines(axes[-1], _ends(shown[-1][0]))
        svg = inline_svg(figure, title)
    note = f"Mean of each cell that holds {ENOUGH_S:.0f} s; all sessions together."
    return Plot(title, svg, note, _along_table(by_temperature, hot))


def _edges(values: Sequence[Floats], cells: int) -> Floats:
    return round_edges(min(float(v.min()) for v in values), max(float(v.max()) for v in values), cells)


def _draw_along(axes: Axes, lines: Mapping[str, Floats], edges: Floats) -> None:
    axes.axhline(0, color=SOFT[0], linewidth=0.8)
    for mean, colour, dashes in zip(lines.values(), COLOURS, ("-", *DASHES[1:]), strict=False):
        axes.plot((edges[:-1] + edges[1:]) / 2, mean, color=colour, linestyle=dashes, marker="o", markersize=2.6)


def _ends(lines: Mapping[str, Floats]) -> list[tuple[float, str, str]]:
    known = ((node, mean[np.isfinite(mean)]) for node, mean in lines.items())
    coloured = zip(known, COLOURS, strict=False)
    return [(float(mean[-1]), words.name(node), colour) for (node, mean), colour in coloured if mean.size]


def _along_title(lines: Mapping[str, Floats], edges: Floats) -> str:
    known = ((node, mean) for node, mean in lines.items() if np.isfinite(mean).any())
    if (worst := next(known, None)) is None:
        return f"No cell of temperature holds {ENOUGH_S:.0f} s of data"
    node, mean = worst
    at = int(np.nanargmax(np.abs(mean)))
    return f"{_off(node, mean[at])} when it is at {_span(edges, at)} °C"


def _along_table(lines: Mapping[str, Floats], edges: Floats) -> FigureTable:
    head = ("measured temperature [°C]", *(f"{words.name(node)} [K]" for node in lines))
    means = [[words.signed(value) if np.isfinite(value) else "–" for value in mean] for mean in lines.values()]
    rows = zip((_span(edges, i) for i in range(edges.size - 1)), *means, strict=True)
    return FigureTable(head, tuple(rows))
