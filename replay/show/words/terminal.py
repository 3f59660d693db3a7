"""The replay as text as wide as the terminal: the answer first, the next command last."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from ingest.texts.names import first_of
from ingest.texts.times import clock
from replay.engine.results.summary import ChannelErrors, Summary
from replay.show.words import heat_words, words
from replay.show.words.filter_words import asked_for, checked, left_out
from replay.show.words.findings import answer, direction, is_moved, mean_error, place_of, power_balance, worst_first
from replay.show.words.width import width
from twin.filters.by_filterpy import Apart

INDENT = 18
LEFT_OUT = 3  # sessions of which it is told what was not replayed
NAME = 40  # characters of a session's name before its line
NUMBER_AND_UNIT = re.compile(
    r"(?<=\d) (?=(?:K|°C|degC|W|kW|W/K|J/K|A|Nm|rpm|l/min|%|s|min|h)(?!\w))|(?<=\d) (?=-> \d)|(?<=\d ->) (?=\d)"
)


def replay_text(
    summaries: Sequence[Summary], next_command: str, checks: Mapping[str, Apart | None] = MappingProxyType({})
) -> str:
    """What `whyhot replay` prints: answer, at most four lines a session, what was asked for by its options, the next
    command; the report says the rest. No colours, no trailing newline. `checks`: session name -> how far filterpy's
    filter is from its own, None where no filter ran."""
    lines = labelled("What is wrong", answer(summaries))
    for summary in summaries:
        lines += ["", *_session(summary)]
    for text in power_balance(summaries):
        lines += ["", *labelled("Power balance", text)]
    if notes := [f"{one.session_name}: {one.note}" for one in summaries if one.note]:
        lines += ["", *labelled("Left out", first_of(notes, LEFT_OUT, ". "))]
    for label, text in _asked(summaries, checks):
        lines += ["", *labelled(label, text)]
    return "\n".join([*lines, "", *labelled("Next", next_command)])


def labelled(label: str, *texts: str) -> list[str]:
    """Paragraphs beside their label, wrapped; a number and its unit, and "6.1 -> 0.9 K", stay on one line."""
    how = {"break_long_words": False, "break_on_hyphens": False}
    lines = [line for text in texts for line in _wrapped(text, width() - INDENT, **how) or [""]]
    return [f"{label if i == 0 else '':<{INDENT}}{line}".rstrip() for i, line in enumerate(lines)]


def _wrapped(text: str, columns: int, **how: Any) -> list[str]:
    bound = NUMBER_AND_UNIT.sub("\N{NO-BREAK SPACE}", text)
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in textwrap.wrap(bound, columns, **how)]


def _asked(summaries: Sequence[Summary], checks: Mapping[str, Apart | None]) -> Iterator[tuple[str, str]]:
    """A paragraph, with its label, for each option that asks something of the replay."""
    if told := [f"{one.session_name} {far}" for one in summaries if (far := integrator_says(one))]:
        yield "Integrator", "; ".join(told)
    if told := [f"{one.session_name}: {'; '.join(found)}" for one in summaries if (found := asked_for(one))]:
        yield "Asked for", ". ".join(told)
    if checks:
        yield "Filter check", checked(checks)


def integrator_says(summary: Summary) -> str | None:
    """ "bdf2: up to 0.31 K from sdirk2, at the rotor at 0:10:00"; None of a run by the default integrator."""
    other = summary.integrator
    if other is None:
        return None
    place = f"at the {words.name(other.node)} at {clock(other.at_s)}"
    return f"{other.name}: up to {other.error_K:.2f} K from {other.against}, {place}"


def _session(summary: Summary) -> list[str]:
    """What was measured, what the model gets wrong, and what it says of places without a sensor; at most four lines."""
    name = summary.session_name
    head = name if len(name) <= NAME else f"{name[: NAME - 1]}…"
    model = f"model {summary.motor} {words.short(summary.model)}"
    about = [*_measured(summary), f"{summary.kind}, {words.duration(summary.duration_s)}", model]
    banded = any(spot.ci95_degC for spot in summary.hot_spots.values())
    by = "by model, 95 %" if banded else "by the model"
    errors = _errors(summary) or ["unknown, as no channel observes a node with usable samples"]
    notes = left_out(summary)
    return [
        *_cut(f"{head}   ", about, 1),
        *_cut("  model, on average: ", errors, 1 if notes else 2),
        *_cut(f"  hottest {by}: ", heat_words.in_brief(summary), 1),
        *_cut("  ", notes, 1),
    ]


def _cut(lead: str, parts: Sequence[str], most: int) -> list[str]:
    """At most `most` lines as wide as the terminal; "…" in place of the last parts where that was too little."""
    for told in range(len(parts), 0, -1):
        shown = [*parts[:told], *["…"] * (told < len(parts))]
        lines = _wrapped(lead + "; ".join(shown), width(), subsequent_indent="    ")
        if len(lines) <= most:
            return lines
    text = lead + "; ".join(parts)  # not even the first one fits
    return _wrapped(text, width(), subsequent_indent="    ", max_lines=most, placeholder=" …") if parts else []


def _measured(summary: Summary) -> list[str]:
    """The highest reading, then those above the limits of their nodes; nothing of runs that were sealed without."""
    limits = {node: one.limit_degC for node, one in summary.limits.items()}
    known = [(one, one.measured_max_degC) for one in summary.channels if one.measured_max_degC is not None]
    ranked = sorted(known, key=lambda item: -item[1])
    above = [(one, degC) for one, degC in ranked[1:] if degC > limits.get(one.node, degC)]
    return [_reading(one, degC, limits.get(one.node), summary) for one, degC in ranked[:1] + above]


def _reading(one: ChannelErrors, degC: float, limit_degC: float | None, summary: Summary) -> str:
    """ "magnet measured up to 143.2 °C at 1:02:03, 6.8 K under its limit"."""
    corrected = " (reading corrected)" if is_moved(one) else ""
    margin = "" if limit_degC is None else f", {heat_words.margin(limit_degC - degC)}"
    at = clock(one.measured_max_at_s or 0.0)
    return f"{place_of(one, summary)} measured up to {degC:.1f} °C at {at}{corrected}{margin}"


def _errors(summary: Summary) -> list[str]:
    """Where the model is off, furthest first; other meters; what is within the sensors' floor; masked steps."""
    errors = worst_first(summary)
    fine = [one for one in errors if one.within_floor]
    told = [_wrong(one, summary) for one in errors if not one.within_floor]
    told += [heat_words.meter(one) for one in sorted(summary.meters, key=lambda one: one.within_floor)]
    if fine:
        floor = words.kelvin(max(one.floor_K for one in fine))
        told += [
            f"{words.joined([place_of(one, summary) for one in fine])} within the sensors' own uncertainty ({floor})"
        ]
    return told + [f"{one.masked:,} steps of {one.channel} masked" for one in errors if one.masked]


def _wrong(one: ChannelErrors, summary: Summary) -> str:
    return f"{place_of(one, summary)} {mean_error(one)} {direction(one)} ({words.kelvin(one.max_K)} at worst)"
