"""What a verb answers, and how it reaches people (text) and programs (JSON)."""

from __future__ import annotations

import argparse
import json
import os
import shlex
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ingest.errors import IngestError
from ingest.texts.plain import plain_line
from replay.cli.encoding import say, takes_all
from replay.cli.progress import tell
from replay.show.words.onward import DEFAULT_STORE, on_store, onward
from replay.written import write

if TYPE_CHECKING:
    from ingest.facts.store import Store

ANSWERS = {  # verb -> what its answer is called, where that is not the verb
    "accept": "acceptance",
    "calibrate": "calibration",
    "correct": "correction",
    "diagnose": "diagnosis",
    "forget": "forgetting",
    "retract": "retraction",
}


@dataclass(frozen=True)
class Answer:
    """`data` goes out with --json, `text` without; `notes` (refusals, warnings) always go to standard error."""

    data: Mapping[str, Any]
    text: str
    code: int = 0
    notes: Sequence[str] = field(default_factory=tuple)


def store_folder(args: argparse.Namespace) -> Path:
    """--store, else WHYHOT_STORE, else ./whyhot-store. Raises StoreError for a URL: a store is a folder."""
    named = str(args.store or os.environ.get("WHYHOT_STORE") or DEFAULT_STORE)
    if "://" in named:
        from ingest.errors import StoreError
        from ingest.facts.ledger_server import shown

        advice = "`whyhot move URL --store DIR` brings its ledger or files there, after which DIR is its name as before"
        raise StoreError(f"--store {shown(named)}: a store is a folder, give that: {advice}")
    return Path(named)


def typed(*words: str, **options: str | Sequence[str] | None) -> str:
    """A command as it would be typed, as a page says what it was asked by: `words`, then the options with a value."""
    for name, value in options.items():
        values = [value] if isinstance(value, str) else value
        words += (f"--{name.replace('_', '-')}", *values) if values else ()
    return shlex.join(["whyhot", *words])


def provenance(store: Store | None, **settings: Any) -> dict[str, Any]:
    """Code version, store head, seeds and settings: what an answer was computed from."""
    from whyhot import __version__

    head = store.ledger.head() if store else None
    return {
        "code": f"whyhot {__version__}",
        "store_head": {"position": head.position, "root": head.root} if head else None,
        "seeds": [],
        "settings": settings,
    }


def deliver(args: argparse.Namespace, answer: Answer) -> int:
    """Print or write the answer; returns its exit code."""
    tell("")
    for note in answer.notes:
        say(plain_line(on_store(note, store_folder(args))), sys.stderr, refused=answer.code != 0)
    if args.json is not None:
        _write_json(args.json, answer.data)
    if args.json != "-" and answer.text:
        say(onward(answer.text, store_folder(args)))
    return answer.code


def deliver_error(args: argparse.Namespace, line: str) -> int:
    """A refusal: one line on standard error and, with --json, `{"schema", "error"}`. Exit code 2."""
    tell("")
    with suppress(IngestError):  # the store that was named may be what is refused
        line = on_store(line, store_folder(args))
    say(plain_line(line), sys.stderr)
    if args.json is not None:
        _write_json(args.json, {"schema": schema_of(args), "error": line, "provenance": provenance(None)})
    return 2


def schema_of(args: argparse.Namespace) -> str:
    """What the answer of a verb is called in its JSON, also where there is none but an error."""
    action = getattr(args, "action", None)
    name = f"{args.verb}_{action}" if action else ANSWERS.get(args.verb, args.verb)
    return f"whyhot.{name}/1"


def _write_json(target: str, data: Mapping[str, Any]) -> None:
    escaped = target == "-" and not takes_all()
    text = json.dumps(data, indent=2, ensure_ascii=escaped, allow_nan=False)
    if target == "-":
        say(text)
    else:
        write(Path(target), text + "\n")
