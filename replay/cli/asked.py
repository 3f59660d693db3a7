"""Flags that several verbs have, said alike."""

from __future__ import annotations

import argparse


def ask_model(parser: argparse.ArgumentParser) -> None:
    """`--model`: read with `replay.engine.files.models.model_named`."""
    parser.add_argument(
        "--model", metavar="M", help="model id, motor name or motor file (default: what the bench file names)"
    )
