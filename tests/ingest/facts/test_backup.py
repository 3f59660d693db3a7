"""A backup holds the first events of its store and all that they cite, whatever stops it; restored it is the store."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from ingest.errors import DamageError, StoreError
from ingest.facts.backup import Amount, backup, restore
from ingest.facts.chain import Head
from ingest.facts.events import SignalDatabaseRegistered
from ingest.facts.store import Store
from ingest.facts.store_check import check
from made.killed import ENVIRONMENT
from made.lines_of_damage import damage
from made.places import on_disk


def put(folder: Path, *names: str) -> None:
    """Each name is an event with 2 sealed bytes; the writer's end adds the seal."""
    with Store.open(folder, create=True) as store:
        for name in names:
            sha256 = store.archive.seal(name.encode() * 2)
            store.ledger.append(f"database-{sha256}", SignalDatabaseRegistered(sha256=sha256, name=f"{name}.dbc"))


def head(folder: Path) -> Head:
    with Store.open(folder) as store:
        return store.ledger.head()


def sealed(folder: Path, name: str) -> Path:
    """The sealed file of a name, to be written to."""
    with Store.open(folder) as store:
        files = [one.event for one in store.ledger.events() if isinstance(one.event, SignalDatabaseRegistered)]
        path = on_disk(store.archive.path(next(file.sha256 for file in files if file.name == f"{name}.dbc")))
    path.chmod(0o644)
    return path


def findings(folder: Path) -> list[str]:
    with Store.open(folder) as store:
        return damage(store)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    put(tmp_path / "store", "a", "b", "c")
    return tmp_path / "store"


@pytest.fixture
def target(tmp_path: Path) -> Path:
    return tmp_path / "elsewhere" / "backup"


def test_a_backup_is_a_store_with_the_same_head_and_only_what_is_new_is_copied(folder: Path, target: Path) -> None:
    first = backup(folder, target)
    assert not (target / "ledger.sqlite-wal").exists(), "the ledger is not whole in one file"
    assert (first.copied, first.there) == (Amount(4, 3, 6), Amount(0, 0, 0))
    assert first.head == head(target) == head(folder)
    before = {path: path.stat().st_mtime_ns for path in (target / "archive").rglob("*") if path.is_file()}
    put(folder, "d")
    second = backup(folder, target)
    assert (second.copied, second.there) == (Amount(2, 1, 2), Amount(4, 3, 6))
    assert second.head == head(target) == head(folder)
    assert before.items() <= {path: path.stat().st_mtime_ns for path in before}.items(), "written again"
    assert backup(folder, target).copied == Amount(0, 0, 0)
    assert findings(target) == second.left == []


def test_what_no_event_cites_is_not_copied(folder: Path, target: Path) -> None:
    with Store.open(folder, write=True) as store:
        store.archive.seal(b"a command that was stopped left it")
    assert backup(folder, target).copied.files == 3
    with Store.open(target) as copy:
        assert [hint for hint in check(copy).hints if "no event cites it" in hint] == []


def test_a_damaged_or_missing_file_of_the_store_is_named_and_all_others_are_copied(folder: Path, target: Path) -> None:
    sealed(folder, "a").write_bytes(b"xx")
    sealed(folder, "b").unlink()
    done = backup(folder, target)
    assert (done.copied, done.head) == (Amount(4, 1, 2), head(folder))
    is_damaged, is_missing = done.left
    assert "is damaged, its 2 bytes" in is_damaged
    assert is_damaged.endswith("(event 1: a.dbc)")
    assert "is missing" in is_missing
    assert is_missing.endswith("(event 2: b.dbc)")
    assert not any((target / "tmp").iterdir())
    put(folder, "a", "b")  # the originals are ingested again
    assert backup(folder, target).left == []
    assert findings(target) == []


def test_a_damaged_file_of_the_backup_is_copied_anew_where_it_is_read(
    folder: Path, target: Path, caplog: pytest.LogCaptureFixture
) -> None:
    backup(folder, target)
    sealed(target, "a").write_bytes(b"xx")
    assert backup(folder, target).copied.files == 0
    assert len(findings(target)) == 1
    assert backup(folder, target, read=True).copied == Amount(0, 1, 2)
    assert findings(target) == []
    assert "replaced by the true bytes" in caplog.text


