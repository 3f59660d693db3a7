"""The store: a folder with the facts, the sealed bytes and what is made from them (ARCHITECTURE, "The store")."""

from __future__ import annotations

import errno
import json
import os
import shutil
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, NamedTuple, Self
from uuid import uuid4

from ingest.errors import IngestError, LedgerError, StoreError
from ingest.facts.alias import reachable
from ingest.facts.archive import Archive
from ingest.facts.bucket import Bucket, ObjectPath, Place
from ingest.facts.durable import sync_folder, sync_tree, write_file
from ingest.facts.ledger import Ledger
from ingest.facts.ledger_server import Server

if TYPE_CHECKING:
    from ingest.facts.cited import Forgotten

SCHEMA = "whyhot.store/1"
ON_SERVER = "whyhot.store/2"  # of a store whose ledger lies in a server, so that a whyhot that knows none refuses it
IN_BUCKET = "whyhot.store/3"  # of one whose files lie in a bucket, wherever its ledger does
MARK = "store.json"
BEHIND = "behind"  # in a store as it was: the folder of the store that its files are read from
OURS = {MARK, "archive", "decoded", "tmp", "ledger.lock", "ledger.sqlite", "ledger.index", "ledger.index-new"}
OURS |= {f"ledger.sqlite-{beside}" for beside in ("shm", "wal", "journal")}  # what SQLite leaves where it was stopped


class Mark(NamedTuple):
    """What store.json says: where ledger and files lie, None: in the folder."""

    ledger: Server | None = None
    files: Bucket | None = None


IN_FOLDER = Mark()


class Store:
    """An open store; use it in a `with` statement. At its end a writer seals what it appended."""

    def __init__(
        self, folder: Path, ledger: Ledger | None, mark: Mark = IN_FOLDER, *, write: bool, new: bool = False
    ) -> None:
        self.folder = folder
        self.mark = mark
        self.files = place_of(folder, mark)
        self._ledger = ledger
        self._write = write
        self._new = new
        self._tmp = folder / "tmp"
        self._works: list[Path] = []
        self.archive = Archive(self.files / "archive", self._tmp if write else None, self._gone)
        self._behind: Store | None = None

    @classmethod
    def open(cls, folder: Path, *, create: bool = False, write: bool = False, alone: bool = False) -> Self:
        """Open the store in `folder`; with `create` it is made, and opened for writing, where there is none. With
        `alone` no other process writes until it is closed, where several may.

        Raises StoreError where there is no store, something else lies there, or the folder cannot be read or written;
        LedgerError where another process is writing, or the server of its ledger cannot be used.
        """
        write = write or create
        try:
            new = create and _is_free(folder)
            if new:
                folder.mkdir(parents=True, exist_ok=True)
            mark = IN_FOLDER if new else mark_of(folder)
            folder = reachable(folder)
            try:
                ledger = Ledger(folder, write=write, create=new, server=mark.ledger, alone=alone)
            except LedgerError:
                if new or mark_of(folder) == mark:
                    raise
                return cls.open(folder, write=write, alone=alone)  # moved while this was looking for it
            try:
                # Moved, or made and moved, while this waited for its turn:
                if write and (folder / MARK).exists() and mark_of(folder) != mark:
                    ledger.close()
                    return cls.open(folder, write=True, alone=alone)
                store = cls(folder, ledger, mark, write=write, new=new)
                if write:
                    store._make_ready(alone)
                return store
            except BaseException:
                ledger.close()
                raise
        except OSError as error:
            raise StoreError(
                f"{folder}: cannot be opened ({error.filename or folder}: {error.strerror}): "
                "give a folder that you may read and write, with --store"
            ) from None

    @classmethod
    def files_of(cls, folder: Path) -> Self:
        """The sealed and decoded files alone, for a worker that is given the facts: its machine may see the folder over
        a network, where a ledger that is being written cannot be read."""
        found = cls(folder, None, mark_of(folder), write=False)
        if (behind := folder / BEHIND).is_file():
            found._read_from(cls.files_of(Path(os.fsdecode(behind.read_bytes()))))
        return found

    @property
    def ledger(self) -> Ledger:
        """The facts. Raises StoreError where the store was opened without them."""
        if self._ledger is None:
            raise StoreError(f"{self.folder}: was opened without its ledger: a worker is given the facts")
        return self._ledger

    @cached_property
    def forgotten(self) -> Forgotten:
        """What had to go for good by now, nothing for a worker. Raises as `Ledger.events`."""
        from ingest.facts.cited import Forgotten, forgotten  # what few commands need

        return Forgotten() if self._ledger is None else forgotten(self._ledger.events())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        unused = self._new and error is not None and self.ledger.head().position == 0
        try:
            if self._write and error is None:
                self.ledger.seal()
        finally:
            self.close()
            if unused:  # what failed at once leaves no store behind
                shutil.rmtree(self.folder.resolve(), ignore_errors=True)

    def close(self) -> None:
        """Let the next writer in."""
        if self._write:
            for work in self._works:
                shutil.rmtree(work, ignore_errors=True)
            self._write = False
        if self._ledger is not None:
            self._ledger.close()

    def work(self) -> Path:
        """A new folder for work in progress, removed at the end with all in it. Raises StoreError for a reader."""
        if not self._write:
            raise StoreError(f"{self.folder}: was opened for reading: open the store for writing")
        folder = self._tmp / uuid4().hex
        folder.mkdir()
        self._works.append(folder)
        return folder

    def decoded(self, decode: str) -> Place:
        """Where the products of a decode lie, or would. Raises StoreError for what cannot be the name of a folder."""
        own = self._own(decode)
        return own if self._behind is None or own.exists() else self._behind.decoded(decode)

    def read_behind(self, store: Store) -> None:
        """From now on read from `store` what files are not here; so do workers that open this one."""
        (self.folder / BEHIND).write_bytes(os.fsencode(store.folder.absolute()))
        self._read_from(store)

    def _read_from(self, store: Store) -> None:
        self._behind, self.archive.behind = store, store.archive

    @property
    def asked(self) -> Path:
        """The folder that a command names: its own, or where this is a store as of before, that of the store itself."""
        return self._behind.asked if self._behind else self.folder

    @property
    def bucket(self) -> Bucket | None:
        """Where files lie that are read here and are in no folder."""
        return self.mark.files or (self._behind.bucket if self._behind else None)

    def _own(self, decode: str) -> Place:
        if not decode.isalnum():
            raise StoreError(f"{self.folder}: {decode!r} is not the id of a decode: see `whyhot verify`")
        return self.files / "decoded" / decode

    def publish(self, made: Path, decode: str) -> Place:
        """Move the folder `made` (from `work`) to its place as a whole, and to disk. One that is there is replaced.

        In a bucket file by file, each whole: the event that names them comes after. Raises OSError where the disk is
        full or fails; then the old one or none is there, and a rebuild makes it again.
        """
        target = self._own(decode)
        if isinstance(target, ObjectPath):
            for file in sorted(made.iterdir()):
                (target / file.name).put(file)
            return target
        sync_tree(made)
        while not _moved(made, target):
            with suppress(FileNotFoundError):  # another writer has moved it away
                target.replace(self.work() / decode)
        sync_folder(target.parent)
        return target

    def _gone(self, sha256: str) -> str | None:
        """Why sealed bytes that are not there had to go, None where they had not, or the ledger cannot be read. Raises
        StoreError where they were moved since the store was opened."""
        if self._ledger is not None and mark_of(self.folder) != self.mark:
            raise StoreError(f"{self.folder}: its files were moved meanwhile: run the same command again")
        try:
            return self.forgotten.files.get(sha256)
        except IngestError:
            return None

    def put_mark(self, mark: Mark) -> None:
        """Say where ledger and files lie from now on: whole, or as it was."""
        said: dict[str, object] = {"schema": IN_BUCKET if mark.files else ON_SERVER if mark.ledger else SCHEMA}
        if mark.ledger:
            said["ledger"] = mark.ledger._asdict()
        if mark.files:
            said["files"] = mark.files.url
        write_file(self._tmp, [(json.dumps(said) + "\n").encode()]).replace(self.folder / MARK)
        sync_folder(self.folder)
        self.mark = mark

    def _make_ready(self, alone: bool) -> None:
        """Make what is missing of the layout, the mark last: a creation that was stopped is taken up by the next. What
        other writers left is removed where none is there; then they are let in, unless this one is to stay alone."""
        for part in ("archive", "decoded", "tmp"):
            (self.folder / part).mkdir(exist_ok=True)
        lock = self.ledger.lock
        if lock and lock.alone:
            empty(self._tmp)
            if self.mark.files:  # what a move that was stopped behind the mark left
                empty(self.folder / "archive")
                empty(self.folder / "decoded")
        if not (self.folder / MARK).exists():
            self.put_mark(self.mark)
        sync_folder(self.folder)
        if lock and self.ledger.place.shared and not alone:
            lock.share()


