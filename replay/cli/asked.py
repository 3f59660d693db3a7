"""What several verbs ask for, said alike: flags, and the sessions and the model that these name."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from replay.cli.answer import store_folder, typed

if TYPE_CHECKING:
    from ingest.facts.events import SessionRecorded
    from ingest.facts.facts import Facts
    from ingest.facts.sessions import Override
    from ingest.facts.store import Store
    from ingest.units.each import Workers

LEVEL = "testing"


class Asked(NamedTuple):
    """An open store, its facts, the model of `--model` (None: what the bench file names) and the sessions of `--on`."""

    store: Store
    known: Facts
    model: str | None
    sessions: Sequence[SessionRecorded]


def opened(args: argparse.Namespace, write: bool = True) -> AbstractContextManager[Store]:
    """The store; with --as-of as it was then, where what is written goes with it."""
    from ingest.facts.as_of import store_as_of
    from ingest.facts.store import Store

    as_of: str | None = getattr(args, "as_of", None)
    folder = store_folder(args)
    return Store.open(folder, write=write) if as_of is None else store_as_of(folder, as_of)


@contextmanager
def asked(args: argparse.Namespace, write: bool = True) -> Iterator[Asked]:
    """What `--model` and `--on` name, as long as the store is open; a motor file of `--model` is published in it."""
    from ingest.facts import facts
    from replay.engine.files.models import model_named

    with opened(args, write) as store:
        model = model_named(store, args.model)
        known = facts.at(store.ledger)
        yield Asked(store, known, model, sessions_of(known, args.on))


def asked_by(verb: str, args: argparse.Namespace, **more: Sequence[str]) -> str:
    """How a page says what was asked for: `--on`, `more`, `--model`, `--as-of`, and `--level` where it is not the
    default."""
    level = None if args.level == LEVEL else args.level
    return typed(verb, on=args.on, **more, model=args.model, level=level, as_of=getattr(args, "as_of", None))


def sessions_of(known: Facts, texts: Sequence[str]) -> list[SessionRecorded]:
    """The sessions of these ids or names, each once and in the store's order: however they are named, it is one
    question."""
    from ingest.facts.sessions import order

    return sorted(known.named(texts), key=order)


def left_out(store: Store, known: Facts, sessions: Sequence[SessionRecorded], model: str) -> list[str]:
    """A line for all that an answer about `model` does not know of `sessions`: beyond its maps, and specimens taken
    as new."""
    from replay.engine.specimen.aged import ageing_left_out
    from replay.engine.specimen.maps_left import maps_left

    return maps_left(store, known, sessions, model) + ageing_left_out(store, known, sessions, model)


def ask_sessions(parser: argparse.ArgumentParser, says: str) -> None:
    parser.add_argument("--on", metavar="S", nargs="+", required=True, help=says)


def ask_model(parser: argparse.ArgumentParser) -> None:
    says = "model id, motor name or motor file (default: what the bench file names)"
    parser.add_argument("--model", metavar="M", help=says)


def ask_level(parser: argparse.ArgumentParser, says: str = "channels that may be learnt from") -> None:
    levels = "testing, all (the default), or production, those that series motors have too"
    parser.add_argument("--level", choices=("testing", "production"), default=LEVEL, help=f"{says}: {levels}")


def ask_as_of(parser: argparse.ArgumentParser) -> None:
    says = "answer from the ledger as it was at an event (its number), a time or a date (ISO 8601, UTC); writes nothing"
    parser.add_argument("--as-of", metavar="POINT", help=says)


def count(text: str) -> int:
    """A whole number of a flag, 1 or more."""
    if not text.isdecimal() or not 1 <= int(text[:13]) <= 10**12:
        raise argparse.ArgumentTypeError(f"{text[:20]} is none: give a whole number of 1 or more")
    return int(text[:13])


def as_of_note(as_of: str | None) -> list[str]:
    return [] if as_of is None else [f"as of {as_of}: what was computed is not kept: without --as-of it is"]


def ask_workers(parser: argparse.ArgumentParser) -> None:
    """Where the work is done."""
    where = parser.add_mutually_exclusive_group()
    says = "processes (default 1); the answer is the same with any number"
    where.add_argument("--workers", type=count, default=1, metavar="N", help=says)
    says = "the dask scheduler of a cluster, as tcp://HOST:8786, whose workers do the work; see docs/scale.md"
    where.add_argument("--scheduler", metavar="URL", help=says)


def workers_of(args: argparse.Namespace) -> Workers | None:
    """What `ask_workers` asked for; None for this process alone. Raises ClusterError."""
    from ingest.units.each import processes
    from replay.engine.runs.cluster import cluster

    return cluster(args.scheduler) if args.scheduler else processes(args.workers)


def ask_page(parser: argparse.ArgumentParser, default: str) -> None:
    says = f"the page to write (default: {default})"
    parser.add_argument("-o", "--out", metavar="FILE", type=Path, default=Path(default), help=says)


def ask_picture(parser: argparse.ArgumentParser) -> None:
    says = "write the picture to this file, and a .png beside it"
    parser.add_argument("-o", "--out", metavar="FILE.svg", type=picture, help=says)


def picture(text: str) -> Path:
    """The file of a picture that a flag names."""
    if Path(text).suffix != ".svg":
        raise argparse.ArgumentTypeError(f'an SVG is written, and a .png beside it: end "{text}" in .svg')
    return Path(text)


def picture_note(target: Path) -> str:
    return f"{target}   and {target.with_suffix('.png').name} beside it"


def ask_logs(parser: argparse.ArgumentParser) -> None:
    from ingest.formats import SUFFIXES

    says = f"log files ({SUFFIXES}), folders, patterns or archives (.zip .gz .zst) of them"
    parser.add_argument("files", metavar="FILE", nargs="+", type=Path, help=says)


KINDS = ("wltp", "s1", "s2", "ageing", "dc_check", "insulation_check", "drive", "other")


def ask_said(parser: argparse.ArgumentParser) -> None:
    """What a log is read with and said to be of."""
    parser.add_argument("--bench", metavar="B", type=Path, help="bench file: what each signal means")
    parser.add_argument("--specimen", metavar="S", help="which motor or part; overrules the bench file")
    parser.add_argument("--batch", metavar="B", help="its batch; overrules the bench file")
    parser.add_argument("--kind", choices=KINDS, help="what test it is; overrules the bench file and recognition")


def said_of(args: argparse.Namespace) -> Override:
    """What `ask_said` asked for. Raises IngestError where a name is blank."""
    from ingest.facts.sessions import Override
    from ingest.intake.attachments import in_words

    specimen, batch = (
        None if text is None else in_words(text, flag, example)
        for text, flag, example in ((args.specimen, "--specimen", "stator-07"), (args.batch, "--batch", "B3"))
    )
    return Override(specimen, batch, args.kind)


def ask_reason(parser: argparse.ArgumentParser) -> None:
    says = 'why, in words that are kept, as "the wrong motor was mounted"'
    parser.add_argument("--reason", metavar="TEXT", required=True, help=says)


def ask_databases(parser: argparse.ArgumentParser) -> None:
    says = "signal database (.dbc .kcd .sym .arxml), folder or pattern of them; may be repeated"
    parser.add_argument("--dbc", metavar="D", type=Path, action="append", default=[], help=says)


def databases_of(args: argparse.Namespace) -> list[Path]:
    """What `ask_databases` asked for. Raises IngestError where something is not there, or is no database."""
    from ingest.intake.given import databases_given

    return databases_given(args.dbc)
