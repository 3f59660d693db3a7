"""`whyhot morning DIR`: what a day's logs hold, what is wrong with them, and the last run of each test beside them."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from replay.cli.answer import Answer, provenance, store_folder, typed
from replay.cli.asked import ask_databases, ask_logs, databases_of

if TYPE_CHECKING:
    from ingest.facts.facts import Facts
    from ingest.facts.store import Store
    from ingest.morning.morning import Morning


def arguments(parser: argparse.ArgumentParser) -> None:
    ask_logs(parser)
    says = "bench file: what each signal means (default: the one in the folder, else the last of the store)"
    parser.add_argument("--bench", metavar="B", type=Path, help=says)
    ask_databases(parser)
    says = "take the logs into the store as `whyhot ingest` does; without, nothing is stored"
    parser.add_argument("--report", metavar="F.html", type=Path, help="write one HTML file with pictures")
    parser.add_argument("--ingest", action="store_true", help=says)


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts.sessions import Override
    from ingest.intake.given import opened
    from ingest.intake.intake import take_in
    from ingest.morning.found_setup import found_setup, taken_as_found
    from ingest.morning.morning import morning
    from replay.cli.progress import tell
    from replay.engine.files.models import for_intake
    from replay.show.verbs.morning import morning_json, morning_text

    databases = databases_of(args)
    with opened(args.files, databases) as given, _stores(store_folder(args), args.ingest) as (store, past):
        found = found_setup(args.files, [*given.logs], args.bench, databases, for_intake, past)
        found, intake = taken_as_found(found, lambda setup: take_in(store, [*given.logs], setup, Override(), tell))
        tell("looking")
        answer = morning(store, intake, past, found.source, args.ingest)
        store.ledger.seal()
        said = provenance(past[0] if past else None, setup=found.source, kept=args.ingest)
        skipped = [*(line for line in given.skipped if not found.explains(line)), *found.unread]
        refusals = [*given.refused, *intake.refusals]
        if args.report:
            tell("drawing")
            _write_report(answer, [*skipped, *refusals], past[0] if past else None, args)
    lists = {"skipped": skipped, "refused": given.refused}
    data = {**morning_json(answer), **lists, "provenance": said}
    nothing = not any(one.decode for one in intake.files)
    text = "" if nothing else morning_text(answer, _given(args))
    if args.report:
        data["report"] = str(args.report)
        text += f"\n{args.report}   opens offline in any browser"
    return Answer(data, text, 1 if refusals else 0, [*skipped, *refusals])


def _given(args: argparse.Namespace) -> list[str]:
    """The logs and what they are read with, as they were typed."""
    bench = ["--bench", str(args.bench)] if args.bench else []
    return [*map(str, args.files), *bench, *(word for one in args.dbc for word in ("--dbc", str(one)))]


def _write_report(found: Morning, notes: Sequence[str], store: Store | None, args: argparse.Namespace) -> None:
    from replay.show.reports.documents import context
    from replay.show.reports.morning_report import write_morning_report

    command = typed("morning", *_given(args), *(["--ingest"] if args.ingest else []))
    write_morning_report(found, notes, args.report, context(store, command))


@contextmanager
def _stores(folder: Path, kept: bool) -> Iterator[tuple[Store, tuple[Store, Facts] | None]]:
    """The store that the logs go into, and the one that was there before with its facts: the same where they are kept,
    else one that is thrown away."""
    from ingest.facts import facts
    from ingest.facts.durable import scratch
    from ingest.facts.store import MARK, Store

    if kept:
        with Store.open(folder, create=True, write=True) as store:
            yield store, (store, facts.at(store.ledger))
        return
    with scratch() as away, Store.open(away / "s", create=True) as store:
        if not (folder / MARK).is_file():
            yield store, None
            return
        with Store.open(folder) as past:
            yield store, (past, facts.at(past.ledger))
