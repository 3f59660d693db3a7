"""Measured against the same session's replays under several models, region by region, each model's residual below.

Models come with their own corrections of a reading. Temperatures show it as recorded, and as corrected where that
differs; errors and residuals of every model are against the reading as recorded.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from replay.engine.results.run import Observed, Run
from replay.show.plots.plots import (
    SMALL,
    WIDTH,
    around_zero,
    draw,
    groups,
    over_driving,
    over_session,
    residual_cells,
    strip,
    table_instants,
    temperature_cells,
    time_axis,
)
from replay.show.words import words
from replay.show.words.figure import (
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
)
from replay.show.words.findings import MOVED_K
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


@dataclass(frozen=True)
class Overlaid:
    """A channel of a session under its models. `models`: key of MODELS -> the channel of its run, with the reading as
    recorded; `corrected`: the last of them with the reading as its bench file corrects it, by `moved_K` in the mean."""

    models: Mapping[str, Observed]
    corrected: Observed
    moved_K: float

    @property
    def first(self) -> Observed:
        return next(iter(self.models.values()))

    @property
    def moved(self) -> bool:
        """Whether the corrected reading is drawn beside the one as recorded."""
        return abs(self.moved_K) >= MOVED_K

    @property
    def reading(self) -> str:
        """What residuals are of."""
        return "recorded" if self.moved else "measured"


def _overlaid(models: Mapping[str, Run], channel: str) -> Overlaid:
    """The reading as recorded is the one of the first model."""
    own = {key: o for key, run in models.items() if (o := _of(run, channel)) is not None}
    first, corrected = next(iter(own.values())), list(own.values())[-1]
    recorded = {key: as_recorded(first, o) for key, o in own.items()}
    by = corrected.measured - as_recorded(first, corrected).measured
    known = corrected.used & np.isfinite(by)
    return Overlaid(recorded, corrected, float(by[known].mean()) if known.any() else 0.0)


def as_recorded(first: Observed, other: Observed) -> Observed:
    """Another model's channel with the reading that the `first` has, at instants that a learnt lag or clock may have
    moved."""
    if np.array_equal(first.t_ns, other.t_ns):
        return replace(other, measured=first.measured)
    return replace(other, measured=np.interp(other.t_ns, first.t_ns, first.measured))


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
    return sum((len(group) + 1) * len(runs) + 2 for group in groups(runs[0])) if runs else 0


def _region(models: Mapping[str, Run], group: Sequence[Observed], columns: int) -> Plot:
    channels = [o.channel for o in sorted(group, key=lambda o: -_off(o))]
    first = next(iter(models.values()))
    several = [_overlaid(models, channel) for channel in channels]
    title = _title(several[0])
    with style(f"{first.session} {channels[0]} models"):
        figure, (upper, *lower) = panels(WIDTH, (1.3, *[0.7] * len(channels), *strip(first)))
        _draw_temperatures(upper, first, several[0], columns)
        for axes, overlaid in zip(lower, several, strict=False):
            _draw_residuals(axes, first, overlaid, columns)
        over_driving(lower[len(several) - 1], lower[len(several) :], first, columns)
        svg = inline_svg(figure, title)
    return Plot(title, svg, _note(several), _table(first, several))


def _note(several: Sequence[Overlaid]) -> str:
    moved = [f"{words.name(one.first.node)} by {words.signed_kelvin(one.moved_K)}" for one in several if one.moved]
    if not moved:
        return ""
    return (
        f"Errors and residuals are of the readings as recorded; learnt corrections move {words.joined(moved)} in the "
        "mean."
    )


def picture(models: Mapping[str, Run], target: Path) -> None:
    """The region that the first model gets most wrong, on white, 900 px wide: `target` with the suffixes .svg and .png.
    Raises ValueError where no channel can be drawn."""
    first = next(iter(models.values()))
    channel = max(first.observed, key=_off).channel
    overlaid = _overlaid(models, channel)
    with style("diagnosis picture"):
        figure, (upper, lower) = panels(9.0, (3.0, 1.7), top=0.7)
        figure.set_facecolor(PAPER[0])
        _draw_temperatures(upper, first, overlaid, 900)
        _draw_residuals(lower, first, overlaid, 900)
        over_session(lower, first)
        figure.text(LEFT, 0.965, _title(overlaid), fontsize=11, fontweight="bold", va="center")
        lower.set_xlabel(f"{time_axis(first).label}, kept session {first.session_name}")
        save(figure, target)


def _of(run: Run, channel: str) -> Observed | None:
    return next((o for o in run.observed if o.channel == channel), None)


def _off(observed: Observed) -> float:
    use = observed.usable
    return float(np.abs(observed.residual[use]).mean()) if use.any() else 0.0


def _title(overlaid: Overlaid) -> str:
    node = words.capital(words.name(overlaid.first.node))
    off = {MODELS[key].label: words.kelvin(_off(observed)) for key, observed in overlaid.models.items()}
    if len(off) > 1 and len(set(off.values())) == 1:
        return f"{node}: mean error {next(iter(off.values()))} with every model"
    return f"{node}: mean error {', '.join(f'{value} {label}' for label, value in off.items())}"


def _draw_temperatures(axes: Axes, run: Run, overlaid: Overlaid, columns: int) -> None:
    """The reading as recorded, the corrected one where that differs, and what each model says."""
    time, one = time_axis(run), overlaid.first
    node = words.name(one.node)
    label = "as recorded" if overlaid.moved else "measured"
    own: Any = {"color": INK[0], "linewidth": 1.5, "label": label, "gid": named(f"{node} {label} [°C]")}
    draw(axes, time, one.t_ns, one.measured, columns, one.used, **own)
    if overlaid.moved:
        other, label = overlaid.corrected, f"corrected ({words.signed_kelvin(overlaid.moved_K)})"
        own = {"color": SOFT[0], "linewidth": 1.0, "label": label, "gid": named(f"{node} {label} [°C]")}
        draw(axes, time, other.t_ns, other.measured, columns, other.used, **own)
    for key, observed in overlaid.models.items():
        label = MODELS[key].label
        own = {**MODELS[key].line, "label": label, "gid": named(f"{node} {label} [°C]")}
        draw(axes, time, observed.t_ns, observed.modelled, columns, **own)
    axes.set_ylabel("temperature [°C]")
    axes.legend(**KEY_ABOVE, ncols=5, handlelength=2.2, columnspacing=1.0)
    name_lines(axes, [(float(one.measured[-1]), words.name(one.node), INK[0])])


def _draw_residuals(axes: Axes, run: Run, overlaid: Overlaid, columns: int) -> None:
    """Reading as recorded minus model [K] of each model."""
    time, one = time_axis(run), overlaid.first
    node = words.name(one.node)
    around_zero(axes, one.floor_K)
    for key, observed in overlaid.models.items():
        gid = named(f"{node} residual {MODELS[key].label} [K]")
        draw(axes, time, observed.t_ns, observed.residual, columns, observed.used, **MODELS[key].line, gid=gid)
    axes.set_ylabel(f"{overlaid.reading} −\nmodel [K]", fontsize=SMALL)
    name_lines(axes, [(0.0, words.name(one.node), INK[0])])


def _table(run: Run, several: Sequence[Overlaid]) -> FigureTable:
    time = time_axis(run)
    at_ns = table_instants([overlaid.first for overlaid in several])
    head, cells = [time.label], [[f"{t:.2f}" for t in time.of(at_ns)]]
    for overlaid in several:
        node = words.name(overlaid.first.node)
        readings = {overlaid.reading: overlaid.first} | ({"corrected": overlaid.corrected} if overlaid.moved else {})
        for label, observed in readings.items():
            head.append(f"{node} {label} [°C]")
            cells.append(temperature_cells(observed, observed.measured, at_ns))
        for key, observed in overlaid.models.items():
            head.append(f"{words.name(observed.node)} {MODELS[key].label} [K]")
            cells.append(residual_cells(observed, at_ns))
    return FigureTable(tuple(head), tuple(zip(*cells, strict=True)))
