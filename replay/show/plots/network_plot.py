"""A motor's network as a picture: nodes by region and coupling, links as wide as they conduct, losses in W."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch, Patch
from matplotlib.textpath import TextPath
from numpy.typing import NDArray

from replay.engine.files.motor_file import SCALES
from replay.errors import MotorFileError
from replay.show.plots.network_places import places_of_boxes, places_of_dots, slice_of
from replay.show.words import words
from replay.show.words.figure import save_svg, style
from replay.show.words.layout import without_overlap
from replay.show.words.palette import INK, PAPER, SERIES, SOFT
from twin.motor.features import evaluate, monomial, monomials, quantity, stream_places
from twin.motor.network import Network, Term

Floats = NDArray[np.float64]

REGION: Mapping[str, str] = {  # region -> colour
    "copper": SERIES["vermillion"][0],
    "iron": SERIES["blue"][0],
    "magnet": SERIES["purple"][0],
    "rotor": SERIES["green"][0],
    "housing": SOFT[0],
    "fluid": SERIES["sky"][0],
    "bearing": SERIES["yellow"][0],
    "other": INK[0],
}
UNITS = {"rpm": "rpm", "A": "A rms", "Nm": "Nm", "V": "V rms", "Wb": "Wb", "lpm": "l/min"}
FLOWS = SERIES["sky"][0]
BOXED = 60  # nodes; larger networks are drawn as dots, with one name a part
LABELLED = 12  # links; in smaller networks each says what it conducts
WIDE, THIN, DECADE = 4.5, 0.35, 1.3  # points: of the best link, of the worst, and what a factor of 10 makes
POINTS = 8.0  # height of a name
CENTRED: Any = {"ha": "center", "va": "center", "color": INK[0]}
MARGIN = 0.25  # inches
DOT = 0.06


@dataclass(frozen=True)
class _Sizes:
    """At one operating point: W/K of each link, W of each node with a loss."""

    links: Floats
    losses: Mapping[str, float]

    @property
    def best(self) -> float:
        """The largest conductance, of links that conduct at all."""
        return max(float(self.links.max(initial=0.0)), 1e-9)


def operating_point(network: Network, said: Sequence[str]) -> dict[str, float]:
    """Key of [scale] -> value, from texts as `speed_rpm=6000`; half of the scale where nothing is said. Raises
    MotorFileError for a text that is no such pair."""
    keys = {key: what for key, what in SCALES.items() if what in network.scale}
    point = {key: network.scale[what] / 2 for key, what in keys.items()}
    for text in said:
        key, _, value = text.partition("=")
        try:
            if key not in keys or not math.isfinite(float(value)):
                raise ValueError
            point[key] = float(value)
        except ValueError:
            known = ", ".join(keys) or "none: it has no [scale]"
            raise MotorFileError(f"--at {text}: say it as KEY=NUMBER; keys of {network.name}: {known}.") from None
    return point


def draw_network(network: Network, point: Mapping[str, float], target: Path) -> None:
    """The picture as an SVG file; the same network and point give the same bytes."""
    sizes = _sizes(network, point)
    boxed = len(network.nodes) <= BOXED
    with style(network.name):
        place, box = _laid_out(network, sizes)
        low, high = (place - box / 2).min(axis=0) - MARGIN, (place + box / 2).max(axis=0) + MARGIN
        head, foot = 0.45, 0.55
        width, height = max(high[0] - low[0], 6.5), high[1] - low[1]
        figure = Figure(figsize=(width, height + head + foot), facecolor=PAPER[0])
        axes = figure.add_axes((0, foot / (height + head + foot), 1, height / (height + head + foot)))
        middle = (low[0] + high[0]) / 2
        axes.set_xlim(middle - width / 2, middle + width / 2)
        axes.set_ylim(low[1], high[1])
        axes.axis("off")
        at = dict(zip(network.names, place, strict=True))
        _draw_links(axes, network, sizes, at)
        _draw_circuits(axes, network, at)
        if boxed:
            for name, size in zip(network.names, box, strict=True):
                _draw_box(axes, network, name, sizes, at[name], size)
        else:
            _draw_dots(axes, network, at)
        figure.text(MARGIN / width, 1 - 0.3 / (height + head + foot), _title(network, sizes, point), fontsize=10)
        _draw_legend(figure, network, sizes)
        save_svg(figure, target)


def places(network: Network) -> Floats:
    """Where nodes and boundaries stand in the picture (n + b, 2) [inches, upwards], at half of the motor's scale."""
    with style(network.name):
        return _laid_out(network, _sizes(network, operating_point(network, ())))[0]


