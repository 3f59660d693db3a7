"""`whyhot calibrate --on S...`: coefficients from recorded sessions, as a new model."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance
from replay.cli.asked import as_of_note, ask_as_of, ask_level, ask_model, ask_sessions, asked


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.epilog = (
        "Sessions kept aside to measure the new model on: leave them out of --on, and replay them with --model; "
        "whyhot diagnose --hold-out does both."
    )
    ask_sessions(parser, "ids or names of sessions to learn from")
    ask_model(parser)
    ask_level(parser)
    says = "parameters, such as loss.magnet.speed2, for which to print what the data alone say (profile likelihood)"
    parser.add_argument("--profile", metavar="NAME", nargs="+", default=[], help=says)
    ask_as_of(parser)


def run(args: argparse.Namespace) -> Answer:
    from replay.cli.progress import tell
    from replay.engine.specimen.maps_left import maps_left
    from replay.show.verbs.calibration import calibration_text, free, moved
    from replay.studies.characterise.calibrate import calibrate_sessions, profiles

    with asked(args) as (store, known, model, sessions):
        result = calibrate_sessions(store, known, sessions, model, args.level, tell=tell)
        event = result.event
        notes = maps_left(store, known, sessions, event.parent)
        data = {
            "schema": "whyhot.calibration/1",
            "calibration": event.calibration,
            "model": event.model,
            "parent": event.parent,
            "motor": event.motor,
            "level": event.level,
            "on": [{"session": session.session, "name": session.name} for session in sessions],
            "converged": event.converged,
            "iterations": event.iterations,
            "log_posterior": event.log_posterior,
            "parameters": event.parameters,
            "moved": [p["name"] for p in event.parameters if moved(p)],
            "left_free": [p["name"] for p in event.parameters if free(p)],
            "errors": event.errors,
            "profiles": profiles(result, list(dict.fromkeys(args.profile))),
            "notes": notes,
            "provenance": provenance(store, level=args.level, model=args.model, as_of=args.as_of),
        }
    notes = [*notes, *as_of_note(args.as_of)]
    if event.converged:
        return Answer(data, calibration_text(data), notes=notes)
    unfinished = "the search did not converge: give more sessions, or check the motor file."
    return Answer(data, calibration_text(data), 1, [*notes, unfinished])
