"""`whyhot rebuild`: samples and warehouse again from nothing but sealed bytes and the ledger."""

from __future__ import annotations

import argparse
from functools import partial

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.asked import ask_workers, workers_of


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--verify", action="store_true", help="compare everything with what it was before")
    ask_workers(parser)


def run(args: argparse.Namespace) -> Answer:
    from analytics.rebuild import rebuild
    from ingest.facts import facts
    from ingest.facts.store import Store
    from ingest.intake.making import redecode
    from ingest.intake.upgrade import needed
    from replay.cli.progress import tell
    from replay.show.words.words import counted

    with Store.open(store_folder(args), write=True) as store:
        again = partial(redecode, workers=workers_of(args), tell=tell)
        made = rebuild(store, again, verify=args.verify)
        known = facts.at(store.ledger)
        elsewhere = needed(store.ledger.events(), known)
        older = [known.files[raw].name for raw in elsewhere.logs]
        done = {"products": made.products, "views": made.views, "differences": list(made.differences)}
        data = {"schema": "whyhot.rebuild/1", **done, "provenance": provenance(store, verify=args.verify)}
    compared = ", each equal to what it was" if args.verify and not made.differences else ""
    text = f"rebuilt {made.products} decoded files and {made.views} views{compared}"
    notes = [*made.notes, *made.differences, *elsewhere.left]
    if older:
        said = f"{counted(len(older), 'log')} decoded by another version, whose files this one does not make again"
        notes.append(f"{said}: {', '.join(older)}; next: whyhot upgrade")
    return Answer(data, text, 1 if made.differences else 0, notes)
