"""The replay as text as wide as the terminal: the answer first, the next command last."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

from replay.engine.results.summary import ChannelErrors, Summary
from replay.show.words import heat_words, words
from replay.show.words.filter_words import checked, filter_says
from replay.show.words.findings import answer, direction, mean_error, power_balance, worst_first
from replay.show.words.width import width
from twin.filters.by_filterpy import Apart

INDENT = 18
NUMBER_AND_UNIT = re.compile(
    r"(?<=\d) (?=(?:K|°C|degC|W|kW|W/K|J/K|A|Nm|rpm|l/min|%|s|min|h)(?!\w))|(?<=\d) (?=-> \d)|(?<=\d ->) (?=\d)"
)


def replay_text(
    summaries: Sequence[Summary], next_command: str, checks: Mapping[str, Apart | None] = MappingProxyType({})
) -> str:
    """What `whyhot replay` prints: answer, a few lines a session, the next command. No colours, no trailing newline.
    `checks`: session name -> how far filterpy's filter is from its own, None where no filter ran."""
    lines = labelled("What is wrong", answer(summaries))
    for summary in summaries:
        lines += ["", *_session(summary)]
    for text in power_balance(summaries):
        lines += ["", *labelled("Power balance", text)]
    if checks:
        lines += ["", *labelled("Filter check", checked(checks))]
    return "\n".join([*lines, "", *labelled("Next", next_command)])


def labelled(label: str, text: str) -> list[str]:
    """A paragraph beside its label, wrapped; a number and its unit, and "6.1 -> 0.9 K", stay on one line."""
    bound = NUMBER_AND_UNIT.sub("\N{NO-BREAK SPACE}", text)
    wrapped = textwrap.wrap(bound, width() - INDENT, break_long_words=False, break_on_hyphens=False) or [""]
    lines = [f"{label if i == 0 else '':<{INDENT}}{line}".rstrip() for i, line in enumerate(wrapped)]
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in lines]


def _session(summary: Summary) -> Iterator[str]:
    model = f"model {summary.motor} {words.short(summary.model)}"
    head = f"{summary.kind}, {words.duration(summary.duration_s)}, {model}, digest {words.short(summary.digest)}"
    yield from textwrap.wrap(f"{summary.session_name}   {head}", width(), subsequent_indent="  ")
    if (other := summary.integrator) is not None:
        place = f"at the {words.name(other.node)} at {words.clock(other.at_s)}"
        yield f"  {other.name}: up to {other.error_K:.2f} K from {other.against}, {place}"
    errors = worst_first(summary)
    if not errors:
        yield "  no channel of this session observes a node of the model with usable samples"
        yield from _beside(summary)
        return
    labels = [_label(error, errors) for error in errors]
    wide = max(map(len, labels))
    yield f"  {'':<{wide}}   {'mean':>7}  {'worst':>7}  {'bias':>7}   measured minus model"
    for label, error in zip(labels, errors, strict=True):
        figures = (words.kelvin(error.mae_K), words.kelvin(error.max_K), words.signed_kelvin(error.bias_K))
        mean, worst, bias = (f"{figure:>7}" for figure in figures)
        yield from _row(f"  {label:<{wide}}   {mean}  {worst}  {bias}   ", _verdict(error))
    yield from _beside(summary)


def _beside(summary: Summary) -> Iterator[str]:
    """What other meters say, heat, hot spots, what the filter makes of them, limits and derating."""
    for one in summary.meters:
        yield from _row(f"  {one.channel} ({one.quantity})   ", heat_words.meter(one))
    for text in (*heat_words.aged(summary), *heat_says(summary)):
        yield from _row("  ", text)


def heat_says(summary: Summary) -> list[str]:
    """What a run says of heat, hot spots, its filter, limits and derating, a sentence each."""
    told = [heat_words.heat(summary), heat_words.hottest(summary), *filter_says(summary)]
    return [text for text in (*told, *heat_words.above_limits(summary), *heat_words.derating(summary)) if text]


def _label(error: ChannelErrors, errors: Sequence[ChannelErrors]) -> str:
    shared = sum(other.node == error.node for other in errors) > 1
    return f"{words.name(error.node)} ({error.channel})" if shared else words.name(error.node)


def _verdict(error: ChannelErrors) -> str:
    place = words.where(error.where)
    most = f"most {place}" if place else f"worst at {words.clock(error.max_at_s)}"
    verdict = f"model {direction(error)}, {most}"
    if error.within_floor:
        verdict = f"within its floor ({words.kelvin(error.floor_K)})"
    beside = f"; mean {told}" if (told := mean_error(error)) != words.kelvin(error.mae_K) else ""
    return verdict + beside + (f"; {error.masked:,} steps masked" if error.masked else "")


def _row(start: str, text: str) -> list[str]:
    lines = textwrap.wrap(text, max(width() - len(start), 20), break_long_words=False, break_on_hyphens=False)
    return [f"{start if i == 0 else ' ' * len(start)}{line}" for i, line in enumerate(lines)]
