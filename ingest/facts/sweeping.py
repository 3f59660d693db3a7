"""The bytes of logs that were forgotten, removed from a store.

The event that says so comes first and the bytes go after. So a removal that is stopped leaves bytes that no fact counts
on: `verify` names them, and the same command again takes them away.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

from ingest.facts.archive import Archive
from ingest.facts.bucket import ObjectPath, Place, listed
from ingest.facts.cited import Forgotten
from ingest.facts.durable import sync_folder

if TYPE_CHECKING:
    from ingest.facts.store import Store

WAREHOUSE = "warehouse*"  # the tables for SQL, old ones and unfinished ones too: they are made again from what is left


class Swept(NamedTuple):
    """How many files were removed, and their bytes."""

    files: int = 0
    bytes: int = 0


def remains(files: Place, archive: Archive, gone: Forgotten) -> Iterator[tuple[Place, str]]:
    """Sealed files and folders of decodes that should be gone and are there, each with what says why. A forged name
    leads nowhere else: only what lies in the store under its own name is looked for."""
    sealed = ((archive.path(sha256), sha256) for sha256 in archive) if gone.files else ()
    yield from ((path, gone.files[sha256]) for path, sha256 in sealed if sha256 in gone.files)
    decoded = listed(files / "decoded", "*") if gone.decodes else ()
    yield from ((path, gone.decodes[path.name]) for path in decoded if path.name in gone.decodes)


def sweep(store: Store, gone: Forgotten) -> Swept:
    """Remove what should be gone from a store, to which nobody else writes. Raises OSError or BucketError where a file
    cannot be removed; the next sweep goes on from there."""
    there = [path for path, _ in remains(store.files, store.archive, gone)]
    if there:  # first the tables, which nothing but the bytes behind them tells to be old
        there = [*store.folder.glob(WAREHOUSE), *there]
    done = Swept()
    for path in there:
        if isinstance(path, ObjectPath):
            sizes = path.sizes()
            done = Swept(done.files + len(sizes), done.bytes + sum(sizes))
            path.remove()
            continue
        files = [one for one in (path, *path.rglob("*")) if one.is_file()]
        done = Swept(done.files + len(files), done.bytes + sum(one.stat().st_size for one in files))
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.chmod(0o600)  # Windows removes no file that is read-only
            path.unlink()
        sync_folder(path.parent)
    return done
