"""Measured against the same session's replays under several models, region by region, each model's residual below."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from replay.engine.results.run import Observed, Run
from replay.show.plots.plots import ROWS, WIDTH, groups, time_axis
from replay.show.words import words
from replay.show.words.figure import LEFT, FigureTable, Plot, inline_svg, name_lines, panels, save, style
from replay.show.words.palette import DASHES, INK, PAPER, SERIES, SOFT, with_variables
from replay.show.words.thin import thin, with_gaps


@dataclass(frozen=True)
class Drawn:
    """How one of the models is called and drawn, the same in every plot."""

    label: str
    colour: str
    dashes: Any


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
        lower[-1].set_xlabel(time_axis(first).label)
        svg = with_variables(inline_svg(figure, title))
    return Plot(title, svg, "", _table(first, series))


def picture(models: Mapping[str, Run], target: Path) -> None:
    """The region that the first model gets most wrong, on white, 900 px wide: `target` with the suffixes .svg and .png.

    Raises ValueError where no channel can be drawn.
    """
    first = next(iter(models.values()))
    channel = max(first.observed, key=_off).channel
    series = {key: o for key, run in models.items() if (o := _of(run, channel)) is not None}
    with style("diagnosis picture"):
        figure, (upper, lower) = panels(9.0, (3.0, 1.7), top=0.7)
        figure.set_facecolor(PAPER[0])
        _draw_temperatures(upper, first, series, 900)
        _draw_residuals(lower, first, series, 900)
        lower.set_xlabel(time_axis(first).label)
        figure.text(LEFT, 0.965, _title(series), fontsize=11, fontweight="bold", va="center")
        upper.set_title(f"kept session {first.session_name}", fontsize=8.5, color=SOFT[0], loc="right")
        save(figure, target)


def _of(run: Run, channel: str) -> Observed | None:
    return next((o for o in run.observed if o.channel == channel), None)


def _off(observed: Observed) -> float:
    use = observed.used & np.isfinite(observed.residual)
    return float(np.abs(observed.residual[use]).mean()) if use.any() else 0.0


def _title(series: Mapping[str, Observed]) -> str:
    node = words.capital(words.name(next(iter(series.values())).node))
    off = {MODELS[key].label: words.kelvin(_off(observed)) for key, observed in series.items()}
    if len(off) > 1 and len(set(off.values())) == 1:
        return f"{node}: mean error {next(iter(off.values()))} with every model"
    return f"{node}: mean error {', '.join(f'{value} {label}' for label, value in off.items())}"


def _draw_temperatures(axes: Axes, run: Run, series: Mapping[str, Observed], columns: int) -> None:
    time = time_axis(run)
    measured = next(iter(series.values()))
    t, y = with_gaps(time.of(measured.t_ns), measured.measured, measured.used)
    axes.plot(*thin(t, y, columns), color=INK[0], linewidth=1.5, label="measured")
    for key, observed in series.items():
        drawn = MODELS[key]
        t, y = with_gaps(time.of(observed.t_ns), observed.modelled, np.ones_like(observed.used))
        axes.plot(*thin(t, y, columns), color=drawn.colour, linestyle=drawn.dashes, linewidth=1.1, label=drawn.label)
    axes.set_ylabel("temperature [°C]")
    axes.set_xlim(0, time.of(run.t_ns[-1:])[0])
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, frameon=False, borderpad=0, handlelength=2.8)
    name_lines(axes, [(float(measured.measured[-1]), words.name(measured.node), INK[0])])


def _draw_residuals(axes: Axes, run: Run, series: Mapping[str, Observed], columns: int) -> None:
    """Measured minus model [K] of each model; grey: one standard deviation of what the sensor itself leaves open."""
    time = time_axis(run)
    one = next(iter(series.values()))
    band = float(np.hypot(one.sd_K, one.bias_sd_K))
    axes.axhspan(-band, band, color=SOFT[0], alpha=0.22, linewidth=0)
    axes.axhline(0, color=SOFT[0], linewidth=0.8)
    for key, observed in series.items():
        t, y = with_gaps(time.of(observed.t_ns), observed.residual, observed.used)
        axes.plot(*thin(t, y, columns), color=MODELS[key].colour, linestyle=MODELS[key].dashes, linewidth=1.1)
    axes.set_ylabel("measured −\nmodel [K]")
    name_lines(axes, [(0.0, words.name(one.node), INK[0])])


def _table(run: Run, series: Mapping[str, Mapping[str, Observed]]) -> FigureTable:
    time = time_axis(run)
    reference = next(iter(next(iter(series.values())).values())).t_ns
    at_ns = reference[np.unique(np.linspace(0, reference.size - 1, ROWS).astype(np.intp))]
    head, cells = [time.label], [[f"{t:.2f}" for t in time.of(at_ns)]]
    for of_models in series.values():
        first = next(iter(of_models.values()))
        head.append(f"{words.name(first.node)} measured [°C]")
        cells.append([f"{v:.1f}" for v in first.measured[_nearest(first, at_ns)]])
        for key, observed in of_models.items():
            i = _nearest(observed, at_ns)
            head.append(f"{words.name(observed.node)} {MODELS[key].label} [K]")
            differences = zip(observed.residual[i], observed.used[i], strict=True)
            cells.append([words.signed(v) if good else "masked" for v, good in differences])
    return FigureTable(tuple(head), tuple(zip(*cells, strict=True)))


def _nearest(observed: Observed, at_ns: NDArray[np.int64]) -> NDArray[np.intp]:
    return np.clip(np.searchsorted(observed.t_ns, at_ns), 0, observed.t_ns.size - 1)
