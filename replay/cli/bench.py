"""`whyhot bench export NAME -o OUT`: a bench file of the store, as it is current."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from ingest.texts.names import handle
from replay.cli.answer import Answer, provenance, store_folder


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("action", choices=("export",), help="write the current version of a bench file of the store")
    parser.add_argument("bench", metavar="BENCH", help="a bench file's name or id, or a session that has it")
    says = "the file to write; an existing one is not overwritten"
    parser.add_argument("-o", "--out", metavar="OUT", type=Path, required=True, help=says)


def run(args: argparse.Namespace) -> Answer:
    from ingest.bench.bench_file import read_bench
    from ingest.facts import facts
    from ingest.facts.store import Store
    from replay.engine.files.benches import current_bench
    from replay.exports.export import whole

    with Store.open(store_folder(args)) as store:
        bench = current_bench(facts.at(store.ledger), args.bench)
        with whole(args.out) as path:
            path.write_bytes(text := store.archive.read(bench.sha256))
        named = read_bench(text, bench.name).motor
        data = {
            "schema": "whyhot.bench_export/1",
            "file": str(args.out),
            "bench": bench.sha256,
            "name": bench.name,
            "motor": bench.motor,
            "provenance": provenance(store),
        }
    lines = [f"{args.out}   {bench.name} {handle(bench.sha256)}"]
    if bench.motor and named:
        beside = args.out.parent / named  # where this bench file looks for it
        there = beside.exists()
        export = shlex.join(["whyhot", "motor", "export", bench.motor, "-o", "NEW" if there else str(beside)])
        lines.append(f"{beside} is there already: {export} writes the current one" if there else f"next: {export}")
    return Answer(data, "\n".join(lines))
