"""A heat without a name over speed and load: where the motor makes more of it, and where it makes less."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from replay.show.plots.cells import ENOUGH_S
from replay.show.plots.error_maps import draw_cells, residual_colours
from replay.show.plots.plots import WIDTH
from replay.show.reports import verdict
from replay.show.words import words
from replay.show.words.figure import FigureTable, Plot, inline_svg, style, tick
from replay.studies.diagnosis.answer import Diagnosis, HeatOverLoad, UnnamedHeat

Floats = NDArray[np.float64]

NOTE = (
    "Orange: more heat than most of the time. Blue: less. A load below 0 brakes. White: the sessions that were learnt "
    f"from were there for less than {ENOUGH_S:.0f} s."
)


def heat_maps(diagnosis: Diagnosis) -> dict[str, Plot]:
    """Node -> the plot of its heat, of each that is known over speed and load."""
    return {heat.node: _plot(diagnosis, heat, heat.map) for heat in diagnosis.unknown if heat.map}


def _plot(diagnosis: Diagnosis, heat: UnnamedHeat, found: HeatOverLoad) -> Plot:
    name, unit = ("torque", "Nm") if found.torque_Nm else ("current", "A")
    loads = np.array(found.torque_Nm or found.current_A)
    speeds, watts, seconds = np.array(found.speed_rpm), np.array(found.watts), np.array(found.seconds)
    there = seconds >= ENOUGH_S
    title = _title(heat, speeds, loads, unit, np.where(there, watts, 0.0))
    with style(f"{diagnosis.diagnosis} heat {heat.node}"):
        figure = Figure(figsize=(WIDTH, 2.7))
        axes = figure.subplots(gridspec_kw={"left": 0.085, "right": 0.86, "bottom": 0.18, "top": 0.95})
        axes.grid(False)
        colours = residual_colours(max(1.0, float(np.abs(watts[there]).max(initial=0.0))))
        x, y = _edges(speeds), _edges(loads)
        draw_cells(axes, x, y, np.where(there, watts, np.nan), colours)
        axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]), xlabel="speed [rpm]", ylabel=f"{name} [{unit}]")
        axes.xaxis.set_major_formatter(tick)
        scale = figure.colorbar(colours, cax=figure.add_axes((0.89, 0.18, 0.015, 0.77)))
        scale.set_label("heat beside the usual [W]")
        scale.outline.set_visible(False)
        svg = inline_svg(figure, title)
    rows = [
        (words.number(speeds[i]), _load(loads[j]), words.signed(watts[i, j]), words.duration(seconds[i, j]))
        for i, j in np.argwhere(there)
    ]
    head = ("speed [rpm]", f"{name} [{unit}]", "heat beside the usual [W]", "time near")
    return Plot(title, svg, NOTE, FigureTable(head, tuple(rows)))


def _title(heat: UnnamedHeat, speeds: Floats, loads: Floats, unit: str, watts: Floats) -> str:
    """ "Magnet: 39 W more than most of the time while the motor brakes", else where that is."""
    i, j = np.unravel_index(int(np.abs(watts).argmax()), watts.shape)
    most = f"{abs(watts[i, j]):.0f} W {'more' if watts[i, j] > 0 else 'less'} than most of the time"
    at = f"at about {words.number(words.rounded(speeds[i]))} rpm and {_load(words.rounded(loads[j]))} {unit}"
    way = next((verdict.WAYS[name] for name in heat.goes_with if name in verdict.WAYS), at)
    return f"{words.capital(words.name(heat.node))}: {most} {way}"


def _load(value: float) -> str:
    return words.number(value).replace("-", "−")


def _edges(knots: Floats) -> Floats:
    """Half-way between knots (k + 1,), the outermost at the first and the last."""
    return np.concatenate([knots[:1], (knots[1:] + knots[:-1]) / 2, knots[-1:]])
