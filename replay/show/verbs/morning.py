"""What `whyhot morning` says: the answer, the balance, then each session in a few lines."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

from ingest.catalogue.description import Repeats
from ingest.catalogue.operating_points import OperatingPoints
from ingest.catalogue.quality import seconds
from ingest.facts.events import COUNTS
from ingest.morning.found_setup import NO_BENCH
from ingest.morning.morning import Before, Morning, Night
from replay.show.verbs.intake import intake_json
from replay.show.verbs.repeat import AXES, difference_says, floor_kept
from replay.show.words import words
from replay.show.words.terminal import labelled

CELLS = 3  # in which a session stayed longest
DIFFERENCES = 3  # of a run before; `whyhot repeat` has all


def morning_json(found: Morning) -> dict[str, Any]:
    """The answer "whyhot.morning/1": files with their balance as `ingest` has them, and each session."""
    intake = intake_json(found.intake)
    return {
        "schema": "whyhot.morning/1",
        "setup": found.source,
        "kept": found.kept,
        "files": intake["files"],
        "flags": intake["flags"],
        "clocks": found.clocks_json(),
        "sessions": found.sessions_json(),
    }


def morning_text(found: Morning, given: Sequence[str]) -> str:
    """As wide as the terminal: what to look at first, the next command last."""
    lines = labelled("Answer", answer(found))
    lines += labelled("Balance", balance(found))
    lines += labelled("Meaning", meaning(found))
    lines += labelled("Clocks", *clock_lines(found))
    for night in found.nights:
        lines += ["", *_night_lines(night)]
    return "\n".join([*lines, "", f"next: {_next(found, given)}"])


UNEXPLAINED = (
    "no bench file says what the signals mean: they are guessed by name and unit, where the log has no units as rpm,"
    " Nm, A, V and °C (whyhot inspect --bench-draft)."
)


def meaning(found: Morning) -> str:
    """What says what the signals mean."""
    return f"{found.source.rstrip('.')}." if found.source != NO_BENCH else UNEXPLAINED


def clock_lines(found: Morning) -> list[str]:
    """What is said of clocks, once where it is the same of several sessions."""
    names = {night.description.session: night.description.name for night in found.nights}
    of: dict[str, list[str]] = {}
    for clock in found.clocks:
        of.setdefault(clock.says, []).append(names[clock.session])
    several = len(names) > 1
    return [f"{says} ({_few(sessions)})" if several else says for says, sessions in of.items()]


def _few(names: Sequence[str]) -> str:
    return words.joined(names) if len(names) <= CELLS else words.counted(len(names), "session")


def answer(found: Morning) -> str:
    """How much there is, and how many things a person should look at."""
    nights = found.nights
    total = sum(night.description.duration_s for night in nights)
    kinds = Counter(night.description.kind for night in nights)
    told = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
    wrong = Counter(name for night in nights for name in look_at(night))
    wrong["clock"] = sum(one.offset is not None and not one.agrees for one in found.clocks)
    wrong["refused or incomplete log"] = len(found.intake.refusals)
    looks = words.joined([words.counted(count, name) for name, count in wrong.items() if count])
    what = (
        f"{words.counted(len(nights), 'session')} ({told}), {words.duration(total)} in all" if nights else "no session"
    )
    return f"{what}. " + (f"To look at: {looks}." if looks else "Nothing stands out.")


def look_at(night: Night) -> Iterator[str]:
    """A word for each thing of a session that a person should look at."""
    yield from ["sensor"] * len({fault.channel for fault in night.sensors})
    if night.description.power and not night.description.power.possible:
        yield "power balance"
    if night.ended.reason == "aborted":
        yield "broken-off run"
    if night.before:
        yield from ["difference"] * len(night.before.comparison.exceeding)
    yield from ["log fault"] * len(of_logs(night))
    yield from ["gap"] * sum(gap.times for gap in {gap for _, gap in _gaps(night)})


def of_logs(night: Night) -> list[str]:
    """What is wrong with stamps and files of a session, as facts say it: all findings that are of no channel."""
    one = night.description
    mine = [f"{channel.name} " for channel in one.channels]
    sensors = {fault.says for fault in night.sensors}
    others = [says for says in one.findings if says not in sensors and not any(map(says.startswith, mine))]
    return [says for says in others if not (one.power and says == one.power.says)]


def balance(found: Morning) -> str:
    """What became of every record of all logs."""
    files, copies = found.intake.files, _copies(found)
    read_whole = {one.raw: one.decode for one in files if one.decode and one.decode.outcome != "quarantined"}
    decodes = [*read_whole.values()]
    counts = {key: sum(one.balance.get(key, 0) for one in decodes) for key in ("found", *COUNTS)}
    parts = " + ".join(f"{counts[key]:,} {key.replace('_', ' ')}" for key in COUNTS if counts[key] or key == "decoded")
    lost = sum(one.raw not in read_whole for one in files)
    unread = f" {words.counted(lost, 'file')} could not be read." if lost else ""
    read = words.counted(len(decodes), "log")
    alike = f" {words.joined([f'{one} is a copy of {first}' for one, first in copies.items()])}." if copies else ""
    return f"{read}, {counts['found']:,} records = {parts}: the balance holds.{unread}{alike}"


def _copies(found: Morning) -> dict[str, str]:
    """Name of each log that holds the bytes of another one -> the name of that."""
    first: dict[str, str] = {}
    return {
        one.name: first[one.raw]
        for one in found.intake.files
        if one.raw and first.setdefault(one.raw, one.name) != one.name
    }


def _night_lines(night: Night) -> list[str]:
    one = night.description
    when = one.start.replace("T", " ")[:16] + " UTC" if one.start else "no absolute time"
    lines = [f"{one.name}   {one.kind}, {words.duration(one.duration_s)}, {when}"]
    last = ""
    for label, says in told(night):
        lines += labelled(f"  {label}" if label != last else "", says)
        last = label
    return lines


def told(night: Night) -> Iterator[tuple[str, str]]:
    """What there is to say of a session: (what it is of, a line)."""
    one = night.description
    yield "kind", one.kind_why
    if (night.ended.reason, one.kind) != ("unknown", "other"):
        yield "ended", ended_says(night)
    yield from (("sensor", fault.says) for fault in night.sensors)
    yield from (("log", says) for says in of_logs(night))
    yield from (("gaps", says) for says in gaps(night))
    if one.power:
        yield "power", one.power.says
    if one.operating_points:
        yield "driven", driven(one.operating_points)
    if night.before:
        yield "before", before(night.before)


def ended_says(night: Night) -> str:
    """ "steady: no temperature changed ..."."""
    return f"{night.ended.reason}: {night.ended.says}"


def gaps(night: Night) -> list[str]:
    """How many channels have gaps, and the longest; none where there is no gap."""
    found = _gaps(night)
    if not found:
        return []
    longest, name = max((gap.longest_s, name) for name, gap in found)
    return [f"{words.counted(len(found), 'channel')}, the longest {seconds(longest)} ({name})"]


def _gaps(night: Night) -> list[tuple[str, Repeats]]:
    """Channels with gaps, and these: of a logger that paused they are equal."""
    return [(one.name, gap) for one in night.description.channels for gap in one.repeats if gap.kind == "gap"]


def driven(points: OperatingPoints) -> str:
    """The operating points at which a session stayed longest, by the middles of their cells."""
    units = [AXES[name.split("_")[0]] for name in (points.x, points.y)]
    middles = [[(a + b) / 2 for a, b in pairwise(edges)] for edges in (points.x_edges, points.y_edges)]
    cells = [
        (minutes, x, y)
        for y, row in zip(middles[1], points.minutes, strict=True)
        for x, minutes in zip(middles[0], row, strict=True)
        if minutes > 0
    ]
    longest = sorted(cells, reverse=True)[:CELLS]
    places = [
        f"{words.number(x)} {units[0]} {words.number(y)} {units[1]}" if x or y else "at rest" for _, x, y in longest
    ]
    told = [f"{place} for {words.duration(60 * cell[0])}" for place, cell in zip(places, longest, strict=True)]
    return f"{'; '.join(told)}; {words.counted(len(cells), 'cell')} in all"


def before(found: Before) -> str:
    """What differs from the last run of the same test."""
    comparison, one = found.comparison, found.name
    alike = f"{words.duration(comparison.matched_s)} alike, {100 * comparison.shares[1]:.0f} % of this run"
    if not comparison.channels:
        return f"driven as {one} ({alike}); no channel is called alike in both, so none is compared"
    if not comparison.exceeding:
        return f"as {one} ({alike}){floor_kept(comparison)}"
    told = "; ".join(difference_says(each) for each in comparison.exceeding[:DIFFERENCES])
    more = len(comparison.exceeding) - DIFFERENCES
    return f"against {one} ({alike}): {told}" + (f"; and {words.counted(more, 'more channel')}" if more > 0 else "")


def _next(found: Morning, given: Sequence[str]) -> str:
    pairs = [(night.before.name, night.description.name) for night in found.nights if night.before]
    if not found.kept:
        return f"to take them into the store: whyhot morning {shlex.join(given)} --ingest"
    if pairs:
        return f"whyhot repeat {shlex.join(pairs[0])}"
    return f"whyhot show {shlex.quote(found.nights[0].description.name)}" if found.nights else "whyhot sessions"
