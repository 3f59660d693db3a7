"""`whyhot upgrade [--dry-run]`: what in a store an earlier version made, and its logs decoded anew by this one."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--dry-run", action="store_true", help="say what would be done, and do nothing")


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from ingest.facts.store import Store
    from ingest.intake.upgrade import needed, upgrade
    from replay.cli.progress import tell
    from replay.engine.files.models import for_intake
    from replay.show.verbs.upgrade import upgrade_text

    with Store.open(store_folder(args), write=not args.dry_run) as store:
        known = facts.at(store.ledger)
        found = needed(store.ledger.events(), known)
        refused = [] if args.dry_run else upgrade(store, list(found.logs), for_intake, tell)
        names = [known.files[raw].name for raw in found.logs]
        data = {
            "schema": "whyhot.upgrade/1",
            "events": dict(found.events),
            "logs": [{"file_id": raw, "decoder": decoder} for raw, decoder in found.logs.items()],
            "dry_run": args.dry_run,
            "provenance": provenance(store),
        }
    left = [*refused, *found.left]
    return Answer(data, upgrade_text(found, names, args.dry_run), 1 if left else 0, left)
