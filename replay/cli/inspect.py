"""`whyhot inspect FILE...`: what is inside logs, before anything is stored."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.cli.answer import Answer, provenance
from replay.cli.asked import ask_databases, ask_logs, databases_of


def arguments(parser: argparse.ArgumentParser) -> None:
    ask_logs(parser)
    ask_databases(parser)
    parser.add_argument("--bench", metavar="B", type=Path, help="bench file that says how to read the time")
    parser.add_argument("--bench-draft", metavar="F", type=Path, help="write a draft bench file to F")


def run(args: argparse.Namespace) -> Answer:
    from ingest.intake.given import opened
    from ingest.intake.inspection import draft, inspect
    from replay.show.verbs.inspection import inspection_json, inspection_text, next_step, nothing_to_draft
    from replay.written import write

    databases = databases_of(args)
    with opened(args.files, databases) as given:
        found = inspect([*given.logs], databases, args.bench)
    notes, wanted, lines = [*given.refused, *found.refusals], args.bench_draft, [inspection_text(found)]
    empty = nothing_to_draft(found, args.dbc, wanted) if wanted else None
    if empty:
        notes.append(empty)
    elif wanted:
        write(wanted, draft(found))
        lines.append(f"draft bench file: {wanted}")
    readable = list(dict.fromkeys(str(given.logs[one.path]) for one in found.files if one.reading))
    lines.append(f"next: {next_step(found, readable, args.dbc, args.bench, wanted)}")
    written = str(wanted) if wanted and not empty else None
    lists = {"skipped": given.skipped, "refused": given.refused, "bench_draft": written}
    data = {**inspection_json(found), **lists, "provenance": provenance(None)}
    return Answer(data, "\n".join(lines) if readable else "", 1 if notes else 0, [*given.skipped, *notes])