def test_a_backup_of_another_store_a_newer_one_and_one_that_was_written_to_are_refused(
    folder: Path, target: Path, tmp_path: Path
) -> None:
    backup(folder, target)
    old, other = tmp_path / "old", tmp_path / "other"
    restore(target, old)
    put(folder, "d")
    backup(folder, target)
    put(other, "x")
    held = head(target)
    with pytest.raises(StoreError, match="is the backup of another store: give another folder"):
        backup(other, target)
    with pytest.raises(StoreError, match="is newer than this store, it holds 6 events and the store 4"):
        backup(old, target)
    put(old, "e")
    with pytest.raises(StoreError, match="holds another event 5 than this store"):
        backup(old, target)
    assert head(target) == held
    assert findings(target) == []


def test_a_folder_that_is_no_place_for_a_backup_is_refused(folder: Path, tmp_path: Path) -> None:
    for inside in (folder, folder / "backup"):
        with pytest.raises(StoreError, match="lies in the store"):
            backup(folder, inside)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "letter.txt").write_text("dear")
    with pytest.raises(StoreError, match="is no store and not empty"):
        backup(folder, tmp_path / "full")


def spoil_ledger(folder: Path) -> None:
    ledger = folder / "ledger.sqlite"
    ledger.write_bytes(ledger.read_bytes().replace(b"b.dbc", b"B.dbc"))


def test_a_damaged_ledger_makes_no_backup_and_is_named(folder: Path, target: Path) -> None:
    spoil_ledger(folder)
    with pytest.raises(DamageError, match=f"^{folder}: event 2 .*is not what was written"):
        backup(folder, target)
    assert not target.exists()


def test_a_backup_with_a_damaged_ledger_is_not_gone_on_with_nor_restored(
    folder: Path, target: Path, tmp_path: Path
) -> None:
    backup(folder, target)
    spoil_ledger(target)
    for copied in (lambda: backup(folder, target), lambda: restore(target, tmp_path / "new")):
        with pytest.raises(DamageError, match=f"^{target}: event 2 .*is not what was written"):
            copied()
    assert not (tmp_path / "new").exists()
    assert findings(folder) == []


def test_a_restored_store_is_the_backed_up_one_and_is_written_to_as_that(
    folder: Path, target: Path, tmp_path: Path
) -> None:
    backup(folder, target)
    done, found = restore(target, tmp_path / "new")
    assert (done.copied, done.head) == (Amount(4, 3, 6), head(folder))
    assert (found.damages, found.whole["sealed files"]) == ([], (3, 3))
    put(tmp_path / "new", "d")
    assert backup(tmp_path / "new", target).copied == Amount(2, 1, 2)


