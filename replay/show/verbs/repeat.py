"""What `whyhot repeat` says: how far two runs were driven alike, what differs beyond its floor, and since when."""

from __future__ import annotations

import shlex

from ingest.catalogue.page import table
from ingest.morning.differences import CellDifference, ChannelDifference
from ingest.morning.repeat import Comparison, Repeat
from ingest.texts.units import as_written
from replay.show.words import words
from replay.show.words.terminal import labelled
from replay.show.words.width import width

AXES = {"speed": "rpm", "torque": "Nm", "current": "A", "oven": "°C"}
NAMES = "A [[change]] in the bench file says that a signal was renamed."
NOTHING = 1e-9  # what rounding leaves of equal runs
SHOWN = 12  # channels; the JSON has all


def repeat_text(found: Repeat) -> str:
    """The answer first, then how it was compared, every channel, and what the ledger knows to have changed."""
    first, second = found.first.name, found.second.name
    lines = labelled("Answer", answer(found))
    lines += labelled("Driven alike", alike(found.beside, first, second))
    lines += labelled("Floor", floor(found))
    lines += ["", *channel_lines(found.beside, first, second)] if found.beside.channels else []
    lines += [line for says in not_compared(found) for line in ("", *labelled("Not compared", says))]
    lines += ["", *labelled("Changed", *change_says(found))]
    return "\n".join([*lines, "", f"next: whyhot show {shlex.quote(second)}"])


def answer(found: Repeat) -> str:
    """What exceeds its floor, and since when."""
    second, beside = found.second.name, found.beside
    if not beside.channels:
        return (
            f"nothing of {second} can be compared with {found.first.name}: no channel is called alike in both. {NAMES}"
        )
    if not beside.exceeding:
        return f"{second} reads as {found.first.name} where both were driven alike{floor_kept(beside)}."
    told = [difference_says(one) + _since(found, one) for one in beside.exceeding[:3]]
    more = len(beside.exceeding) - len(told)
    rest = f" And {words.counted(more, 'more channel')}." if more else ""
    return f"In {second}, against {found.first.name}: {'; '.join(told)}.{rest}"


def floor_kept(beside: Comparison) -> str:
    """That nothing exceeds its floor, or only what start and drive may explain."""
    if not beside.explained:
        return ": nothing exceeds its floor"
    told = [difference_says(one) for one in beside.explained[:2]]
    more = len(beside.explained) - len(told)
    rest = f"; and {words.counted(more, 'more channel')}" if more else ""
    return f", but for what start and drive may explain: {'; '.join(told)}{rest}"


def difference_says(one: ChannelDifference) -> str:
    """ "T_1 reads 4.2 K more at about 6,000 rpm and 100 A (start and drive explain 0.0 to 0.5 K, floor 1.4 K)"."""
    off = one.worst.difference
    low, high = one.worst.explained
    of = f"start and drive explain {figure(low)} to {amount(high, one)}, " if _explains(one) else ""
    more = "more" if off > 0 else "less"
    where = where_says(one.worst)
    return f"{one.channel} reads {amount(abs(off), one)} {more}{where} ({of}floor {amount(one.floor, one)})"


def where_says(place: CellDifference) -> str:
    """ " at about 6,000 rpm and 100 A": the middle of the cell."""
    sides = [f"{words.number((a + b) / 2)} {AXES[name]}" for name, (a, b) in place.cell.items()]
    return f" at about {words.joined(sides)}" if sides else ""


def alike(beside: Comparison, first: str, second: str) -> str:
    """How long, and by what they were laid beside each other."""
    shares = [f"{100 * share:.0f} % of {name}" for share, name in zip(beside.shares, (first, second), strict=True)]
    how = f"by {words.joined([*beside.by])}, in {words.counted(beside.stretches, 'stretch').replace('chs', 'ches')}"
    means = " Below are the means of both over it, and the difference where it is largest." if beside.channels else ""
    return f"{words.duration(beside.matched_s)} {how}: {words.joined(shares)}.{means}"


def floor(found: Repeat) -> str:
    """What a difference is weighed against."""
    sensors = "two standard deviations of two sessions' sensor errors (meters 2 %)"
    if not found.earlier:
        return f"{sensors}; no earlier run of this test tells how well it repeats."
    runs = words.counted(len(found.earlier), "earlier run")
    return f"{sensors}, or what {runs} of this test ({', '.join(found.earlier)}) differed by where that is more."


def channel_lines(beside: Comparison, first: str, second: str) -> list[str]:
    """Every channel in both runs, one line each."""
    rows = [channel_row(one) for one in beside.channels[:SHOWN]]
    more = len(beside.channels) - len(rows)
    lines = table(channel_head(first, second), rows, width(), right=(2, 3, 4, 5, 6))
    return lines + ([f"and {words.counted(more, 'more channel')} (--json has all)"] if more else [])


def channel_head(first: str, second: str) -> tuple[str, ...]:
    """What stands above the cells of `channel_row`: of each run its mean, then how they differ where that is most."""
    return "channel", "unit", first, second, "at most", "explained", "floor", "", "where"


def channel_row(one: ChannelDifference) -> tuple[str, ...]:
    """A channel in both runs, as cells."""
    low, high = one.worst.explained
    explained = f"{figure(low)} to {figure(high)}" if _explains(one) else ""
    figures = (figure(one.first), figure(one.second), _signed(one.worst.difference))
    place = where_says(one.worst).removeprefix(" at about ").replace(" and ", ", ")
    return one.channel, as_written(one.unit or ""), *figures, explained, figure(one.floor), one.verdict, place


def _explains(one: ChannelDifference) -> bool:
    """Whether start and drive explain anything, rounding aside."""
    return max(map(abs, one.worst.explained)) >= NOTHING


def _since(found: Repeat, one: ChannelDifference) -> str:
    if not found.between:
        return ""
    return f", since {found.since[one.channel]}"


def not_compared(found: Repeat) -> list[str]:
    """The channels that only one of both runs has, a line for each run."""
    runs = zip(found.beside.only, (found.first.name, found.second.name), strict=True)
    return [f"only in {run}: {words.joined(names)}." for names, run in runs if names]


def change_says(found: Repeat) -> list[str]:
    """What the ledger knows to have changed, a line each with its event."""
    told = [f"#{one.position} {(one.recorded or '')[:16].replace('T', ' ')}: {one.says}" for one in found.changes]
    first, second = found.first.name, found.second.name
    return told or [f"the store knows of nothing that changed between {first} and {second}."]


def amount(value: float, one: ChannelDifference) -> str:
    """A number with the unit of a channel's differences."""
    unit = "K" if one.quantity == "temperature" else as_written(one.unit or "")
    return f"{figure(value)} {unit}".strip()


def _signed(value: float) -> str:
    return f"{'+' * (value >= NOTHING)}{figure(value)}"


def figure(value: float) -> str:
    """What tells of a number: "4.2", "0.13", "483", "1,200"; what is less than 0.1 with one digit."""
    value = value if abs(value) >= NOTHING else 0.0
    if abs(value) >= 100:
        return f"{value:,.0f}".replace("-", "−")
    text = (
        f"{value:.1f}" if abs(value) >= 1 or value == 0.0 else f"{value:.2g}" if abs(value) >= 0.1 else f"{value:.1g}"
    )
    return text.replace("-", "−")
