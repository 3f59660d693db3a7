"""`whyhot seen D`: in which other sessions of the store the cause of a diagnosis acts, and since when."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance
from replay.cli.asked import ask_as_of, opened, sessions_of


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("diagnosis", metavar="DIAGNOSIS", help="id of a diagnosis, or its beginning, as d-4f0c")
    parser.add_argument("--cause", metavar="C", help="which of its causes (default: the first that has a size)")
    says = "look in these only (default: all sessions of this motor in the store)"
    parser.add_argument("--sessions", metavar="S", nargs="+", default=[], help=says)
    ask_as_of(parser)


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from replay.cli.progress import tell
    from replay.show.reports.seen import document, seen_text
    from replay.studies.diagnosis.accept import find_diagnosis
    from replay.studies.since.seen import cause_of, seen

    with opened(args, write=False) as store:
        known = facts.at(store.ledger)
        found = find_diagnosis(store, known, args.diagnosis)
        done = seen(store, known, found, cause_of(found, args.cause), sessions_of(known, args.sessions), tell)
        data = {**document(done), "provenance": provenance(store, cause=args.cause, as_of=args.as_of)}
    return Answer(data, seen_text(done), 1 if done.not_asked else 0, done.not_asked)
