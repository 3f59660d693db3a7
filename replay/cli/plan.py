"""`whyhot plan --sessions S...`: what these sessions could find, and the bench day that would show most besides; with
`--tests` of tests that have not been run."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from replay.cli.answer import Answer, provenance
from replay.cli.asked import ask_as_of, ask_level, asked, left_out

if TYPE_CHECKING:
    from replay.studies.planning.plan import Planned

A_DAY_H = 6.0


def arguments(parser: argparse.ArgumentParser) -> None:
    what = parser.add_mutually_exclusive_group(required=True)
    says = "ids or names of recorded sessions: what they show, and what they leave silent"
    what.add_argument("--sessions", metavar="S", nargs="+", dest="on", help=says)
    says = "tests that have not been run, each as a CSV with the columns of --out; needs --bench and no store"
    what.add_argument("--tests", metavar="FILE.csv", nargs="+", type=Path, help=says)
    says = "the bench file that says which sensors there are: needed with --tests; sessions were read with theirs"
    parser.add_argument("--bench", metavar="B", type=Path, help=says)
    says = "model id, motor name or motor file (default: what the bench file names); with --tests a motor file"
    parser.add_argument("--motor", metavar="M", dest="model", help=says)
    ask_level(parser)
    says = f"bench hours available, rests included (default {A_DAY_H:g})"
    parser.add_argument("--hours", type=_hours, default=A_DAY_H, help=says)
    says = "plan for these causes alone (ids; default: for all candidates)"
    parser.add_argument("--cause", metavar="C", nargs="+", default=[], help=says)
    says = "write the day for the bench to this file: one row a second, one column for each set value"
    parser.add_argument("-o", "--out", metavar="FILE.csv", type=Path, help=says)
    ask_as_of(parser)
    parser.set_defaults(refuse=parser.error)


def _hours(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value <= 24.0:
        raise argparse.ArgumentTypeError(f"{text} is no time on a bench: give hours above 0 and at most 24, such as 6")
    return value


def run(args: argparse.Namespace) -> Answer:
    from replay.cli.progress import tell
    from replay.show.verbs.plan import document, plan_text
    from replay.studies.planning.plan import plan, refuse_other_bench
    from replay.studies.planning.written import write_plan

    if args.out and args.out.suffix != ".csv":
        args.refuse(f"--out writes a CSV: end {args.out} in .csv")
    if args.tests and not args.bench:
        args.refuse("--tests needs --bench: the bench file says which sensors the tests are read with")
    if args.tests and args.as_of:
        args.refuse("--as-of goes with --sessions: tests that have not been run ask no store")
    settings = {"level": args.level, "motor": args.model, "hours": args.hours, "cause": args.cause, "as_of": args.as_of}
    if args.out and args.out.resolve() in _read_from(args):
        args.refuse(f"{args.out} is a file that the day is planned from: give --out another name")
    if args.tests:
        found, left, origin = _of_tests(args), [], provenance(None, **settings)
    else:
        with asked(args, write=args.model is not None) as (store, known, model, sessions):
            if args.bench:
                refuse_other_bench(known, sessions, args.bench)
            found = plan(store, known, sessions, model, args.level, args.hours, args.cause, tell)
            left, origin = left_out(store, known, sessions, found.model), provenance(store, **settings)
    if args.out:
        write_plan(found, args.out)
    written = [f"{args.out}   the day, a row a second"] if args.out else []
    data = {**document(found), "notes": left, "provenance": origin}
    return Answer(data, plan_text(found, _onward(args)), notes=[*left, *written])


def _read_from(args: argparse.Namespace) -> set[Path]:
    """The files that the plan is made from."""
    given = [*(args.tests or ()), args.bench, Path(args.model) if args.model else None]
    return {one.resolve() for one in given if one}


def _onward(args: argparse.Namespace) -> str:
    """The day and what it promises as files, or what to do with them."""
    if args.out:
        return f"run {args.out} on the bench, then whyhot ingest FILE --bench FILE"
    words = ["--tests", *map(str, args.tests), "--bench", str(args.bench)] if args.tests else ["--sessions", *args.on]
    said = {"--motor": args.model, "--level": args.level, "--hours": f"{args.hours:g}", "--as-of": args.as_of}
    words += [word for flag, value in said.items() if value for word in (flag, value)]
    words += ["--cause", *args.cause] if args.cause else []
    return f"the day as a file: {shlex.join(['whyhot', 'plan', *words, '--out', 'day.csv', '--json', 'plan.json'])}"


def _of_tests(args: argparse.Namespace) -> Planned:
    from replay.cli.progress import tell
    from replay.studies.planning.listed import read_listed
    from replay.studies.planning.plan import plan_listed

    if args.model and not args.model.endswith(".toml"):
        args.refuse("with --tests --motor is a motor file (ends in .toml): no store is asked")
    listed = read_listed(args.tests, args.bench, Path(args.model) if args.model else None)
    return plan_listed(listed, args.level, args.hours, args.cause, tell)
