"""`whyhot correct X... --reason TEXT`: what was said wrongly of logs, said anew; the sealed bytes are read again."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.asked import ask_databases, ask_reason, ask_said, databases_of, said_of


def arguments(parser: argparse.ArgumentParser) -> None:
    says = "log or session (all its logs): its name, id, or the beginning of its id"
    parser.add_argument("what", metavar="X", nargs="+", help=says)
    ask_reason(parser)
    ask_said(parser)
    ask_databases(parser)


def run(args: argparse.Namespace) -> Answer:
    from ingest.errors import CorrectionError
    from ingest.facts.store import Store
    from ingest.intake.corrections import correct
    from replay.cli.progress import tell
    from replay.engine.files.models import for_intake
    from replay.show.verbs.corrections import put_right_json, put_right_text
    from replay.studies.again.stale import became_stale

    said = said_of(args)
    if not any(vars(said).values()) and args.bench is None and not args.dbc:
        raise CorrectionError("nothing to correct: say what is right: --bench, --dbc, --specimen, --batch or --kind")
    with Store.open(store_folder(args), write=True) as store:
        done = correct(store, args.what, said, (args.bench, databases_of(args)), args.reason, for_intake, tell)
        found = became_stale(store.ledger.events(), done.before, done.after)
        store.ledger.seal()
        answer = put_right_json(done, args.reason, found)
        data = {"schema": "whyhot.correction/1", **answer, "provenance": provenance(store)}
    return Answer(data, put_right_text("Corrected", done, args.reason, found), 1 if done.left else 0, notes=done.left)
