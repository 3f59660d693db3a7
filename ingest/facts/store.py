"""The store: a folder with the facts, the sealed bytes and what is made from them (ARCHITECTURE, "The store")."""

from __future__ import annotations

import errno
import json
import shutil
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self
from uuid import uuid4

from ingest.errors import IngestError, LedgerError, StoreError
from ingest.facts.alias import reachable
from ingest.facts.archive import Archive
from ingest.facts.durable import sync_folder, sync_tree, write_file
from ingest.facts.ledger import Ledger
from ingest.facts.ledger_server import Server

if TYPE_CHECKING:
    from ingest.facts.cited import Forgotten

SCHEMA = "whyhot.store/1"
ON_SERVER = "whyhot.store/2"  # of a store whose ledger lies in a server, so that a whyhot that knows none refuses it
MARK = "store.json"
OURS = {MARK, "archive", "decoded", "tmp", "ledger.lock", "ledger.sqlite", "ledger.index", "ledger.index-new"}
OURS |= {f"ledger.sqlite-{beside}" for beside in ("shm", "wal", "journal")}  # what SQLite leaves where it was stopped


class Store:
    """An open store; use it in a `with` statement. At its end a writer seals what it appended."""

    def __init__(self, folder: Path, ledger: Ledger | None, *, write: bool, new: bool = False) -> None:
        self.folder = folder
        self._ledger = ledger
        self._write = write
        self._new = new
        self._tmp = folder / "tmp"
        self._works: list[Path] = []
        self.archive = Archive(folder / "archive", self._tmp if write else None, self._gone)

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
            server = None if new else server_of(folder)
            folder = reachable(folder)
            try:
                ledger = Ledger(folder, write=write, create=new, server=server, alone=alone)
            except LedgerError:
                if new or server_of(folder) == server:
                    raise
                return cls.open(folder, write=write, alone=alone)  # moved while this was looking for it
            try:
                store = cls(folder, ledger, write=write, new=new)
                if write:
                    store._make_ready(alone)
                    if server_of(folder) != server:  # moved while this waited for its turn
                        ledger.close()
                        return cls.open(folder, write=True, alone=alone)
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
    def files(cls, folder: Path) -> Self:
        """The sealed and decoded files alone, for a worker that is given the facts: its machine may see the folder over
        a network, where a ledger that is being written cannot be read."""
        return cls(folder, None, write=False)

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

    def decoded(self, decode: str) -> Path:
        """Where the products of a decode lie, or would. Raises StoreError for what cannot be the name of a folder."""
        if not decode.isalnum():
            raise StoreError(f"{self.folder}: {decode!r} is not the id of a decode: see `whyhot verify`")
        return self.folder / "decoded" / decode

    def publish(self, made: Path, decode: str) -> Path:
        """Move the folder `made` (from `work`) to its place as a whole, and to disk. One that is there is replaced.

        Raises OSError where the disk is full or fails; then the old one or none is there, and a rebuild makes it again.
        """
        target = self.decoded(decode)
        sync_tree(made)
        while not _moved(made, target):
            with suppress(FileNotFoundError):  # another writer has moved it away
                target.replace(self.work() / decode)
        sync_folder(target.parent)
        return target

    def _gone(self, sha256: str) -> str | None:
        """Why sealed bytes that are not there had to go, None where they had not, or the ledger cannot be read."""
        try:
            return self.forgotten.files.get(sha256)
        except IngestError:
            return None

    def put_ledger(self, server: Server | None) -> None:
        """Say in the mark where the ledger lies from now on: whole, or as it was. None: in the folder."""
        on_server = {"schema": ON_SERVER, "ledger": server._asdict()} if server else None
        text = json.dumps(on_server or {"schema": SCHEMA}) + "\n"
        write_file(self._tmp, [text.encode()]).replace(self.folder / MARK)
        sync_folder(self.folder)

    def _make_ready(self, alone: bool) -> None:
        """Make what is missing of the layout, the mark last: a creation that was stopped is taken up by the next. What
        other writers left is removed where none is there; then they are let in, unless this one is to stay alone."""
        for part in ("archive", "decoded", "tmp"):
            (self.folder / part).mkdir(exist_ok=True)
        lock = self.ledger.lock
        if lock and lock.alone:
            _empty(self._tmp)
        if not (self.folder / MARK).exists():
            self.put_ledger(None)
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


def server_of(folder: Path) -> Server | None:
    """Where the ledger of the store in `folder` lies by its mark; None: in the folder.

    Raises StoreError where there is no store, or one of a schema that is not known here.
    """
    try:
        mark = json.loads((folder / MARK).read_bytes())
        schema = mark["schema"]
        server = Server(**mark["ledger"]) if schema == ON_SERVER else None
    except (FileNotFoundError, NotADirectoryError):
        advice = "`whyhot ingest FILE...` makes one, --store DIR or WHYHOT_STORE names another"
        raise StoreError(f"{folder}: there is no store here: {advice}") from None
    except (ValueError, TypeError, KeyError):
        raise StoreError(f"{folder / MARK}: is not readable: it should hold {json.dumps({'schema': SCHEMA})}") from None
    if schema not in (SCHEMA, ON_SERVER):
        raise StoreError(f"{folder / MARK}: schema {schema!r} is not known here (this is {SCHEMA}): update whyhot")
    return server


def _moved(made: Path, target: Path) -> bool:
    """Whether the folder `made` is at `target` now; where something is there it is left where it was."""
    try:
        made.replace(target)
    except OSError as error:
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST, errno.EACCES) or not target.exists():
            raise
        return False
    return True


def _empty(folder: Path) -> None:
    """Remove what writers left in `folder`; only one that is alone may."""
    for path in folder.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
