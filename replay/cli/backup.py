"""`whyhot backup DIR`: what another folder lacks of the store is copied there."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.progress import tell


def arguments(parser: argparse.ArgumentParser) -> None:
    says = "the folder of the backup, on another disk; it is created, or brought up to date"
    parser.add_argument("folder", metavar="DIR", type=Path, help=says)
    says = "also read and hash what the backup holds already, and copy damaged files again"
    parser.add_argument("--read", action="store_true", help=says)


def run(args: argparse.Namespace) -> Answer:
    from ingest.errors import StoreError
    from ingest.facts.backup import backup
    from replay.cli.refusal import of_machine
    from replay.show.verbs.backup import backed_up_text, copied_json

    store = store_folder(args)
    try:
        done = backup(store, args.folder, args.read, tell)
    except OSError as error:  # the store was read: what fails is the other disk
        raise StoreError(of_machine(error, str(args.folder))) from None
    data = {
        "schema": "whyhot.backup/1",
        "store": str(store),
        "backup": str(args.folder),
        **copied_json(done),
        "provenance": {**provenance(None, read=args.read), "store_head": vars(done.head)},
    }
    return Answer(data, backed_up_text(done, args.folder), 1 if done.left else 0, done.left)
