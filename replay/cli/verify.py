"""`whyhot verify`: is every fact and every sealed byte what it was?"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from replay.cli.answer import Answer, provenance, store_folder

if TYPE_CHECKING:
    from ingest.facts.chain import Head


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--read", action="store_true", help="read and hash every sealed file and product too")
    says = "a head noted earlier (whyhot head): nothing before it may have changed"
    parser.add_argument("--since", metavar="POSITION:ROOT", help=says)


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import store_check
    from ingest.facts.store import Store

    with Store.open(store_folder(args)) as store:
        findings = store_check.damage(store, read=args.read, since=_head(args.since))
        hints = store_check.hints(store)
        head = store.ledger.head()
        made_from = provenance(store, read=args.read, since=args.since)
    data = {"schema": "whyhot.verify/1", "findings": findings, "hints": hints, "provenance": made_from}
    if findings:
        return Answer(data, f"{len(findings)} finding{'s' * (len(findings) != 1)}", code=1, notes=[*findings, *hints])
    depth = "every event and every sealed byte" if args.read else "every event (sealed bytes too with --read)"
    return Answer(data, f"intact: {depth}; head {head.position}:{head.root}", notes=hints)


def _head(text: str | None) -> Head | None:
    from ingest.errors import LedgerError
    from ingest.facts.chain import Head

    if text is None:
        return None
    position, _, root = text.partition(":")
    if not position.isdecimal() or len(root) != 64:
        raise LedgerError(f"--since {text}: is no head: give POSITION:ROOT as `whyhot head` printed it.")
    return Head(int(position), root)
