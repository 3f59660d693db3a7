"""`whyhot bisect CHANNEL`: since when a channel reads otherwise than the model, and what changed there."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance
from replay.cli.asked import ask_as_of, ask_level, ask_model, opened, sessions_of


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("channel", metavar="CHANNEL", help="a channel that observes a node, as the bench file names it")
    says = "look in these (default: all sessions of the motor in the store)"
    parser.add_argument("--sessions", metavar="S", nargs="+", default=[], help=says)
    parser.add_argument("--specimen", metavar="S", help="which motor, where the store holds several")
    ask_model(parser)
    ask_level(parser)
    ask_as_of(parser)


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from replay.cli.progress import tell
    from replay.engine.files.models import model_named
    from replay.show.reports.bisect import bisect_text, document
    from replay.studies.since import bisect

    with opened(args, write=args.model is not None) as store:
        model = model_named(store, args.model)
        known = facts.at(store.ledger)
        sessions = bisect.sessions_of(known, sessions_of(known, args.sessions), args.specimen)
        found = bisect.bisect(store, known, args.channel, sessions, model, args.level, tell)
        settings = {"model": args.model, "level": args.level, "specimen": args.specimen, "as_of": args.as_of}
        data = {**document(found), "provenance": provenance(store, **settings)}
    return Answer(data, bisect_text(found))
