"""What each sensor is worth, as JSON and as text as wide as the terminal."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import takewhile
from textwrap import wrap
from typing import Any

from ingest.catalogue.page import table
from replay.show.words import words
from replay.show.words.terminal import labelled
from replay.show.words.width import width
from replay.studies.characterise.bands import LEAST_OTHERS, student
from replay.studies.characterise.sensors import TOLERATED_K, Worth

LEAST_COVERED = 0.9  # coverage of a 95 % band below which it is said to be too narrow


def document(found: Worth) -> dict[str, Any]:
    """`whyhot.sensors/1`."""
    margin = found.margin
    return {
        "schema": "whyhot.sensors/1",
        "motor": found.network.name,
        "model": found.model,
        "sessions": [session.session for session in found.sessions],
        "heat_at": found.node,
        "withheld": [vars(one) for one in found.withheld],
        "done_without": [vars(one) for one in found.order],
        "dispensable": dispensable(found),
        "margin": None if margin is None else {**vars(margin), "channels": list(margin.channels)},
    }


def dispensable(found: Worth) -> list[str]:
    """The channels that can go one after the other while each one gone is estimated to a mean of 2 K."""
    return [one.channel for one in takewhile(lambda one: one.worst_mae_K <= TOLERATED_K, found.order)]


def sensors_text(found: Worth) -> str:
    """What `whyhot sensors` prints. No colours, no trailing newline."""
    lines = labelled("Answer", answer(found))
    lines += ["", *_table(found)]
    for text in band_notes(found):
        lines += labelled("Bands", text)
    lines += ["", *_order(found)]
    for text in margin_notes(found):
        lines += ["", *labelled("Margin", text)]
    return "\n".join(lines)


def answer(found: Worth) -> str:
    """How many could go, and the one that is missed most."""
    gone = dispensable(found)
    most = max(found.withheld, key=lambda one: one.mae_K)
    channels = words.counted(len(found.withheld), "channel")
    within = f"estimated to {TOLERATED_K:.0f} K or better in the mean"
    could = f"Of {channels} {words.joined(gone)} could be removed: each is then still {within}."
    none = f"None of {channels} could be removed and still be {within}."
    off = f"what is estimated in its place is {words.kelvin(most.mae_K)} off in the mean"
    missed = f"Removed alone, {most.channel} ({words.name(most.node)}) is missed most: {off}."
    return f"{could if gone else none} {missed}"


def _table(found: Worth) -> Iterator[str]:
    rows = []
    for one in sorted(found.withheld, key=lambda one: -one.mae_K):
        narrow = ": too narrow" if one.covered < LEAST_COVERED else ""
        errors = [words.kelvin(error) for error in (one.mae_K, one.max_K, one.open_loop_K)]
        covered = f"{100 * one.covered:.0f} % in {words.counted(one.sessions, 'session')}{narrow}"
        rows.append((_label(one.channel, one.node), *errors, f"± {words.kelvin(one.band_K)}", covered))
    yield from table(
        ("Withheld", "mean error", "worst", "open loop", "95 % band", "time within it"), rows, width(), (1, 2, 3, 4)
    )


def band_notes(found: Worth) -> Iterator[str]:
    """Where bands come from: few sessions make them wide, and some channels have too few for any but the filter's."""
    if others := sorted({one.sessions - 1 for one in found.withheld if one.widened}):
        factors = words.joined([f"{student(count):.1f} with {count}" for count in others])
        yield (
            f"each session's from the errors in the others, times Student's factor ({factors}): few sessions make "
            "wide bands"
        )
    alone = [one.channel for one in found.withheld if not one.widened]
    if alone:
        whose = "" if len(alone) == len(found.withheld) else f" for {words.joined(alone)}"
        yield (
            f"the filter's own{whose}: they hold noise, and not what the model gets wrong, so they may be too narrow; "
            f"wider ones come from the errors in other sessions, and need {LEAST_OTHERS + 1} sessions with the channel"
        )


def _label(channel: str, node: str) -> str:
    return f"{words.name(node)} ({channel})"


def _order(found: Worth) -> Iterator[str]:
    yield from wrap("Removed one after the other, with the worst mean error of those removed", width())
    for i, one in enumerate(found.order):
        left = len(found.withheld) - 1 - i
        yield f"  {one.channel:<20} {words.kelvin(one.worst_mae_K):>7}   {words.counted(left, 'channel')} left"


def margin_notes(found: Worth) -> Iterator[str]:
    """The margin from a vehicle's channels to the hot spot, or how to get it."""
    margin = found.margin
    if margin is None:
        yield (
            "no channel is of level production: say which a vehicle has with --vehicle CHANNEL, or level = "
            '"production" in the bench file'
        )
        return
    yield (
        f"from {words.joined(list(margin.channels))} to the hottest winding (mostly {words.name(margin.hottest)}), "
        f"passed in {100 * margin.risk:g} % of the time: {words.kelvin(margin.from_sensor_K)} above the hottest "
        f"reading, {words.kelvin(margin.from_filter_K)} above what a filter makes of the readings"
    )
