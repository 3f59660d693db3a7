"""`whyhot view S...`: the layers of sessions in the rerun viewer."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.cli.answer import Answer, provenance, store_folder


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("sessions", metavar="S", nargs="+", help="sessions; their latest replays come along as layers")
    says = "where the .rrd files go (default: layers)"
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("layers"), help=says)
    parser.add_argument("--write-only", action="store_true", help="write the layers and do not open the viewer")


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from ingest.facts.store import Store
    from replay.show.reports.documents import write_layers
    from replay.show.reports.layers import view

    with Store.open(store_folder(args)) as store:
        paths = write_layers(store, facts.at(store.ledger), args.sessions, args.out)
        data = {"schema": "whyhot.view/1", "files": [str(p) for p in paths], "provenance": provenance(store)}
    if not args.write_only:
        view(paths)
    return Answer(data, "\n".join(str(path) for path in paths))
