"""A named cause's law over speed: what its place carries as published, recalibrated, with the cause and by its
rivals."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes

from ingest.texts.units import as_written
from replay.show.plots.compare import MODELS
from replay.show.plots.plots import WIDTH
from replay.show.words import words
from replay.show.words.figure import (
    KEY_ABOVE,
    MOVING,
    FigureTable,
    Plot,
    inline_svg,
    name_lines,
    named,
    panels,
    style,
    tick,
)
from replay.show.words.palette import SERIES, SOFT, rival_lines
from replay.studies.diagnosis.answer import Diagnosis, LawCourse

HEIGHT, LINE = 2.1, 0.17  # inches: of the panel, of a rival's name above it
READING = (
    "All that the place carries, each model by its own fit, without what temperature changes. Green band: 95 % of the "
    "cause's size. Shaded: speeds that the sessions learnt from visited; elsewhere a law is an extrapolation."
)


def law_plots(diagnosis: Diagnosis) -> dict[str, Plot]:
    """Id of a named heat or heat path -> its picture."""
    return {law.cause: _plot(diagnosis, law) for law in diagnosis.laws}


def _plot(diagnosis: Diagnosis, law: LawCourse) -> Plot:
    title = _title(law)
    with style(f"{diagnosis.diagnosis} {law.cause} law"):
        figure, (axes,) = panels(WIDTH, (HEIGHT,), top=0.1 + LINE * len(law.rivals))
        _draw(axes, law)
        svg = inline_svg(figure, title)
    return Plot(title, svg, READING, _table(law))


def _title(law: LawCourse) -> str:
    """ "Rotor surface to teeth at 12,681 rpm and 147 A: 17.5 W/K with the cause (13.2 to 21.7), 9.4 recalibrated"."""
    load = [f"{words.number(round(value))} {as_written(key.rpartition('_')[2])}" for key, value in law.at.items()]
    last = max(i for i, speed in enumerate(law.speed_rpm) if speed <= law.trained_rpm[-1][1])
    at = f"{words.number(round(law.speed_rpm[last]))} rpm and {' and '.join(load)}"
    ends = [words.digits(values[last]) for values in (law.extended, law.low, law.high, law.recalibrated, law.published)]
    found, low, high, recalibrated, published = ends
    place = words.capital(words.name(law.place).replace("-", " to "))
    size = f"{found} {law.unit} with the cause ({low} to {high})"
    return f"{place} at {at}: {size}, {recalibrated} recalibrated, {published} as published"


def _draw(axes: Axes, law: LawCourse) -> None:
    for low, high in law.trained_rpm:
        axes.axvspan(low, high, color=SOFT[0], alpha=0.1, linewidth=0, gid=MOVING)
    band: Any = {"color": SERIES["green"][0], "alpha": 0.18, "linewidth": 0, "gid": MOVING}
    axes.fill_between(law.speed_rpm, law.low, law.high, **band)
    ends = []
    for key, values in (
        ("published", law.published),
        ("recalibrated", law.recalibrated),
        ("extended", law.extended),
    ):
        gid = named(f"{MODELS[key].label} [{law.unit}]")
        axes.plot(law.speed_rpm, values, **MODELS[key].line, gid=gid)
        ends.append((values[-1], MODELS[key].label, MODELS[key].colour))
    for (name, values), line in zip(law.rivals.items(), rival_lines(), strict=False):
        label = f"rival: {name}"
        axes.plot(law.speed_rpm, values, **line, label=label, gid=named(f"{label} [{law.unit}]"))
    if law.rivals:
        axes.legend(**KEY_ABOVE, ncols=1, handlelength=2.6, labelspacing=0.2)
    axes.set_xlim(law.speed_rpm[0], law.speed_rpm[-1])
    axes.set_xlabel("speed [rpm]")
    axes.xaxis.set_major_formatter(tick)
    axes.set_ylabel(f"{'loss' if law.unit == 'W' else 'conductance'}\n[{law.unit}]")
    name_lines(axes, ends)


def _table(law: LawCourse) -> FigureTable:
    head = ("speed [rpm]", *(MODELS[key].label for key in MODELS), "from", "to", *law.rivals)
    columns = [law.published, law.recalibrated, law.extended, law.low, law.high, *law.rivals.values()]
    rows = zip(law.speed_rpm, *columns, strict=True)
    return FigureTable(head, tuple((words.number(round(row[0])), *map(words.digits, row[1:])) for row in rows))
