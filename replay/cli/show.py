"""`whyhot show S`: one session as it was recorded."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.asked import ask_as_of


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("session", metavar="S", help="id, unique beginning of an id, or name of a session")
    ask_as_of(parser)


def run(args: argparse.Namespace) -> Answer:
    from ingest.catalogue.page import render
    from ingest.catalogue.show import describe
    from ingest.facts import facts
    from ingest.facts.store import Store
    from replay.show.words.width import width

    with Store.open(store_folder(args)) as store:
        known = facts.at(store.ledger, args.as_of)
        description = describe(store, known, known.session(args.session))
        data = {**description.to_json(), "provenance": provenance(store, as_of=args.as_of)}
        return Answer(data, render(description, width()))
