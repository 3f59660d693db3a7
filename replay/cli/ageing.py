"""`whyhot ageing`: what heat has done to the insulation of every specimen, which stand out, and what life is left."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.cli.answer import Answer, provenance, store_folder, typed
from replay.cli.asked import ask_as_of, ask_picture, ask_workers, picture_note, workers_of


def arguments(parser: argparse.ArgumentParser) -> None:
    says = (
        "model id, motor name or motor file: checks in one of its configurations are evaluated through it, and the law "
        "of deterioration is written into it, as a new model"
    )
    parser.add_argument("--motor", metavar="M", help=says)
    ask_workers(parser)
    ask_as_of(parser)
    ask_picture(parser)
    parser.add_argument("--report", metavar="F.html", type=Path, help="write one HTML file with pictures")


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from ingest.facts.store import Store
    from replay.cli.progress import tell
    from replay.engine.files.models import model_named
    from replay.show.verbs.ageing import ageing_text
    from replay.studies.ageing.assess import assess
    from replay.studies.ageing.assessment import document

    with Store.open(store_folder(args), write=args.as_of is None) as store:
        model = model_named(store, args.motor)
        known = facts.at(store.ledger, args.as_of)
        found = assess(store, known, model, args.as_of, tell, workers_of(args))
        data = document(found, provenance(store, motor=args.motor, as_of=args.as_of))
        if args.report:
            from replay.show.reports.ageing_report import write_ageing_report
            from replay.show.reports.documents import context

            asked = context(store, typed("ageing", motor=args.motor, as_of=args.as_of))
            write_ageing_report(found, args.report, asked, kept=args.as_of is None)
            data |= {"report": str(args.report)}
    notes = list(found.notes)
    if args.report:
        notes.append(f"{args.report}   opens offline in any browser")
    if args.out:
        from replay.show.verbs.ageing_plot import picture  # matplotlib takes half a second to load

        picture(found, args.out)
        notes.append(picture_note(args.out))
    return Answer(data, ageing_text(found, kept=args.as_of is None), notes=notes)
