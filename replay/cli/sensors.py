"""`whyhot sensors --on S...`: what each sensor is worth, and the margin from a vehicle's sensors to the hot spot."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance
from replay.cli.asked import ask_as_of, ask_model, ask_sessions, asked


def arguments(parser: argparse.ArgumentParser) -> None:
    ask_sessions(parser, "ids or names of sessions")
    ask_model(parser)
    says = "channels that a vehicle has (default: those of level production)"
    parser.add_argument("--vehicle", metavar="CHANNEL", nargs="+", default=[], help=says)
    says = "share of the time in which the hot spot may exceed its limit (default 0.01)"
    parser.add_argument("--risk", type=_share, default=0.01, help=says)
    ask_as_of(parser)


def _share(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < 0.5:
        raise argparse.ArgumentTypeError(f"{text} is no share: give a number above 0 and below 0.5, such as 0.01")
    return value


def run(args: argparse.Namespace) -> Answer:
    from replay.cli.progress import tell
    from replay.engine.specimen.maps_left import maps_left
    from replay.show.verbs.sensors import document, sensors_text
    from replay.studies.characterise.sensors import sensors_worth

    with asked(args, write=args.model is not None) as (store, known, model, sessions):
        found = sensors_worth(store, known, sessions, model, list(dict.fromkeys(args.vehicle)), args.risk, tell)
        left = maps_left(store, known, sessions, found.model)
        data = {**document(found), "notes": left, "provenance": provenance(store, model=args.model, as_of=args.as_of)}
    return Answer(data, sensors_text(found), notes=left)
