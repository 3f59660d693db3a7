"""The pages of `whyhot sessions` and `whyhot show` as plain text: no colours, and never wider than asked."""

from __future__ import annotations

import shlex
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from ingest.catalogue import operating_points, power
from ingest.catalogue.description import ChannelDescription, SessionDescription
from ingest.catalogue.power import PowerBalance
from ingest.catalogue.quality import NO_SAMPLES, seconds
from ingest.facts.events import COUNTS
from ingest.texts.cells import cell, places
from ingest.texts.names import first_of, handle
from ingest.texts.plain import plain_line
from ingest.texts.times import clock
from ingest.texts.units import as_written

NONE = "–"
NAMED = 3  # channels of one gap
LEAST = 8  # characters that a text in a table is cut to at most


def sessions(answer: Mapping[str, Any], width: int = 100, as_of: str | None = None, of: int = 0) -> str:
    """The answer of `sessions --json` as a table of at most `width` columns, with what could not be read below it.

    `as_of`: the ledger position or time of which the answer speaks, None for now; `of`: how many sessions there are,
    where the answer holds only the last ones.
    """
    if not answer["sessions"] and not answer["quarantined_files"]:
        if as_of is not None:
            return f"No session was known as of {as_of}.\nnext: whyhot sessions"
        return "No session in this store yet.\nnext: whyhot ingest FILE..."
    rows = [_session_row(one) for one in answer["sessions"]]
    head = ("session", "kind", "start (UTC)", "length", "motor", "specimen", "channels", "quarantined", "id")
    lines = [f"{len(rows)} session{'s' * (len(rows) != 1)}"]
    if of > len(rows):
        lines = [f"{of:,} sessions, the last {len(rows):,}: --last N shows more"]
    lines += table(head, rows, width, right=(2, 3, 6, 7)) if rows else []
    for one in answer["quarantined_files"]:
        lines += _wrap(f"quarantined: {one['why'] or one['file']}", width)
    return "\n".join(
        [*lines, "", f"next: whyhot show {shlex.quote(_called(answer['sessions'], of))}"] if rows else lines
    )


def _called(sessions: Sequence[Mapping[str, Any]], of: int) -> str:
    """The last session by its name, or by its id where another has that name, or one that is not shown may have it."""
    names, last = [one["name"] for one in sessions], sessions[-1]
    return str(last["name"] if names.count(last["name"]) == 1 and of <= len(names) else last["session"])


def render(description: SessionDescription, width: int = 100) -> str:
    """The page of `whyhot show` as plain text of at most `width` columns."""
    findings = ["Look at", *_look_at(description)] if description.findings else []
    blocks = [_heading(description), _sources(description), findings, _channels(description, width)]
    blocks.append(["Power", *_power(description.power, description.channels)])
    if description.operating_points:
        blocks.append(
            ["Operating points", *operating_points.draw(description.operating_points, width - 2).splitlines()]
        )
    blocks.append([f"next: {_next(description)}"])
    indented = [[block[0], *(f"  {line}" for line in block[1:])] for block in blocks if block]
    return "\n\n".join("\n".join(piece for line in block for piece in _wrap(line, width)) for block in indented)


