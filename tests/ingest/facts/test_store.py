from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import pytest

from ingest.errors import LedgerError, StoreError
from ingest.facts import store_check
from ingest.facts.events import (
    AgeingAssessed,
    BenchRegistered,
    LedgerSealed,
    ModelPublished,
    ReplayCompleted,
    SessionRecorded,
    SignalDatabaseRegistered,
)
from ingest.facts.store import Store
from made import lines_of_damage
from made.events import decode, raw, session

BLF, DBC, BENCH, MOTOR, FRAME, PRODUCT = (
    name.encode() for name in ("blf", "dbc", "bench", "motor", "frame", "product")
)


def sha(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A closed store with one event of each kind that cites bytes."""
    path = tmp_path / "whyhot-store"
    with Store.open(path, create=True) as store:
        for data in (BLF, DBC, BENCH, MOTOR, FRAME):
            store.archive.seal(data)
        made = store.work()
        (made / "recording.mcap").write_bytes(PRODUCT)
        store.publish(made, "d1")
        store.ledger.append("file-1", raw("1_s1.blf", BLF))
        store.ledger.append("database-1", SignalDatabaseRegistered(sha256=sha(DBC), name="bench.dbc"))
        store.ledger.append(
            "bench-1", BenchRegistered(sha256=sha(BENCH), name="bench.toml", motor="motor.toml", model=sha(MOTOR))
        )
        store.ledger.append("motor-1", ModelPublished(model=sha(MOTOR), motor="m", file="motor.toml", parent=None))
        store.ledger.append("file-1", decode("d1", sha(BLF), products={"recording.mcap": sha(PRODUCT)}))
        store.ledger.append("session-1", of_decode("1", "d1"))
        store.ledger.append("run-1", run({"frame": sha(FRAME)}))
    return path


def of_decode(number: str, made: str) -> SessionRecorded:
    """A session whose samples are those of a decode of the log."""
    files = [{"raw": sha(BLF), "decode": made, "first_record": 0, "last_record": 1}]
    return replace(session(number, f"{number}_s1"), files=files)


def run(artefacts: dict[str, str]) -> ReplayCompleted:
    return ReplayCompleted(
        run="r1",
        session="1",
        model=sha(MOTOR),
        motor="m",
        level="testing",
        bench=None,
        key={},
        digest="d",
        environment={},
        artefacts=artefacts,
        summary={},
    )


def blob(folder: Path, data: bytes) -> Path:
    return folder / "archive" / sha(data)[:2] / sha(data)


def damage(path: Path, data: bytes) -> None:
    path.chmod(0o644)
    path.write_bytes(data)


def verify(folder: Path, *, read: bool = True) -> list[str]:
    with Store.open(folder) as store:
        return lines_of_damage.damage(store, read)


def hints(folder: Path) -> list[str]:
    with Store.open(folder) as store:
        return [line for line in store_check.check(store, read=False).hints if not line.startswith("SQLite")]


def test_a_store_is_made_with_its_layout_and_opened_again(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "whyhot-store"
    with Store.open(folder, create=True, write=True) as store:
        assert store.folder == folder
    assert json.loads((folder / "store.json").read_text()) == {"schema": "whyhot.store/1"}
    assert {path.name for path in folder.iterdir() if path.is_dir()} == {"archive", "decoded", "tmp"}
    with Store.open(folder) as store:
        assert store.ledger.events() == []
    with Store.open(folder, create=True) as store:
        assert store.ledger.append("file-1", raw("a")).position == 1


def test_a_store_may_be_made_in_an_empty_folder(tmp_path: Path) -> None:
    with Store.open(tmp_path, create=True) as store:
        assert lines_of_damage.damage(store) == []


@pytest.mark.parametrize("write", [False, True])
def test_where_there_is_no_store_none_is_made_unasked(tmp_path: Path, write: bool) -> None:
    folder = tmp_path / "nowhere"
    with pytest.raises(StoreError) as caught:
        Store.open(folder, write=write)
    assert str(caught.value) == (
        f"{folder}: there is no store here: `whyhot ingest FILE...` makes one, "
        "--store DIR or WHYHOT_STORE names another"
    )
    assert not folder.exists()


def test_a_folder_with_other_things_in_it_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("hello")
    with pytest.raises(StoreError, match=r"is no store and not empty \(it holds thesis.tex\): give an empty or new"):
        Store.open(tmp_path, create=True)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize("left", ["ledger.lock", "ledger.sqlite-journal", "ledger.sqlite-wal", "ledger.sqlite-shm"])
def test_what_a_creation_that_was_stopped_left_is_taken_up(tmp_path: Path, left: str) -> None:
    (tmp_path / "ledger.sqlite").touch()
    (tmp_path / left).touch()
    with Store.open(tmp_path, create=True) as store:
        assert lines_of_damage.damage(store) == []


def test_a_file_in_place_of_a_folder_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "whyhot-store"
    path.write_text("hello")
    with pytest.raises(StoreError, match="there is no store here"):
        Store.open(path)
    with pytest.raises(StoreError, match=r"cannot be opened .*Not a directory"):
        Store.open(path, create=True)


def test_a_creation_that_was_stopped_is_taken_up_by_the_next(tmp_path: Path) -> None:
    with Store.open(tmp_path, create=True):
        pass
    (tmp_path / "store.json").unlink()
    with pytest.raises(StoreError, match="there is no store here"):
        Store.open(tmp_path)
    with Store.open(tmp_path, create=True) as store:
        assert lines_of_damage.damage(store) == []


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            '{"schema": "whyhot.store/9"}',
            "store.json: schema 'whyhot.store/9' is not known here (this is whyhot.store/1)",
        ),
        ("", 'store.json: is not readable: it should hold {"schema": "whyhot.store/1"}'),
        ("[]", "store.json: is not readable"),
        ('{"a": 1}', "store.json: is not readable"),
        ("\udce9", "store.json: is not readable"),
    ],
)
def test_a_mark_that_is_not_known_is_refused(folder: Path, text: str, says: str) -> None:
    (folder / "store.json").write_text(text, errors="surrogateescape", encoding="utf-8")
    with pytest.raises(StoreError) as caught:
        Store.open(folder)
    assert says in str(caught.value)


@pytest.mark.parametrize("call", ["mkdir", "open"])
def test_a_folder_that_cannot_be_written_is_said_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    def refused(path: Path, *given: object) -> int:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(f"os.{call}", refused)
    with pytest.raises(StoreError, match=r"s: cannot be opened \(.*: Permission denied\): give a folder that you may"):
        Store.open(tmp_path / "s", create=True)


def test_a_reader_changes_nothing(folder: Path) -> None:
    with Store.open(folder) as store:
        with pytest.raises(StoreError, match="opened for reading"):
            store.archive.seal(b"new")
        with pytest.raises(StoreError, match="opened for reading"):
            store.work()
        with pytest.raises(LedgerError, match="opened for reading"):
            store.ledger.append("file-1", raw("a"))


def test_a_writer_seals_the_ledger_at_its_end_and_only_when_something_is_new(folder: Path) -> None:
    with Store.open(folder) as store:
        events = store.ledger.events()
    assert isinstance(events[-1].event, LedgerSealed)
    with Store.open(folder, write=True):
        pass
    with Store.open(folder) as store:
        assert store.ledger.events() == events


def test_a_writer_that_fails_leaves_its_events_to_be_sealed_by_the_next(folder: Path) -> None:
    with pytest.raises(ZeroDivisionError), Store.open(folder, write=True) as store:
        store.ledger.append("file-2", raw("2_s2.blf", BLF))
        raise ZeroDivisionError
    with Store.open(folder) as store:
        assert store.ledger.events(LedgerSealed)[-1].position != store.ledger.head().position
    with Store.open(folder, write=True):
        pass
    with Store.open(folder) as store:
        assert store.ledger.events(LedgerSealed)[-1].position == store.ledger.head().position


def test_work_left_over_is_swept_by_a_writer_and_never_by_a_reader(folder: Path) -> None:
    left = folder / "tmp" / "left"
    left.mkdir()
    (left / "part").write_bytes(b"x")
    (folder / "tmp" / "seal").write_bytes(b"x")
    with Store.open(folder):
        assert left.exists()
    with Store.open(folder, write=True) as store:
        assert list((folder / "tmp").iterdir()) == []
        store.work()
    assert list((folder / "tmp").iterdir()) == []


def test_closing_twice_leaves_the_next_writers_work_alone(folder: Path) -> None:
    first = Store.open(folder, write=True)
    first.close()
    with Store.open(folder, write=True) as second:
        work = second.work()
        first.close()
        assert work.exists()


def test_products_are_published_whole_and_replace_older_ones(folder: Path) -> None:
    with Store.open(folder, write=True) as store:
        made = store.work()
        (made / "inner").mkdir()
        (made / "inner" / "rows.parquet").write_bytes(b"rows")
        assert store.publish(made, "d1") == store.decoded("d1")
    assert not made.exists()
    assert [path.name for path in (folder / "decoded" / "d1").rglob("*")] == ["inner", "rows.parquet"]


@pytest.mark.parametrize("decode_id", ["", "..", "a/b", "../archive"])
def test_what_cannot_be_a_decode_id_is_never_a_path(folder: Path, decode_id: str) -> None:
    with Store.open(folder) as store, pytest.raises(StoreError, match="is not the id of a decode"):
        store.decoded(decode_id)


def test_a_store_that_was_not_touched_is_whole(folder: Path) -> None:
    assert verify(folder) == []
    assert verify(folder, read=False) == []
    assert hints(folder) == []


@pytest.mark.parametrize(
    ("data", "cited"),
    [
        (BLF, "(event 1: 1_s1.blf)"),
        (DBC, "(event 2: bench.dbc)"),
        (BENCH, "(event 3: bench.toml)"),
        (MOTOR, "(event 4: motor.toml)"),
        (FRAME, "(event 7: frame of run r1)"),
    ],
)
def test_a_sealed_file_that_is_missing_or_changed_is_damage_and_says_who_cites_it(
    folder: Path, data: bytes, cited: str
) -> None:
    path = blob(folder, data)
    damage(path, b"other")
    (found,) = verify(folder)
    assert found.startswith(f"{path}: is damaged, its 5 bytes are not those that were sealed: ingest the original")
    assert found.endswith(cited)
    path.unlink()
    for read in (True, False):
        (found,) = verify(folder, read=read)
        assert found.startswith(f"{path}: is missing")
        assert found.endswith(cited)


def test_two_sealed_files_that_changed_places_are_both_found(folder: Path) -> None:
    damage(blob(folder, BLF), DBC)
    damage(blob(folder, DBC), BLF)
    assert len(verify(folder)) == 2


def test_a_product_that_changed_is_damage_and_one_that_is_missing_a_hint(folder: Path) -> None:
    path = folder / "decoded" / "d1" / "recording.mcap"
    damage(path, b"other")
    assert verify(folder) == [
        f"{path}: is damaged, its bytes are not those that the decode gave: `whyhot rebuild` makes it again"
    ]
    path.unlink()
    assert verify(folder) == []
    assert hints(folder) == [f"{path}: is missing: `whyhot rebuild` makes it again"]


def test_where_all_products_are_missing_that_is_one_hint(folder: Path) -> None:
    with Store.open(folder, write=True) as store:
        products = {"a.parquet": sha(b"a"), "b.parquet": sha(b"b")}
        store.ledger.append("file-1", decode("d2", sha(BLF), products=products))
    assert hints(folder) == [], "no session needs them"
    with Store.open(folder, write=True) as store:
        store.ledger.append("session-2", of_decode("2", "d2"))
    assert len(hints(folder)) == 2
    (folder / "decoded" / "d1" / "recording.mcap").unlink()
    (line,) = [one for one in hints(folder) if "decoded" in one]
    assert line.endswith("decoded: holds none of 3 decoded files, as in a backup: `whyhot rebuild` makes it again")


def test_what_no_event_cites_is_a_hint_but_damage_where_it_is_broken(folder: Path) -> None:
    with Store.open(folder, write=True) as store:
        store.archive.seal(b"orphan")
        store.publish(store.work(), "d9")
    assert verify(folder) == []
    assert hints(folder) == [
        f"{blob(folder, b'orphan')}: no event cites it: a stopped command left it, it may stay",
        f"{folder / 'decoded' / 'd9'}: no event names it: a stopped command left it, it may be deleted",
    ]
    damage(blob(folder, b"orphan"), b"")
    (found,) = verify(folder)
    assert found.endswith("(no event cites it)")


def test_an_event_that_cites_no_sha256_is_a_finding_not_a_path(folder: Path) -> None:
    with Store.open(folder, write=True) as store:
        store.ledger.append("run-2", run({"frame": "../../../etc/passwd"}))
    (found,) = verify(folder)
    assert "'../../../etc/passwd' is not a SHA-256" in found


def test_damage_of_the_ledger_and_of_files_is_listed_together(folder: Path) -> None:
    import sqlite3
    from contextlib import closing

    with closing(sqlite3.connect(folder / "ledger.sqlite")) as connection, connection:
        connection.execute("UPDATE stored_events SET originator_id='file-2' WHERE rowid=2")
    damage(blob(folder, BLF), b"")
    found = verify(folder)
    assert any("event 2 ('file-2' version 1): is not what was written" in line for line in found)
    assert any(str(blob(folder, BLF)) in line for line in found)


def test_verify_proves_nothing_before_a_given_head_changed(folder: Path) -> None:
    with Store.open(folder) as store:
        head = store.ledger.head()
    with Store.open(folder, write=True) as store:
        store.ledger.append("session-1", session("1", "1_s1"))
    with Store.open(folder) as store:
        assert lines_of_damage.damage(store, since=head) == []


@pytest.mark.parametrize("affected", [False, True])
def test_a_sqlite_that_needs_the_lock_is_said(folder: Path, monkeypatch: pytest.MonkeyPatch, affected: bool) -> None:
    monkeypatch.setattr(store_check, "has_wal_reset_bug", lambda: affected)
    with Store.open(folder) as store:
        said = [
            line
            for line in store_check.check(store, read=False).hints
            if "can corrupt a database that two processes write at once" in line
        ]
    assert len(said) == affected


def test_the_document_and_the_tables_of_an_assessment_are_checked(folder: Path) -> None:
    with Store.open(folder, write=True) as store:
        answer, table = store.archive.seal(b"answer"), store.archive.seal(b"checks")
        event = AgeingAssessed(
            assessment="a1", key={}, answer=answer, artefacts={"checks": table}, sessions=["1"], digest="d"
        )
        store.ledger.append("ageing-a1", event)
    assert verify(folder) == []
    for data, what in ((b"answer", "document"), (b"checks", "checks")):
        damage(blob(folder, data), b"other")
        (line,) = verify(folder)
        assert line.endswith(f"{what} of ageing assessment a1)")
        damage(blob(folder, data), data)
