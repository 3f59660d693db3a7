"""`whyhot diagnose --on S... [--hold-out S...]`: what is wrong, why, and what the extended model gains."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.cli.answer import Answer, provenance
from replay.cli.asked import (
    as_of_note,
    ask_as_of,
    ask_level,
    ask_model,
    ask_sessions,
    asked,
    asked_by,
    left_out,
    sessions_of,
)


def arguments(parser: argparse.ArgumentParser) -> None:
    ask_sessions(parser, "ids or names of sessions to learn from")
    says = "sessions kept to measure the gain on; opened once"
    parser.add_argument("--hold-out", metavar="S", nargs="+", default=[], help=says)
    ask_model(parser)
    ask_level(parser)
    parser.add_argument("--report", metavar="F.html", type=Path, help="write the report of the diagnosis to this file")
    says = "compare the answer with this plan, a file that `whyhot plan --json P` wrote: what it promised, what came"
    parser.add_argument("--planned", metavar="P", type=Path, help=says)
    ask_as_of(parser)


def run(args: argparse.Namespace) -> Answer:
    from replay.cli.progress import tell
    from replay.show.reports.diagnosis_text import diagnosis_text
    from replay.show.reports.documents import write_diagnosis
    from replay.show.verbs import planned
    from replay.studies.diagnosis.answer import document
    from replay.studies.diagnosis.diagnose import diagnose
    from replay.studies.planning.promised import read_plan

    plan = read_plan(args.planned) if args.planned else None
    with asked(args) as (store, known, model, train):
        kept = sessions_of(known, args.hold_out)
        if plan:
            plan.refuse_other(known, [*train, *kept], model)
        found = diagnose(store, known, train, kept, model, args.level, tell)
        if args.report:
            command = asked_by("diagnose", args, hold_out=args.hold_out)
            write_diagnosis(store, found, args.report, command, tell)
        left = left_out(store, known, [*train, *kept], found.model)
        data = {
            **document(found, provenance(store, level=args.level, model=args.model, as_of=args.as_of)),
            "notes": left,
        }
    data |= {"planned": planned.document(plan, found)} if plan else {}
    text = diagnosis_text(found, list(planned.paragraphs(plan, found)) if plan else ())
    written = [f"{args.report}   opens offline in any browser"] if args.report else []
    return Answer(data, text, notes=[*left, *written, *as_of_note(args.as_of)])