def test_nothing_is_restored_over_a_store(folder: Path, target: Path, tmp_path: Path) -> None:
    backup(folder, target)
    before = head(folder)
    with pytest.raises(StoreError, match="is a store already, with 4 events: nothing was written"):
        restore(target, folder)
    assert head(folder) == before
    with pytest.raises(StoreError, match="there is no backup here"):
        restore(tmp_path / "nowhere", tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_what_the_backup_lacks_is_named_when_it_is_restored(folder: Path, target: Path, tmp_path: Path) -> None:
    backup(folder, target)
    sealed(target, "a").write_bytes(b"xx")
    done, found = restore(target, tmp_path / "new")
    assert len(done.left) == 1
    assert "is damaged" in done.left[0]
    assert ["is missing" in one.says for one in found.damages] == [True]


def test_what_a_restore_could_not_read_the_next_one_brings(folder: Path, target: Path, tmp_path: Path) -> None:
    backup(folder, target)
    file = sealed(target, "b")
    file.rename(tmp_path / "aside")
    done, found = restore(target, tmp_path / "new")
    assert (len(done.left), len(found.damages)) == (1, 1)
    (tmp_path / "aside").rename(file)
    done, found = restore(target, tmp_path / "new")
    assert (done.left, found.damages, done.head) == ([], [], head(folder))
    with pytest.raises(StoreError, match="is a store already"):
        restore(target, tmp_path / "new")


def test_a_full_disk_keeps_what_was_copied_and_the_next_backup_goes_on(
    folder: Path, target: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    backup(folder, target)
    held = head(target)
    put(folder, "d", "e")
    written, true_write = list[int](), os.write

    def write(handle: int, data: bytes) -> int:
        written.append(len(data))
        if len(written) > 2:  # the number of the process, one file, and then no more
            raise OSError(errno.ENOSPC, "No space left on device")
        return true_write(handle, data)

    with monkeypatch.context() as patch:
        patch.setattr(os, "write", write)
        with pytest.raises(OSError, match="No space left"):
            backup(folder, target)
    assert head(target) == held
    assert findings(target) == []
    assert not any((target / "tmp").iterdir())
    assert backup(folder, target).copied == Amount(3, 1, 2)
    assert head(target) == head(folder)


COMMON = """
import json, os, shutil, sys
from pathlib import Path
from ingest.facts.backup import backup, restore
from ingest.facts.events import RawFileSealed
from ingest.facts.ledger_place import SqliteFile
from ingest.facts.store import Store
from ingest.facts.store_check import check
from made.killed import dies_at, ended, started

here = Path(sys.argv[1])
folder = here / "store"

def put(store, text):
    sha256 = store.archive.seal(text.encode() * 50)
    event = RawFileSealed(sha256=sha256, name=text, size=50 * len(text), format=None)
    store.ledger.append(f"file-{sha256}", event)

def state(folder):
    # what is wrong with a store, and its head; nothing where a stopped command had not made one yet
    if not (folder / "store.json").exists():
        return [], 0
    with Store.open(folder) as store:
        found = check(store)
        return [one.says for one in found.damages], found.head.position if found.head else 0
"""

AT_EACH_CALL = """
CHANGES = [(os, ("write", "fsync", "replace", "mkdir")), (SqliteFile, ("insert", "disconnect"))]

with Store.open(folder, create=True) as store:
    put(store, "first")
backup(folder, here / "before")
with Store.open(folder, write=True) as store:
    put(store, "second")

kills, found, heads, whole = 0, [], [], state(folder)
for verb in ("backup", "restore"):
    code = -9
    for call in range(1000):
        target = here / f"{verb}-{call}"
        if verb == "backup":
            shutil.copytree(here / "before", target)
            work = lambda: backup(folder, target)
        else:
            work = lambda: restore(folder, target)
        code = ended(started(lambda: dies_at(call, work, CHANGES)))
        if code == 0:
            break
        kills += code == -9
        damages, position = state(target)
        found += damages if position else []  # a restore that was stopped holds files and no event yet, as it says
        heads.append([verb, position])
        if verb == "backup" or not position:
            work()
        found += [f"{target}: {state(target)}"] * (state(target) != whole)
found += [f"the store: {state(folder)}"] * (state(folder) != whole)
print(json.dumps({"kills": kills, "tries": len(heads), "found": found, "heads": heads, "whole": whole[1]}))
"""


def attack(script: str, folder: Path) -> dict[str, Any]:
    command = [sys.executable, "-c", COMMON + script, str(folder)]
    done = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    result: dict[str, Any] = json.loads(done.stdout)
    return result


@pytest.mark.skipif(sys.platform == "win32", reason="needs fork and kill -9")
def test_killed_before_each_change_of_the_disk_the_copy_is_whole_and_the_next_finishes_it(tmp_path: Path) -> None:
    result = attack(AT_EACH_CALL, tmp_path)
    assert result["found"] == []
    assert result["kills"] == result["tries"] >= 25
    assert {tuple(one) for one in result["heads"]} == {
        ("backup", 2),
        ("backup", result["whole"]),
        ("restore", 0),
        ("restore", result["whole"]),
    }, "all events or those of before"
