"""One plot of the report: a matplotlib figure drawn without global state, as SVG that follows the page's colours."""

from __future__ import annotations

import html
import io
import re
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unicodedata import east_asian_width

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path
from scipy.optimize import isotonic_regression

from ingest.texts.plain import plain, plain_line
from replay.show.words.palette import INK, SOFT, with_variables
from replay.written import write, written

FONT = "DejaVu Sans"
STYLE: Any = {
    "svg.fonttype": "none",
    "font.family": ["sans-serif"],
    "font.sans-serif": [FONT],  # laid out with this; the page shows its own system font
    "font.size": 8.5,
    "text.parse_math": False,  # names may hold a dollar sign
    "text.color": INK[0],
    "axes.edgecolor": SOFT[0],
    "axes.labelcolor": INK[0],
    "axes.facecolor": "none",
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "axes.unicode_minus": True,
    "figure.facecolor": "none",
    "grid.color": SOFT[0],
    "grid.alpha": 0.25,
    "grid.linewidth": 0.5,
    "hatch.color": SOFT[0],
    "hatch.linewidth": 0.4,
    "lines.linewidth": 1.2,
    "lines.scale_dashes": True,
    "path.simplify": True,
    "xtick.color": INK[0],
    "ytick.color": INK[0],
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
}
KEY_ABOVE: Any = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "frameon": False, "borderpad": 0}  # of a key
BEHIND: Any = {"xytext": (5, 0), "textcoords": "offset points", "va": "center", "fontsize": 7}  # a bar
BAND: Any = {"color": SOFT[0], "alpha": 0.22, "linewidth": 0}  # within which nothing can be told
LINE_ID, AXES_ID = "line: ", "axes: "  # how ids begin that tell the page's script what a line and its axes are
MOVING = "band: "  # the id of what else moves along the axis with the lines: a band, a shade, rows of colours
PART_ID, FLOW_ID, SAYS_ID = "part: ", "flow: ", "says: "  # and what changes over time: an area, a width, a name
HOOKS = {LINE_ID: "data-line", AXES_ID: "data-axes", MOVING: "data-band", "xtick_": "data-tick"}
HOOKS |= {PART_ID: "data-part", FLOW_ID: "data-flow", SAYS_ID: "data-says"}
LEFT, BOTTOM = 0.112, 0.42  # share of the width, inches: for the axes' titles
RIGHT = 0.835  # share of the width at which the axes end: names stand behind it
LONGEST = 18  # letters of a name there; a longer or wider one loses its middle
LETTER_EM = 0.55  # width of a usual letter
LINE = 11 / 72  # inches: height of a name at the end of a line


@dataclass(frozen=True)
class FigureTable:
    """The data behind a plot, as text: `rows` are as long as `head`."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Plot:
    """A plot of the report: the title says the finding, the note how to read it."""

    title: str
    svg: str
    note: str
    table: FigureTable


@contextmanager
def style(key: str) -> Iterator[None]:
    """Draw inside this. `key` makes the ids within the SVG, so that plots on one page cannot mix theirs up. Raises
    OSError where the font cannot be read."""
    with matplotlib.rc_context(STYLE | {"svg.hashsalt": key}), warnings.catch_warnings(), _font_read():
        warnings.filterwarnings("ignore", message="Glyph .* missing")  # the page's font has it
        yield


@contextmanager
def _font_read() -> Iterator[None]:
    """Raises the OSError of a font that is read in here: letters are read as they are drawn, where matplotlib prints
    the error and draws on, or says only that there is no such letter."""
    lost: list[BaseException] = []
    said, sys.unraisablehook = sys.unraisablehook, lambda told: _keep(lost, told) or said(told)
    try:
        yield
    except RuntimeError:
        if not lost:
            raise
    finally:
        sys.unraisablehook = said
    if lost:
        raise lost[0]


def _keep(lost: list[BaseException], told: sys.UnraisableHookArgs) -> bool:
    """Whether what Python could not raise is an OSError, which is kept then."""
    if found := isinstance(told.exc_value, OSError):
        lost.append(told.exc_value)
    return found


def panels(width: float, heights: Sequence[float], top: float = 0.28) -> tuple[Figure, list[Axes]]:
    """Panels over one another with one time axis [inches; `top` for key and title], and room for names at the right."""
    figure = Figure()
    grid: dict[str, Any] = {"height_ratios": list(heights), "left": LEFT, "right": RIGHT, "hspace": 0.14}
    total = sum(heights) + top + BOTTOM
    grid |= {"top": 1 - top / total, "bottom": BOTTOM / total}
    figure.set_size_inches(width, total)
    axes = figure.subplots(len(heights), 1, sharex=True, squeeze=False, gridspec_kw=grid)
    for ax in axes[:, 0]:
        ax.yaxis.set_label_coords(-0.094, 0.5)
    return figure, list(axes[:, 0])


def save(figure: Figure, target: Path) -> None:
    """As `target` with the suffixes .svg and .png; the same figure gives the same bytes."""
    save_svg(figure, target.with_suffix(".svg"))
    with written(target.with_suffix(".png")) as part:
        figure.savefig(part, format="png", dpi=200, metadata={"Software": None})


def _svg(figure: Figure, metadata: dict[str, None]) -> str:
    """The text of the figure as SVG; no name in it steers who reads it, or is what XML does not take."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata=metadata)
    return plain(buffer.getvalue())


