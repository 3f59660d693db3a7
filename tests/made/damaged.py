"""Logs that something is wrong with: read in time with every record accounted for, or refused in one line."""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path

from ingest.errors import UnreadableLogError
from ingest.formats import Format, Frames, Log, Rows, open_log
from made.places import LOGS

PATIENCE_S = 5.0  # for one damaged sample


def sample(entry: Format) -> Path:
    """A small log of a format, with records that are read and records that are not."""
    return LOGS / f"sample.{entry.name}"


def read(path: Path) -> tuple[Log, list[Frames | Rows]]:
    """A log and all its batches."""
    log = open_log(path)
    return log, list(log.batches())


def check_account(log: Log, batches: Iterable[Frames | Rows]) -> None:
    """Every record once: in a batch, or rejected."""
    in_batches = [int(number) for batch in batches for number in batch.record]
    assert in_batches == sorted(in_batches)
    rejected = [entry.record for entry in log.rejected]
    assert rejected == sorted(rejected)
    assert sorted(in_batches + rejected) == list(range(log.found))


def read_damaged(path: Path) -> bool:
    """Anything may be wrong with `path`: it is read in time and keeps the account, or refused in one line. Returns
    whether it was read."""
    began = time.monotonic()
    try:
        check_account(*read(path))
        kept = True
    except UnreadableLogError as error:
        assert str(error).startswith(f"{path.name}: ")
        assert "\n" not in str(error)
        kept = False
    assert time.monotonic() - began < PATIENCE_S
    return kept
