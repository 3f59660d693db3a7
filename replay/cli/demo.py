"""`whyhot demo`: from eleven real recordings to what the published model of that motor gets wrong."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.cli.answer import Answer, provenance


def arguments(parser: argparse.ArgumentParser) -> None:
    """No arguments of its own: it writes under ./demo (or the store named by --store)."""


def run(args: argparse.Namespace) -> Answer:
    from replay.cli.progress import tell
    from replay.demo.demo import run_demo

    folder = Path("demo")
    done = run_demo(folder, Path(args.store) if args.store else folder / "store", tell)
    return Answer({**done.data, "provenance": provenance(None)}, done.text, notes=done.notes)
