"""`whyhot forget LOG... --reason TEXT`: a log must go for good: its bytes are removed, the fact of it remains."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.asked import ask_reason


def arguments(parser: argparse.ArgumentParser) -> None:
    says = "log, taken back before or not: its name, SHA-256, or the beginning of it"
    parser.add_argument("log", metavar="LOG", nargs="+", help=says)
    ask_reason(parser)


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts.store import Store
    from ingest.intake.retractions import forget
    from replay.show.verbs.corrections import forgotten_json, forgotten_text
    from replay.studies.again.stale import became_stale

    with Store.open(store_folder(args), write=True) as store:
        found = forget(store, args.log, args.reason)
        answers = became_stale(store.ledger.events(), found.done.before, found.done.after)
        store.ledger.seal()
        answer = forgotten_json(found, args.reason, answers)
        data = {"schema": "whyhot.forgetting/1", **answer, "provenance": provenance(store)}
    left = found.done.left
    return Answer(data, forgotten_text(found, args.reason, answers), 1 if left else 0, left)
