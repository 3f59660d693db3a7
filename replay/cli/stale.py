"""`whyhot stale [--redo]`: what was computed from facts that are others by now, and the same asked again."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--redo", action="store_true", help="ask all of them again")


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from ingest.facts.store import Store
    from replay.cli.progress import tell
    from replay.show.verbs.corrections import redone_text, stale_json, stale_text
    from replay.studies.again.redo import redo
    from replay.studies.again.stale import stale

    with Store.open(store_folder(args), write=args.redo) as store:
        done = redo(store, tell) if args.redo else []
        left = stale(store.ledger.events(), facts.at(store.ledger))
        data = {
            "schema": "whyhot.stale/1",
            "redone": [{"name": one.old.name, "why": one.old.why, "new": one.new} for one in done if one.new],
            "stale": stale_json(left),
            "stale_in_use": list(left.in_use),
            "provenance": provenance(store),
        }
    refusals = [one.refusal for one in done if one.refusal]
    return Answer(data, redone_text(done, left) if args.redo else stale_text(left), 1 if refusals else 0, refusals)
