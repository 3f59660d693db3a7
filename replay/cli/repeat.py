"""`whyhot repeat S1 S2`: the same test again, and what reads differently where it was driven alike."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from replay.cli.answer import Answer, provenance, store_folder, typed
from replay.cli.asked import ask_as_of

if TYPE_CHECKING:
    from ingest.facts.store import Store
    from ingest.morning.repeat import Repeat


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("first", metavar="S1", help="the session to compare with: id, beginning of an id, or name")
    parser.add_argument("second", metavar="S2", help="the session that may differ from it")
    parser.add_argument("--report", metavar="F.html", type=Path, help="write one HTML file with a picture")
    ask_as_of(parser)


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from ingest.facts.store import Store
    from ingest.morning.repeat import repeat
    from replay.show.verbs.repeat import repeat_text

    with Store.open(store_folder(args)) as store:
        known = facts.at(store.ledger, args.as_of)
        found = repeat(store, known, known.session(args.first), known.session(args.second))
        if args.report:
            _write_report(found, store, args)
        data = {**found.to_json(), "provenance": provenance(store, as_of=args.as_of)}
    text = repeat_text(found)
    if args.report:
        data["report"] = str(args.report)
        text += f"\n{args.report}   opens offline in any browser"
    return Answer(data, text)


def _write_report(found: Repeat, store: Store, args: argparse.Namespace) -> None:
    from replay.show.reports.documents import context
    from replay.show.reports.repeat_report import write_repeat_report

    write_repeat_report(found, args.report, context(store, typed("repeat", args.first, args.second)))
