"""The network at its places in the motor's cut: what is left at each sensor as colour, heat flows as widths, what was
named marked; drawn where the model is furthest off, with a slider over the session."""

from __future__ import annotations

import html
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.textpath import TextPath
from numpy.typing import NDArray

from ingest.texts.quantities import column_suffix
from ingest.texts.times import clock
from replay.engine.results.run import Run
from replay.show.plots.compare import MODELS
from replay.show.plots.error_maps import residual_colours
from replay.show.plots.plots import WIDTH
from replay.show.plots.residual_strip import column_means
from replay.show.viewer.cut import LENGTH, HalfRing, parts
from replay.show.words import words
from replay.show.words.figure import FLOW_ID, PART_ID, SAYS_ID, FigureTable, Plot, inline_svg, style
from replay.show.words.palette import INK, SOFT
from replay.studies.diagnosis.answer import Diagnosis
from twin.motor.causes import parse
from twin.motor.features import evaluate, monomials, quantity, scale
from twin.motor.network import Network
from twin.run.losses import flows_between
from twin.run.simulate import Frame

Floats = NDArray[np.float64]
Pair = tuple[str, str]

INSTANTS = 48  # equal parts of the session, one a step of the slider
ROW, ABOVE, BELOW = 0.29, 0.42, 0.72  # inches: of a ring, of the boundaries over the motor, of the key under it
ACROSS = 4.6  # of half the stack's length: the width of the picture, names of what stands at an end included
WIDEST, THINNEST, MARK = 12.0, 0.3, 7.0  # points: of the largest flow, of none, behind the path that was named
NO_SENSOR = "#dfe2e7"  # on both pages: names on it are black
LETTERS, CLOSE = 6.5, 5.0  # points: of names, and of rows whose names may stand under one another
TABLE_ROWS, TABLE_FLOWS = 24, 6
READING = (
    "Half of the motor cut along its shaft, the shaft at the bottom; boundaries above. Orange: measured hotter than "
    "the model; blue: colder; grey: no sensor. Lines: heat between places by the model, their widths the root of the "
    "watts; green: what was named. Means over {}. On a screen a slider leads through the session."
)


@dataclass(frozen=True)
class CutCourse:
    """Over equal parts of a session (INSTANTS,): what is left at nodes with a sensor [K], NaN where none may be used,
    and the heat from the first to the second of two places [W]."""

    times: Sequence[str]
    left_K: Mapping[str, Floats]
    flows_W: Mapping[Pair, Floats]

    @property
    def worst(self) -> tuple[int, str]:
        """The part and the node with the largest error."""
        node = max(self.left_K, key=lambda name: float(np.nanmax(np.abs(self.left_K[name]))))
        return int(np.nanargmax(np.abs(self.left_K[node]))), node


def cut_plot(diagnosis: Diagnosis, run: Run, network: Network) -> Plot | None:
    """The cut of a run as published; None where no usable sensor sits at a node, or the run lacks what a heat needs."""
    course = course_of(run, network)
    if course is None:
        return None
    named = _named(diagnosis)
    title = _title(course, named, run)
    with style(f"{run.session} cut"):
        svg = inline_svg(_draw(course, network, named), title)
    svg = svg.replace("<svg ", f'<svg data-over-time="{html.escape(json.dumps(_over_time(course)))}" ', 1)
    part = words.duration(float(run.t_ns[-1] - run.t_ns[0]) / 1e9 / INSTANTS)
    return Plot(title, svg, READING.format(part), _table(course, named))


def course_of(run: Run, network: Network) -> CutCourse | None:
    """What the picture shows of a run; None where there is nothing to show."""
    left: dict[str, list[Floats]] = {}
    for one in run.observed:
        if one.node in run.nodes and one.usable.any():
            left.setdefault(one.node, []).append(column_means(run, one, INSTANTS))
    columns = monomials(network)
    needed = {f: f + column_suffix(quantity(f) or "") for one in columns for f in one.features if quantity(f)}
    outside = [f"{boundary.name}_degC" for boundary in network.boundaries]
    if not left or not {*needed.values(), *outside} <= set(run.inputs) or len(run.t_ns) <= INSTANTS:
        return None
    steps = len(run.t_ns) - 1
    u = {feature: run.inputs[column] / scale(network, feature) for feature, column in needed.items()}
    hours = {f: np.zeros(steps) for one in columns for f in one.features if f not in needed}  # of a new motor
    temperatures = (run.temperatures[1:] + run.temperatures[:-1]) / 2
    boundaries = np.column_stack([run.inputs[column] for column in outside])
    frame = Frame(1.0, _means(evaluate(columns, u | hours, steps)), _means(boundaries))
    ends = np.linspace(0, (run.t_ns[-1] - run.t_ns[0]) / 1e9, INSTANTS + 1)
    return CutCourse(
        [clock(float(t)) for t in (ends[1:] + ends[:-1]) / 2],
        {node: np.array(means).mean(axis=0) for node, means in left.items()},
        flows_between(network, frame, _means(temperatures)),
    )


