"""`whyhot verify`: is every fact and every sealed byte what it was?"""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--read", action="store_true", help="read and hash every sealed file and product too")


def run(args: argparse.Namespace) -> Answer:
    from ingest.store import Store

    with Store.open(store_folder(args)) as store:
        findings = store.verify(read=args.read)
        head = store.ledger.head()
        data = {"schema": "whyhot.verify/1", "findings": findings, "provenance": provenance(store, read=args.read)}
    if findings:
        return Answer(data, f"{len(findings)} findings.", code=1, notes=findings)
    depth = "every event and every sealed byte" if args.read else "every event (sealed bytes too with --read)"
    return Answer(data, f"intact: {depth}; head {head.position} {head.root[:12]}")
