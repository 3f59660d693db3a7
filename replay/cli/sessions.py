"""`whyhot sessions`: the catalogue of recorded sessions."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--as-of", metavar="POINT", help="as known at a ledger position or an ISO time")


def run(args: argparse.Namespace) -> Answer:
    from ingest.catalogue.show import render_sessions, sessions_json
    from ingest.facts import facts
    from ingest.facts.store import Store

    with Store.open(store_folder(args)) as store:
        known = facts.at(store.ledger, args.as_of)
        data = {**sessions_json(known), "provenance": provenance(store, as_of=args.as_of)}
        return Answer(data, render_sessions(known, as_of=args.as_of))
