"""A ledger moved into a PostgreSQL server and back: equal heads, and whole whenever the move is stopped."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from ingest.errors import DamageError, LedgerError, StoreError
from ingest.facts import ledger, ledger_lock
from ingest.facts import move as move_module
from ingest.facts.backup import backup, restore
from ingest.facts.chain import Head
from ingest.facts.ledger_lock import WriterLock
from ingest.facts.move import HERE, move
from ingest.facts.store import MARK, Store, mark_of
from made.events import put
from made.forged import change
from made.killed import ENVIRONMENT
from made.lines_of_damage import damage
from made.postgres import PostgresServer, why_none

if why := why_none():
    pytest.skip(why, allow_module_level=True)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "store"
    with Store.open(folder, create=True) as store:
        put(store, "a")
    with Store.open(folder, write=True) as store:
        put(store, "b")
    return folder


def state(folder: Path) -> tuple[list[str], Head]:
    with Store.open(folder) as store:
        return damage(store), store.ledger.head()


def tables(server: PostgresServer) -> list[str]:
    return [name for (name,) in server.sql("SELECT tablename FROM pg_tables WHERE tablename LIKE 'whyhot%'")]


def test_there_and_back_heads_are_equal_and_nothing_of_the_old_ledger_stays(
    folder: Path, server: PostgresServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(move_module, "PAGE", 2)
    before, others = state(folder), tables(server)
    rows = rows_of(folder)
    done = move(folder, server.url)
    assert (done.head, done.left) == (before[1], ())
    assert done.was == str(folder / "ledger.sqlite")
    assert done.now.startswith(server.url)
    assert state(folder) == before
    assert rows_of(folder) == rows
    assert len(tables(server)) == len(others) + 1
    assert not [*folder.glob("ledger.sqlite*")]
    with Store.open(folder, write=True) as store:
        put(store, "c")
    longer = state(folder)
    done = move(folder, HERE)
    assert (done.head, state(folder)) == (longer[1], longer)
    assert tables(server) == others
    assert json.loads((folder / MARK).read_text()) == {"schema": "whyhot.store/1"}
    with Store.open(folder, write=True) as store:
        put(store, "d")
    assert state(folder)[0] == []


def rows_of(folder: Path) -> list[object]:
    with Store.open(folder) as store:
        return [*store.ledger.rows()]


def test_a_backup_of_a_store_with_a_server_is_one_with_a_file_and_equal(
    folder: Path, server: PostgresServer, tmp_path: Path
) -> None:
    before = state(folder)
    move(folder, server.url)
    assert backup(folder, tmp_path / "backup").head == before[1]
    with Store.open(folder, write=True) as store:
        put(store, "c")
    backup(folder, tmp_path / "backup")
    restore(tmp_path / "backup", tmp_path / "new")
    assert state(tmp_path / "new") == state(folder)
    assert mark_of(tmp_path / "new").ledger is None
    with Store.open(folder) as store:
        assert len(store.ledger.events(as_of="2")) == 2


def test_what_is_there_already_damaged_or_written_to_is_not_moved(
    folder: Path, server: PostgresServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    others = tables(server)
    with pytest.raises(StoreError, match=r"its ledger is in its folder already: nothing was moved"):
        move(folder, HERE)
    monkeypatch.setattr(ledger_lock, "WAIT_S", 0.05)
    with Store.open(folder, write=True), pytest.raises(LedgerError, match=r"another whyhot .* is writing"):
        move(folder, server.url)
    with monkeypatch.context() as broken, pytest.raises(LedgerError, match=r"does not give back what was stored there"):
        broken.setattr(move_module, "_head", lambda place: Head(1, "other"))
        move(folder, server.url)
    assert tables(server) == others
    assert state(folder)[0] == []
    change(folder, "UPDATE stored_events SET state = ? WHERE rowid = 2", b"x")
    with pytest.raises(DamageError, match=r"event 2 .*is not what was written"):
        move(folder, server.url)
    assert tables(server) == others


def test_beside_writers_at_a_server_a_ledger_is_not_moved_back(
    folder: Path, server: PostgresServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    move(folder, server.url)
    with pytest.raises(StoreError, match=r"its ledger is in postgresql://.* already: nothing was moved"):
        move(folder, server.url)
    monkeypatch.setattr(ledger_lock, "WAIT_S", 0.05)
    with (
        Store.open(folder, write=True),
        Store.open(folder, write=True),
        pytest.raises(LedgerError, match=r"another whyhot .* is writing"),
    ):
        move(folder, HERE)
    assert mark_of(folder).ledger


def test_a_writer_that_waited_for_the_move_writes_to_the_new_ledger(
    folder: Path, server: PostgresServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    todo = [server.url]

    class Late(WriterLock):
        def __init__(self, path: Path, *, shared: bool = False) -> None:
            if todo:
                move(folder, todo.pop())
            super().__init__(path, shared=shared)

    monkeypatch.setattr(ledger, "WriterLock", Late)
    with Store.open(folder, write=True) as store:
        put(store, "c")
    assert mark_of(folder).ledger
    todo.append(HERE)
    with Store.open(folder, write=True) as store:
        put(store, "d")
    assert mark_of(folder).ledger is None
    assert len(rows_of(folder)) == 8
    assert state(folder)[0] == []


KILLED = """
import json, os, shutil, sys
from pathlib import Path
from ingest.facts.ledger_place import SqliteFile
from ingest.facts.ledger_server import ServerTable
from ingest.facts.move import HERE, move
from ingest.facts.store import Store
from ingest.facts.store_check import check
from made.killed import dies_at, ended, started

CHANGES = [(os, ("fsync", "replace", "unlink")), (SqliteFile, ("insert", "disconnect"))]
CHANGES += [(ServerTable, ("insert", "disconnect", "remove"))]
here, url = Path(sys.argv[1]), sys.argv[2]

def state(folder):
    with Store.open(folder) as store:
        found = check(store)
        return [one.says for one in found.damages], str(found.head)

kills, found = 0, []
whole = state(here / "store")
for to in (url, HERE):
    for call in range(1000):
        folder = here / f"{call}"
        shutil.copytree(here / "store", folder)
        if to == HERE:
            move(folder, url)
        code = ended(started(lambda: dies_at(call, lambda: move(folder, to), CHANGES)))
        found += [state(folder)] * (state(folder) != whole)
        kills += code == -9
        if "2" in (folder / "store.json").read_text():
            move(folder, HERE)
        found += [state(folder)] * (state(folder) != whole)
        shutil.rmtree(folder)
        if code == 0:
            break
        if code != -9:
            found.append(code)
print(json.dumps({"kills": kills, "found": found}))
"""


def test_killed_at_each_step_of_a_move_the_store_is_whole_and_moves_again(
    folder: Path, server: PostgresServer, tmp_path: Path
) -> None:
    command = [sys.executable, "-c", KILLED, str(tmp_path), server.url]
    done = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["found"] == []
    assert result["kills"] >= 20