def table(head: Sequence[str], rows: Iterable[Sequence[str]], width: int, right: Sequence[int] = ()) -> list[str]:
    """Rows under a heading, two blanks between columns, those of `right` flush right.

    Where that is wider than `width`, texts lose their ends, the first column down to a third of the width; numbers
    (`right`) never, as part of one is another. Then the last columns are left out, which is said below.
    """
    cells = [tuple(head), *(tuple(map(plain_line, row)) for row in rows)]
    widths = [max(places(row[i]) for row in cells) for i in range(len(head))]
    least = [size if i in right else min(size, LEAST if i else max(LEAST, width // 3)) for i, size in enumerate(widths)]
    while sum(least) + 2 * (len(least) - 1) > width and len(least) > 1:
        least.pop()
    widths = widths[: len(least)]
    while sum(widths) + 2 * (len(widths) - 1) > width and widths != least:
        loose = [i for i in range(len(widths)) if widths[i] > least[i]]
        widths[max(loose, key=lambda i: widths[i])] -= 1
    lines = [
        "  ".join(
            cell(text, size, i in right) for i, (text, size) in enumerate(zip(row, widths, strict=False))
        ).rstrip()
        for row in cells
    ]
    out = [name or "notes" for i, name in enumerate(head) if i >= len(widths) and any(row[i] for row in cells[1:])]
    return lines + (_wrap(f"not shown, as {width} columns are too few: {', '.join(out)}", width) if out else [])


def _session_row(one: Mapping[str, Any]) -> tuple[str, ...]:
    start = one["start"].replace("T", " ")[:16] if one["start"] else NONE
    about = (one["kind"], start, clock(one["duration_s"]), one["motor"] or NONE, one["specimen"] or NONE)
    return one["name"], *about, str(one["channels"]), f"{one['quarantined']:,}", one["session"][:8]


def _heading(one: SessionDescription) -> list[str]:
    when = one.start.replace("T", " ").replace("Z", " UTC") if one.start else "no absolute time"
    facts = {"motor": one.motor, "specimen": one.specimen, "batch": one.batch, "bench": one.bench}
    about = [f"{key} {value}" for key, value in {**facts, "configuration": one.configuration}.items() if value]
    said = [f"{key} = {value}" for key, value in one.attributes.items()]
    lines = [f"{one.name}   {one.kind}: {one.kind_why}", f"{when}, {clock(one.duration_s)}, session {one.session}"]
    lines += [" · ".join(words) for words in (about, said) if words]
    if one.corrections:
        lines.append(f"corrected below and in what is computed, by {one.bench}: {', '.join(one.corrections)}")
    return lines + [f"since {change}" for change in one.changes]


def _sources(one: SessionDescription) -> list[str]:
    lines = ["Sources"]
    for source in one.sources:
        counts = " · ".join(f"{key.replace('_', ' ')} {source.balance.get(key, 0):,}" for key in COUNTS)
        holds = "balance holds" if source.holds else "BALANCE DOES NOT HOLD"
        whole = (source.first_record, source.last_record) == (0, max(source.balance.get("found", 0) - 1, 0))
        rows = "" if whole else f", {source.records}"
        lines.append(
            f"{source.file}   {source.balance.get('found', 0):,} records{rows}   sealed {handle(source.sha256)}"
        )
        lines.append(f"  {counts}   {holds}")
        lines += [f"  times: {source.times}"] if source.times else []
        lines += [f"  {source.outcome}: {source.why}"] if source.why else []
        lines += [f"  rejected at {bad.get('where')}: {bad.get('why')}" for bad in source.rejections[:3]]
        unknown = sorted(source.unknown_ids.items(), key=lambda pair: -pair[1])[:5]
        lines += [f"  unknown: {' · '.join(f'{name} {count:,}' for name, count in unknown)}"] if unknown else []
    return lines


_WITHOUT_MOTOR = {  # kind -> what to ask of a session of a specimen's insulation
    "dc_check": "whyhot ageing",
    "ageing": 'whyhot sql "FROM cycles"',
    "insulation_check": 'whyhot sql "FROM insulation_checks"',
}


def _next(one: SessionDescription) -> str:
    """The command that follows, or what a replay of this session lacks."""
    name = shlex.quote(one.name)
    if one.bench is None:
        return "no bench file says yet what these signals mean: whyhot inspect FILE... --bench-draft bench.toml"
    if one.motor is None and one.specimen and one.kind in _WITHOUT_MOTOR:
        return _WITHOUT_MOTOR[one.kind]
    if one.motor is None:
        return f'add motor = "motor.toml" to {one.bench} and ingest again, or whyhot replay {name} --model motor.toml'
    return f"whyhot replay {name}"


def _look_at(one: SessionDescription) -> Iterator[str]:
    """What is to be looked at: a gap of many channels, as of a logger that was off, is one line."""
    gaps = {f"{channel.name} {NO_SAMPLES} ": channel.name for channel in one.channels}
    told: dict[str, list[str]] = {}
    for says in one.findings:
        name = next((name for begins, name in gaps.items() if says.startswith(begins)), "")
        told.setdefault(says.removeprefix(name), []).append(name)
    for says, names in told.items():
        has = says.replace(" has ", " have ", 1) if len(names) > 1 else says
        yield f"{first_of(names, NAMED)}{has}"


def _channels(one: SessionDescription, width: int) -> list[str]:
    head = ("name", "quantity", "unit", "node", "rate", "low", "high", "noise", "gaps", "held")
    rows = [
        (
            *(channel.name, channel.quantity or NONE, as_written(channel.unit or NONE)),
            "(ignored)" if channel.role == "ignored" else channel.node or NONE,
            NONE if channel.rate_Hz is None else f"{channel.rate_Hz:.3g} Hz",
            *(_number(channel.low), _number(channel.high), _noise(channel.noise)),
            _repeats(channel, "gap"),
            _repeats(channel, "held", "stuck", "saturated"),
        )
        for channel in one.channels
    ]
    ignored = sum(channel.role == "ignored" for channel in one.channels)
    count = f"{len(rows) - ignored}, and {ignored} ignored" if ignored else f"{len(rows)}"
    return [f"Channels ({count})", *table(head, rows, width - 2, right=(4, 5, 6, 7))]


def _repeats(channel: ChannelDescription, *kinds: str) -> str:
    """ "6 x to 240 s, saturated 12 s"."""
    return ", ".join(
        ("" if one.kind in ("gap", "held") else f"{one.kind} ")
        + (f"{one.times} x to " if one.times > 1 else "")
        + seconds(one.longest_s)
        for one in channel.repeats
        if one.kind in kinds
    )


def _power(found: PowerBalance | None, channels: Sequence[ChannelDescription]) -> list[str]:
    if found is None:
        missing = power.lacking({one.quantity for one in channels if one.role != "ignored"})
        verb = "is" if len(missing) == 1 else "are"
        return [f"not known: {' and '.join(missing or power.PARTS)} {verb} not recorded{'' if missing else ' at once'}"]
    numbers = f"{found.electrical_kWh:.2f} kWh in, {found.mechanical_kWh:.2f} kWh at the shaft; see above"
    lines = [found.says if found.possible else numbers]
    lines.append(f"electrical power from {found.electrical_from}; {seconds(found.loaded_h * 3600)} under load")
    best = max((cell for cell in found.efficiency if cell.minutes >= 1), key=lambda cell: cell.efficiency, default=None)
    if best:
        lines.append(
            f"best efficiency {100 * best.efficiency:.1f} % at {best.speed_rpm[0]:,g} to {best.speed_rpm[1]:,g} rpm, "
            f"{best.torque_Nm[0]:g} to {best.torque_Nm[1]:g} Nm ({best.minutes:.1f} min)"
        )
    return lines


def _number(value: float | None) -> str:
    if value is None:
        return NONE
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def _noise(value: float | None) -> str:
    """Two digits tell what noise is like: "200", "0.0096"."""
    return NONE if value is None else _number(float(f"{value:.2g}"))


def _wrap(line: str, width: int) -> list[str]:
    """A line in pieces of at most `width`, broken at blanks, what follows indented by two more."""
    indent = " " * (len(line) - len(line.lstrip()) + 2)
    return textwrap.wrap(line, width, subsequent_indent=indent, break_on_hyphens=False) or [line]
