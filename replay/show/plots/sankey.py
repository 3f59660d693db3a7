"""Flows as bands whose widths are their amounts: parts that come in at the left, all of them, parts that go out at the
right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.patches import PathPatch, Rectangle
from matplotlib.path import Path

from replay.show.words import words
from replay.show.words.figure import fitting, kept_apart
from replay.show.words.palette import SOFT

Parts = Sequence[tuple[str, float]]  # name, amount

GAP = 0.07  # of the whole, between two parts of a side
TRUNK = (0.46, 0.54)  # share of the width where all flow together
END = 0.025  # share of the width that a part's end takes
LONGEST = 22  # letters of a name
BAND = 0.45  # opacity of a band


def draw_flows(axes: Axes, comes: Parts, goes: Parts, unit: str, colours: Mapping[str, str]) -> None:
    """Parts of either side, largest first, with their amounts and shares of the whole. `colours`: name -> colour."""
    whole = sum(amount for _, amount in comes)
    axes.set_xlim(0, 1)
    axes.set_ylim(-whole * (1 + GAP * (max(len(comes), len(goes)) - 1)), 0)
    axes.axis("off")
    trunk = Rectangle(
        (TRUNK[0], _top(axes, whole) - whole), TRUNK[1] - TRUNK[0], whole, color=SOFT[0], alpha=BAND, lw=0
    )
    axes.add_patch(trunk)
    for parts, right in ((comes, False), (goes, True)):
        _draw_side(axes, sorted(parts, key=lambda part: -part[1]), right, unit, whole, colours)


def _top(axes: Axes, height: float) -> float:
    """Where something of this height begins so that it lies in the middle."""
    return (axes.get_ylim()[0] + height) / 2


def _draw_side(axes: Axes, parts: Parts, right: bool, unit: str, whole: float, colours: Mapping[str, str]) -> None:
    inner, outer = _top(axes, whole), _top(axes, whole * (1 + GAP * (len(parts) - 1)))
    names = []
    for name, amount in parts:
        colour = colours.get(name.removeprefix("from ").removeprefix("less "), SOFT[0])
        at = 1 - END if right else 0.0
        axes.add_patch(Rectangle((at, outer - amount), END, amount, color=colour, lw=0))
        edges = (1 - END, TRUNK[1]) if right else (END, TRUNK[0])
        axes.add_patch(PathPatch(_band(*edges, outer, inner, amount), color=colour, alpha=BAND, lw=0))
        names.append(
            (
                outer - amount / 2,
                f"{fitting(name, LONGEST)} {words.number(amount)} {unit}, {100 * amount / whole:.0f} %",
            )
        )
        inner, outer = inner - amount, outer - amount - GAP * whole
    for place, text in kept_apart(axes, names):
        across, side = (1.02, "left") if right else (-0.02, "right")
        axes.text(across, place, text, transform=axes.transAxes, ha=side, va="center", fontsize=7.5)


def _band(x0: float, x1: float, y0: float, y1: float, width: float) -> Path:
    """From (x0, y0) to (x1, y1), level at both ends, `width` downwards."""
    middle = (x0 + x1) / 2
    upper = [(x0, y0), (middle, y0), (middle, y1), (x1, y1)]
    lower = [(x1, y1 - width), (middle, y1 - width), (middle, y0 - width), (x0, y0 - width)]
    curve = [Path.CURVE4] * 3
    return Path([*upper, *lower, (x0, y0)], [Path.MOVETO, *curve, Path.LINETO, *curve, Path.CLOSEPOLY])
