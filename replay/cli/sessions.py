"""`whyhot sessions`: the catalogue of recorded sessions."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.asked import ask_as_of, count

LAST = 100  # sessions that fit a terminal with its scroll-back


def arguments(parser: argparse.ArgumentParser) -> None:
    says = f"the last N sessions (default: {LAST} as text, all of them as JSON)"
    parser.add_argument("--last", metavar="N", type=count, help=says)
    ask_as_of(parser)


def run(args: argparse.Namespace) -> Answer:
    from ingest.catalogue import page
    from ingest.catalogue.show import sessions_json
    from ingest.facts import facts
    from ingest.facts.store import Store
    from replay.show.words.width import width

    with Store.open(store_folder(args)) as store:
        known = facts.at(store.ledger, args.as_of)
        last = args.last or (LAST if args.json is None else None)
        shown, of = known.last_sessions(last) if last else (None, 0)
        answer = sessions_json(known, shown)
        data = {**answer, "provenance": provenance(store, as_of=args.as_of)}
        return Answer(data, page.sessions(answer, width(), args.as_of, of))
