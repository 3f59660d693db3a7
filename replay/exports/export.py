"""A session written as a file of another program: whole, under its name, or not at all."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from replay.errors import ExportError
from replay.exports import csv, mcap, mf4, parquet, xlsx
from replay.exports.samples import OutColumn, Part, SessionRows, session_rows
from replay.written import written

if TYPE_CHECKING:
    from ingest.facts.store import Store

WRITERS: Mapping[str, Callable[[Path, SessionRows], None]] = {
    "csv": csv.write,
    "xlsx": xlsx.write,
    "parquet": parquet.write,
    "mcap": mcap.write,
    "mf4": mf4.write,
}


@dataclass(frozen=True)
class Exported:
    """What was written: columns, what was not, how many rows, and whether they have a date."""

    columns: Sequence[OutColumn]
    unnamed: Sequence[str]
    texts: Sequence[str]
    rows: int
    absolute: bool


def export(
    store: Store, facts: Facts, session: SessionRecorded, to: str, target: Path, excel: str | None = None
) -> Exported:
    """Write a session's samples to `target`, as `to` names it; `excel`: of CSV, the country whose Excel shall open it.

    Raises ExportError where a file is there already, or the session holds no sample.
    """
    rows = session_rows(store, facts, session)
    write = partial(csv.write, excel=excel) if to == "csv" else WRITERS[to]
    written = 0

    def counted() -> Iterator[Part]:
        nonlocal written
        for part in rows.parts:
            written += len(part[0])
            yield part

    with whole(target) as path:
        write(path, replace(rows, parts=counted()))
    return Exported(rows.columns, rows.unnamed, rows.texts, written, rows.absolute)


@contextmanager
def whole(target: Path) -> Iterator[Path]:
    """A path to write to, which becomes `target` once all is written. Raises ExportError where a file is there already,
    or no folder."""
    if target.exists():
        raise ExportError(f"{target}: is there already: give another name with -o, or remove it first.")
    if not target.parent.is_dir():
        raise ExportError(f"{target}: there is no folder {target.parent}: make it first, or give another name with -o.")
    with written(target) as path:
        yield path
