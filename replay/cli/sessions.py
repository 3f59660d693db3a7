"""`whyhot sessions`: the catalogue of recorded sessions."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.asked import ask_as_of


def arguments(parser: argparse.ArgumentParser) -> None:
    ask_as_of(parser)


def run(args: argparse.Namespace) -> Answer:
    from ingest.catalogue import page
    from ingest.catalogue.show import sessions_json
    from ingest.facts import facts
    from ingest.facts.store import Store
    from replay.show.words.width import width

    with Store.open(store_folder(args)) as store:
        known = facts.at(store.ledger, args.as_of)
        answer = sessions_json(known)
        data = {**answer, "provenance": provenance(store, as_of=args.as_of)}
        return Answer(data, page.sessions(answer, width(), args.as_of))
