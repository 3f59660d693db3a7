"""Plots over time: measured against model with the residual below, the inputs, and the one picture of the README."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from ingest.texts.units import without_unit
from replay.engine.results.run import Observed, Run
from replay.show.words import words
from replay.show.words.figure import (
    BAND,
    KEY_ABOVE,
    LEFT,
    FigureTable,
    Plot,
    inline_svg,
    name_lines,
    named,
    panels,
    save,
    style,
    tick,
)
from replay.show.words.findings import finding, worst_first
from replay.show.words.palette import COLOURS, DASHES, INK, PAPER, SERIES, SOFT
from replay.show.words.thin import next_samples, thin, with_gaps

Floats = NDArray[np.float64]

TOGETHER = 4  # channels in one panel
ROWS = 40  # of the table behind a plot
NEAR_LIMIT = 0.5  # of the temperatures' range: a limit that is further away is not drawn
STRIP = 0.38  # inches: height of the inputs under a plot
SMALL = 7.0  # points: titles of axes of low panels
WIDTH = 7.6  # inches: the text width of an A4 page
AXES: Mapping[str, tuple[str, str]] = {  # unit at the end of an input's name -> (title of its panel, unit)
    "rpm": ("speed", "rpm"),
    "A": ("current", "A"),
    "Nm": ("torque", "Nm"),
    "degC": ("boundaries", "°C"),
    "lpm": ("flow", "l/min"),
}


@dataclass(frozen=True)
class TimeAxis:
    """Time since the start of a session, in minutes up to three hours, in hours above."""

    start_ns: int
    unit_s: float
    unit: str

    @property
    def label(self) -> str:
        return f"time since start [{self.unit}]"

    def of(self, t_ns: NDArray[np.int64]) -> Floats:
        """Nanoseconds (N,) -> this axis' unit."""
        return np.asarray((t_ns - self.start_ns) / 1e9 / self.unit_s, dtype=np.float64)


def time_axis(run: Run) -> TimeAxis:
    """The axis that fits the run's length."""
    long = run.t_ns[-1] - run.t_ns[0] > 3 * 3600 * 1e9
    return TimeAxis(int(run.t_ns[0]), *((3600.0, "h") if long else (60.0, "min")))


def over_session(axes: Axes, run: Run) -> None:
    """The time axis of a whole session, with its title."""
    time = time_axis(run)
    axes.set_xlim(0, time.of(run.t_ns[-1:])[0])
    axes.set_xlabel(time.label)


def draw(
    axes: Axes,
    time: TimeAxis,
    t_ns: NDArray[np.int64],
    values: Floats,
    columns: int,
    used: NDArray[np.bool_] | None = None,
    **line: Any,
) -> None:
    """Values (M,) at `t_ns` as a line thinned to `columns`, open where they are not `used` or samples are missing."""
    known = np.ones(t_ns.size, dtype=np.bool_) if used is None else used
    axes.plot(*thin(*with_gaps(time.of(t_ns), values, known), columns), **line)


def around_zero(axes: Axes, *floors: float) -> None:
    """The zero of a residual; grey: one standard deviation of what sensors themselves leave open."""
    for floor in floors:
        axes.axhspan(-floor, floor, **BAND)
    axes.axhline(0, color=SOFT[0], linewidth=0.8)


def instants(size: int, rows: int = ROWS) -> NDArray[np.intp]:
    """Indices of at most `rows` evenly spread of `size` instants."""
    return np.unique(np.linspace(0, size - 1, rows).astype(np.intp))


def groups(run: Run) -> list[list[Observed]]:
    """Observed channels by region of their node, in the order of the nodes, at most 4 together."""
    by_region: dict[str, list[Observed]] = {}
    order = {node: i for i, node in enumerate(run.nodes)}
    for observed in sorted(run.observed, key=lambda o: order.get(o.node, len(order))):
        if observed.usable.any():
            by_region.setdefault(run.regions.get(observed.node, "other"), []).append(observed)
    return [members[i : i + TOGETHER] for members in by_region.values() for i in range(0, len(members), TOGETHER)]


def over_time(run: Run, group: Sequence[Observed], columns: int) -> Plot:
    """Measured and model of a group of channels over time, and residuals below; `columns` to thin to."""
    mine = {observed.channel for observed in group}
    worst = next(error for error in worst_first(run.summary) if error.channel in mine)
    title = finding(worst, run.summary)
    with style(f"{run.session} {group[0].channel}"):
        figure, (upper, lower, *below) = panels(WIDTH, (1.3, 0.75, *strip(run)))
        draw_temperatures(upper, run, group, columns)
        draw_residuals(lower, run, group, columns)
        over_driving(lower, below, run, columns)
        svg = inline_svg(figure, title)
    return Plot(title, svg, "", _table(run, group))


def driving(run: Run) -> list[str]:
    """The columns of speed and one load, as far as they are known."""
    known = [name for name, values in run.inputs.items() if np.isfinite(values).any()]
    load = next((name for name in ("current_A", "torque_Nm") if name in known), None)
    return [name for name in ("speed_rpm", load) if name in known]


