"""What the next test would show: a sensor's reading by each model, and how far apart these are."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from replay.show.plots.compare import MODELS
from replay.show.plots.plots import WIDTH, around_zero
from replay.show.words import words
from replay.show.words.figure import KEY_ABOVE, FigureTable, Plot, inline_svg, named, panels, style
from replay.show.words.palette import rival_lines
from replay.studies.diagnosis.answer import Diagnosis, ForeseenTest

LINE = 0.17  # inches: of a model's name above the panels
RECALIBRATED = "recalibrated"


def foreseen_plot(diagnosis: Diagnosis) -> Plot | None:
    """Readings above, below them how far each is from the first of the causes; None where there is no next test."""
    test = diagnosis.foreseen
    if test is None:
        return None
    causes = [cause.id for cause in diagnosis.causes if cause.id in test.reads]
    first = [name for name in (RECALIBRATED, *causes) if name in test.reads]
    test = replace(test, reads={name: test.reads[name] for name in dict.fromkeys([*first, *test.reads])})
    to = (causes or [*test.reads])[0]
    title = _title(test, to)
    with style(f"{diagnosis.diagnosis} foreseen"):
        figure, (upper, lower) = panels(WIDTH, (1.3, 1.0), top=0.1 + LINE * len(test.reads))
        around_zero(lower, test.floor_K)
        minutes, reference = np.array(test.t_s) / 60, np.array(test.reads[to])
        others = iter(rival_lines())
        for name, reads in test.reads.items():
            line: dict[str, Any] = _line(name, causes) or next(others)
            label = _called(name, causes)
            upper.plot(minutes, reads, **line, label=label, gid=named(f"{label} [°C]"))
            lower.plot(minutes, np.array(reads) - reference, **line, gid=named(f"{label}, apart [K]"))
        upper.legend(**KEY_ABOVE, ncols=1, handlelength=2.6, labelspacing=0.2)
        upper.set_ylabel(f"{test.channel}\n[°C]")
        lower.set_ylabel("apart [K]")
        lower.set_xlabel("time since start [min]")
        lower.set_xlim(0, minutes[-1])
        svg = inline_svg(figure, title)
    note = (
        f"Below: each reading less the one {_called(to, causes)}. Grey: what {test.channel} may be off, one standard "
        "deviation. Nothing is fitted on the test, as its inputs are known beforehand."
    )
    return Plot(title, svg, note, _table(test, causes))


def _line(name: str, causes: list[str]) -> dict[str, Any] | None:
    key = RECALIBRATED if name == RECALIBRATED else "extended" if name in causes else None
    return MODELS[key].line if key else None


def _called(name: str, causes: list[str]) -> str:
    if name == RECALIBRATED:
        return "recalibrated, without a cause"
    return f"with {name}" if name in causes else f"if it were {name}"


def _title(test: ForeseenTest, to: str) -> str:
    """ "S1 at 12,681 rpm and 0 A, 60 min: if it is not ..., MAG reads 1.5 to 5.7 K otherwise, 3 times what it ..."."""
    reference = np.array(test.reads[to])
    apart = {name: float(np.abs(np.array(reads) - reference).max()) for name, reads in test.reads.items() if name != to}
    nearest, furthest = min(apart.values()), max(apart.values())
    low, span = words.kelvin(nearest).removesuffix(" K"), words.kelvin(furthest)
    span = span if span.startswith(low) else f"{low} to {span}"
    off = f"at least {nearest / test.floor_K:.0f} times what it may be off"
    if nearest < 2 * test.floor_K:
        off = f"where it may be off by {words.kelvin(test.floor_K)}"
    truth = "there is a cause" if to == RECALIBRATED else f"it is not {to}"
    return f"{test.says}: if {truth}, {test.channel} reads {span} otherwise, {off}"


def _table(test: ForeseenTest, causes: list[str]) -> FigureTable:
    head = ("time [min]", *(f"{_called(name, causes)} [°C]" for name in test.reads))
    rows = zip(test.t_s, *test.reads.values(), strict=True)
    return FigureTable(
        head, tuple((f"{row[0] / 60:.1f}", *(words.fixed(value, 2) for value in row[1:])) for row in rows)
    )
