"""What `whyhot inspect` says of logs."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ingest.intake.inspection import FoundSignal, InspectedFile, Inspection
from ingest.log import unread
from ingest.texts.cells import cell, places
from ingest.texts.times import to_second
from replay.show.words.words import counted, duration

SHOWN, UNKNOWN, NOTES = 40, 10, 10  # signals, identifiers and notes on databases; the JSON has all


def inspection_json(found: Inspection) -> dict[str, Any]:
    """The answer "whyhot.inspect/1"."""
    return {
        "schema": "whyhot.inspect/1",
        "files": [_file_json(one) for one in found.files],
        "signals": [
            {"signal": s.signal.qualified, "unit": s.signal.unit, "quantity": s.quantity, "low": s.low, "high": s.high}
            for s in found.signals
        ],
        "unknown_ids": found.unknown_ids,
        "notes": list(found.notes),
    }


def _file_json(one: InspectedFile) -> dict[str, Any]:
    reading = one.reading
    if reading is None:
        return {"name": one.path.name, "outcome": "unreadable", "why": one.why}
    return {
        "name": one.path.name,
        "outcome": "cut" if reading.cut else "readable",
        "why": reading.cut,
        "note": one.note,
        "format": reading.format,
        "found": reading.found,
        "rejected": reading.rejected,
        "rejections": [{"where": r.where, "why": r.why} for r in reading.rejections],
        "absolute": reading.absolute,
        "start_ns": reading.start_ns,
        "end_ns": reading.end_ns,
        "settings": dict(reading.settings),
        "stamps": list(one.stamps),
        "ids": dict(reading.ids),
    }


def inspection_text(found: Inspection) -> str:
    """Files first, then signals with what they seem to be."""
    lines = [line for one in found.files if one.reading for line in _file_lines(one)]
    there = found.there
    width = max((places(seen.signal.qualified) for seen in there), default=0)
    lines += [f"  {_signal_line(seen, width)}" for seen in there[:SHOWN]]
    if len(there) > SHOWN:
        lines.append(f"  and {len(there) - SHOWN} more signals (--json has all)")
    if absent := len(found.signals) - len(there):
        lines.append(f"  {counted(absent, 'signal')} of the databases in no frame of these logs")
    unknown = list(found.unknown_ids.items())
    for key, count in unknown[:UNKNOWN]:
        lines.append(f"  {key}: {count:,} frame{'s' * (count != 1)} that no database explains")
    if others := unknown[UNKNOWN:]:
        frames = sum(count for _, count in others)
        lines.append(f"  and {frames:,} frames of {len(others):,} more identifiers (--json has all)")
    lines += [f"  {note}" for note in found.notes[:NOTES]]
    if len(found.notes) > NOTES:
        lines.append(f"  and {len(found.notes) - NOTES} more notes on the databases (--json has all)")
    return "\n".join(lines)


def nothing_to_draft(found: Inspection, databases: Sequence[Path], draft: Path) -> str | None:
    """Why `draft` was not written; None where there are signals to write down."""
    if found.there:
        return None
    if _frames(found) and not databases:
        return f"{draft}: no draft was written: frames show no signals without their database. Add --dbc FILE.dbc."
    if found.signals:
        return f"{draft}: no draft was written: no message of the databases is in these logs. Name theirs with --dbc."
    return f"{draft}: no draft was written: no signal was found in these logs. Give logs that hold some."


def next_step(
    found: Inspection, logs: Sequence[str], databases: Sequence[Path], bench: Path | None, draft: Path | None
) -> str:
    """What to do after `whyhot inspect` of `logs`, those that can be read, with these --dbc, --bench, --bench-draft."""
    explained = bool(databases) or not _frames(found)
    dbc = [word for path in databases for word in ("--dbc", str(path))] if explained else ["--dbc", "FILE.dbc"]
    if draft and found.there and explained:
        return f"complete {draft}, then whyhot ingest {shlex.join([*logs, '--bench', str(draft), *dbc])}"
    if bench and not draft:
        return f"whyhot ingest {shlex.join([*logs, '--bench', str(bench), *dbc])}"
    return f"whyhot inspect {shlex.join([*logs, *dbc, '--bench-draft', str(draft or 'bench.toml')])}"


def _frames(found: Inspection) -> bool:
    return any(one.reading.holds == "frames" for one in found.files if one.reading)


def _file_lines(one: InspectedFile) -> list[str]:
    reading = one.reading
    assert reading is not None
    start, end = reading.start_ns, reading.end_ns
    seconds = 0.0 if start is None or end is None else (end - start) / 1e9
    clock = f"from {to_second(start)} UTC" if reading.absolute and start is not None else "time from its own start"
    holds = reading.holds if reading.found != 1 else reading.holds.removesuffix("s")
    lines = [f"{one.path.name}   {reading.format}   {reading.found:,} {holds} in {duration(seconds)}, {clock}"]
    if count := reading.settings.get("zeros_at_head"):
        lines.append(f"  begins with {count:,} bytes of 0: what stood there is lost; copy the file again")
    if "header_line" in reading.settings:
        lines.append(f"  its header is line {reading.settings['header_line']:,}")
    if begun := reading.settings.get("begun"):
        lines.append(f'  its times count from what stands above it: "{begun}"')
    if count := reading.settings.get("lines_of_no_row"):
        lines.append(
            f"  {counted(count, 'line')} below its header: comments, empty ones, statistics, or the header again"
        )
    if reading.settings.get("counter_wraps"):
        lines.append("  its counter of 32 bits began anew, and is read on")
    if "rows a second, as" in str(reading.settings.get("time")):
        lines.append(f"  it has no column of times: {reading.settings['time']}")
    if beside := reading.settings.get("times_beside"):
        lines.append(f"  columns of times: {', '.join(beside)}: each stamps the columns behind it")
    if long := reading.settings.get("long_table"):
        lines.append(f"  {_long_table(long)}")
    if further := reading.settings.get("further_tables"):
        lines.append(f"  another table begins at {' and at '.join(further)}: read too, with its own times")
    left = unread.findings(one.path.name, reading.settings)
    lines += [f"  {flag.says.removeprefix(f'{one.path.name}: ')}" for flag in left]
    if "left_out" in reading.settings:
        lines.append(f"  left out, no numbers or texts with times: {', '.join(reading.settings['left_out'])}")
    for what, says in (("texts", "a text in place of a number"), ("invalid", "marked invalid")):
        if counts := reading.settings.get(what):
            lines.append(f"  missing, {says}: {', '.join(f'{name} ({n:,})' for name, n in counts.items())}")
    if one.note:
        lines.append(f"  {one.note}")
    lines += [f"  {says}" for says in one.stamps]
    if reading.cut:
        lines.append(f"  {reading.cut}")
    if reading.rejected:
        first = reading.rejections[0]
        lines.append(f"  {reading.rejected:,} rejected, the first at {first.where}: {first.why}")
    return lines


def _long_table(long: Mapping[str, Any]) -> str:
    """That each name is a channel, where its values stand, and what is not read."""
    names = f"a row a sample: each name in {' and '.join(long['names'])} is a channel with its own times"
    bad = f", missing where {long['quality']} is bad" if "quality" in long else ""
    left = f"; left out: {', '.join(long['left_out'])}" if "left_out" in long else ""
    return f"{names}, its values in {long['values']}{bad}{left}"


def _signal_line(seen: FoundSignal, width: int) -> str:
    span = f"{seen.low:g} to {seen.high:g}" if seen.low is not None and seen.high is not None else ""
    what = f"{seen.signal.unit or '-':<8} {seen.quantity or 'not guessed':<20}"
    return f"{cell(seen.signal.qualified, width)}  {what} {span}".rstrip()
