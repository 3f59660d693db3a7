"""Measured against the same session's replays under several models, region by region, each model's residual below."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from replay.engine.results.run import Observed, Run
from replay.show.plots.plots import (
    WIDTH,
    around_zero,
    draw,
    groups,
    instants,
    nearest,
    over_session,
    residual_cells,
    time_axis,
)
from replay.show.words import words
from replay.show.words.figure import KEY_ABOVE, LEFT, FigureTable, Plot, inline_svg, name_lines, panels, save, style
from replay.show.words.palette import DASHES, INK, PAPER, SERIES, SOFT


@dataclass(frozen=True)
class Drawn:
    """How one of the models is called and drawn, the same in every plot."""

    label: str
    colour: str
    dashes: Any

    @property
    def line(self) -> dict[str, Any]:
        return {"color": self.colour, "linestyle": self.dashes, "linewidth": 1.1}


MODELS: Mapping[str, Drawn] = {
    "published": Drawn("as published", SERIES["vermillion"][0], DASHES[1]),
    "recalibrated": Drawn("recalibrated", SERIES["blue"][0], DASHES[2]),
    "extended": Drawn("with the cause", SERIES["green"][0], DASHES[0]),
}


def compare(models: Mapping[str, Run], columns: int) -> list[Plot]:
    """A plot a region of one session. `models`: key of MODELS -> its run; `columns` that lines are thinned to."""
    known = {key: models[key] for key in MODELS if key in models}
    if not known:
        return []
    of_run = groups(next(iter(known.values())))
    furthest_off_first = sorted(of_run, key=lambda group: -max(map(_off, group)))
    return [_region(known, group, columns) for group in furthest_off_first]


def lines_drawn(models: Mapping[str, Run]) -> int:
    """How many lines `compare` draws: what the size of a page grows with."""
    runs = list(models.values())
    return sum((len(group) + 1) * len(runs) + 1 for group in groups(runs[0])) if runs else 0


def _region(models: Mapping[str, Run], group: Sequence[Observed], columns: int) -> Plot:
    channels = [o.channel for o in sorted(group, key=lambda o: -_off(o))]
    first = next(iter(models.values()))
    series = {c: {key: o for key, run in models.items() if (o := _of(run, c)) is not None} for c in channels}
    title = _title(series[channels[0]])
    with style(f"{first.session} {channels[0]} models"):
        figure, (upper, *lower) = panels(WIDTH, (1.5, *[0.8] * len(channels)))
        _draw_temperatures(upper, first, series[channels[0]], columns)
        for axes, channel in zip(lower, channels, strict=True):
            _draw_residuals(axes, first, series[channel], columns)
        over_session(lower[-1], first)
        svg = inline_svg(figure, title)
    return Plot(title, svg, "", _table(first, series))


def picture(models: Mapping[str, Run], target: Path) -> None:
    """The region that the first model gets most wrong, on white, 900 px wide: `target` with the suffixes .svg and .png.
    Raises ValueError where no channel can be drawn."""
    first = next(iter(models.values()))
    channel = max(first.observed, key=_off).channel
    series = {key: o for key, run in models.items() if (o := _of(run, channel)) is not None}
    with style("diagnosis picture"):
        figure, (upper, lower) = panels(9.0, (3.0, 1.7), top=0.7)
        figure.set_facecolor(PAPER[0])
        _draw_temperatures(upper, first, series, 900)
        _draw_residuals(lower, first, series, 900)
        over_session(lower, first)
        figure.text(LEFT, 0.965, _title(series), fontsize=11, fontweight="bold", va="center")
        upper.set_title(f"kept session {first.session_name}", fontsize=8.5, color=SOFT[0], loc="right")
        save(figure, target)


def _of(run: Run, channel: str) -> Observed | None:
    return next((o for o in run.observed if o.channel == channel), None)


def _off(observed: Observed) -> float:
    use = observed.usable
    return float(np.abs(observed.residual[use]).mean()) if use.any() else 0.0


def _title(series: Mapping[str, Observed]) -> str:
    node = words.capital(words.name(next(iter(series.values())).node))
    off = {MODELS[key].label: words.kelvin(_off(observed)) for key, observed in series.items()}
    if len(off) > 1 and len(set(off.values())) == 1:
        return f"{node}: mean error {next(iter(off.values()))} with every model"
    return f"{node}: mean error {', '.join(f'{value} {label}' for label, value in off.items())}"


def _draw_temperatures(axes: Axes, run: Run, series: Mapping[str, Observed], columns: int) -> None:
    time, one = time_axis(run), next(iter(series.values()))
    draw(axes, time, one.t_ns, one.measured, columns, one.used, color=INK[0], linewidth=1.5, label="measured")
    for key, observed in series.items():
        draw(axes, time, observed.t_ns, observed.modelled, columns, **MODELS[key].line, label=MODELS[key].label)
    axes.set_ylabel("temperature [°C]")
    axes.legend(**KEY_ABOVE, ncols=4, handlelength=2.8)
    name_lines(axes, [(float(one.measured[-1]), words.name(one.node), INK[0])])


def _draw_residuals(axes: Axes, run: Run, series: Mapping[str, Observed], columns: int) -> None:
    """Measured minus model [K] of each model."""
    time, one = time_axis(run), next(iter(series.values()))
    around_zero(axes, one.floor_K)
    for key, observed in series.items():
        draw(axes, time, observed.t_ns, observed.residual, columns, observed.used, **MODELS[key].line)
    axes.set_ylabel("measured −\nmodel [K]")
    name_lines(axes, [(0.0, words.name(one.node), INK[0])])


def _table(run: Run, series: Mapping[str, Mapping[str, Observed]]) -> FigureTable:
    time = time_axis(run)
    reference = next(iter(next(iter(series.values())).values())).t_ns
    at_ns = reference[instants(reference.size)]
    head, cells = [time.label], [[f"{t:.2f}" for t in time.of(at_ns)]]
    for of_models in series.values():
        first = next(iter(of_models.values()))
        head.append(f"{words.name(first.node)} measured [°C]")
        cells.append([f"{v:.1f}" for v in first.measured[nearest(first, at_ns)]])
        for key, observed in of_models.items():
            head.append(f"{words.name(observed.node)} {MODELS[key].label} [K]")
            cells.append(residual_cells(observed, nearest(observed, at_ns)))
    return FigureTable(tuple(head), tuple(zip(*cells, strict=True)))
