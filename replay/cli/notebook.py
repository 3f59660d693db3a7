"""`whyhot notebook [NAME]`: a notebook over the store, in marimo or as a file of one's own."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from replay.cli.answer import Answer, provenance, store_folder


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", metavar="NAME", nargs="?", help="the notebook (default: say which there are)")
    says = "write it to this file: .ipynb for Jupyter, .py to change in marimo; an existing file is not overwritten"
    parser.add_argument("-o", "--out", metavar="OUT", type=Path, help=says)
    parser.set_defaults(refuse=parser.error)


def run(args: argparse.Namespace) -> Answer:
    from replay.show.notebooks import shelf

    if args.name is None:
        if args.out:
            args.refuse("--out is for one notebook: give its NAME")
        return _listed({name: shelf.says(path) for name, path in shelf.notebooks().items()})
    path, store = shelf.notebook(args.name), store_folder(args)
    data = {"schema": "whyhot.notebook/1", "notebook": args.name, "provenance": provenance(None)}
    if args.out is None:
        shelf.run(path, store)
        return Answer(data, "")
    shelf.write(path, args.out)
    opens = "jupyter lab" if args.out.suffix == ".ipynb" else "marimo edit"
    says = f"{args.out}\nit asks the store of WHYHOT_STORE: WHYHOT_STORE={shlex.quote(str(store))} {opens} {args.out}"
    return Answer({**data, "file": str(args.out)}, says)


def _listed(notebooks: dict[str, str]) -> Answer:
    wide = max(map(len, notebooks))
    lines = [f"{name:<{wide}}  {says}" for name, says in notebooks.items()]
    rows = [{"notebook": name, "says": says} for name, says in notebooks.items()]
    data = {"schema": "whyhot.notebook/1", "notebooks": rows, "provenance": provenance(None)}
    return Answer(data, "\n".join([*lines, f"next: whyhot notebook {next(iter(notebooks))}"]))
