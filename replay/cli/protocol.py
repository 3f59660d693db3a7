"""`whyhot protocol --on S...`: influence on drive cycles, fit on S1 and S2, check and filter on drive cycles."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.cli.answer import Answer, provenance, store_folder


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--on",
        metavar="S",
        nargs="+",
        required=True,
        help="ids or names of sessions: S1 and S2 points, and drive cycles",
    )
    parser.add_argument(
        "--model", metavar="M", help="model id, motor name or motor file (default: what the bench file names)"
    )
    parser.add_argument(
        "--level", choices=("testing", "production"), default="testing", help="channels that may be learnt from"
    )
    parser.add_argument("--report", metavar="FILE.html", type=Path, help="write the report to this file")


def run(args: argparse.Namespace) -> Answer:
    from ingest import facts
    from ingest.store import Store
    from replay.cli.progress import tell
    from replay.engine.models import model_named
    from replay.show.protocol import document, protocol_text
    from replay.show.protocol_report import write_protocol_report
    from replay.studies.protocol import run_protocol

    with Store.open(store_folder(args), write=True) as store:
        model = model_named(store, args.model)
        known = facts.at(store.ledger)
        sessions = [known.session(text) for text in dict.fromkeys(args.on)]
        found = run_protocol(store, known, sessions, model, args.level, tell)
        if args.report:
            command = f"whyhot protocol --on {' '.join(args.on)}"
            write_protocol_report(store, found, args.report, command)
        data = {**document(found), "provenance": provenance(store, level=args.level, model=args.model)}
    converged = found.calibration.event.converged
    unfinished = [] if converged else ["the search did not converge: give more points, or check the motor file."]
    return Answer(data, protocol_text(found), 1 if unfinished else 0, unfinished)
