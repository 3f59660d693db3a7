"""`whyhot envelope --on S...`: load over speed that the motor bears for ever and for 10, 30 and 60 s."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance
from replay.cli.asked import ask_as_of, ask_level, ask_model, ask_picture, ask_sessions, asked, left_out, picture_note


def arguments(parser: argparse.ArgumentParser) -> None:
    ask_sessions(parser, "ids or names of sessions that show currents over speed and torque")
    ask_model(parser)
    ask_level(parser, "channels that bands may use")
    ask_picture(parser)
    ask_as_of(parser)


def run(args: argparse.Namespace) -> Answer:
    from replay.cli.progress import tell
    from replay.show.verbs.envelope import document, envelope_text, picture
    from replay.studies.characterise.envelope import envelope

    with asked(args, write=args.model is not None) as (store, known, model, sessions):
        found = envelope(store, known, sessions, model, args.level, tell)
        left = left_out(store, known, sessions, found.model)
        settings = {"level": args.level, "model": args.model, "as_of": args.as_of}
        data = {**document(found), "notes": left, "provenance": provenance(store, **settings)}
    if args.out:
        picture(found, args.out)
    return Answer(data, envelope_text(found), notes=[*left, *([picture_note(args.out)] if args.out else [])])
