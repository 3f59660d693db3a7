"""Sealed and decoded files moved into a bucket and back: the same store, and whole whenever the move is stopped."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from ingest.errors import BucketError, DamageError, LedgerError, StoreError
from ingest.facts import facts, ledger_lock
from ingest.facts.as_of import store_as_of
from ingest.facts.backup import backup, restore
from ingest.facts.chain import Head
from ingest.facts.events import DecodeCompleted
from ingest.facts.move_files import HERE, OWNER, move_files
from ingest.facts.sessions import Override
from ingest.facts.store import MARK, Store, mark_of
from ingest.facts.store_check import AGAIN, check, check_without_ledger
from ingest.intake.intake import take_in
from ingest.intake.making import redecode
from ingest.intake.setup import MotorFile, prepare
from made.bucket import KEYS, BucketServer
from made.events import put
from made.killed import ENVIRONMENT
from made.lines_of_damage import damage
from made.places import on_disk
from made.tables import ONE_CHANNEL

LOG = "time,T\n2026-01-01T08:00:00Z,20\n2026-01-01T08:00:01Z,21\n"


def no_motor(path: Path) -> MotorFile:
    raise AssertionError(path)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A store of a log and its decode."""
    (tmp_path / "bench.toml").write_text(ONE_CHANNEL)
    (tmp_path / "a.csv").write_text(LOG)
    taken(tmp_path, "a.csv")
    return tmp_path / "store"


def taken(here: Path, name: str) -> None:
    with Store.open(here / "store", create=True) as store:
        assert take_in(store, [here / name], prepare([here / name], here / "bench.toml", [], no_motor), Override())


def state(folder: Path) -> tuple[list[str], list[str], Head]:
    with Store.open(folder) as store:
        found = check(store)
        hints = [one for one in found.hints if not one.startswith("SQLite")]
        return [one.says for one in found.damages], hints, store.ledger.head()


def local(folder: Path) -> dict[str, bytes]:
    """Name -> bytes of every sealed and decoded file in the folder."""
    found = [*folder.glob("archive/*/*"), *folder.glob("decoded/*/*")]
    return {str(path.relative_to(folder)): path.read_bytes() for path in found}


def remote(bucket: BucketServer) -> dict[str, bytes]:
    return {key.removeprefix("store/"): bucket.objects[key] for key in bucket.names() if not key.endswith(OWNER)}


def test_there_and_back_the_files_are_the_same_and_nothing_stays(folder: Path, bucket: BucketServer) -> None:
    before, files = state(folder), local(folder)
    assert before[:2] == ([], [])
    done = move_files(folder, bucket.url())
    assert (done.head, done.left) == (before[2], ())
    assert (done.was, done.now) == (
        f"{folder}/archive and {folder}/decoded",
        "s3://lab/store/archive and s3://lab/store/decoded",
    )
    assert json.loads((folder / MARK).read_text()) == {"schema": "whyhot.store/3", "files": bucket.url()}
    assert (state(folder), remote(bucket), local(folder)) == (before, files, {})
    (folder.parent / "b.csv").write_text(LOG.replace("01-01", "01-02"))
    taken(folder.parent, "b.csv")
    longer = state(folder)
    assert (longer[:2], len(remote(bucket)), local(folder)) == (([], []), 2 * len(files) - 1, {})
    files = remote(bucket)
    assert move_files(folder, bucket.url("second")).was == "s3://lab/store/archive and s3://lab/store/decoded"
    assert (state(folder), bucket.names(), len(bucket.names("second/"))) == (longer, [], len(files) + 1)
    assert move_files(folder, HERE).head == longer[2]
    assert bucket.names("second/") == []
    assert (state(folder), bucket.names(), local(folder)) == (longer, [], files)
    assert json.loads((folder / MARK).read_text()) == {"schema": "whyhot.store/1"}


def test_what_is_missing_or_changed_there_is_found_and_made_again(folder: Path, bucket: BucketServer) -> None:
    move_files(folder, bucket.url())
    with Store.open(folder, write=True) as store:
        known = facts.at(store.ledger)
        [decode] = known.decodes.values()
        [product] = [key for key in bucket.names() if key.endswith(".parquet")]
        made = bucket.objects[product]
        bucket.objects[product] = made[:-1]
        says = f"s3://lab/{product}: is damaged, its bytes are not those that the decode gave: {AGAIN}"
        assert damage(store) == [says]
        redecode(store, known)
        assert bucket.objects[product] == made
        del bucket.objects[product]
        hints = [one for one in check(store).hints if "is missing" in one]
        assert hints == [f"s3://lab/{product}: is missing: {AGAIN}"]
        redecode(store, known)
        raw = f"store/archive/{decode.raw[:2]}/{decode.raw}"
        bucket.objects[raw] = b"x"
        [says] = damage(store)
        assert says.startswith(f"s3://lab/{raw}: is damaged, its 1 bytes are not those that were sealed")
        with pytest.raises(DamageError, match="what was made from it before is left as it is"):
            redecode(store, known)
    assert check_without_ledger(folder, "no ledger").damages[1].says.startswith(f"s3://lab/{raw}: is damaged")
    with pytest.raises(DamageError, match="is damaged"):
        move_files(folder, HERE)
    assert mark_of(folder).files


