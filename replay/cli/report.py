"""`whyhot report S...` or `whyhot report DIAGNOSIS`: one HTML file of sealed runs, or of a diagnosis."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, typed
from replay.cli.asked import ask_as_of, ask_page, opened


def arguments(parser: argparse.ArgumentParser) -> None:
    says = "replayed sessions (default: all), or one diagnosis as d-4f0c"
    parser.add_argument("sessions", metavar="S", nargs="*", help=says)
    says = (
        "model id, motor name or motor file that the replays are of (default: the one that is current for each session)"
    )
    parser.add_argument("--model", metavar="M", help=says)
    ask_page(parser, "report.html")
    ask_as_of(parser)


def run(args: argparse.Namespace) -> Answer:
    if len(args.sessions) == 1 and args.sessions[0].startswith("d-"):
        return _of_diagnosis(args)
    from ingest.facts import facts
    from replay.engine.files.models import known_model
    from replay.show.reports.documents import write_replay_report
    from replay.show.reports.report import mixed

    with opened(args, write=False) as store:
        known = facts.at(store.ledger)
        model = None if args.model is None else known_model(known, args.model)
        command = typed("report", *args.sessions, model=args.model, as_of=args.as_of)
        runs = write_replay_report(store, known, args.sessions, args.out, command, model)
        data = {
            "schema": "whyhot.report/1",
            "file": str(args.out),
            "runs": [run.run for run in runs],
            "provenance": provenance(store, model=args.model, as_of=args.as_of),
        }
    made = f"{args.out}   {len(runs)} session{'s' * (len(runs) != 1)}; opens offline in any browser"
    return Answer(data, "\n".join(filter(None, [made, mixed(runs)])))


def _of_diagnosis(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from replay.cli.progress import tell
    from replay.errors import ReplayDataError
    from replay.show.reports.documents import write_diagnosis
    from replay.studies.diagnosis.accept import find_diagnosis

    (name,) = args.sessions
    if args.model is not None:
        raise ReplayDataError(f"--model {args.model}: {name} shows the models of its own: leave --model out.")
    with opened(args) as store:
        diagnosis = find_diagnosis(store, facts.at(store.ledger), name)
        write_diagnosis(store, diagnosis, args.out, typed("report", name, as_of=args.as_of), tell)
        data = {
            "schema": "whyhot.report/1",
            "file": str(args.out),
            "diagnosis": diagnosis.diagnosis,
            "provenance": provenance(store, as_of=args.as_of),
        }
    return Answer(data, f"{args.out}   diagnosis {name}; opens offline in any browser")
