"""`whyhot report S...`: one HTML file of sealed runs."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.cli.answer import Answer, provenance, store_folder


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("sessions", metavar="S", nargs="*", help="replayed sessions (default: all)")
    parser.add_argument("--out", metavar="FILE", type=Path, default=Path("report.html"), help="default: report.html")


def run(args: argparse.Namespace) -> Answer:
    from ingest import facts
    from ingest.store import Store
    from replay.show.documents import write_replay_report

    with Store.open(store_folder(args)) as store:
        known = facts.at(store.ledger, None)
        runs = write_replay_report(store, known, args.sessions, args.out, "whyhot report " + " ".join(args.sessions))
        data = {
            "schema": "whyhot.report/1",
            "file": str(args.out),
            "runs": [run.run for run in runs],
            "provenance": provenance(store),
        }
    return Answer(data, f"{args.out}   {len(runs)} session{'s' * (len(runs) != 1)}; opens offline in any browser")
