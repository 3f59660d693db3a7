"""The ranking of causes: evidence as bars, with what chance alone reaches and what a term must exceed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from replay.show.plots.plots import WIDTH
from replay.show.reports import verdict
from replay.show.reports.verdict import against
from replay.show.words import words
from replay.show.words.figure import KEY_ABOVE, FigureTable, Plot, inline_svg, style
from replay.show.words.palette import INK, SERIES, SOFT
from replay.studies.diagnosis.answer import Diagnosis

SHOWN = 12  # bars at most
NAMED, UNKNOWN = "named", "unknown"
ROW, MARGIN = 0.38, 0.8  # inches: height of a bar with its name, of what is above and below
ABOVE = 0.25  # rows: room for the name of the first bar
READING = (
    "ln BF: natural logarithm of how many times better the recordings fit with this cause than without, all "
    "coefficients free; of what was named by leaving it out at the end, of rivals when they were tried. Null: what the "
    "best candidate reaches by chance in 1 of 20 cases where nothing is wrong."
)


@dataclass(frozen=True)
class Bar:
    """One bar: what it stands for, how it ended, its colour."""

    name: str
    log_bayes_factor: float
    ended: str
    colour: str


def ranking(diagnosis: Diagnosis) -> Plot | None:
    """Evidence of named causes, unknown heats and rivals, best first; None where nothing was tried."""
    bars = _bars(diagnosis)
    if not bars:
        return None
    title = _title(diagnosis, bars)
    with style(f"{diagnosis.diagnosis} ranking"):
        svg = inline_svg(_draw(diagnosis, bars), title)
    rows = tuple((bar.name, words.digits(bar.log_bayes_factor), bar.ended) for bar in bars)
    return Plot(title, svg, READING, FigureTable(("cause", "ln BF", "what became of it"), rows))


def _bars(diagnosis: Diagnosis) -> list[Bar]:
    named = [Bar(c.id, c.log_bayes_factor, NAMED, SERIES["green"][0]) for c in diagnosis.causes]
    purple, heats = SERIES["purple"][0], diagnosis.unknown
    unknown = [Bar(f"Unknown heat at {words.name(h.node)}", h.log_bayes_factor, UNKNOWN, purple) for h in heats]
    rivals = [Bar(r.id, r.log_bayes_factor, r.why_not, SOFT[0]) for r in verdict.rivals(diagnosis)]
    return _ranked([*named, *unknown, *rivals[: max(SHOWN - len(named) - len(unknown), 0)]])


def _ranked(bars: Sequence[Bar]) -> list[Bar]:
    return sorted(bars, key=lambda bar: -bar.log_bayes_factor)


def _title(diagnosis: Diagnosis, bars: Sequence[Bar]) -> str:
    limits = against(diagnosis)
    lead = next((bar for bar in bars if bar.ended in (NAMED, UNKNOWN)), None)
    if lead is None:
        best = f"{bars[0].name} at ln BF {words.digits(bars[0].log_bayes_factor)}"
        return f"No candidate was named: the best is {best} ({limits})"
    rivals = [bar.log_bayes_factor for bar in bars if bar.ended not in (NAMED, UNKNOWN)]
    best = f", best rival {words.digits(max(rivals))}" if rivals else ""
    refused = ", refused as told below" * (max(rivals, default=0.0) > lead.log_bayes_factor)
    return f"{lead.name}: ln BF {words.digits(lead.log_bayes_factor)}{best}{refused} ({limits})"


def _draw(diagnosis: Diagnosis, bars: Sequence[Bar]) -> Figure:
    height = ROW * (len(bars) + ABOVE) + MARGIN
    figure = Figure(figsize=(WIDTH, height))
    axes = figure.add_axes((0.02, 0.42 / height, 0.96, (height - MARGIN) / height))
    axes.barh(range(len(bars)), [bar.log_bayes_factor for bar in bars], height=0.3, color=[bar.colour for bar in bars])
    for row, bar in enumerate(bars):
        ended = f", {bar.ended}" if bar.ended in (NAMED, UNKNOWN) else ""
        text = f"{bar.name}: {words.digits(bar.log_bayes_factor)}{ended}"
        axes.annotate(text, (0, row - 0.4), xytext=(2, 0), textcoords="offset points", va="center", fontsize=8)
    _draw_thresholds(axes, diagnosis, len(bars))
    axes.set_ylim(len(bars) - 0.5, -0.5 - ABOVE)
    axes.set_xlim(min(0.0, *(bar.log_bayes_factor for bar in bars)), None)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    axes.set_xlabel("evidence, ln BF")
    return figure


def _draw_thresholds(axes: Axes, diagnosis: Diagnosis, bars: int) -> None:
    """Null and threshold across each bar; not across the names above it."""
    tops, bottoms = ([row + end for row in range(bars)] for end in (-0.22, 0.22))
    for value, text, dashes in (
        (diagnosis.null_log_bayes_factor, "null", (0, (1.4, 1.2))),
        (diagnosis.threshold, "threshold", (0, (5, 1.6))),
    ):
        label = f"{text} {words.digits(value)}"
        axes.vlines([value] * bars, tops, bottoms, color=INK[0], linewidth=1.0, linestyle=dashes, label=label)
    axes.legend(**KEY_ABOVE, ncols=2, handlelength=2.6)
