"""`whyhot diagnose --on S... [--hold-out S...]`: what is wrong, why, and what the extended model gains."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.asked import ask_model


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--on", metavar="S", nargs="+", required=True, help="ids or names of sessions to learn from")
    parser.add_argument(
        "--hold-out", metavar="S", nargs="+", default=[], help="sessions kept to measure the gain on; opened once"
    )
    ask_model(parser)
    parser.add_argument(
        "--level", choices=("testing", "production"), default="testing", help="channels that may be learnt from"
    )
    parser.add_argument("--report", metavar="F.html", type=Path, help="write the report of the diagnosis to this file")


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from ingest.facts.store import Store
    from replay.cli.progress import tell
    from replay.engine.files.models import model_named
    from replay.engine.specimen.aged import ageing_left_out
    from replay.engine.specimen.maps_left import maps_left
    from replay.show.reports.diagnosis_text import diagnosis_text
    from replay.show.reports.documents import write_diagnosis
    from replay.studies.diagnosis.answer import document
    from replay.studies.diagnosis.diagnose import diagnose

    with Store.open(store_folder(args), write=True) as store:
        model = model_named(store, args.model)
        known = facts.at(store.ledger)
        train = [known.session(text) for text in dict.fromkeys(args.on)]
        kept = [known.session(text) for text in dict.fromkeys(args.hold_out)]
        found = diagnose(store, known, train, kept, model, args.level, tell)
        if args.report:
            command = "whyhot diagnose --on " + " ".join(args.on)
            command += " --hold-out " + " ".join(args.hold_out) if args.hold_out else ""
            write_diagnosis(store, found.diagnosis, args.report, command, tell)
        left = maps_left(store, known, [*train, *kept], found.diagnosis.model)
        left += ageing_left_out(store, known, [*train, *kept], found.diagnosis.model)
        data = {**document(found.diagnosis, provenance(store, level=args.level, model=args.model)), "notes": left}
    written = [f"{args.report}   opens offline in any browser"] if args.report else []
    return Answer(data, diagnosis_text(found.diagnosis), notes=[*left, *written])
