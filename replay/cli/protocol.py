"""`whyhot protocol --on S...`: influence on drive cycles, fit on S1 and S2, check and filter on drive cycles."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.asked import ask_model


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--on",
        metavar="S",
        nargs="+",
        required=True,
        help="ids or names of sessions: S1 and S2 points, and drive cycles",
    )
    ask_model(parser)
    parser.add_argument(
        "--level", choices=("testing", "production"), default="testing", help="channels that may be learnt from"
    )
    parser.add_argument("--report", metavar="FILE.html", type=Path, help="write the report to this file")


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from ingest.facts.store import Store
    from replay.cli.progress import tell
    from replay.engine.files.models import model_named
    from replay.engine.specimen.aged import ageing_left_out
    from replay.engine.specimen.maps_left import maps_left
    from replay.show.reports.protocol_report import write_protocol_report
    from replay.show.verbs.protocol import document, protocol_text
    from replay.studies.characterise.protocol import run_protocol, template_needed

    if args.model and args.model.endswith(".toml") and not Path(args.model).is_file():
        raise template_needed(f"--model {args.model}: there is no such file")
    with Store.open(store_folder(args), write=True) as store:
        model = model_named(store, args.model)
        known = facts.at(store.ledger)
        sessions = [known.session(text) for text in dict.fromkeys(args.on)]
        found = run_protocol(store, known, sessions, model, args.level, tell)
        if args.report:
            command = f"whyhot protocol --on {' '.join(args.on)}"
            write_protocol_report(store, found, args.report, command)
        left = maps_left(store, known, sessions, found.calibration.event.parent)
        left += ageing_left_out(store, known, sessions, found.calibration.event.parent)
        data = {**document(found), "notes": left, "provenance": provenance(store, level=args.level, model=args.model)}
    converged = found.calibration.event.converged
    unfinished = [] if converged else ["the search did not converge: give more points, or check the motor file."]
    return Answer(data, protocol_text(found), 1 if unfinished else 0, [*left, *unfinished])
