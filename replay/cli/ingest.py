"""`whyhot ingest FILE...`: logs become facts, and every record is accounted for."""

from __future__ import annotations

import argparse

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.asked import ask_databases, ask_logs, ask_said, ask_workers, databases_of, said_of, workers_of


def arguments(parser: argparse.ArgumentParser) -> None:
    ask_logs(parser)
    ask_said(parser)
    ask_databases(parser)
    ask_workers(parser)


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts.store import Store
    from ingest.facts.store_check import without_events
    from ingest.intake.given import opened
    from ingest.intake.intake import take_in
    from ingest.intake.setup import prepare
    from replay.cli.progress import tell
    from replay.engine.files.models import for_intake
    from replay.show.verbs.intake import intake_json, intake_text

    databases, said = databases_of(args), said_of(args)
    with opened(args.files, databases) as given:
        logs = [*given.logs]
        setup = prepare(logs, args.bench, databases, for_intake)
        with Store.open(store_folder(args), create=True, write=True) as store:
            lost = None if store.ledger.head().position else without_events(store)
            intake = take_in(store, logs, setup, said, tell, workers=workers_of(args))
            store.ledger.seal()
            origin = provenance(store, bench=str(args.bench) if args.bench else None)
    data = {**intake_json(intake), "skipped": given.skipped, "refused": given.refused, "provenance": origin}
    nothing = not any(one.decode for one in intake.files)
    refusals = [*given.refused, *intake.refusals]
    notes = [*([lost] if lost else []), *given.skipped, *refusals]
    return Answer(data, "" if nothing else intake_text(intake), 1 if refusals else 0, notes)
