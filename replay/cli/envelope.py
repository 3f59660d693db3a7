"""`whyhot envelope --on S...`: load over speed that the motor bears for ever and for 10, 30 and 60 s."""

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
        help="ids or names of sessions that show currents over speed and torque",
    )
    ask_model(parser)
    parser.add_argument(
        "--level", choices=("testing", "production"), default="testing", help="channels that bands may use"
    )
    parser.add_argument(
        "--out", metavar="FILE.svg", type=Path, help="write the picture to this file, and a .png beside it"
    )
    parser.set_defaults(refuse=parser.error)


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from ingest.facts.store import Store
    from replay.cli.progress import tell
    from replay.engine.files.models import model_named
    from replay.engine.specimen.aged import ageing_left_out
    from replay.engine.specimen.maps_left import maps_left
    from replay.show.verbs.envelope import document, envelope_text, picture
    from replay.studies.characterise.envelope import envelope

    if args.out and args.out.suffix != ".svg":
        args.refuse(f"--out writes an SVG, and a .png beside it: end {args.out} in .svg")
    with Store.open(store_folder(args), write=args.model is not None) as store:
        model = model_named(store, args.model)
        known = facts.at(store.ledger)
        sessions = [known.session(text) for text in dict.fromkeys(args.on)]
        found = envelope(store, known, sessions, model, args.level, tell)
        left = maps_left(store, known, sessions, found.model)
        left += ageing_left_out(store, known, sessions, found.model)
        data = {**document(found), "notes": left, "provenance": provenance(store, level=args.level, model=args.model)}
    if args.out:
        picture(found, args.out)
    written = [f"{args.out}   and {args.out.with_suffix('.png').name} beside it"] if args.out else []
    return Answer(data, envelope_text(found), notes=[*left, *written])