def save_svg(figure: Figure, target: Path) -> None:
    """The same figure gives the same bytes."""
    write(target, _svg(figure, {"Date": None}))


def inline_svg(figure: Figure, label: str) -> str:
    """The figure as an `<svg>` element for a page, in its font and colours: no prolog, two decimals, no ids but those
    it refers to."""
    for axes in figure.axes:
        if any((drawn.get_gid() or "").startswith((LINE_ID, MOVING)) for drawn in axes.get_children()):
            edges = (*axes.get_xlim(), *axes.get_ylim())
            axes.set_gid(AXES_ID + " ".join(f"{edge:.9g}" for edge in edges))
    text = _svg(figure, {"Date": None, "Creator": None, "Type": None, "Format": None})
    text = text[text.index("<svg") :]
    referred = set(re.findall(r"#\w+", text))
    text = re.sub(r"\s*<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    for told, attribute in HOOKS.items():
        text = text.replace(f' id="{told}', f' {attribute}="')
    text = re.sub(r" id=\"([^\"]*)\"", lambda m: m[0] if f"#{m[1]}" in referred else "", text)
    text = re.sub(r" d=\"[^\"]*\"", lambda m: re.sub(r"(\.\d\d)\d+", r"\1", m[0]), text)
    text = text.replace("xlink:href", "href").replace(f"'{FONT}'", "system-ui").replace("\n", " ")
    box = re.search(r"viewBox=\"[^\"]*\"", text)
    assert box is not None, "matplotlib writes a viewBox"
    opening = f'<svg {box[0]} role="img" aria-label="{html.escape(plain(label))}">'
    return with_variables(opening + re.sub(r" {2,}", " ", text[text.index(">") + 1 :]))


def named(name: str) -> str:
    """The `gid` of a line that a reader of the page can read values off, hide and take out as CSV under this name."""
    return f"{LINE_ID}{name}"


def name_lines(axes: Axes, names: Sequence[tuple[float, str, str]]) -> None:
    """Names at the right end of lines: (y in data units, text, colour), moved as little as keeps them apart."""
    ranked = sorted(names)
    for (place, text), (_, _, colour) in zip(
        kept_apart(axes, [(y, text) for y, text, _ in ranked]), ranked, strict=True
    ):
        axes.annotate(
            fitting(text), (1.01, place), xycoords="axes fraction", va="center", color=colour, annotation_clip=False
        )


def kept_apart(axes: Axes, names: Sequence[tuple[float, str]]) -> list[tuple[float, str]]:
    """Names beside the axes, from below: (y in data units, text) as (share of the axes' height, text), moved as little
    as keeps them apart."""
    low, high = axes.get_ylim()
    ranked = sorted(names)
    figure = axes.get_figure(root=True)
    assert figure is not None, "axes are drawn in a figure"
    height = axes.get_position().height * figure.get_figheight()
    spread = LINE / height * np.arange(len(ranked))
    free = max(0.0, 1.0 - float(spread[-1])) if ranked else 0.0  # so that none stands beside the panel above or below
    wanted = np.array([(y - low) / (high - low) for y, _ in ranked])
    places = isotonic_regression(np.clip(wanted - spread, 0.0, free)).x + spread
    return [(float(place), text) for place, (_, text) in zip(places, ranked, strict=True)]


def tick(value: float, _: object) -> str:
    """What stands at a tick of an axis: no digit is lost that tells it from the next, thousands are apart."""
    return f"{value:,.10g}".replace("-", "−")


def fitting(name: str, longest: int = LONGEST) -> str:
    """A name as it is shown, in the room that so many usual letters take: both ends tell it from its neighbours."""
    shown = plain_line(name)
    for length in range(min(len(shown), longest), 1, -1):
        cut = shown if length == len(shown) else f"{shown[: length - length // 2 - 1]}…{shown[-(length // 2) :]}"
        if _ems(cut) <= LETTER_EM * longest:
            return cut
    return shown[:1]


def _ems(text: str) -> float:
    """How wide a text is, in font sizes; East Asian letters, which the font does not have, as wide as a W."""
    drawn = "".join("W" if east_asian_width(letter) in "WF" else letter for letter in text)
    return float(
        text_to_path.get_text_width_height_descent(drawn, FontProperties(family=FONT, size=1.0), ismath=False)[0]
    )
