"""`whyhot export S --to FORMAT`: the samples of a session as a file of another program."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.asked import ask_as_of

SHOWN = 8  # names of signals in a line


def arguments(parser: argparse.ArgumentParser) -> None:
    from replay.exports.csv import EXCELS
    from replay.exports.export import WRITERS

    parser.add_argument("session", metavar="S", help="the session, by name or id")
    parser.add_argument(
        "--to", choices=tuple(WRITERS), required=True, help="what to write; each has names, units and times in UTC"
    )
    says = "the file to write (default: the session's name); an existing one is not overwritten"
    parser.add_argument("-o", "--out", metavar="OUT", type=Path, help=says)
    says = "a CSV for the Excel of a country: its decimal sign, delimiter and dates (default: comma and point)"
    parser.add_argument("--excel", choices=tuple(EXCELS), help=says)
    ask_as_of(parser)
    parser.set_defaults(refuse=parser.error)


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from ingest.facts.store import Store
    from ingest.texts.names import first_of
    from replay.exports.export import export

    if args.excel and args.to != "csv":
        args.refuse(f"--excel is for --to csv: Excel reads numbers and dates of an {args.to} file as they are")
    with Store.open(store_folder(args)) as store:
        known = facts.at(store.ledger, args.as_of)
        session = known.session(args.session)
        target = args.out or Path(f"{session.name}.{args.to}")
        settings = {"to": args.to, "excel": args.excel, "as_of": args.as_of}
        about = provenance(store, **settings)  # while there is no file that it could fail beside
        done = export(store, known, session, args.to, target, args.excel)
        data = {
            "schema": "whyhot.export/1",
            "session": session.session,
            "file": str(target),
            "rows": done.rows,
            "left_out": list(done.unnamed),
            "texts": list(done.texts),
            "columns": [{"name": one.name, "unit": one.unit, "place": one.place} for one in done.columns],
            "provenance": about,
        }
    says = f"{target}   {session.name}: {done.rows:,} rows, {len(done.columns)} channels"
    notes = [] if done.absolute else [f"session {session.name}: has no date: times count from its logger's start."]
    if done.unnamed:
        says += f"\nleft out, as the bench file does not say what they are: {first_of(done.unnamed, SHOWN)}"
    if done.texts:
        says += f"\nleft out, as they hold text: {first_of(done.texts, SHOWN)}"
    return Answer(data, says, notes=notes)
