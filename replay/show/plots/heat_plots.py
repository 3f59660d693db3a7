"""Where the heat of a session comes from and where it goes: bands as wide as their watts, and the course over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from replay.engine.results.run import Run
from replay.show.plots.plots import WIDTH, over_driving, strip, time_axis
from replay.show.plots.sankey import draw_flows
from replay.show.words import heat_words, words
from replay.show.words.figure import FigureTable, Plot, inline_svg, name_lines, named, panels, style, tick
from replay.show.words.palette import COLOURS, DASHES, INK, SOFT
from replay.show.words.thin import thin
from twin.run.losses import HeatBalance, HeatPart, StoredHeat

Floats = NDArray[np.float64]
Parts = list[tuple[str, float]]  # name, mean [W]

FLOWS, APART, COURSE = 1.2, 0.2, 1.0  # inches: height of the bands, to the course below, of the course
SMOOTH_S = 60.0  # of the course over time: a driving cycle's losses jump every second


def heat_balance(run: Run, columns: int) -> Plot | None:
    """The account of a run; None where no heat was made or the run was sealed without one."""
    losses = run.summary.losses
    if losses is None or run.heat is None or losses.energy_J <= 0:
        return None
    made, gone = parts_of(losses, run.summary.duration_s)
    title = _title(made, gone)
    with style(f"{run.session} heat"):
        figure, (axes, *below) = panels(WIDTH, (COURSE, *strip(run)), top=FLOWS + APART)
        share = FLOWS / figure.get_figheight()
        draw_flows(figure.add_axes((0.29, 1 - share, 0.43, 0.96 * share)), made, gone, "W", _colours(losses))
        _draw_course(axes, run, _colours(losses), columns)
        over_driving(axes, below, run, columns)
        svg = inline_svg(figure, title)
    note = f"Above: means over the session; what came in is what went out. Below: means over {SMOOTH_S:.0f} s."
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


def _draw_course(axes: Axes, run: Run, colours: Mapping[str, str], columns: int) -> None:
    assert run.heat is not None
    time, ends = time_axis(run), []
    step_s = float(run.t_ns[1] - run.t_ns[0]) / 1e9
    middle = time.of((run.t_ns[:-1] + run.t_ns[1:]) // 2)
    made = np.sum([np.zeros(middle.size), *run.heat.kinds.values()], axis=0)
    lines = [("made", made, INK[0])]
    taken_by = ((words.name(name), taken) for name, taken in run.heat.boundaries.items())
    lines += [(f"into {name}", taken, colours.get(name, SOFT[0])) for name, taken in taken_by]
    for (name, watts, colour), dashes in zip(lines, ("-", *DASHES), strict=False):
        smooth = _smoothed(watts, round(SMOOTH_S / step_s))
        gid = named(f"{name} [W]")
        axes.plot(*thin(middle, smooth, columns), color=colour, linestyle=dashes, linewidth=1.1, gid=gid)
        ends.append((float(smooth[-1]), name, colour))
    axes.set_ylabel("heat [W]")
    axes.yaxis.set_major_formatter(tick)
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
    shown = tuple(
        (kind, what, words.digits(energy / 1e3), words.fixed(100 * energy / whole)) for kind, what, energy in rows
    )
    return FigureTable(("heat", "where", "energy [kJ]", "share [%]"), shown)


def _rows(
    kind: str, parts: Mapping[str, HeatPart] | Mapping[str, StoredHeat], named: Mapping[str, str] | None = None
) -> Sequence[tuple[str, str, float]]:
    return [(kind, (named or {}).get(name) or words.name(name), part.energy_J) for name, part in parts.items()]
