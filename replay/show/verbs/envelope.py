"""What a motor bears, as JSON, as text as wide as the terminal, and as a picture."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ingest.catalogue.page import table
from replay.show.plots.error_maps import LOAD_NAMES
from replay.show.verbs.intake import session_json
from replay.show.words import words
from replay.show.words.figure import KEY_ABOVE, save, style, tick
from replay.show.words.palette import COLOURS, DASHES, INK, PAPER, SOFT
from replay.show.words.terminal import labelled
from replay.show.words.width import width
from replay.studies.characterise.envelope import DURATIONS_S, Ended, Envelope
from twin.run.envelope import Border

MARKS = {"temperature": "o", "current limit": "s", "load limit": "s", "time": "x"}
WHY = {
    "temperature": "at its temperature limit",
    "current limit": "at the largest current of all sessions",
    "load limit": "at the largest load of all sessions",
    "time": "by time",
}
ENDED = ("pulse", "seconds", "current_A", "speed_rpm", "load", "node", "hottest_degC", "reason")  # keys of `Ended`
ALIKE = 0.03  # pulses whose load and speed differ by less are told together
FITTED = (
    "95 %, from what these sessions leave unknown of the coefficients; errors of the network's form are not in them"
)
UNFITTED = (
    "95 %, from the sd of the motor file, as this model was fitted to nothing: calibrate first, then give that --model"
)
MARKED = (
    "triangle: no limit reached at the most recorded load; o, square, x: S1 sessions and S2 pulses that ended by "
    "temperature, current, time"
)


def document(found: Envelope) -> dict[str, Any]:
    """`whyhot.envelope/1`; `seconds` null where it is continuous."""
    return {
        "schema": "whyhot.envelope/1",
        "motor": found.network.name,
        "model": found.model,
        "load": found.load_column,
        "boundaries_degC": found.boundaries,
        "start_degC": found.start_degC,
        "bands": "sessions" if found.fitted else "motor file",
        "curves": [
            {
                "seconds": None if math.isinf(seconds) else seconds,
                "points": [
                    {
                        "speed_rpm": speed,
                        "load": one.load,
                        "ci95": [one.low, one.high],
                        "node": one.node,
                        "headroom_K": one.headroom_K,
                    }
                    for speed, one in zip(found.speeds_rpm, of_time, strict=True)
                ],
            }
            for seconds, of_time in zip(DURATIONS_S, zip(*found.borders, strict=True), strict=True)
        ],
        "ended": [{**session_json(one.session), **{key: getattr(one, key) for key in ENDED}} for one in found.ended],
    }


def envelope_text(found: Envelope) -> str:
    """What `whyhot envelope` prints. No colours, no trailing newline."""
    lines = labelled("Answer", answer(found))
    lines += ["", *_table(found)]
    lines += ["", *labelled("Held at", _held(found))]
    lines += labelled("Bands", FITTED if found.fitted else UNFITTED)
    for some in together(found.ended):
        lines += labelled("Ended", ending(some, found.load_column))
    return "\n".join(lines)


def answer(found: Envelope) -> str:
    """The largest load that may be held continuously, at which speed, and what limits it."""
    name, unit = LOAD_NAMES[found.load_column]
    held = [(of_speed[0], rpm) for of_speed, rpm in zip(found.borders, found.speeds_rpm, strict=True)]
    most, rpm = max(held, key=lambda one: one[0].load)
    why = f"limited by the {words.name(most.node)}" if most.node else "the most that was recorded there"
    load, band = f"{most.load:.0f} {unit} of {name}", f"{most.low:.0f} to {most.high:.0f}"
    return f"{found.network.name} can hold {load} continuously at {rpm:,.0f} rpm ({band}): {why}."


def duration(seconds: float) -> str:
    return "continuous" if math.isinf(seconds) else f"{seconds:.0f} s"


def _table(found: Envelope) -> Iterator[str]:
    unit = LOAD_NAMES[found.load_column][1]
    rows = [
        (f"{speed:,.0f} rpm", *map(load_says, of_speed))
        for speed, of_speed in zip(found.speeds_rpm, found.borders, strict=True)
    ]
    head = (f"{unit} held at", *map(duration, DURATIONS_S))
    yield from table(head, rows, width(), right=range(1, len(head)))
    told = [cell for row in rows for cell in row[1:]]
    if any(cell.startswith("at least") for cell in told):
        yield from textwrap.wrap("at least: with the largest load recorded at that speed no limit is reached", width())
    if "no load" in told:
        yield "no load: none was recorded at that speed"
    nodes = {one.node for of_speed in found.borders for one in of_speed if one.node}
    yield f"limited by {words.joined(sorted(map(words.name, nodes)))}" if nodes else "no node reaches its limit"


def load_says(one: Border) -> str:
    """ "17 (15 to 19)", or "at least 17" where no limit was reached; the band stands where it is one. "no load" at a
    speed at which none was recorded."""
    if one.node is None and round(one.load) <= 0:
        return "no load"
    load, low, high = (f"{value:.0f}" for value in (one.load, one.low, one.high))
    return f"{'at least ' if one.node is None else ''}{load}" + (f" ({low} to {high})" if low != high else "")


def _held(found: Envelope) -> str:
    around = words.joined([f"{words.name(name)} {value:.0f} °C" for name, value in found.boundaries.items()])
    return f"{around}; seconds are counted from rest in equilibrium with them ({found.start_degC:.0f} °C)"


def together(found: Sequence[Ended]) -> list[list[Ended]]:
    """Pulses of one session at one load and speed that ended for one reason; each S1 session by itself."""
    groups: list[list[Ended]] = []
    for one in found:
        like = next((some for some in groups if one.pulse is not None and _alike(one, some[0])), None)
        if like is None:
            groups.append([one])
        else:
            like.append(one)
    return groups


def _alike(one: Ended, other: Ended) -> bool:
    return (
        (one.session.session, one.reason) == (other.session.session, other.reason)
        and abs(one.load - other.load) <= ALIKE * other.load
        and abs(one.speed_rpm - other.speed_rpm) <= ALIKE * other.speed_rpm
    )


def ending(some: Sequence[Ended], load_column: str) -> str:
    """How a session, or pulses of it that are told together, ended and why; how hot the hottest of them was."""
    unit = LOAD_NAMES[load_column][1]
    one = max(some, key=lambda e: -math.inf if e.hottest_degC is None else e.hottest_degC)
    hot = f"{words.name(one.node)} {one.hottest_degC:.0f} °C, " if one.node and one.hottest_degC is not None else ""
    amps = "" if one.current_A is None or load_column == "current_A" else f" and {one.current_A:.0f} A"
    subject = f"{one.session.name} ({one.session.kind}){_which(some)}"
    return f"{subject} {WHY[one.reason]}: {hot}{one.load:.0f} {unit}{amps} at {one.speed_rpm:,.0f} rpm"


def _which(some: Sequence[Ended]) -> str:
    """ " pulses 1, 2 and 4 of 60 s"; nothing for a whole session."""
    if some[0].pulse is None:
        return ""
    lengths = sorted(round(one.seconds) for one in some)
    long = f"{lengths[0]} s" if lengths[0] == lengths[-1] else f"{lengths[0]} to {lengths[-1]} s"
    return f" pulse{'s' if len(some) > 1 else ''} {words.joined([str(one.pulse) for one in some])} of {long}"


def picture(found: Envelope, target: Path) -> None:
    """Load over speed with bands and the S1 and S2 sessions, on white: `target` with the suffixes .svg and .png."""
    name, unit = LOAD_NAMES[found.load_column]
    speeds = np.array(found.speeds_rpm)
    with style("envelope"):
        figure = Figure(figsize=(9.0, 5.0), facecolor=PAPER[0])
        axes = figure.add_axes((0.08, 0.14, 0.89, 0.71))
        curves = zip(*found.borders, strict=True)
        for of_time, seconds, colour, dashes in zip(curves, DURATIONS_S, COLOURS, DASHES, strict=False):
            low, high = [b.low for b in of_time], [b.high for b in of_time]
            axes.fill_between(speeds, low, high, color=colour, alpha=0.15, linewidth=0)
            axes.plot(speeds, [b.load for b in of_time], color=colour, linestyle=dashes, label=duration(seconds))
            open_ended = [(s, b.load) for s, b in zip(speeds, of_time, strict=True) if b.node is None]
            if open_ended:
                axes.plot(*zip(*open_ended, strict=True), linestyle="", marker="^", markersize=5, color=colour)
        for one, *_ in together(found.ended):
            axes.plot([one.speed_rpm], [one.load], linestyle="", marker=MARKS[one.reason], color=INK[0], markersize=5)
            place = (one.speed_rpm, one.load)
            axes.annotate(one.session.name, place, xytext=(6, -3), textcoords="offset points", fontsize=7)
        axes.set_xlabel("speed [rpm]")
        axes.xaxis.set_major_formatter(tick)
        axes.set_ylabel(f"{name} [{unit}]")
        axes.set_xlim(0.0, None)
        axes.set_ylim(0.0, None)
        axes.legend(**KEY_ABOVE, ncols=4)
        figure.text(0.08, 0.95, textwrap.fill(answer(found), 95), fontsize=9.5, fontweight="bold", va="center")
        notes = (f"band: {(FITTED if found.fitted else UNFITTED).split(':')[0]}", MARKED)
        figure.text(0.08, 0.012, "\n".join(notes), fontsize=6.5, color=SOFT[0])
        save(figure, target)
