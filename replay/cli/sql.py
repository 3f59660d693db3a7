"""`whyhot sql "SELECT ..."`: the warehouse, read-only and confined to this store."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.asked import ask_as_of, count


def arguments(parser: argparse.ArgumentParser) -> None:
    says = 'one statement, e.g. "SELECT * FROM sessions"; views: whyhot sql "SHOW TABLES"'
    parser.add_argument("query", metavar="SQL", help=says)
    parser.add_argument("--csv", action="store_true", help="comma-separated instead of a table")
    says = "give at most so many rows (default 1,000,000)"
    parser.add_argument("--rows", metavar="N", type=count, help=says)
    says = "stop after so many seconds (default 60)"
    parser.add_argument("--seconds", metavar="S", type=count, help=says)
    ask_as_of(parser)


def run(args: argparse.Namespace) -> Answer:
    from analytics import answer, query
    from ingest.facts.store import Store
    from replay.show.words.width import width

    with Store.open(store_folder(args)) as store:
        rows = args.rows or query.ROWS
        result, asked = query.ask(store, args.query, rows, args.seconds or query.SECONDS, args.as_of)
        data = {"schema": "whyhot.sql/1", **answer.to_json(result), "left_out": asked.left_out}
        data["provenance"] = provenance(store, as_of=args.as_of)
        text = answer.to_csv(result).rstrip("\n") if args.csv else answer.to_text(result, width())
    more = [f"SQL: these are the first {rows:,} rows, there are more: allow more with --rows"] if result.more else []
    notes = [*asked.notes, *([asked.left_out] if asked.left_out else []), *more]
    return Answer(data, text, 1 if more and args.rows is None else 0, notes)
