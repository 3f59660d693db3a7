"""`whyhot inspect FILE...`: what is inside logs, before anything is stored."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.cli.answer import Answer, provenance


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("files", metavar="FILE", nargs="+", type=Path, help="log files")
    parser.add_argument(
        "--dbc", metavar="D", type=Path, action="append", default=[], help="signal database; may be repeated"
    )
    parser.add_argument("--bench", metavar="B", type=Path, help="bench file that says how to read the time")
    parser.add_argument("--bench-draft", metavar="F", type=Path, help="write a draft bench file to F")


def run(args: argparse.Namespace) -> Answer:
    from ingest.inspection import draft, inspect
    from replay.show.inspection import inspection_json, inspection_text

    found = inspect(args.files, args.dbc, args.bench)
    written = None
    if args.bench_draft and found.signals:
        args.bench_draft.write_text(draft(found), encoding="utf-8")
        written = str(args.bench_draft)
    data = {**inspection_json(found), "bench_draft": written, "provenance": provenance(None)}
    readable = any(one.reading for one in found.files)
    text = inspection_text(found) + (f"\ndraft bench file: {written}" if written else "")
    return Answer(data, text if readable else "", 1 if found.refusals else 0, found.refusals)
