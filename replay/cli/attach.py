"""`whyhot attach FILE... --specimen S --finding TEXT`: any file (a photograph) sealed with what was found on S."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from replay.cli.answer import Answer, provenance, store_folder

if TYPE_CHECKING:
    from ingest.intake.attachments import AttachedFile


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("files", metavar="FILE", nargs="+", type=Path, help="photograph, thermogram or any other file")
    parser.add_argument("--specimen", metavar="S", required=True, help="which motor or part was inspected")
    parser.add_argument("--finding", metavar="TEXT", required=True, help='what it shows, as "resin cracked at slot 3"')
    when = parser.add_mutually_exclusive_group()
    when.add_argument("--when", metavar="TIME", help="time of the inspection, as 2025-12-24T08:00:00Z")
    when.add_argument("--session", metavar="ID", help="the session that it followed: id, beginning of it, or name")


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from ingest.facts.store import Store
    from ingest.intake.attachments import Finding, attach, unknown_specimen

    finding = Finding(args.specimen, args.finding, args.when, args.session)
    with Store.open(store_folder(args), create=True, write=True) as store:
        done = attach(store, args.files, finding)
        store.ledger.seal()
        note = unknown_specimen(facts.at(store.ledger), done[0].event.specimen)
        data = {
            "schema": "whyhot.attach/1",
            "inspections": [{**vars(one.event), "written": not one.known} for one in done],
            "provenance": provenance(store),
        }
    return Answer(data, _text(done), notes=[note] if note else [])


def _text(done: Sequence[AttachedFile]) -> str:
    from replay.show.words.terminal import labelled
    from replay.show.words.words import short

    first = done[0].event
    lines = labelled("Specimen", first.specimen) + labelled("Finding", first.finding)
    for one in done:
        what = f"{one.event.name} {short(one.event.sha256)}, {one.event.media_type}, {one.event.size:,} bytes"
        lines += labelled("Known before" if one.known else "Sealed", what)
    return "\n".join([*lines, "", *labelled("Next", 'whyhot sql "FROM inspections"')])
