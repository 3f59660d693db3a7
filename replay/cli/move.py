"""`whyhot move URL | sqlite | files`: the ledger into a PostgreSQL server, the files into a bucket, or back."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.progress import tell


def arguments(parser: argparse.ArgumentParser) -> None:
    says = "the ledger: postgresql://USER@HOST:5432/DATABASE, without a password, or the word sqlite, for the store's "
    says += "folder; sealed and decoded files: s3://BUCKET/PREFIX, without a key, or the word files, for the folder"
    parser.add_argument("to", metavar="URL|sqlite|files", help=says)


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts.bucket import is_bucket
    from ingest.facts.move import move
    from ingest.facts.move_files import HERE, move_files
    from replay.show.verbs.move import moved_text

    folder = store_folder(args)
    done = (move_files if is_bucket(args.to) or args.to == HERE else move)(folder, args.to, tell)
    data = {
        "schema": "whyhot.move/1",
        "store": str(folder),
        "from": done.was,
        "to": done.now,
        "provenance": {**provenance(None), "store_head": vars(done.head)},
    }
    return Answer(data, moved_text(done), 1 if done.left else 0, done.left)
