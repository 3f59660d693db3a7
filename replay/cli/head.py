"""`whyhot head`: the ledger's head, to be kept elsewhere as proof of what was known."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder


def arguments(parser: argparse.ArgumentParser) -> None:
    """No arguments of its own."""


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts.store import Store

    with Store.open(store_folder(args)) as store:
        head = store.ledger.head()
        data = {"schema": "whyhot.head/1", **vars(head), "provenance": provenance(store)}
    return Answer(data, str(head))
