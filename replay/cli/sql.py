"""`whyhot sql "SELECT ..."`: the warehouse, read-only and confined to this store."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "query", metavar="SQL", help='one statement, e.g. "SELECT * FROM sessions"; views: whyhot sql "SHOW TABLES"'
    )
    parser.add_argument("--csv", action="store_true", help="comma-separated instead of a table")
    parser.add_argument("--as-of", metavar="POINT", help="as known at a ledger position or an ISO time")


def run(args: argparse.Namespace) -> Answer:
    from analytics import answer, query, warehouse
    from ingest.facts.store import Store

    with Store.open(store_folder(args)) as store, warehouse.refresh(store, args.as_of) as opened:
        result = query.run(opened.connection, args.query)
        data = {"schema": "whyhot.sql/1", **answer.to_json(result), "provenance": provenance(store, as_of=args.as_of)}
        return Answer(
            data, answer.to_csv(result).rstrip("\n") if args.csv else answer.to_text(result), notes=opened.notes
        )
