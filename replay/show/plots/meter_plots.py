"""A meter over time: what it measured against what the model says it would, each in its own unit, with the difference
below."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from replay.engine.results.run import Metered, Run
from replay.show.plots.plots import ROWS, WIDTH, time_axis
from replay.show.words import heat_words, words
from replay.show.words.figure import FigureTable, Plot, inline_svg, panels, style
from replay.show.words.palette import COLOURS, DASHES, INK, SOFT, with_variables
from replay.show.words.thin import thin, with_gaps

Floats = NDArray[np.float64]

NAMES = {"power": "electrical power", "heat": "heat", "resistance": "resistance", "flux": "flux linkage"}


def meter_over_time(run: Run, metered: Metered, columns: int) -> Plot:
    """Measured and model of a meter over time, residual with its own uncertainty below; `columns` to thin to."""
    title = _title(run, metered)
    unit, factor = _shown(metered, metered.measured)
    off, off_factor = _shown(metered, metered.residual[metered.used])
    with style(f"{run.session} {metered.channel}"):
        figure, (upper, lower) = panels(WIDTH, (1.3, 0.8))
        _draw(upper, run, metered, factor, columns)
        _draw_residual(lower, run, metered, off_factor, columns)
        upper.set_ylabel(f"{NAMES[metered.quantity]} [{unit}]")
        lower.set_ylabel(f"measured −\nmodel [{off}]")
        lower.set_xlabel(time_axis(run).label)
        svg = with_variables(inline_svg(figure, title))
    return Plot(title, svg, "", _table(run, metered, unit, factor))


def _title(run: Run, metered: Metered) -> str:
    errors = next(one for one in run.summary.meters if one.channel == metered.channel)
    unit = metered.unit
    of = "into" if metered.quantity == "heat" else "of"
    subject = f"{metered.channel}, {NAMES[metered.quantity]} {of} the {words.name(metered.place)}"
    error = heat_words.quantity(errors.mae, unit)
    if errors.within_floor:
        floor = heat_words.quantity(errors.floor, unit)
        return f"{subject}: model within the meter's own uncertainty ({error} of {floor})"
    way = "below" if errors.bias > 0 else "above"
    return f"{subject}: model off by {error} on average, mostly {way} the meter"


def _shown(metered: Metered, values: Floats) -> tuple[str, float]:
    """The unit that suits the size of values, and the factor to it."""
    size, symbol = float(np.nanmax(np.abs(values), initial=0.0)), heat_words.SYMBOLS.get(metered.unit, metered.unit)
    if metered.unit == "W":
        return ("kW", 1e-3) if size >= 1e4 else ("W", 1.0)
    return (f"m{symbol}", 1e3) if size < 1.0 else (symbol, 1.0)


def _draw(axes: Axes, run: Run, metered: Metered, factor: float, columns: int) -> None:
    time = time_axis(run)
    t, measured = with_gaps(time.of(metered.t_ns), factor * metered.measured, metered.used)
    axes.plot(*thin(t, measured, columns), color=COLOURS[0], linewidth=1.4, label="measured")
    t, modelled = with_gaps(time.of(metered.t_ns), factor * metered.modelled, np.ones_like(metered.used))
    axes.plot(*thin(t, modelled, columns), color=INK[0], linestyle=DASHES[0], linewidth=1.0, label="model")
    axes.set_xlim(0, time.of(run.t_ns[-1:])[0])
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:,.4g}".replace("-", "−"))
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False, borderpad=0, handlelength=2.6)


def _draw_residual(axes: Axes, run: Run, metered: Metered, factor: float, columns: int) -> None:
    time, floor = time_axis(run), factor * metered.floor
    axes.axhspan(-floor, floor, color=SOFT[0], alpha=0.22, linewidth=0)
    axes.axhline(0, color=SOFT[0], linewidth=0.8)
    t, residual = with_gaps(time.of(metered.t_ns), factor * metered.residual, metered.used)
    axes.plot(*thin(t, residual, columns), color=COLOURS[0], linewidth=0.9)


def _table(run: Run, metered: Metered, unit: str, factor: float) -> FigureTable:
    at = np.unique(np.linspace(0, metered.t_ns.size - 1, ROWS).astype(np.intp))
    cells = [[f"{t:.2f}" for t in time_axis(run).of(metered.t_ns[at])]]
    for values in (metered.measured, metered.modelled, metered.residual):
        cells.append([f"{factor * value:,.5g}".replace("-", "−") for value in values[at]])
    head = (time_axis(run).label, *(f"{what} [{unit}]" for what in ("measured", "model", "difference")))
    return FigureTable(head, tuple(zip(*cells, strict=True)))
