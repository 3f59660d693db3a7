"""A meter over time: what it measured against what the model says it would, and the difference below."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from ingest.texts.units import as_written
from replay.engine.results.run import Metered, Run
from replay.show.plots.plots import (
    WIDTH,
    TimeAxis,
    around_zero,
    draw,
    instants,
    over_driving,
    strip,
    time_axis,
)
from replay.show.words import heat_words, words
from replay.show.words.figure import KEY_ABOVE, FigureTable, Plot, inline_svg, named, panels, style, tick
from replay.show.words.palette import COLOURS, DASHES, INK

Floats = NDArray[np.float64]

NAMES = {"power": "electrical power", "heat": "heat", "resistance": "resistance", "flux": "flux linkage"}


def meter_over_time(run: Run, metered: Metered, columns: int) -> Plot:
    """Measured and model of a meter over time, residual with its own uncertainty below; `columns` to thin to."""
    title, time = _title(run, metered), time_axis(run)
    unit, factor = _shown(metered, metered.measured)
    off, off_factor = _shown(metered, metered.residual[metered.used])
    with style(f"{run.session} {metered.channel}"):
        figure, (upper, lower, *below) = panels(WIDTH, (1.3, 0.8, *strip(run)))
        _draw(upper, time, metered, (unit, factor), columns)
        around_zero(lower, off_factor * metered.floor)
        residual = off_factor * metered.residual
        own: Any = {"color": COLOURS[0], "linewidth": 0.9, "gid": named(f"{metered.channel} residual [{off}]")}
        draw(lower, time, metered.t_ns, residual, columns, metered.used, **own)
        upper.set_ylabel(f"{NAMES[metered.quantity]} [{unit}]")
        lower.set_ylabel(f"measured −\nmodel [{off}]")
        over_driving(lower, below, run, columns)
        svg = inline_svg(figure, title)
    return Plot(title, svg, "", _table(time, metered, unit, factor))


def _title(run: Run, metered: Metered) -> str:
    errors = next(one for one in run.summary.meters if one.channel == metered.channel)
    unit = metered.unit
    of = "into" if metered.quantity == "heat" else "of"
    subject = f"{metered.channel}, {NAMES[metered.quantity]} {of} the {words.name(metered.place)}"
    error = heat_words.quantity(errors.mae, unit)
    if errors.within_floor:
        floor = heat_words.quantity(errors.floor, unit)
        return f"{subject}: model on average within the meter's own uncertainty ({error} of {floor})"
    way = "below" if errors.bias > 0 else "above"
    return f"{subject}: model off by {error} on average, mostly {way} the meter"


def _shown(metered: Metered, values: Floats) -> tuple[str, float]:
    """The unit that suits the size of values, and the factor to it."""
    size, symbol = float(np.nanmax(np.abs(values), initial=0.0)), as_written(metered.unit)
    if metered.unit == "W":
        return ("kW", 1e-3) if size >= 1e4 else ("W", 1.0)
    return (f"m{symbol}", 1e3) if size < 1.0 else (symbol, 1.0)


def _draw(axes: Axes, time: TimeAxis, metered: Metered, shown: tuple[str, float], columns: int) -> None:
    unit, factor = shown
    measured, modelled = factor * metered.measured, factor * metered.modelled
    solid, dashed = {"color": COLOURS[0], "linewidth": 1.4}, {"color": INK[0], "linestyle": DASHES[0], "linewidth": 1.0}
    gids = [named(f"{metered.channel} {what} [{unit}]") for what in ("measured", "model")]
    draw(axes, time, metered.t_ns, measured, columns, metered.used, **solid, label="measured", gid=gids[0])
    draw(axes, time, metered.t_ns, modelled, columns, **dashed, label="model", gid=gids[1])
    axes.yaxis.set_major_formatter(tick)
    axes.legend(**KEY_ABOVE, ncols=2, handlelength=2.6)


def _table(time: TimeAxis, metered: Metered, unit: str, factor: float) -> FigureTable:
    at = instants(metered.t_ns.size)
    cells = [[f"{t:.2f}" for t in time.of(metered.t_ns[at])]]
    for values in (metered.measured, metered.modelled, metered.residual):
        cells.append([f"{factor * value:,.5g}".replace("-", "−") for value in values[at]])
    head = (time.label, *(f"{what} [{unit}]" for what in ("measured", "model", "difference")))
    return FigureTable(head, tuple(zip(*cells, strict=True)))
