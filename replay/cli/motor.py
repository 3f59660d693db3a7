"""`whyhot motor check FILE`: the motor file as the program sees it."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.cli.answer import Answer, provenance


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("action", choices=("check",), help="check: read it, refuse what cannot be, say what it is")
    parser.add_argument("file", metavar="FILE", type=Path, help="a motor file")


def run(args: argparse.Namespace) -> Answer:
    from replay.engine.motor_file import describe, read_motor

    description = describe(read_motor(args.file.read_bytes(), args.file.name))
    data = {"schema": "whyhot.motor_check/1", **description.to_json(), "provenance": provenance(None)}
    return Answer(data, description.text())