def _laid_out(network: Network, sizes: _Sizes) -> tuple[Floats, Floats]:
    """Centres and sizes (n + b, 2) of nodes and boundaries: boxes with names, or dots where there are many."""
    boxed = len(network.nodes) <= BOXED
    box = np.array([_box(name, sizes) if boxed else (DOT, DOT) for name in network.names])
    return places_of_boxes(network, sizes.links, box) if boxed else places_of_dots(network), box


def _sizes(network: Network, point: Mapping[str, float]) -> _Sizes:
    columns = monomials(network)
    features = {feature for item in columns for feature in item.features}
    u = {f: np.array([_dimensionless(network, f, point)]) for f in features}
    phi = dict(zip(columns, evaluate(columns, u, 1)[0].tolist(), strict=True))

    def total(terms: Sequence[Term]) -> float:
        return float(sum(term.coefficient * phi.get(monomial(term), 1.0) for term in terms))

    losses = {source.node: total(source.terms) for source in network.sources}
    return _Sizes(np.array([total(link.terms) for link in network.links]), losses)


def _dimensionless(network: Network, feature: str, point: Mapping[str, float]) -> float:
    what = quantity(feature)
    if what is None:
        return 0.0  # hours above a temperature: a new motor
    return next(value for key, value in point.items() if SCALES[key] == what) / network.scale[what]


def _lines(name: str, sizes: _Sizes) -> list[str]:
    return [words.name(name), *([_watt(sizes.losses[name])] if name in sizes.losses else [])]


def _watt(value: float) -> str:
    if abs(value) >= 1000:
        return f"{value / 1000:.2f} kW"
    return f"{value:.0f} W" if abs(value) >= 10 else f"{value:.1f} W"


def _box(name: str, sizes: _Sizes) -> tuple[float, float]:
    lines = _lines(name, sizes)
    widest = max(TextPath((0, 0), line, size=POINTS).get_extents().width for line in lines) / 72
    return widest + 0.22, 0.16 * len(lines) + 0.12


def _width(conductance: float, best: float) -> float:
    return float(max(THIN, WIDE + DECADE * np.log10(max(conductance, 1e-12) / best)))


def _draw_links(axes: Axes, network: Network, sizes: _Sizes, at: Mapping[str, Floats]) -> None:
    best = sizes.best
    for link, conductance in zip(network.links, sizes.links.tolist(), strict=True):
        a, b = at[link.a], at[link.b]
        axes.plot([a[0], b[0]], [a[1], b[1]], color=SOFT[0], alpha=0.55, linewidth=_width(conductance, best), zorder=1)
        if len(network.links) <= LABELLED:
            patch = {"facecolor": PAPER[0], "edgecolor": "none", "alpha": 0.85, "pad": 0.8}
            x, y = (a + b) / 2
            axes.text(x, y, f"{words.digits(conductance)} W/K", fontsize=POINTS - 1.5, zorder=2, bbox=patch, **CENTRED)


def _draw_circuits(axes: Axes, network: Network, at: Mapping[str, Floats]) -> None:
    for before, node in stream_places(network):
        a, b = at[before], at[node]
        axes.plot([a[0], b[0]], [a[1], b[1]], color=FLOWS, linewidth=1.6, zorder=3)
        ends = (a + 0.45 * (b - a), a + 0.58 * (b - a))  # in the middle, where no name hides it
        head: Any = {"arrowstyle": "-|>", "mutation_scale": 13, "shrinkA": 0, "shrinkB": 0}
        axes.add_patch(FancyArrowPatch(*map(tuple, ends), color=FLOWS, zorder=4, **head))


