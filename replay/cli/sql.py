"""`whyhot sql "SELECT ..."`: the warehouse, read-only and confined to this store."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.asked import ask_as_of


def arguments(parser: argparse.ArgumentParser) -> None:
    says = 'one statement, e.g. "SELECT * FROM sessions"; views: whyhot sql "SHOW TABLES"'
    parser.add_argument("query", metavar="SQL", help=says)
    parser.add_argument("--csv", action="store_true", help="comma-separated instead of a table")
    ask_as_of(parser)


def run(args: argparse.Namespace) -> Answer:
    from analytics import answer, query, warehouse
    from ingest.facts.store import Store

    with Store.open(store_folder(args)) as store, warehouse.refresh(store, args.as_of) as opened:
        result = query.run(opened.connection, args.query)
        data = {"schema": "whyhot.sql/1", **answer.to_json(result), "provenance": provenance(store, as_of=args.as_of)}
        text = answer.to_csv(result).rstrip("\n") if args.csv else answer.to_text(result)
        return Answer(data, text, notes=opened.notes)
