"""`whyhot replay S...`: the twin over recorded sessions, and what it gets wrong."""

from __future__ import annotations

import argparse
import shlex
from dataclasses import asdict
from typing import TYPE_CHECKING

from replay.cli.answer import Answer, provenance
from replay.cli.asked import as_of_note, ask_as_of, ask_level, ask_model, ask_workers, opened, sessions_of, workers_of

if TYPE_CHECKING:
    from ingest.facts.events import ReplayCompleted
    from twin.filters.by_filterpy import Apart


def arguments(parser: argparse.ArgumentParser) -> None:
    says = "ids or names of sessions (default: every session with a model)"
    parser.add_argument("sessions", metavar="S", nargs="*", help=says)
    ask_model(parser)
    ask_level(parser, "channels that the twin may start from")
    says = (
        "what the filter is to find, as loss.NODE.constant (a heat), loss.NODE.scale, conductance.A-B.scale or "
        "sensor.NODE.bias; may be given again (default: the loss of the magnets)"
    )
    parser.add_argument("--unknown", metavar="CAUSE", action="append", default=[], help=says)
    says = "bdf2 is the paper's; its distance from sdirk2 is printed (default sdirk2)"
    parser.add_argument("--integrator", choices=("sdirk2", "bdf2"), default="sdirk2", help=says)
    says = "run filterpy's filter beside the filter of each session, and say how far the two are apart"
    parser.add_argument("--check-filter", action="store_true", help=says)
    ask_workers(parser)
    ask_as_of(parser)


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from replay.cli.progress import tell
    from replay.engine.files.models import model_named
    from replay.engine.results.summary import read
    from replay.engine.runs.campaign import replay_sessions
    from replay.show.words.filter_words import left_out
    from replay.show.words.terminal import replay_text

    with opened(args) as store:
        known = facts.at(store.ledger)
        sessions = sessions_of(known, args.sessions) or list(known.sessions)
        model = model_named(store, args.model)
        outcomes = replay_sessions(
            store, sessions, model, args.level, workers_of(args), tell, args.integrator, args.unknown, args.check_filter
        )
        runs = [outcome.run for outcome in outcomes if outcome.run]
        summaries = [read(event.summary) for event in runs]
        refusals = [outcome.refusal for outcome in outcomes if outcome.refusal]
        settings = {"level": args.level, "model": args.model, "as_of": args.as_of}
        settings |= {"unknown": args.unknown} if args.unknown else {}
        data = {
            "schema": "whyhot.replay/1",
            "runs": [_run(outcome.run, outcome.apart) for outcome in outcomes if outcome.run],
            "refused": refusals,
            "notes": [f"{one.session_name}: {why}" for one in summaries for why in left_out(one)],
            "provenance": provenance(store, **settings),
        }
    if not runs:
        why = refusals[0] if refusals else "no sessions"
        return Answer({**data, "error": why}, "", 2, refusals or ["no sessions to replay"])
    checks = {outcome.session.name: outcome.apart for outcome in outcomes if outcome.run} if args.check_filter else {}
    name = shlex.quote(summaries[0].session_name)
    of_model = "" if args.model is None else f" --model {shlex.quote(args.model)}"
    onward = f"whyhot report {name}{of_model}" if args.as_of is None else f"whyhot replay {name}"
    return Answer(
        data, replay_text(summaries, onward, checks), 1 if refusals else 0, [*refusals, *as_of_note(args.as_of)]
    )


def _run(event: ReplayCompleted, checked: Apart | None) -> dict[str, object]:
    """A run as JSON: its summary and id, and how far filterpy's filter is from its own where that was asked for."""
    return {**event.summary, "run": event.run, **({"filter_check": asdict(checked)} if checked else {})}
