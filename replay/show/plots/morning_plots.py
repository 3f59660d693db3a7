"""Pictures of a session as it was recorded: its course, where it was driven, and the run before beside it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ingest.catalogue.channels import ChannelData, current, find
from ingest.catalogue.operating_points import OperatingPoints
from ingest.morning.morning import Before, Night
from ingest.texts.units import as_written, with_unit, without_unit
from replay.show.plots.plots import ROWS, WIDTH, TimeAxis, draw, instants
from replay.show.words import words
from replay.show.words.figure import KEY_ABOVE, FigureTable, Plot, inline_svg, name_lines, named, panels, style, tick
from replay.show.words.palette import COLOURS, DASHES, INK
from replay.show.words.thin import next_samples, thin

MOST_LINES = len(COLOURS)  # of a panel of temperatures
MOST_PANELS = 3
THOUSANDS = 10_000  # from here on an axis counts in thousands: longer numbers run into its title
LONG_s = 3 * 3600.0  # from here on hours are shown


def course(night: Night, columns: int) -> Plot | None:
    """Speed, load and temperatures of a session over time; None where it holds none of these."""
    channels = [one for one in night.channels if len(one.t_ns) > 1 and one.spec.role != "ignored"]
    drives = [one for one in (find(channels, "speed"), find(channels, "torque") or current(channels)) if one]
    dead = {fault.channel for fault in night.sensors if fault.fault == "dead"}
    warm = [one for one in channels if one.spec.quantity == "temperature" and one.spec.name not in dead]
    shown = warm[: MOST_LINES * MOST_PANELS]
    size = -(-len(shown) // max(1, -(-len(shown) // MOST_LINES)))  # as many in each panel
    groups = [shown[i : i + size] for i in range(0, len(shown), max(size, 1))]
    if not drives and not groups:
        return None
    time = _time_axis([*drives, *shown])
    title = _title(night, warm)
    with style(f"{night.description.session} course"):
        figure, axes = panels(WIDTH, [0.62] * len(drives) + [1.5] * len(groups), top=0.08)
        for ax, one in zip(axes, drives, strict=False):
            thousand = float(np.abs(one.value).max()) >= THOUSANDS
            unit = f"[{'1000 ' if thousand else ''}{as_written(one.unit or '')}]"
            own: Any = {"color": INK[0], "linewidth": 0.8, "gid": named(f"{one.spec.quantity} {unit}")}
            draw(ax, time, one.t_ns, one.value / (1000 if thousand else 1), columns, **own)
            ax.set_ylabel(f"{one.spec.quantity}\n{unit}")
            ax.yaxis.set_major_formatter(tick)
        for ax, group in zip(axes[len(drives) :], groups, strict=True):
            for one, colour in zip(group, COLOURS, strict=False):
                own = {"color": colour, "linewidth": 1.1, "gid": named(with_unit(one.spec.name, "°C"))}
                draw(ax, time, one.t_ns, one.value, columns, **own)
            ax.set_ylabel("temperature [°C]")
            name_lines(ax, [(float(one.value[-1]), one.spec.name, c) for one, c in zip(group, COLOURS, strict=False)])
        axes[-1].set_xlabel(time.label)
        svg = inline_svg(figure, title)
    left = [*sorted(dead), *(one.spec.name for one in warm[len(shown) :])]
    note = f"not drawn: {words.joined(left)}" if left else ""
    return Plot(title, svg, note, _table(time, [*drives, *shown]))


def _title(night: Night, warm: Sequence[ChannelData]) -> str:
    if not warm:
        return f"What drove {night.description.name}"
    hottest = max(warm, key=lambda one: float(one.value.max()))
    return f"Up to {hottest.value.max():.1f} °C, at {hottest.spec.name}"


def _time_axis(channels: Sequence[ChannelData]) -> TimeAxis:
    start = min(int(one.t_ns[0]) for one in channels)
    long = max(int(one.t_ns[-1]) for one in channels) - start > LONG_s * 1e9
    return TimeAxis(start, *((3600.0, "h") if long else (60.0, "min")))


def _table(time: TimeAxis, channels: Sequence[ChannelData]) -> FigureTable:
    t_ns = max((one.t_ns for one in channels), key=np.ptp)
    at = t_ns[instants(len(t_ns), ROWS)]
    head = (time.label, *(with_unit(one.spec.name, as_written(one.unit or "")) for one in channels))
    cells = [[f"{t:.2f}" for t in time.of(at)]]
    for one in channels:
        i, there = next_samples(one.t_ns, at)
        cells.append([words.fixed(value) for value in np.where(there, one.value[i], np.nan)])
    return FigureTable(head, tuple(zip(*cells, strict=True)))


def operating_map(points: OperatingPoints, key: str) -> Plot:
    """How long a session stayed in each cell of speed and load: the darker, the longer."""
    minutes = np.array(points.minutes)
    k, i = np.unravel_index(int(minutes.argmax()), minutes.shape)
    load, unit = points.y.rsplit("_", 1)
    x, y = (np.array([(a + b) / 2 for a, b in pairwise(e)]) for e in (points.x_edges, points.y_edges))
    place = f"{words.number(x[i])} rpm and {words.number(y[k])} {unit}" if x[i] or y[k] else "rest"
    title = f"Longest at {place}: {words.duration(60 * float(minutes[k, i]))}"
    with style(f"{key} cells"):
        figure = Figure(figsize=(WIDTH, 0.28 * len(y) + 0.75))
        height = figure.get_figheight()
        ax = figure.add_axes((0.1, 0.5 / height, 0.88, 1 - 0.6 / height))
        ax.grid(False)
        for row, column in np.argwhere(minutes > 0):
            a, b = points.x_edges[column : column + 2]
            c, d = points.y_edges[row : row + 2]
            share = float(np.sqrt(minutes[row, column] / minutes.max()))
            ax.fill([a, b, b, a], [c, c, d, d], facecolor=COLOURS[0], alpha=0.1 + 0.55 * share, linewidth=0)
            ax.text((a + b) / 2, (c + d) / 2, _minutes(minutes[row, column]), ha="center", va="center", fontsize=7)
        ax.set_xticks(x)
        ax.set_yticks(y)
        ax.set_xlim(points.x_edges[0], points.x_edges[-1])
        ax.set_ylim(points.y_edges[0], points.y_edges[-1])
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_formatter(tick)
        ax.set_xlabel("speed [rpm]")
        ax.set_ylabel(f"{load} [{unit}]")
        svg = inline_svg(figure, title)
    rows = [(f"{y[row]:,g}", *(f"{value:.1f}" for value in minutes[row])) for row in range(len(y))]
    head = (f"{load} [{unit}] \\ speed [rpm]", *(f"{value:,g}" for value in x))
    return Plot(title, svg, "minutes in each cell of speed and load", FigureTable(head, tuple(rows)))


def _minutes(value: float) -> str:
    return f"{value:.0f}" if value >= 10 else f"{value:.1f}" if value >= 0.05 else ""


def beside(before: Before, key: str, columns: int) -> Plot | None:
    """The temperatures that are furthest off the run before, this run solid and that one dashed; None without any."""
    courses = before.comparison.courses
    if not courses:
        return None
    exceeding = [one.channel for one in before.comparison.exceeding if one.channel in {c.channel for c in courses}]
    title = f"No temperature is off {before.name} by more than start, drive and floor explain"
    if exceeding:
        title = f"Off {before.name} by more than its floor: {words.joined(exceeding)}"
    end = max(float(one.t_s[-1]) for one in courses)
    unit_s, unit = (3600.0, "h") if end > LONG_s else (60.0, "min")
    with style(f"{key} beside"):
        figure, (ax, lower) = panels(WIDTH, (1.5, 0.95))
        ends: list[tuple[float, str, str]] = []
        offs: list[tuple[float, str, str]] = []
        for one, colour, dashes in zip(courses, COLOURS, DASHES, strict=False):
            t, name = one.t_s / unit_s, without_unit(one.channel)
            now: Any = {"color": colour, "linewidth": 1.4, "gid": named(f"{name} this run [°C]")}
            ax.plot(*thin(t, one.second, columns), **now)
            then: Any = {"color": colour, "linestyle": dashes, "gid": named(f"{name} {before.name} [°C]")}
            ax.plot(*thin(t, one.first, columns), linewidth=1.1, **then)
            apart: Any = {"color": colour, "linewidth": 1.1, "gid": named(f"{name} difference [K]")}
            lower.plot(*thin(t, one.second - one.first, columns), **apart)
            ends.append((float(one.second[np.isfinite(one.second)][-1]), one.channel, colour))
            off = one.second - one.first
            offs.append((float(off[np.isfinite(off)][-1]), one.channel, colour))
        for line, text in (("-", "this run"), (DASHES[0], before.name)):
            ax.plot([], [], color=INK[0], linestyle=line, label=text)
        ax.legend(**KEY_ABOVE, ncols=2, handlelength=2.6)
        ax.set_ylabel("temperature [°C]")
        lower.set_ylabel("difference\n[K]")
        lower.set_xlabel(f"time since start [{unit}]")
        name_lines(ax, ends)
        name_lines(lower, offs)
        svg = inline_svg(figure, title)
    at = instants(len(courses[0].t_s), ROWS)
    called = [without_unit(one.channel) for one in courses]
    head = (f"time since start [{unit}]", *(f"{name} {w} [°C]" for name in called for w in ("now", "before")))
    cells = [[f"{t:.2f}" for t in courses[0].t_s[at] / unit_s]]
    for one in courses:
        cells += [[words.fixed(value) for value in one.second[at]], [words.fixed(value) for value in one.first[at]]]
    return Plot(title, svg, "", FigureTable(head, tuple(zip(*cells, strict=True))))