def _is_free(folder: Path) -> bool:
    """True where a store can be made. Raises StoreError where the folder holds something else."""
    if not folder.exists():
        return True
    names = {path.name for path in folder.iterdir()}
    if MARK in names:
        return False
    if strange := sorted(names - OURS):
        raise StoreError(f"{folder}: is no store and not empty (it holds {strange[0]}): give an empty or new folder")
    return True


def place_of(folder: Path, mark: Mark) -> Place:
    """What archive and decoded files of the store in `folder` lie under."""
    return mark.files.root if mark.files else folder


def mark_of(folder: Path) -> Mark:
    """What the mark of the store in `folder` says.

    Raises StoreError where there is no store, or one of a schema that is not known here.
    """
    try:
        said = json.loads((folder / MARK).read_bytes())
        schema = said["schema"]
        server = Server(**said["ledger"]) if schema == ON_SERVER or (schema == IN_BUCKET and "ledger" in said) else None
        files = Bucket(said["files"]) if schema == IN_BUCKET else None
    except (FileNotFoundError, NotADirectoryError):
        advice = "`whyhot ingest FILE...` makes one, --store DIR or WHYHOT_STORE names another"
        raise StoreError(f"{folder}: there is no store here: {advice}") from None
    except (ValueError, TypeError, KeyError, RecursionError):
        raise StoreError(f"{folder / MARK}: is not readable: it should hold {json.dumps({'schema': SCHEMA})}") from None
    if schema not in (SCHEMA, ON_SERVER, IN_BUCKET):
        raise StoreError(f"{folder / MARK}: schema {schema!r} is not known here (this is {SCHEMA}): update whyhot")
    return Mark(server, files)


def _moved(made: Path, target: Path) -> bool:
    """Whether the folder `made` is at `target` now; where something is there it is left where it was."""
    try:
        made.replace(target)
    except OSError as error:
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST, errno.EACCES) or not target.exists():
            raise
        return False
    return True


def empty(folder: Path) -> None:
    """Remove what was left in `folder`; only a writer that is alone may."""
    for path in folder.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
