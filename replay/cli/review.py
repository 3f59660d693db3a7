"""`whyhot review DIAGNOSIS`: its change of motor and bench file as a page that a colleague can sign."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder, typed
from replay.cli.asked import ask_page


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("diagnosis", metavar="DIAGNOSIS", help="id of a diagnosis, or its beginning, as d-4f0c")
    ask_page(parser, "review.html")


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts.store import Store
    from replay.cli.progress import tell
    from replay.show.reports.documents import context
    from replay.show.reports.review_report import document, review_text, write_review
    from replay.studies.diagnosis.review import review

    with Store.open(store_folder(args), write=True) as store:
        found = review(store, args.diagnosis, tell)
        write_review(found, args.out, context(store, typed("review", args.diagnosis)))
        data = {**document(found), "file": str(args.out), "provenance": provenance(store)}
    return Answer(data, review_text(found, args.out))
