"""`whyhot restore DIR --store NEW`: a backup becomes a store, and every byte of it is checked."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.progress import tell


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", metavar="DIR", type=Path, help="the folder of the backup; --store names a new one")


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts.backup import restore
    from replay.show.verbs.backup import copied_json, restored_text

    store = store_folder(args)
    done, found = restore(args.folder, store, tell)
    damages = [one.says for one in found.damages]
    data = {
        "schema": "whyhot.restore/1",
        "store": str(store),
        "backup": str(args.folder),
        **copied_json(done),
        "damages": damages,
        "provenance": {**provenance(None), "store_head": vars(done.head)},
    }
    return Answer(data, restored_text(done, found, store), 1 if damages else 0, [*done.left, *damages])
