"""`whyhot verify`: is every fact and every sealed byte what it was?"""

from __future__ import annotations

import argparse
import re
import shlex
from typing import TYPE_CHECKING

from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.asked import ask_workers, workers_of
from replay.errors import ReplayDataError

if TYPE_CHECKING:
    from pathlib import Path

    from ingest.facts.chain import Head
    from ingest.facts.store_check import StoreCheck

HEAD = re.compile("([0-9]{1,18})[: ]([0-9a-f]{12,64})")  # older reports and the status show the root's beginning


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--read", action="store_true", help="read and hash every sealed file and product too")
    says = "a head noted earlier (from whyhot head or a report): nothing before it may have changed"
    parser.add_argument("--since", metavar="POSITION:ROOT", help=says)
    ask_workers(parser)


def run(args: argparse.Namespace) -> Answer:
    from ingest.errors import LedgerError, ServerError
    from ingest.facts import store_check
    from ingest.facts.store import Store
    from replay.cli.progress import tell

    folder, since, workers = store_folder(args), _head(args.since), workers_of(args)
    if workers and not args.read:
        raise ReplayDataError("--workers and --scheduler read sealed files and products: give --read too.")
    try:
        with Store.open(folder) as store:
            found = store_check.check(store, args.read, since, workers, tell)
    except ServerError:
        raise
    except LedgerError as error:
        found = store_check.check_without_ledger(folder, str(error), args.read)
    head = vars(found.head) if found.head else None
    data = {
        "schema": "whyhot.verify/1",
        "findings": [one.says for one in found.damages],
        "damages": [vars(one) for one in found.damages],
        "whole": {what: {"whole": good, "of": of} for what, (good, of) in found.whole.items()},
        "sessions_whole": found.sessions,
        "next": _next(found, folder),
        "hints": found.hints,
        "provenance": {**provenance(None, read=args.read, since=args.since), "store_head": head},
    }
    if found.damages:
        lines = [one.says + (f"; affects {', '.join(one.affects)}" if one.affects else "") for one in found.damages]
        return Answer(data, _text(found, folder), code=1, notes=[*lines, *found.hints])
    unread = "every event; sealed bytes were not read (--read reads them)"
    depth = "every event and every sealed byte" if args.read else unread
    return Answer(data, f"intact: {depth}; head {found.head}", notes=found.hints)


def _text(found: StoreCheck, folder: Path) -> str:
    """How much is damaged, what it affects, what is good and what to do now."""
    from replay.show.words.terminal import labelled
    from replay.show.words.words import counted, joined

    affected = sorted({name for one in found.damages for name in one.affects})
    files = [f"{good:,} of {of:,} {what}" for what, (good, of) in found.whole.items()]
    whole = f"{joined(files)}; sessions that no damage affects: {', '.join(found.sessions) or 'none'}"
    lines = [f"{counted(len(found.damages), 'finding')}, each read twice, in the lines above", ""]
    lines += labelled("Affected", ", ".join(affected) or "no session by name")
    lines += labelled("Whole", whole)
    for i, step in enumerate(_next(found, folder)):
        lines += labelled("Then" if i else "Next", step)
    return "\n".join(lines)


def _next(found: StoreCheck, folder: Path) -> list[str]:
    """What mends the damage, each step once, in the order in which it is to be done. A backup is mended from the store
    that it is of, if there is one."""
    steps = list(dict.fromkeys(one.mend for one in found.damages))
    if steps and found.is_backup:
        again = f"whyhot backup --store STORE {shlex.quote(str(folder))} --read, if it is the backup of STORE; else"
        steps = [f"{again} {steps[0]}", *steps[1:]]
    return [*steps, "whyhot verify --read"] if steps else []


def _head(text: str | None) -> Head | None:
    from ingest.errors import LedgerError
    from ingest.facts.chain import Head

    if text is None:
        return None
    found = HEAD.fullmatch(text.strip())
    if found is None:
        raise LedgerError(f"--since {text}: is no head: give POSITION:ROOT as `whyhot head` or a report printed it.")
    return Head(int(found[1]), found[2])
