"""Pictures of the protocol: what each parameter moves where, and what each further point leaves unknown."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator, NullFormatter

from replay.show.plots.plots import WIDTH
from replay.show.words import words
from replay.show.words.figure import FigureTable, Plot, inline_svg, name_lines, style, tick
from replay.show.words.palette import COLOURS, DASHES, DIVERGING, INK
from replay.studies.characterise.protocol import Protocol, of_interest

SHOWN, MOST_NODES = 20, 24  # parameters, nodes
LINES = 5  # nodes whose course is drawn
ROW = 0.21  # inches
NUMBER_FROM_K = 0.5  # smaller values are shown by their colour alone


def influence_map(found: Protocol) -> Plot:
    """Parameter x node [K]: what one prior standard deviation moves on the drive cycles, most influential first."""
    weighed = found.influence
    nodes_of_interest = of_interest(found.network)
    rows = weighed.order(nodes_of_interest)[:SHOWN]
    columns = np.sort(np.argsort(-weighed.per_sd_K.max(axis=0))[:MOST_NODES])
    values = weighed.per_sd_K[rows][:, columns]
    names = [weighed.parameters[i].name for i in rows]
    nodes = [words.name(weighed.nodes[i]) for i in columns]
    place = max(nodes_of_interest, key=lambda n: weighed.per_sd_K[rows[0], n])
    moved = words.kelvin(weighed.per_sd_K[rows[0], place])
    title = f"{names[0]} moves the {words.name(weighed.nodes[place])} most: {moved} for one prior sd"
    with style(f"{found.calibration.event.calibration} influence"):
        svg = inline_svg(_draw_map(values, names, nodes), title)
    note = (
        "Root mean square over the drive cycles of the change of each node's temperature when a parameter is one "
        "prior standard deviation (`sd` in the motor file) off. Rows without colour cannot be seen there."
    )
    cells = tuple((name, *(f"{v:.2f}" for v in row)) for name, row in zip(names, values, strict=True))
    return Plot(title, svg, note, FigureTable(("parameter", *nodes), cells))


def _draw_map(values: np.ndarray, names: list[str], nodes: list[str]) -> Figure:
    longest = max(map(len, nodes))
    top, height = 0.07 * longest + 0.1, ROW * len(names)
    figure = Figure(figsize=(WIDTH, top + height + 0.1))
    left = 0.03 + 0.0098 * max(map(len, names))
    axes = figure.add_axes((left, 0.1 / (top + height + 0.1), 0.985 - left, height / (top + height + 0.1)))
    shades = LinearSegmentedColormap.from_list("influence", [DIVERGING[1], DIVERGING[2]])
    axes.pcolormesh(values, cmap=shades, vmin=0.0, vmax=float(values.max()), linewidth=0)
    for (row, column), value in np.ndenumerate(values):
        if value >= NUMBER_FROM_K:
            axes.text(column + 0.5, row + 0.5, f"{value:.1f}", ha="center", va="center", fontsize=5.5, color="#000000")
    axes.invert_yaxis()
    axes.set_yticks(np.arange(len(names)) + 0.5, names, fontsize=7)
    axes.xaxis.tick_top()
    axes.set_xticks(np.arange(len(nodes)) + 0.5, nodes, fontsize=7, rotation=90)
    axes.tick_params(length=0)
    axes.grid(False)
    return figure


def points_curve(found: Protocol) -> Plot:
    """What the parameters leave unknown of the least known nodes on the drive cycles [K], point by point: those
    recorded, then those proposed."""
    recorded = [found.points[choice.test].name for choice in found.choices]
    proposed = [f"next {i}" for i, _ in enumerate(found.proposals, start=1)]
    labels = ["none", *(f"+ {name}" for name in recorded), *proposed]
    after_each = [one.known_K for one in found.choices] + [one.known_K for one in found.proposals]
    course = np.array([found.unknown_K, *after_each])
    least = sorted(of_interest(found.network), key=lambda i: -course[0, i])[:LINES]
    nodes = [words.name(found.influence.nodes[i]) for i in least]
    before, after = (words.kelvin(course[row, least[0]]) for row in (0, len(recorded)))
    points = words.counted(len(recorded), "point")
    title = f"{words.capital(nodes[0])}: {before} unknown before any point, {after} after {points}"
    with style(f"{found.calibration.event.calibration} points"):
        figure = Figure(figsize=(WIDTH, 2.6))
        axes = figure.add_axes((0.1, 0.2, 0.68, 0.72))
        _draw_course(axes, course[:, least], nodes, labels, len(recorded))
        svg = inline_svg(figure, title)
    note = (
        "Standard deviation of each node on the drive cycles that comes from the coefficients and capacities alone, "
        "each point added in the order in which they teach most; behind the vertical line points that were not run, "
        "those that teach most an hour first."
    )
    head = ("points", "nats", *nodes)
    gains = [one.gain for one in found.choices] + [one.gain for one in found.proposals]
    taken = ["before any", *recorded, *(one.words for one in found.proposals)]
    steps = zip(taken, ["", *(f"{gain:.1f}" for gain in gains)], course[:, least], strict=True)
    rows = tuple((name, gain, *(f"{left:.2f}" for left in unknown)) for name, gain, unknown in steps)
    return Plot(title, svg, note, FigureTable(head, rows))


def _draw_course(axes: Axes, course: np.ndarray, nodes: list[str], labels: list[str], recorded: int) -> None:
    """`recorded`: points that were run; those behind them have open marks."""
    places = np.arange(len(course))
    for values, colour, dashes in zip(course.T, COLOURS, DASHES, strict=False):
        axes.plot(places, values, color=colour, linestyle=dashes)
        axes.plot(places[: recorded + 1], values[: recorded + 1], color=colour, linestyle="", marker="o", markersize=3)
        (proposed,) = axes.plot(places[recorded + 1 :], values[recorded + 1 :], color=colour, linestyle="", marker="o")
        proposed.set(markersize=3, markerfacecolor="none")
    if recorded + 1 < len(course):
        axes.axvline(recorded + 0.5, color=INK[0], linewidth=0.6)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(tick)
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(-0.1, places[-1] + 0.1)
    axes.xaxis.set_major_locator(MultipleLocator(1))
    axes.set_xticks(places, labels, fontsize=7)
    axes.set_ylabel("left unknown [K]")
    low, high = axes.get_ylim()
    ends = low + (high - low) * np.log(course[-1] / low) / np.log(high / low)  # names are placed as on a linear axis
    name_lines(axes, [(float(v), n, c) for v, n, c in zip(ends, nodes, COLOURS, strict=False)])