def _draw_box(axes: Axes, network: Network, name: str, sizes: _Sizes, centre: Floats, size: Floats) -> None:
    """A boundary has a dashed edge; a node with a loss is tinted and says it."""
    region = next((node.region for node in network.nodes if node.name == name), None)
    colour = INK[0] if region is None else REGION[region]
    corner = centre - size / 2
    for face, alpha, edge in ((PAPER[0], 1.0, "none"), (colour, 0.18 if name in sizes.losses else 0.0, colour)):
        box = FancyBboxPatch(
            (corner[0] + 0.06, corner[1] + 0.06),
            size[0] - 0.12,
            size[1] - 0.12,
            boxstyle="round,pad=0.06,rounding_size=0.06" if region else "square,pad=0.06",
            facecolor=to_rgba(face, alpha),
            edgecolor=edge,
            linewidth=1.4,
            linestyle="-" if region else (0, (3, 2)),
            zorder=5,
        )
        axes.add_patch(box)
    lines = _lines(name, sizes)
    for k, line in enumerate(lines):
        height = centre[1] + 0.16 * ((len(lines) - 1) / 2 - k)
        axes.text(centre[0], height, line, fontsize=POINTS, ha="center", va="center_baseline", color=INK[0], zorder=6)


def _draw_dots(axes: Axes, network: Network, at: Mapping[str, Floats]) -> None:
    parts: dict[str, list[str]] = {}
    for node in network.nodes:
        axes.plot(*at[node.name], marker="o", markersize=4.5, color=REGION[node.region], zorder=5)
        parts.setdefault(slice_of(node.name)[0], []).append(node.name)
    for boundary in network.boundaries:
        axes.plot(*at[boundary.name], marker="s", markersize=8, color=PAPER[0], markeredgecolor=INK[0], zorder=5)
        parts[boundary.name] = [boundary.name]
    texts = [words.name(part) + (f" × {len(names)}" if len(names) > 1 else "") for part, names in parts.items()]
    size = np.array([(TextPath((0, 0), text, size=POINTS).get_extents().width / 72 + 0.1, 0.18) for text in texts])
    middles = np.array([at[names[len(names) // 2]] for names in parts.values()])
    for text, centre in zip(texts, without_overlap(middles + np.array([0, 0.14]), size), strict=True):
        patch = {"facecolor": PAPER[0], "edgecolor": "none", "alpha": 0.8, "pad": 1.0}
        axes.text(centre[0], centre[1], text, fontsize=POINTS, zorder=7, bbox=patch, **CENTRED)


def _title(network: Network, sizes: _Sizes, point: Mapping[str, float]) -> str:
    counts = f"{network.name}: {words.counted(len(network.nodes), 'node')}, {words.counted(len(network.links), 'link')}"
    total = _watt(sum(sizes.losses.values()))
    values = [f"{words.number(value)} {UNITS[key.rpartition('_')[2]]}" for key, value in point.items()]
    return f"{counts}; {total} of loss{' at ' * bool(values)}{words.joined(values)}"


def _draw_legend(figure: Figure, network: Network, sizes: _Sizes) -> None:
    best = sizes.best
    used = dict.fromkeys(node.region for node in network.nodes)
    handles: list[Line2D | Patch] = [
        Patch(facecolor=REGION[region], alpha=0.7, label=region) for region in REGION if region in used
    ]
    handles.append(Patch(facecolor="none", edgecolor=INK[0], linestyle=(0, (3, 2)), label="boundary"))
    decade = 10.0 ** np.floor(np.log10(best))
    for value in (decade, decade / 10, decade / 100):
        handles.append(Line2D([], [], color=SOFT[0], alpha=0.55, linewidth=_width(value, best), label=f"{value:g} W/K"))
    if network.circuits:
        handles.append(Line2D([], [], color=FLOWS, linewidth=1.6, label="fluid flows"))
    figure.legend(handles=handles, loc="lower center", ncols=min(len(handles), 7), frameon=False, fontsize=POINTS - 0.5)
