"""Sealed bytes and decoded files of a store from its folder into a bucket, from one bucket into another, or back.

Each sealed file is hashed on its way and read back; then one rename of the mark makes the new place the current one.
What is stopped before it leaves the store whole where it was, and after it where it is. No other process writes
meanwhile. An object `whyhot.json` beside them says whose files they are, so that no two stores share a place.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from ingest.errors import IngestError, StoreError
from ingest.facts.bucket import Bucket, ObjectPath, Place, listed
from ingest.facts.cited import cited
from ingest.facts.durable import write_file
from ingest.facts.events import DecodeCompleted
from ingest.facts.ledger_row import Recorded
from ingest.facts.move import MovedStore
from ingest.facts.store import Store, empty, mark_of

HERE = "files"  # the word for files in the store's folder
OWNER = "whyhot.json"
SCHEMA = "whyhot.files/1"


def move_files(folder: Path, to: str, tell: Callable[[str], None] = lambda line: None) -> MovedStore:
    """Move what the store in `folder` has sealed and decoded to the URL `to`, or with "files" into the folder.

    Raises StoreError where it is there already or another store's files are, BucketError where `to` is no URL of a
    bucket or the server refuses, DamageError where events or sealed files are damaged; then nothing has changed.
    """
    bucket = None if to == HERE else Bucket(to)
    if mark_of(folder).files == bucket:
        raise StoreError(f"{folder}: its files are in {bucket or 'its folder'} already: nothing was moved")
    with closing(Store.open(folder, write=True, alone=True)) as store:
        tell("checking every event")
        recorded = store.ledger.events()
        first = recorded[0].digest if recorded else ""
        mark = store.mark._replace(files=bucket)
        target = Store(store.folder, None, mark, write=True)
        if isinstance(target.files, ObjectPath):
            _refuse_others(target.files, first)
            _own(store, target.files, first, moving=True)
        _copy(store, target, recorded, tell)
        was = store.files
        store.put_mark(mark)
        if isinstance(target.files, ObjectPath):
            _own(store, target.files, first, moving=False)
        return MovedStore(_said(was), _said(target.files), store.ledger.head(), _removed(was))


def _said(files: Place) -> str:
    return f"{files}/archive and {files}/decoded"


def _refuse_others(root: ObjectPath, first: str) -> None:
    """Raises StoreError where something lies at `root` that no move of this store was stopped at."""
    above = root.parent
    while "/" in above.key:
        if (above / OWNER).is_file():
            raise StoreError(f"{root}: lies among the files of a store, at {above}: give another prefix")
        above = above.parent
    owner = root / OWNER
    if owner.is_file():
        try:
            known = json.loads(owner.read_bytes()) == _owned(first, moving=True)
        except ValueError:  # half of one, as a server that refused its end left it
            known = [*map(str, listed(root, "*"))] == [str(owner)]
        if not known:
            raise StoreError(f"{root}: holds the files of a store: give another prefix")
    elif listed(root, "*"):
        raise StoreError(f"{root}: is not empty, and holds no files of a store: give another prefix")


def _owned(first: str, moving: bool) -> dict[str, object]:
    return {"schema": SCHEMA, "first_event": first, "moving": moving}


def _own(store: Store, root: ObjectPath, first: str, moving: bool) -> None:
    (root / OWNER).put(write_file(store.work(), [json.dumps(_owned(first, moving)).encode()]))


def _copy(store: Store, target: Store, recorded: list[Recorded], tell: Callable[[str], None]) -> None:
    sealed = sorted({*store.archive, *cited(recorded)})
    for number, sha256 in enumerate(sealed, 1):
        tell(f"sealed file {number:,} of {len(sealed):,}")
        if target.archive.damage(sha256):  # else a move that was stopped brought it there
            target.archive.seal(store.archive.chunks(sha256))
    decodes = {one.event.decode for one in recorded if isinstance(one.event, DecodeCompleted)}
    made = [one for one in listed(store.files / "decoded", "*") if one.name in decodes]
    work = store.work()
    for number, folder in enumerate(made, 1):
        tell(f"decoded log {number:,} of {len(made):,}")
        copy = work / folder.name
        copy.mkdir()
        for file in listed(folder, "*"):
            with file.open("rb") as source, (copy / file.name).open("xb") as into:
                shutil.copyfileobj(source, into)
        target.publish(copy, folder.name)
        shutil.rmtree(copy, ignore_errors=True)


def _removed(was: Place) -> tuple[str, ...]:
    """Remove the old files. Returns a line where that fails."""
    try:
        if isinstance(was, ObjectPath):
            for name in ("archive", "decoded", OWNER):  # what else lies there is not ours
                (was / name).remove()
        else:
            empty(was / "archive")
            empty(was / "decoded")
    except (IngestError, OSError) as error:
        return (f"the old files are still there, and are no longer used: {error}",)
    return ()
