"""`whyhot retract X... --reason TEXT`: a log, session, diagnosis or inspection is taken back, or brought back."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.asked import ask_reason


def arguments(parser: argparse.ArgumentParser) -> None:
    says = "log, session, diagnosis (as d-4f0c) or inspection: its name, id, or the beginning of its id"
    parser.add_argument("what", metavar="X", nargs="+", help=says)
    ask_reason(parser)
    parser.add_argument("--undo", action="store_true", help="bring back what was taken back")


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts.store import Store
    from ingest.intake.retractions import reinstate, retract
    from replay.show.verbs.corrections import put_right_json, put_right_text
    from replay.studies.again.stale import became_stale

    with Store.open(store_folder(args), write=True) as store:
        done = (reinstate if args.undo else retract)(store, args.what, args.reason)
        found = became_stale(store.ledger.events(), done.before, done.after)
        store.ledger.seal()
        data = {
            "schema": "whyhot.retraction/1",
            "undone": args.undo,
            **put_right_json(done, args.reason, found),
            "provenance": provenance(store),
        }
    label = "Brought back" if args.undo else "Taken back"
    return Answer(data, put_right_text(label, done, args.reason, found), 1 if done.left else 0, done.left)
