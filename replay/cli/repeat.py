"""`whyhot repeat S1 S2`: the same test again, and what reads differently where it was driven alike."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.asked import ask_as_of


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("first", metavar="S1", help="the session to compare with: id, beginning of an id, or name")
    parser.add_argument("second", metavar="S2", help="the session that may differ from it")
    ask_as_of(parser)


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from ingest.facts.store import Store
    from ingest.morning.repeat import repeat
    from replay.show.verbs.repeat import repeat_text

    with Store.open(store_folder(args)) as store:
        known = facts.at(store.ledger, args.as_of)
        found = repeat(store, known, known.session(args.first), known.session(args.second))
        data = {**found.to_json(), "provenance": provenance(store, as_of=args.as_of)}
    return Answer(data, repeat_text(found))
