"""`whyhot doctor`: what a problem report needs."""

from __future__ import annotations

import argparse
import locale
import platform
import shutil
import sqlite3
from importlib.metadata import PackageNotFoundError, version

from replay.cli.answer import Answer, provenance, store_folder

PACKAGES = (
    "numpy",
    "scipy",
    "numba",
    "pyarrow",
    "duckdb",
    "mcap",
    "eventsourcing",
    "psycopg",
    "cantools",
    "matplotlib",
    "rerun-sdk",
)
SQLITE_BUG = "; it can lose data when two processes write at once: whyhot lets only one write, by ledger.lock"


def arguments(parser: argparse.ArgumentParser) -> None:
    """No arguments of its own."""


def run(args: argparse.Namespace) -> Answer:
    from ingest.errors import StoreError
    from ingest.facts.ledger_lock import has_wal_reset_bug
    from ingest.facts.store import IN_FOLDER, MARK, mark_of
    from replay.show.words import words
    from whyhot.installation import problems

    folder = store_folder(args)
    free = shutil.disk_usage(next(p for p in (folder, *folder.absolute().parents) if p.exists())).free
    affected, notes = has_wal_reset_bug(), problems()
    there, mark = (folder / MARK).exists(), IN_FOLDER
    if there:
        try:
            mark = mark_of(folder)
        except StoreError as error:
            notes.append(str(error))
    elsewhere = {"ledger": mark.ledger and mark.ledger.url, "files": mark.files and mark.files.url}
    facts = {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "locale": ".".join(part or "?" for part in locale.getlocale()),
        "sqlite": sqlite3.sqlite_version,
        "sqlite_wal_reset_bug": affected,
        "store": str(folder.absolute()),
        "store_exists": there,
        **elsewhere,
        "free_bytes": free,
    }
    packages = {name: _version(name) for name in PACKAGES}
    lies = "".join(f"; its {what} in {url}" for what, url in elsewhere.items() if url)
    shown = {
        **{name: facts[name] for name in ("python", "platform", "locale")},
        "sqlite": f"{facts['sqlite']}{SQLITE_BUG if affected else ''}",
        "store": f"{facts['store']}{lies if there else ', not there yet'}; {words.size(free)} free",
    }
    rows = {**shown, **{name: found or "not installed" for name, found in packages.items()}}
    lines = [f"{name:<15}{value}" for name, value in rows.items()]
    found = {**facts, "packages": packages, "problems": notes}
    data = {"schema": "whyhot.doctor/1", **found, "provenance": provenance(None)}
    return Answer(data, "\n".join(lines), 1 if notes else 0, notes)


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