def strip(run: Run) -> list[float]:
    """The height of the panel of inputs under a plot [inches]; none where no input is known."""
    return [STRIP] * bool(driving(run))


def over_driving(axes: Axes, below: Sequence[Axes], run: Run, columns: int) -> None:
    """The time of the session under a plot whose lowest panel is `axes`, with what drove the motor between; `below` as
    in `draw_driving`."""
    draw_driving(below, run, columns)
    over_session((axes, *below)[-1], run)


def draw_driving(below: Sequence[Axes], run: Run, columns: int) -> None:
    """What drove the motor as a strip under a plot, each as a share of its largest, which is told beside. `below`: one
    panel, or none where nothing is known."""
    time = time_axis(run)
    middle = time.of((run.t_ns[:-1] + run.t_ns[1:]) // 2)
    for axes in below:
        ends = []
        for name, colour, end in zip(driving(run), (INK[0], SERIES["orange"][0]), (0.8, 0.1), strict=False):
            largest = float(np.nanmax(np.abs(run.inputs[name])))
            quantity, _, unit = name.rpartition("_")
            most = f"{words.number(largest)} {AXES[unit][1]}"
            own: Any = {"color": colour, "linewidth": 0.8, "gid": named(f"{quantity} [of {most}]")}
            axes.plot(*thin(middle, run.inputs[name] / max(largest, 1e-9), columns), **own)
            ends.append((end, f"to {most}", colour))
        low = min(0.0, axes.get_ylim()[0])
        axes.set_ylim(low, 1.08)
        axes.set_yticks([])
        axes.set_ylabel("speed,\nload", fontsize=SMALL)
        name_lines(axes, [(low + share * (1.08 - low), text, colour) for share, text, colour in ends])


def draw_temperatures(axes: Axes, run: Run, group: Sequence[Observed], columns: int) -> None:
    """Measured solid, model dashed, one colour a channel, names at the right."""
    time, ends = time_axis(run), []
    for observed, name, colour, dashes in zip(group, _names(run, group), COLOURS, DASHES, strict=False):
        own: Any = {"color": colour, "linewidth": 1.4, "gid": named(f"{name} measured [°C]")}
        draw(axes, time, observed.t_ns, observed.measured, columns, observed.used, **own)
        own = {"color": colour, "linewidth": 1.1, "linestyle": dashes, "gid": named(f"{name} model [°C]")}
        draw(axes, time, observed.t_ns, observed.modelled, columns, **own)
        ends.append((float(observed.measured[observed.usable][-1]), name, colour))
    axes.set_ylabel("temperature [°C]")
    _draw_limits(axes, run, group)
    for style_, text in (("-", "measured"), (DASHES[0], "model")):
        axes.plot([], [], color=INK[0], linestyle=style_, label=text)
    axes.legend(**KEY_ABOVE, ncols=2, handlelength=2.6)
    name_lines(axes, ends)


def _draw_limits(axes: Axes, run: Run, group: Sequence[Observed]) -> None:
    """The limits of the group's nodes, those that the temperatures come near."""
    low, high = axes.get_ylim()
    limits = {run.limits_degC[o.node] for o in group if o.node in run.limits_degC}
    for limit in sorted(limit for limit in limits if limit < high + NEAR_LIMIT * (high - low)):
        axes.axhline(limit, color=SOFT[0], linewidth=0.9, linestyle=(0, (1.4, 1.2)))
        axes.annotate(
            f"limit {limit:g} °C",
            (0.005, limit),
            xycoords=("axes fraction", "data"),
            xytext=(0, 2),
            textcoords="offset points",
            color=SOFT[0],
            fontsize=7,
        )


def draw_residuals(axes: Axes, run: Run, group: Sequence[Observed], columns: int) -> None:
    """Measured minus model [K]."""
    time, ends = time_axis(run), []
    around_zero(axes, *sorted({round(observed.floor_K, 3) for observed in group}))
    for observed, name, colour, dashes in zip(group, _names(run, group), COLOURS, ("-", *DASHES[1:]), strict=False):
        residual = observed.residual
        own: Any = {"color": colour, "linestyle": dashes, "linewidth": 1.1, "gid": named(f"{name} residual [K]")}
        draw(axes, time, observed.t_ns, residual, columns, observed.used, **own)
        ends.append((float(residual[observed.usable][-1]), name, colour))
    axes.set_ylabel("measured −\nmodel [K]", fontsize=SMALL)
    if len(group) > 1:
        name_lines(axes, ends)


def _names(run: Run, group: Sequence[Observed]) -> list[str]:
    nodes = [observed.node for observed in run.observed]
    return [words.name(o.node) if nodes.count(o.node) == 1 else without_unit(o.channel) for o in group]


def inputs_over_time(run: Run, columns: int) -> Plot | None:
    """What drove the motor, one panel a unit, torque only where no current is known; None where nothing is known."""
    by_unit: dict[str, list[str]] = {}
    for column in (name for name, values in run.inputs.items() if np.isfinite(values).any()):
        by_unit.setdefault(column.rpartition("_")[2], []).append(column)
    shown = [(unit, by_unit[unit]) for unit in AXES if unit in by_unit and not (unit == "Nm" and "A" in by_unit)]
    if not shown:
        return None
    time = time_axis(run)
    middle = time.of((run.t_ns[:-1] + run.t_ns[1:]) // 2)
    title = f"What drove it: {words.joined([AXES[unit][0] for unit, _ in shown])}"
    with style(f"{run.session} inputs"):
        figure, axes = panels(WIDTH, [0.55] * len(shown), top=0.08)
        for ax, (unit, names) in zip(axes, shown, strict=True):
            _draw_inputs(ax, unit, {name: thin(middle, run.inputs[name], columns) for name in names[: len(COLOURS)]})
        over_session(axes[-1], run)
        svg = inline_svg(figure, title)
    return Plot(title, svg, "", _input_table(run, [name for _, names in shown for name in names]))


def _draw_inputs(axes: Axes, unit: str, series: Mapping[str, tuple[Floats, Floats]]) -> None:
    ends, alone = [], len(series) == 1
    for (name, (t, y)), colour, dashes in zip(series.items(), COLOURS, ("-", *DASHES), strict=False):
        gid = named(f"{words.name(name.rpartition('_')[0])} [{AXES[unit][1]}]")
        axes.plot(t, y, color=INK[0] if alone else colour, linestyle=dashes, linewidth=0.8, gid=gid)
        end = float(y[np.isfinite(y)][-1]) if np.isfinite(y).any() else 0.0
        ends.append((end, words.name(name.rpartition("_")[0]), colour))
    axes.set_ylabel("\n".join((AXES[unit][0], f"[{AXES[unit][1]}]")), fontsize=SMALL)
    axes.yaxis.set_major_formatter(tick)
    if not alone:
        name_lines(axes, ends)


def _table(run: Run, group: Sequence[Observed]) -> FigureTable:
    time, names, at_ns = time_axis(run), _names(run, group), table_instants(group)
    columns = ("measured [°C]", "model [°C]", "difference [K]")
    head = (time.label, *(f"{name} {what}" for name in names for what in columns))
    cells = [[f"{t:.2f}" for t in time.of(at_ns)]]
    for observed in group:
        cells += [temperature_cells(observed, values, at_ns) for values in (observed.measured, observed.modelled)]
        cells.append(residual_cells(observed, at_ns))
    return FigureTable(head, tuple(zip(*cells, strict=True)))


def table_instants(some: Sequence[Observed]) -> NDArray[np.int64]:
    """The instants of a table of channels [ns]: those of the one that goes on for longest."""
    t_ns = max((observed.t_ns for observed in some), key=np.ptp)
    return t_ns[instants(t_ns.size)]


def temperature_cells(observed: Observed, values: Floats, at_ns: NDArray[np.int64]) -> list[str]:
    """Values (M,) of a channel at each instant, a dash where it has no sample."""
    i, there = next_samples(observed.t_ns, at_ns)
    return [words.fixed(value) for value in np.where(there, values[i], np.nan)]


def residual_cells(observed: Observed, at_ns: NDArray[np.int64]) -> list[str]:
    """What a channel is off at each instant: "+1.4", "masked", a dash where it has no sample."""
    i, there = next_samples(observed.t_ns, at_ns)
    used = zip(observed.used[i], there, observed.residual[i], strict=True)
    return [(words.signed(off) if use else "masked") if here else words.fixed(np.nan) for use, here, off in used]


def _input_table(run: Run, names: Sequence[str]) -> FigureTable:
    time = time_axis(run)
    i = instants(run.t_ns.size - 1)
    head = (time.label, *(f"{words.name(n.rpartition('_')[0])} [{AXES[n.rpartition('_')[2]][1]}]" for n in names))
    cells = [[f"{t:.2f}" for t in time.of(run.t_ns[i])], *([words.fixed(v) for v in run.inputs[n][i]] for n in names)]
    return FigureTable(head, tuple(zip(*cells, strict=True)))


def picture(runs: Sequence[Run], target: Path) -> None:
    """The worst session in one picture, on white, 900 px wide: `target` with the suffixes .svg and .png. Raises
    ValueError where no run has a usable channel."""
    run, worst = max(((run, e) for run in runs for e in worst_first(run.summary)), key=lambda one: one[1].mae_K)
    ranked = [error.channel for error in worst_first(run.summary)][:TOGETHER]
    group = [observed for observed in run.observed if observed.channel in ranked]
    with style("picture"):
        figure, (upper, lower) = panels(9.0, (3.0, 1.7), top=0.62)
        figure.set_facecolor(PAPER[0])
        draw_temperatures(upper, run, group, 900)
        draw_residuals(lower, run, group, 900)
        over_session(lower, run)
        figure.text(LEFT, 0.96, finding(worst, run.summary), fontsize=11, fontweight="bold", va="center")
        says = f"session {run.session_name}, model {run.motor}, open loop"
        upper.set_title(says, fontsize=8.5, color=SOFT[0], loc="right")
        save(figure, target)
