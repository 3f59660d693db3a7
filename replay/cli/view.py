"""`whyhot view S...`: the layers of sessions in the rerun viewer."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.cli.answer import Answer, provenance
from replay.cli.asked import ask_as_of, opened


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("sessions", metavar="S", nargs="+", help="sessions; their latest replays are added as layers")
    says = "where the .rrd files go (default: layers)"
    parser.add_argument("-o", "--out", metavar="DIR", type=Path, default=Path("layers"), help=says)
    says = "lay sessions over one another, from their starts or where they were driven alike, or the cycles of each"
    parser.add_argument("--align", choices=("start", "test", "cycle"), help=says)
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--write-only", action="store_true", help="write the layers and do not open the viewer")
    where.add_argument("--web", action="store_true", help="serve the viewer to a browser, on this machine alone")
    ask_as_of(parser)


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from replay.show.reports.documents import seen
    from replay.show.viewer import program
    from replay.show.viewer.aligned import write_aligned
    from replay.show.viewer.layers import write_layers

    with opened(args, write=False) as store:
        known = facts.at(store.ledger)
        shown = [seen(store, known, session) for session in known.named(args.sessions)]
        if args.align:
            paths = [write_aligned(shown, args.align, args.out)]
        else:
            paths = [path for one in shown for path in write_layers(one, args.out)]
        origin = provenance(store, as_of=args.as_of)
        data = {"schema": "whyhot.view/1", "files": [str(p) for p in paths], "provenance": origin}
    lines = [str(path) for path in paths]
    if args.web:
        lines.append(program.serve(paths))
    elif not args.write_only:
        program.view(paths)
    return Answer(data, "\n".join(lines), notes=[one.missing for one in shown if one.missing])
