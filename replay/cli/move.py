"""`whyhot move URL | sqlite`: the ledger into a PostgreSQL server, or back into the store's folder."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.progress import tell


def arguments(parser: argparse.ArgumentParser) -> None:
    says = "postgresql://USER@HOST:5432/DATABASE, without a password; or the word sqlite, for the store's folder"
    parser.add_argument("to", metavar="URL|sqlite", help=says)


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts.move import move
    from replay.show.verbs.move import moved_text

    folder = store_folder(args)
    done = move(folder, args.to, tell)
    data = {
        "schema": "whyhot.move/1",
        "store": str(folder),
        "from": done.was,
        "to": done.now,
        "provenance": {**provenance(None), "store_head": vars(done.head)},
    }
    return Answer(data, moved_text(done), 1 if done.left else 0, done.left)