def _means(values: Floats) -> Floats:
    """Over equal parts of the steps (N, k) -> (INSTANTS, k)."""
    edges = np.linspace(0, len(values), INSTANTS + 1).astype(np.intp)
    found: Floats = np.add.reduceat(values, edges[:-1], axis=0) / np.diff(edges)[:, None]
    return found


def _named(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Places of what was named: nodes as (name,), heat paths as their two ends."""
    return [tuple(place.split("-")) for cause in diagnosis.causes for place in cause.members or [parse(cause.id).place]]


def _is_named(pair: Pair, named: Sequence[tuple[str, ...]]) -> bool:
    return any(set(place) == set(pair) for place in named)


def _title(course: CutCourse, named: Sequence[tuple[str, ...]], run: Run) -> str:
    """ "id_4 at 1:32:02: rotor measured 18.7 K colder than as published; 85 W from stator to rotor, the path named"."""
    at, node = course.worst
    left = float(course.left_K[node][at])
    told = f"{run.session_name} at {course.times[at]}: {words.name(node)} measured {words.kelvin(abs(left))} "
    told += f"{'hotter' if left > 0 else 'colder'} than as published"
    for (a, b), flow in course.flows_W.items():
        if _is_named((a, b), named):
            ends = (a, b) if flow[at] >= 0 else (b, a)
            told += f"; {abs(flow[at]):.0f} W from {words.name(ends[0])} to {words.name(ends[1])}, the path named"
    return told


def _kelvin(value: float) -> str:
    return words.signed_kelvin(value) if np.isfinite(value) else "no sample"


def _over_time(course: CutCourse) -> dict[str, object]:
    """What the page's script needs to draw another time: colours and words of parts, widths of flows."""
    colours, widest = residual_colours(_largest(course)), _widest(course)
    return {
        "times": list(course.times),
        "at": course.worst[0],
        "fill": {name: [_fill(colours, value) for value in values] for name, values in course.left_K.items()},
        "says": {
            name: [f"{words.name(name)} {_kelvin(value)}" for value in values] for name, values in course.left_K.items()
        },
        "wide": [[round(_wide(value, widest), 2) for value in values] for values in course.flows_W.values()],
    }


def _largest(course: CutCourse) -> float:
    return max(1.0, *(float(np.nanmax(np.abs(values))) for values in course.left_K.values()))


def _widest(course: CutCourse) -> float:
    return max(1e-9, *(float(np.abs(values).max()) for values in course.flows_W.values()), 0.0)


def _fill(colours: ScalarMappable, value: float) -> str:
    return to_hex(colours.to_rgba(value)) if np.isfinite(value) else NO_SENSOR  # type: ignore[arg-type]


def _wide(watts: float, widest: float) -> float:
    return max(THINNEST, WIDEST * float(np.sqrt(abs(watts) / widest)))


def _draw(course: CutCourse, network: Network, named: Sequence[tuple[str, ...]]) -> Figure:
    rings = parts(network)
    rows = len({ring.r for ring in rings})
    height = ROW * rows
    figure = Figure(figsize=(WIDTH, height + ABOVE + BELOW))
    axes = figure.add_axes((0, BELOW / (height + ABOVE + BELOW), 1, (height + ABOVE) / (height + ABOVE + BELOW)))
    axes.axis("off")
    axes.set_xlim(-ACROSS / 2, ACROSS / 2)
    axes.set_ylim(0, 1 + ABOVE / height)
    at = course.worst[0]
    centres = {ring.node: (sum(ring.x) / 2, sum(ring.r) / 2) for ring in rings}
    count = len(network.boundaries)
    for i, boundary in enumerate(network.boundaries):
        centres[boundary.name] = (-ACROSS / 2 + ACROSS * (i + 0.5) / count, 1 + 0.6 * ABOVE / height)
    colours, widest = residual_colours(_largest(course)), _widest(course)
    for ring in rings:
        left = course.left_K.get(ring.node)
        fill = NO_SENSOR if left is None else _fill(colours, float(left[at]))
        _draw_part(axes, ring, fill, (ring.node,) in named)
        says = words.name(ring.node) if left is None else f"{words.name(ring.node)} {_kelvin(float(left[at]))}"
        _draw_name(axes, ring, says, height)
    for i, ((a, b), flow) in enumerate(course.flows_W.items()):
        marked = _is_named((a, b), named)
        (x0, y0), (x1, y1) = centres[a], centres[b]
        colour = MODELS["extended"].colour if marked else SOFT[0]
        line: Any = {"color": colour, "solid_capstyle": "round", "zorder": 4 if marked else 3}
        if marked:  # seen even when hardly any heat flows
            axes.plot([x0, x1], [y0, y1], linewidth=MARK, alpha=0.3, **line)
        line |= {"alpha": 0.9 if marked else 0.5, "gid": f"{FLOW_ID}{i}"}
        axes.plot([x0, x1], [y0, y1], linewidth=_wide(float(flow[at]), widest), **line)
    for boundary in network.boundaries:
        x, y = centres[boundary.name]
        axes.plot([x], [y], marker="s", markersize=5, color=SOFT[0], zorder=5)
        axes.text(x + 0.04, y, words.name(boundary.name), fontsize=LETTERS + 1, va="center", color=INK[0], zorder=6)
    _draw_key(figure, widest, _largest(course), bool(named))
    return figure


def _draw_part(axes: Axes, ring: HalfRing, fill: str, named: bool) -> None:
    corner, size = (ring.x[0], ring.r[0]), (ring.x[1] - ring.x[0], ring.r[1] - ring.r[0])
    edge = MODELS["extended"].colour if named else SOFT[0]
    wide = 2.2 if named else 0.5
    axes.add_patch(
        Rectangle(corner, *size, facecolor=fill, edgecolor=edge, linewidth=wide, gid=f"{PART_ID}{ring.node}", zorder=2)
    )


def _draw_name(axes: Axes, ring: HalfRing, says: str, height: float) -> None:
    """At the left in its part, beside one that stands at an end; not at all where there is no room."""
    (left, right), y = ring.x, sum(ring.r) / 2
    own: Any = {"fontsize": LETTERS, "va": "center", "zorder": 6, "gid": f"{SAYS_ID}{ring.node}"}
    gap, high = 3 / 72 * ACROSS / WIDTH, (ring.r[1] - ring.r[0]) * height * 72
    longest = TextPath((0, 0), f"{words.name(ring.node)} −88.8 K", size=LETTERS).get_extents().width / 72
    if high >= CLOSE and (right <= -LENGTH or left >= LENGTH):
        x, side = (left - gap, "right") if right <= -LENGTH else (right + gap, "left")
        axes.text(x, y, says, ha=side, color=INK[0], **own)
    elif high >= LETTERS and longest * ACROSS / WIDTH + 2 * gap < right - left:
        axes.text(left + gap, y, says, color="#000000", **own)


def _draw_key(figure: Figure, widest: float, largest: float, named: bool) -> None:
    height = figure.get_figheight()
    bar = figure.add_axes((0.08, 0.44 / height, 0.3, 0.09 / height))
    scale = figure.colorbar(residual_colours(largest), cax=bar, orientation="horizontal")
    scale.set_label("measured − model [K]")
    scale.outline.set_visible(False)
    round_W = 10.0 ** np.floor(np.log10(widest))
    flows = [value for value in (5 * round_W, round_W, round_W / 10) if value <= widest]
    lines = [
        Line2D([], [], color=SOFT[0], alpha=0.5, linewidth=_wide(v, widest), label=f"{words.number(v)} W")
        for v in flows
    ]
    if named:
        lines.append(Line2D([], [], color=MODELS["extended"].colour, linewidth=2.2, label="what was named"))
    place: Any = {"loc": "center left", "bbox_to_anchor": (0.45, 0.46 / height)}
    figure.legend(handles=lines, ncols=len(lines), frameon=False, handlelength=2.6, **place)


def _table(course: CutCourse, named: Sequence[tuple[str, ...]]) -> FigureTable:
    sizes = {pair: float(np.abs(values).max()) for pair, values in course.flows_W.items()}
    told = sorted(sizes, key=lambda pair: (not _is_named(pair, named), -sizes[pair]))[:TABLE_FLOWS]
    head = ("time", *(f"{words.name(node)} [K]" for node in course.left_K))
    head += tuple(f"{words.name(a)} to {words.name(b)} [W]" for a, b in told)
    rows = []
    for i in range(0, INSTANTS, INSTANTS // TABLE_ROWS):
        left = [_kelvin(float(values[i])).removesuffix(" K") for values in course.left_K.values()]
        rows.append((course.times[i], *left, *(words.fixed(course.flows_W[pair][i]) for pair in told)))
    return FigureTable(head, tuple(rows))