def test_a_backup_has_the_bytes_and_is_a_store_in_a_folder(folder: Path, bucket: BucketServer, tmp_path: Path) -> None:
    before = state(folder)
    move_files(folder, bucket.url())
    assert backup(folder, tmp_path / "backup").head == before[2]
    move_files(folder, HERE)
    done, found = restore(tmp_path / "backup", tmp_path / "new")
    assert (done.head, found.damages, mark_of(tmp_path / "new").files) == (before[2], [], None)
    assert local(tmp_path / "new") == {name: data for name, data in local(folder).items() if name.startswith("archive")}


def test_as_of_an_event_files_are_read_where_they_lie_and_none_is_written(folder: Path, bucket: BucketServer) -> None:
    move_files(folder, bucket.url())
    files = remote(bucket)
    with Store.open(folder) as now:
        end = str(now.ledger.head().position)
    with store_as_of(folder, end) as then:
        assert check(then).damages == []
        [decode] = [one.event for one in then.ledger.events() if isinstance(one.event, DecodeCompleted)]
        assert str(then.decoded(decode.decode)).startswith("s3://lab/store/decoded/")
        sha256 = then.archive.seal(b"new")
        assert on_disk(then.archive.path(sha256)).read_bytes() == b"new"
    assert remote(bucket) == files


def test_what_is_there_already_or_of_others_is_not_moved(
    folder: Path, bucket: BucketServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = local(folder)
    with pytest.raises(StoreError, match=r"its files are in its folder already: nothing was moved"):
        move_files(folder, HERE)
    bucket.objects["store/notes.txt"] = b"mine"
    with pytest.raises(StoreError, match=r"^s3://lab/store: is not empty, and holds no files of a store"):
        move_files(folder, bucket.url())
    bucket.objects["store/whyhot.json"] = b"31\r\n{"
    with pytest.raises(StoreError, match=r"^s3://lab/store: holds the files of a store: give another prefix"):
        move_files(folder, bucket.url())
    del bucket.objects["store/notes.txt"]
    with Store.open(tmp_path / "other", create=True) as store:
        put(store, "z")
    move_files(tmp_path / "other", bucket.url())
    with pytest.raises(StoreError, match=r"^s3://lab/store: holds the files of a store: give another prefix"):
        move_files(folder, bucket.url())
    with pytest.raises(StoreError, match=r"^s3://lab/store/a/b: lies among the files of a store, at s3://lab/store: "):
        move_files(folder, bucket.url("store/a/b"))
    bucket.objects["store/notes.txt"] = b"mine"
    move_files(tmp_path / "other", HERE)
    assert bucket.names() == ["store/notes.txt"]
    with pytest.raises(BucketError, match=r"^s3://none: there is no such bucket"):
        move_files(folder, bucket.url(bucket="none"))
    monkeypatch.setattr(ledger_lock, "WAIT_S", 0.05)
    with Store.open(folder, write=True), pytest.raises(LedgerError, match=r"another whyhot .* is writing"):
        move_files(folder, bucket.url("mine"))
    assert (local(folder), bucket.names("mine/")) == (before, [])


def test_a_reader_of_before_the_move_is_told_and_not_that_bytes_are_lost(folder: Path, bucket: BucketServer) -> None:
    with Store.open(folder) as reader:
        [raw] = facts.at(reader.ledger).files
        move_files(folder, bucket.url())
        with pytest.raises(StoreError, match=r"its files were moved meanwhile: run the same command again"):
            reader.archive.read(raw)


KILLED = """
import os, sys
from pathlib import Path
from ingest.facts.bucket import ObjectPath
from ingest.facts.move_files import move_files
from made.killed import dies_at

folder, to, call = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])
changes = [(os, ("replace", "unlink", "rmdir")), (ObjectPath, ("_put", "remove"))]
dies_at(call, lambda: move_files(folder, to), changes)
"""


@pytest.mark.parametrize("back", [False, True])
def test_killed_in_the_middle_the_store_is_whole_and_moves_again(
    folder: Path, bucket: BucketServer, back: bool
) -> None:
    before = state(folder)
    killed = 0
    for call in (1, 4, 7, 11) if back else (1, 5, 9, 13):
        if back and mark_of(folder).files is None:
            bucket.objects.clear()  # what is left where nothing names it
            move_files(folder, bucket.url())
        elif not back and mark_of(folder).files:
            move_files(folder, HERE)
        words = [sys.executable, "-c", KILLED, str(folder), HERE if back else bucket.url(), str(call)]
        done = subprocess.run(words, env={**ENVIRONMENT, **KEYS}, capture_output=True, text=True, check=False)
        killed += done.returncode == -signal.SIGKILL
        assert state(folder) == before, call
    assert killed == 4
