"""The share of its current that a controller allows a motor, by its sensor and by the hot spot that this stands for."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from replay.engine.results.hot_spots import REGIONS
from replay.engine.results.run import Run
from replay.engine.results.summary import DeratingCourse
from replay.show.plots.plots import WIDTH, instants, over_driving, strip, time_axis
from replay.show.words import words
from replay.show.words.figure import FigureTable, Plot, inline_svg, name_lines, named, panels, style
from replay.show.words.palette import COLOURS, DASHES, SOFT
from replay.show.words.thin import thin
from twin.run.derating import Derating

Floats = NDArray[np.float64]


def derating_over_time(run: Run, course: DeratingCourse, columns: int) -> Plot | None:
    """A rule of the bench file beside a run; None where its sensor was not recorded as an observation."""
    watched = next((one for one in run.observed if one.channel == course.channel), None)
    hot = hottest_of(run, course.protects)
    if watched is None or hot is None or not watched.used.any():
        return None
    rule, time = Derating(course.begin_degC, course.end_degC), time_axis(run)
    t = {"sensor": time.of(watched.t_ns[watched.used]), "hot spot": time.of(run.t_ns)}
    degC = {"sensor": watched.measured[watched.used], "hot spot": hot}
    names = {"sensor": words.name(course.channel), "hot spot": "hot spot"}
    title = _title(course)
    with style(f"{run.session} derating {course.channel}"):
        figure, (upper, lower, *below) = panels(WIDTH, (1.2, 0.9, *strip(run)), top=0.08)
        allowed = {k: 100 * rule.factor(v) for k, v in degC.items()}
        for ax, values, what in ((upper, degC, "[°C]"), (lower, allowed, "allows [%]")):
            ends = []
            for (key, y), colour, dashes in zip(values.items(), COLOURS, ("-", DASHES[0]), strict=False):
                gid = named(f"{names[key]} {what}")
                ax.plot(*thin(t[key], y, columns), color=colour, linestyle=dashes, linewidth=1.2, gid=gid)
                ends.append((float(y[-1]), names[key], colour))
            if ax is upper:
                for degrees in (course.begin_degC, course.end_degC):
                    ax.axhline(degrees, color=SOFT[0], linewidth=0.8, linestyle=(0, (1.4, 1.2)))
                name_lines(ax, ends)
        upper.set_ylabel("temperature [°C]")
        lower.set_ylabel("current\nallowed [%]")
        lower.set_ylim(-4, 104)
        over_driving(lower, below, run, columns)
        svg = inline_svg(figure, title)
    begins = f"where {words.name(course.channel)} begins to take current back"
    note = f"Dotted: {begins}, and where none is left. Dashed: the model."
    return Plot(title, svg, note, _table(run, rule, t, degC))


def hottest_of(run: Run, spot: str) -> Floats | None:
    """The hottest of what a rule protects, (N + 1,) [degC]; None where the motor has no such node."""
    for region in REGIONS[spot]:
        at = [i for i, node in enumerate(run.nodes) if run.regions.get(node) == region]
        if at:
            hottest: Floats = run.temperatures[:, at].max(axis=1)
            return hottest
    return None


def _title(course: DeratingCourse) -> str:
    sensor = words.name(course.channel)
    if course.late_s > 0:
        late = f"for {words.duration(course.late_s)} it allows all the current that the hot spot does not"
        return f"{sensor} sees the hottest {course.protects} too late: {late}"
    if course.seconds > 0:
        return f"{sensor} takes current back for {words.duration(course.seconds)}"
    return f"{sensor} allows full current throughout"


def _table(run: Run, rule: Derating, t: Mapping[str, Floats], degC: Mapping[str, Floats]) -> FigureTable:
    at = t["sensor"][instants(t["sensor"].size)]
    head = (time_axis(run).label, "sensor [°C]", "current allowed [%]", "hot spot [°C]", "by the hot spot [%]")
    cells = [[f"{value:.2f}" for value in at]]
    for key in ("sensor", "hot spot"):
        values = np.interp(at, t[key], degC[key])
        cells += [[words.fixed(value) for value in values], [f"{100 * value:.0f}" for value in rule.factor(values)]]
    return FigureTable(head, tuple(zip(*cells, strict=True)))
