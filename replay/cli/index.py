"""`whyhot index --out site/`: pages over the whole store with a first page that leads to them, to lie on a share."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from replay.cli.answer import Answer, provenance, store_folder


def arguments(parser: argparse.ArgumentParser) -> None:
    says = "the folder of the pages; those that have not changed are not written again"
    parser.add_argument("-o", "--out", metavar="DIR", type=Path, required=True, help=says)


def run(args: argparse.Namespace) -> Answer:
    from functools import partial

    from ingest.facts import facts
    from ingest.facts.store import Store
    from replay.cli.progress import tell
    from replay.show.reports.site import INDEX, write_site
    from replay.show.reports.site_index import index_page
    from replay.show.reports.site_pages import wanted

    with Store.open(store_folder(args)) as store:
        known = facts.at(store.ledger)
        done = write_site(args.out, wanted(store, known), partial(index_page, store, known), tell)
        data = {"schema": "whyhot.index/1", "folder": str(args.out), **asdict(done), "provenance": provenance(store)}
    counts = f"{len(done.written)} files written, {len(done.kept)} unchanged, {len(done.removed)} removed"
    text = f"{args.out / INDEX}   {counts}; opens offline in any browser"
    return Answer(data, text, 1 if done.refused else 0, done.refused)
