"""`whyhot protocol --on S...`: influence on drive cycles, fit on S1 and S2, check and filter on drive cycles."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.cli.answer import Answer, provenance
from replay.cli.asked import as_of_note, ask_as_of, ask_level, ask_model, ask_sessions, asked, asked_by, left_out


def arguments(parser: argparse.ArgumentParser) -> None:
    ask_sessions(parser, "ids or names of sessions: S1 and S2 points, and drive cycles")
    ask_model(parser)
    ask_level(parser)
    parser.add_argument("--report", metavar="FILE.html", type=Path, help="write the report to this file")
    ask_as_of(parser)


def run(args: argparse.Namespace) -> Answer:
    from replay.cli.progress import tell
    from replay.show.reports.protocol_report import write_protocol_report
    from replay.show.verbs.protocol import document, protocol_text
    from replay.studies.characterise.protocol import run_protocol, template_needed

    if args.model and args.model.endswith(".toml") and not Path(args.model).is_file():
        raise template_needed(f"--model {args.model}: there is no such file")
    with asked(args) as (store, known, model, sessions):
        found = run_protocol(store, known, sessions, model, args.level, tell)
        if args.report:
            write_protocol_report(store, found, args.report, asked_by("protocol", args))
        left = left_out(store, known, sessions, found.calibration.event.parent)
        settings = {"level": args.level, "model": args.model, "as_of": args.as_of}
        data = {**document(found), "notes": left, "provenance": provenance(store, **settings)}
    notes = [*left, *as_of_note(args.as_of)]
    if found.calibration.event.converged:
        return Answer(data, protocol_text(found), notes=notes)
    unfinished = "the search did not converge: give more points, or check the motor file."
    return Answer(data, protocol_text(found), 1, [*notes, unfinished])
