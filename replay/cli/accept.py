"""`whyhot accept DIAGNOSIS`: the extended model or bench version becomes current."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ingest.texts.names import first_of, handle
from replay.cli.answer import Answer, provenance, store_folder

if TYPE_CHECKING:
    from ingest.facts.store import Store

MOST_CHANGES = 40  # lines that are shown of a file
NAMED = 5  # other specimens that are named
ALSO = (
    "they have these files too. Where the cause is of one specimen alone, ingest the logs of the others again, with "
    "bench and motor files of their own"
)


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("diagnosis", metavar="DIAGNOSIS", help="id of a diagnosis, or its beginning, as d-4f0c")
    parser.add_argument("--steps", type=int, metavar="N", help="only the first N steps of its chain")


def run(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from ingest.facts.store import Store
    from replay.studies.again.stale import stale
    from replay.studies.diagnosis.accept import accept

    with Store.open(store_folder(args), write=True) as store:
        done = accept(store, args.diagnosis, args.steps)
        event, recorded = done.event, store.ledger.events()
        in_use = stale(recorded, facts.fold(recorded)).in_use
        data = {
            "schema": "whyhot.acceptance/1",
            "diagnosis": event.diagnosis,
            "causes": event.causes,
            "parent": event.parent,
            "model": event.model,
            "parent_bench": event.parent_bench,
            "bench": event.bench,
            "benches": {one.parent_bench: one.bench for one in (event, *done.further) if one.bench},
            "changes": _changes(store, [(one.parent, one.model) for one in (event, *done.further)])
            | _changes(store, [(one.parent_bench, one.bench) for one in (event, *done.further)]),
            "other_specimens": dict(sorted(done.others.items())),
            "written": not done.known,
            "provenance": provenance(store),
        }
    notes = [
        f"session {name}: goes on with model {model[:8]}: say --model {str(event.model)[:8]} to replay it."
        for name, model in done.elsewhere.items()
    ]
    notes += [f"{one}: whyhot stale --redo asks it again" for one in in_use if f"d-{handle(event.diagnosis)}" in one]
    return Answer(data, _text(data), notes=notes)


def _changes(store: Store, replaced: Sequence[tuple[str | None, str | None]]) -> dict[str, list[str]]:
    """New file -> what differs from the one before."""
    from replay.engine.files.changes import changes

    read = store.archive.read
    return {new: changes(read(old), read(new)) for old, new in replaced if old and new}


def _text(data: Mapping[str, Any]) -> str:
    from replay.show.words.terminal import labelled
    from replay.show.words.words import counted, joined, short

    models = {data["parent"]: data["model"]} if data["model"] else {}
    pairs = [("model", one) for one in models.items()] + [("bench file", one) for one in data["benches"].items()]
    now = [f"{what} {short(new)} in place of {short(old)}" for what, (old, new) in pairs]
    told = "is accepted" if data["written"] else "was accepted before: nothing was written"
    lines = labelled("Accepted" if data["written"] else "Nothing new", f"d-{short(data['diagnosis'])} {told}")
    lines += labelled("Causes", joined(data["causes"]))
    lines += labelled("Current", joined(now))
    if others := data["other_specimens"]:
        of = [f"{counted(count, 'session')} of {name}" for name, count in others.items()]
        lines += labelled("Also for", f"{first_of(of, NAMED)}: {ALSO}")
    for what, (_, new) in pairs:
        lines += ["", *_shown(f"{what} {short(new)}", data["changes"][new])]
    return "\n".join([*lines, "", *labelled("Next", "whyhot replay · whyhot report")])


def _shown(what: str, changes: Sequence[str]) -> list[str]:
    from replay.show.words.width import width

    more, most = len(changes) - MOST_CHANGES, width() - 2
    lines = [f"  {line if len(line) < most else line[: most - 1] + '…'}" for line in changes[:MOST_CHANGES]]
    return [f"Changes of {what}", *lines, *([f"  and {more:,} more lines: --json has all"] if more > 0 else [])]
