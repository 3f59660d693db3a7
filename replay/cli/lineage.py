"""`whyhot lineage X`: from a number back to the frames, files, code and command that it came from."""

from __future__ import annotations

import argparse
import json
import re

from replay.cli.answer import Answer, provenance
from replay.cli.asked import ask_as_of, opened

QUERY = re.compile(r"\s*(select|from|with)\s", re.IGNORECASE)


def arguments(parser: argparse.ArgumentParser) -> None:
    says = (
        "a session, log, replay, diagnosis, calibration, model, bench file or inspection by name or id; "
        "RUN@TIME/CHANNEL, a point of a replay (TIME in seconds or as 1:02:03; without it the mean over the run, as a "
        "report gives it; RUN may be a session); LOG:RECORD or LOG:FIRST-LAST; or a SELECT, of which the first row "
        "counts"
    )
    parser.add_argument("what", metavar="X", help=says)
    parser.add_argument(
        "--openlineage",
        action="store_true",
        help="as events of OpenLineage, one a line of JSON, for catalogues of data",
    )
    ask_as_of(parser)


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from replay.show.verbs.lineage import lineage_json, lineage_text
    from replay.studies.lineage.openlineage import events
    from replay.studies.lineage.trace import trace, trace_row

    with opened(args, write=False) as store:
        recorded = store.ledger.events()
        known = facts.fold(recorded)
        if QUERY.match(args.what):
            from analytics import query

            found = trace_row(store, recorded, known, query.first_row(store, args.what, query.SECONDS))
        else:
            found = trace(store, recorded, known, args.what)
        data = {
            "schema": "whyhot.lineage/1",
            "what": args.what,
            **lineage_json(found),
            "provenance": provenance(store, as_of=args.as_of),
        }
        if args.openlineage:
            return Answer(data, "\n".join(json.dumps(one) for one in events(known, found.links)))
    return Answer(data, lineage_text(found))
