from __future__ import annotations

import json
import random
import sqlite3
import sys
from collections.abc import Iterator, Sequence
from contextlib import closing, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from eventsourcing.persistence import OperationalError, StoredEvent
from eventsourcing.sqlite import SQLiteApplicationRecorder

from ingest.errors import DamageError, IngestError, LedgerError
from ingest.facts import ledger as ledger_module
from ingest.facts import ledger_lock
from ingest.facts.chain import Head, canonical
from ingest.facts.events import EVENTS, DiagnosisCompleted, Event, LedgerSealed, RawFileSealed, SessionRecorded
from ingest.facts.ledger import Ledger
from ingest.facts.ledger_audit import audit
from ingest.facts.ledger_lock import has_wal_reset_bug
from ingest.facts.ledger_place import SqliteFile
from ingest.facts.ledger_row import Recorded, _fits
from made.events import decode, raw, session
from made.forged import change, forge, resealed, rewrite, stored


@pytest.fixture
def ledger(tmp_path: Path) -> Iterator[Ledger]:
    with closing(Ledger(tmp_path, write=True, create=True)) as made:
        yield made


def fill(ledger: Ledger) -> Head:
    """Nine events in four streams, two seals, two events after the last one. Returns the head."""
    one, two = raw("1_s1.blf"), raw("2_s2.blf")
    ledger.append(f"file-{one.sha256}", one, happened="2025-10-09T08:53:20Z")
    ledger.append_all([(f"file-{two.sha256}", two), (f"file-{one.sha256}", decode("d1", one.sha256))])
    ledger.seal()
    ledger.append("session-1", session("1", "1_s1"))
    ledger.append("session-1", session("1", "1_s1", bench="b"))
    ledger.seal()
    ledger.append("session-2", session("2", "2_s2", start_ns=2**62))
    ledger.append(f"file-{two.sha256}", decode("d2", two.sha256, why="ends before its end: ümlaut"))
    return ledger.head()


@pytest.fixture
def written(tmp_path: Path) -> Path:
    """A closed ledger in `tmp_path`."""
    with closing(Ledger(tmp_path, write=True, create=True)) as ledger:
        fill(ledger)
    return tmp_path


def findings(folder: Path, since: Head | None = None) -> list[str]:
    with closing(Ledger(folder)) as ledger:
        return [one.says for one in audit(ledger, since).findings]


def head_of(folder: Path) -> Head:
    with closing(Ledger(folder)) as ledger:
        return ledger.head()


def test_what_is_appended_comes_back_equal_and_in_order(written: Path) -> None:
    with closing(Ledger(written)) as ledger:
        events = ledger.events()
    assert [one.position for one in events] == list(range(1, 10))
    assert [type(one.event).__name__ for one in events[:4]] == [
        "RawFileSealed",
        "RawFileSealed",
        "DecodeCompleted",
        "LedgerSealed",
    ]
    assert events[0].event == raw("1_s1.blf")
    assert events[2].event == decode("d1", raw("1_s1.blf").sha256)
    assert (events[0].happened, events[0].caused_by) == ("2025-10-09T08:53:20Z", None)
    assert [one.version for one in events if one.stream == "session-1"] == [1, 2]
    assert events[0].code.startswith("whyhot ")


def test_an_event_is_there_for_readers_as_soon_as_append_returns(ledger: Ledger, tmp_path: Path) -> None:
    with closing(Ledger(tmp_path)) as reader:
        assert reader.events() == []
        recorded = ledger.append("file-a", raw("a"))
        assert reader.events() == [recorded]


def test_events_are_chosen_by_type_stream_and_position(written: Path) -> None:
    with closing(Ledger(written)) as ledger:
        assert [one.position for one in ledger.events(RawFileSealed)] == [1, 2]
        assert [one.position for one in ledger.events(SessionRecorded, LedgerSealed)] == [4, 5, 6, 7, 8]
        assert [one.position for one in ledger.events(stream="session-1")] == [5, 6]
        assert [one.position for one in ledger.events(as_of="2")] == [1, 2]
        assert [one.position for one in ledger.events(RawFileSealed, as_of=1)] == [1]
        assert ledger.events(as_of=0) == []


def test_as_of_a_time_gives_what_was_recorded_up_to_then(written: Path) -> None:
    with closing(Ledger(written)) as ledger:
        third = ledger.events()[2]
        assert len(ledger.events(as_of=third.recorded)) == 3
        assert len(ledger.events(as_of=third.recorded.removesuffix("Z"))) == 3
        assert len(ledger.events(as_of=third.recorded.replace("Z", "+00:00"))) == 3
        assert len(ledger.events(as_of="2999-01-01")) == 9
        assert ledger.events(as_of="1999-01-01T00:00:00+02:00") == []


def test_as_of_a_date_is_the_whole_day(ledger: Ledger, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ledger_module, "datetime", clock_of(2001))
    ledger.append_all([("file-a", raw("a")), ("file-b", raw("b"))])  # at midnight and a microsecond later
    for moment, known in (("2000-12-31", 0), ("2001-01-01T00:00", 1), ("2001-01-01", 2)):
        assert len(ledger.events(as_of=moment)) == known


@pytest.mark.parametrize(
    ("as_of", "says"),
    [
        ("10", "as of 10: the ledger ends at event 9: give a number up to that, or a time"),
        ("soon", "as of 'soon': is neither the number of an event (up to 9) nor a time like 2026-11-21T08:00:00Z"),
        ("0001-01-01T00:00:00+23:00", "is neither the number of an event"),
    ],
)
def test_an_as_of_that_means_nothing_is_refused(written: Path, as_of: str, says: str) -> None:
    with closing(Ledger(written)) as ledger, pytest.raises(LedgerError) as caught:
        ledger.events(as_of=as_of)
    assert says in str(caught.value)


def clock_of(year: int) -> type[datetime]:
    """A clock that stands."""

    class Wrong(datetime):
        @classmethod
        def now(cls, tz: Any = None) -> Wrong:
            return cls(year, 1, 1, tzinfo=UTC)

    return Wrong


def test_recorded_times_rise_even_when_the_clock_is_set_back(ledger: Ledger, monkeypatch: pytest.MonkeyPatch) -> None:
    first = ledger.append("file-a", raw("a"))
    monkeypatch.setattr(ledger_module, "datetime", clock_of(2001))
    second, third = ledger.append_all([("file-b", raw("b")), ("file-c", raw("c"))])
    assert first.recorded < second.recorded < third.recorded
    assert audit(ledger).findings == []


def test_a_time_that_a_wrong_clock_made_meaningless_is_refused_and_others_are_not(
    ledger: Ledger, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = ledger.append("file-a", raw("a"))
    with monkeypatch.context() as jumped:
        jumped.setattr(ledger_module, "datetime", clock_of(2200))
        wrong = ledger.append("file-b", raw("b"))
    after = ledger.append("file-c", raw("c"))
    assert wrong.recorded < after.recorded and audit(ledger).findings == []
    for moment, known in (("1999-01-01", 0), (first.recorded, 1), (wrong.recorded, 2), ("2999-01-01", 3), (2, 2)):
        assert len(ledger.events(as_of=moment)) == known
    with pytest.raises(LedgerError, match=r"event 2 says it was recorded on 2200-01-01, so a clock .* \(up to 3\)"):
        ledger.events(as_of="2100-01-01")


def test_all_of_a_batch_is_stored_or_nothing(ledger: Ledger) -> None:
    bad = decode("d", "a", balance={"found": float("nan")})
    with pytest.raises(LedgerError, match="cannot be stored as JSON"):
        ledger.append_all([("file-a", raw("a")), ("file-b", bad)])
    assert ledger.events() == []
    assert [one.version for one in ledger.append_all([("file-a", raw("a")), ("file-a", raw("a"))])] == [1, 2]
    assert ledger.append_all([]) == []


def test_an_event_that_would_not_come_back_equal_is_refused(ledger: Ledger) -> None:
    with pytest.raises(LedgerError, match="holds what JSON does not give back"):
        ledger.append("file-a", decode("d", "a", databases=("a", "b")))


def test_the_names_of_events_are_those_that_ledgers_hold() -> None:
    names = """RawFileSealed SignalDatabaseRegistered BenchRegistered MotorRegistered ModelPublished DecodeCompleted
        SessionRecorded SessionRegrouped QualityFlagged ReplayCompleted ReplayDiverged CalibrationCompleted
        HeldOutOpened CauseNamed ModelExtended GainMeasured DiagnosisCompleted CauseAccepted InspectionRecorded
        AgeingAssessed FactRetracted FactReinstated LogForgotten LogCorrected LedgerSealed ClockAligned"""
    assert set(EVENTS) == {f"whyhot:{name}" for name in names.split()}


def test_an_event_that_is_not_declared_is_refused(ledger: Ledger) -> None:
    class Strange(Event):
        pass

    with pytest.raises(LedgerError, match="whyhot:Strange: is not an event of the ledger"):
        ledger.append("file-a", Strange())


def test_a_ledger_opened_for_reading_refuses_to_append(written: Path) -> None:
    with closing(Ledger(written)) as ledger, pytest.raises(LedgerError, match="opened for reading"):
        ledger.append("file-a", raw("a"))


def test_a_stream_that_another_program_wrote_to_is_refused_in_one_line(ledger: Ledger, tmp_path: Path) -> None:
    first = ledger.append("file-a", raw("a"))
    tail = ledger._tail("file-a")
    change(tmp_path, "INSERT INTO stored_events SELECT originator_id, 2, topic, state FROM stored_events")

    def stale(stream: str) -> Recorded | None:
        return tail

    ledger._tail, ledger._last = stale, lambda: first  # type: ignore[method-assign]
    with pytest.raises(
        LedgerError, match=r"another program wrote to the same stream meanwhile: run the same"
    ) as caught:
        ledger.append("file-a", raw("b"))
    assert "\n" not in str(caught.value)


def test_a_locked_database_is_one_sentence_and_works_again_later(
    ledger: Ledger, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("eventsourcing.sqlite.SQLITE3_DEFAULT_LOCK_TIMEOUT", 0.05)
    ledger.place.disconnect()
    with closing(sqlite3.connect(tmp_path / "ledger.sqlite")) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(
            LedgerError, match=r"ledger.sqlite: cannot be read or written \(database is locked\)"
        ) as caught:
            ledger.append("file-a", raw("a"))
        assert "\n" not in str(caught.value)
    assert ledger.append("file-a", raw("a")).position == 1


def test_a_full_disk_stores_nothing_and_the_same_append_works_after(ledger: Ledger) -> None:
    assert isinstance(ledger.place, SqliteFile) and ledger.place._factory
    with ledger.place._factory.datastore.get_connection(commit=True) as connection:  # type: ignore[attr-defined]
        connection.cursor().execute("PRAGMA max_page_count=8")
    long = decode("d", "a", why="x" * 100_000)
    with pytest.raises(LedgerError, match="database or disk is full"):
        ledger.append("file-a", long)
    assert ledger.events() == []
    assert ledger.append("file-a", long).position == 1
    assert audit(ledger).findings == []


@pytest.mark.skipif(sys.platform == "win32", reason="needs file size limits")
def test_a_commit_that_fails_stores_nothing_and_the_ledger_stays_usable(ledger: Ledger, tmp_path: Path) -> None:
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    refused = 0
    for more in range(0, 40_000, 4_000):
        event = decode(f"d{more}", "a", why="x" * 10_000)
        size = (tmp_path / "ledger.sqlite-wal").stat().st_size
        resource.setrlimit(resource.RLIMIT_FSIZE, (size + more, hard))
        try:
            ledger.append("file-a", event)
        except LedgerError:
            refused += 1
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        if not ledger.events() or ledger.events()[-1].event != event:
            ledger.append("file-a", event)
    assert refused >= 3
    assert len(ledger.events()) == 10
    assert audit(ledger).findings == []


@pytest.mark.parametrize(("says", "calls"), [("database is locked", 2), ("disk I/O error", 1)])
def test_only_a_locked_database_is_tried_once_more(
    ledger: Ledger, monkeypatch: pytest.MonkeyPatch, says: str, calls: int
) -> None:
    tried: list[int] = []

    def refuse(recorder: SQLiteApplicationRecorder, rows: Sequence[StoredEvent]) -> None:
        tried.append(len(rows))
        raise OperationalError(says)

    with monkeypatch.context() as patch:
        patch.setattr(SQLiteApplicationRecorder, "insert_events", refuse)
        with pytest.raises(LedgerError, match=says):
            ledger.append("file-a", raw("a"))
    assert tried == [1] * calls
    assert ledger.append("file-a", raw("a")).position == 1


@pytest.mark.parametrize("at_once", [1, 2, 3, 9, 10])
def test_rows_are_read_page_by_page_without_loss(written: Path, at_once: int) -> None:
    with closing(Ledger(written)) as ledger:
        assert [row.id for row in ledger.rows(at_once=at_once)] == list(range(1, 10))


def test_a_second_writer_waits_then_says_who_writes(
    ledger: Ledger, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import os

    monkeypatch.setattr(ledger_lock, "WAIT_S", 0.05)
    expected = rf"ledger.lock: another whyhot \(process {os.getpid()}\) is writing to this store: wait for it to end"
    with pytest.raises(LedgerError, match=expected):
        Ledger(tmp_path, write=True)
    ledger.close()
    Ledger(tmp_path, write=True).close()


def test_a_reader_neither_waits_for_a_writer_nor_checkpoints(ledger: Ledger, tmp_path: Path) -> None:
    ledger.append("file-a", raw("a"))
    wal = tmp_path / "ledger.sqlite-wal"
    before = (wal.read_bytes(), (tmp_path / "ledger.sqlite").read_bytes())
    with closing(Ledger(tmp_path)) as reader:
        assert len(reader.events()) == 1
        assert audit(reader).findings == []
    assert len(before[0]) > 0
    assert (wal.read_bytes(), (tmp_path / "ledger.sqlite").read_bytes()) == before


def test_a_reader_sees_what_a_killed_writer_left_and_leaves_it_as_it_is(ledger: Ledger, tmp_path: Path) -> None:
    ledger.append("file-a", raw("a"))
    left = tmp_path / "left"
    left.mkdir()
    for name in ("ledger.sqlite", "ledger.sqlite-wal"):
        (left / name).write_bytes((tmp_path / name).read_bytes())
    before = (left / "ledger.sqlite-wal").read_bytes()
    with closing(Ledger(left)) as reader:
        assert [one.event for one in reader.events()] == [raw("a")]
    assert (left / "ledger.sqlite-wal").read_bytes() == before


def test_a_ledger_on_a_read_only_medium_is_read(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.access", lambda path, mode: False)
    before = sorted(path.name for path in written.iterdir())
    assert "immutable=1" in ledger_lock.reading_uri(written / "ledger.sqlite")
    assert findings(written) == []
    assert sorted(path.name for path in written.iterdir()) == before


def test_a_seal_holds_the_head_before_it_and_is_made_once(ledger: Ledger) -> None:
    assert ledger.seal() is None
    ledger.append("file-a", raw("a"))
    head = ledger.head()
    sealed = ledger.seal()
    assert sealed and sealed.event == LedgerSealed(position=head.position, root=head.root)
    assert ledger.seal() is None


def test_the_head_is_the_same_for_every_reader_and_moves_with_each_event(ledger: Ledger, tmp_path: Path) -> None:
    heads = [ledger.head()]
    for name in "abc":
        ledger.append("file-a", raw(name))
        heads.append(ledger.head())
    assert len(set(heads)) == 4
    assert head_of(tmp_path) == heads[-1]


def test_a_ledger_that_was_not_touched_has_no_findings(written: Path) -> None:
    head = head_of(written)
    assert findings(written, head) == []
    with closing(Ledger(written, write=True)) as ledger:
        ledger.append("session-1", session("1", "1_s1"))
        ledger.seal()
    assert findings(written, head) == []


COLUMNS = ["rowid", "originator_id", "originator_version", "topic", "state"]


def flipped(value: int | str | bytes, rng: random.Random) -> int | str | bytes:
    """`value` with one bit other."""
    if isinstance(value, int):
        return value ^ 1 << rng.randrange(12)
    data = bytearray(value.encode() if isinstance(value, str) else value)
    data[rng.randrange(len(data))] ^= 1 << rng.randrange(7)
    return bytes(data) if isinstance(value, bytes) else data.decode(errors="replace")


@pytest.mark.parametrize("column", COLUMNS)
def test_a_flipped_bit_in_any_column_is_found_and_never_read(written: Path, column: str) -> None:
    rng = random.Random(column)
    rows = stored(written)
    image = (written / "ledger.sqlite").read_bytes()
    tried = 0
    for row in rows * 3:
        value = flipped(row[COLUMNS.index(column)], rng)
        (written / "ledger.sqlite").write_bytes(image)
        try:
            change(written, f"UPDATE stored_events SET {column}=? WHERE rowid=?", value, row[0])
        except sqlite3.IntegrityError:
            continue  # the row would take another's place: SQLite refuses
        tried += 1
        assert findings(written), (row, value)
    assert tried >= 15


@pytest.mark.parametrize("column", COLUMNS[1:])
def test_a_column_of_another_type_is_found(written: Path, column: str) -> None:
    change(written, f"UPDATE stored_events SET {column}=NULL WHERE rowid=3")
    assert any("event 3" in line and "another type" in line for line in findings(written))
    with closing(Ledger(written)) as ledger, pytest.raises(DamageError, match="event 3"):
        ledger.events()


def test_flipped_bits_of_the_file_are_found_wherever_they_change_what_is_read(written: Path) -> None:
    rng = random.Random(20261121)
    path = written / "ledger.sqlite"
    image, true_rows = path.read_bytes(), stored(written)
    silent, changed = [], 0
    for _ in range(250):
        damaged = bytearray(image)
        place = rng.randrange(len(image))
        damaged[place] ^= 1 << rng.randrange(8)
        path.write_bytes(damaged)
        try:
            same = stored(written) == true_rows
        except (sqlite3.Error, UnicodeError):
            same = False
        changed += not same
        if not same and not findings(written):
            silent.append(place)
        with closing(Ledger(written)) as ledger, suppress(IngestError):
            ledger.events()  # nothing but our own one-line errors comes out
        for left in written.glob("ledger.sqlite-*"):
            left.unlink()
    assert silent == []
    assert changed > 50


def test_damage_in_the_index_by_which_streams_are_found_is_found(written: Path) -> None:
    path = written / "ledger.sqlite"
    image = path.read_bytes()
    places = [place for place in range(len(image)) if image.startswith(b"session-2", place)]
    rows = stored(written)
    assert len(places) == 2  # the row, and its entry in the index
    unread = 0
    for place in places:
        path.write_bytes(image[:place] + b"t" + image[place + 1 :])
        unread += stored(written) == rows
        assert findings(written)
    assert unread == 1


def test_a_truncated_file_is_found_and_said_in_one_line(written: Path) -> None:
    path = written / "ledger.sqlite"
    image = path.read_bytes()
    for size in range(0, len(image), 1024):
        path.write_bytes(image[:size])
        found = findings(written)
        assert found, size
        assert all("\n" not in line for line in found)


@pytest.mark.parametrize("position", range(1, 9))
def test_a_row_deleted_in_the_middle_is_found(written: Path, position: int) -> None:
    change(written, "DELETE FROM stored_events WHERE rowid=?", position)
    assert f"events {position} to {position} are missing" in findings(written)


def test_rows_cut_off_at_the_end_are_found_against_a_head_noted_before(written: Path) -> None:
    head = head_of(written)
    change(written, "DELETE FROM stored_events WHERE rowid>=8")
    assert findings(written) == []  # what comes after the last seal is proven by nothing in the store
    assert findings(written, head) == ["the ledger ends at event 7, the head given was 9: the end is missing"]


def test_an_older_copy_of_the_ledger_is_found_against_a_head_noted_before(written: Path) -> None:
    image = (written / "ledger.sqlite").read_bytes()
    with closing(Ledger(written, write=True)) as ledger:
        ledger.append("session-1", session("1", "1_s1"))
        head = ledger.head()
    (written / "ledger.sqlite").write_bytes(image)
    assert len(findings(written, head)) == 1


@pytest.mark.parametrize(
    "statement",
    [
        "DELETE FROM stored_events WHERE rowid=3",
        "UPDATE stored_events SET rowid=rowid+100 WHERE rowid>4",
        "UPDATE stored_events SET rowid=-5 WHERE rowid=3",
        "UPDATE stored_events SET rowid=0 WHERE rowid=1",
        "UPDATE stored_events SET rowid=9223372036854775807 WHERE rowid=9",
    ],
)
def test_a_history_with_missing_or_renumbered_events_is_found_and_never_read(written: Path, statement: str) -> None:
    change(written, statement)
    assert any("missing" in line or "number was changed" in line for line in findings(written))
    for read in (Ledger.events, Ledger.head):
        with closing(Ledger(written)) as ledger, pytest.raises(DamageError, match="; `whyhot verify` lists all damage"):
            read(ledger)


@pytest.mark.parametrize(
    ("part", "edits"),
    [
        ("body", {"size": None}),
        ("body", {"size": "long"}),
        ("body", {"size": 2**70}),
        ("body", {"name": ["a"]}),
        ("body", {"name": 7}),
        ("body", {"format": {}}),
        (None, {"body": None}),
        (None, {"body": []}),
        (None, {"recorded": "soon"}),
        (None, {"recorded": None}),
        (None, {"code": 1}),
        (None, {"happened": [1]}),
    ],
)
def test_a_forged_payload_of_another_type_is_damage_even_with_a_digest_that_fits(
    written: Path, part: str | None, edits: dict[str, Any]
) -> None:
    position, stream, version, topic, state = stored(written)[0]
    envelope = json.loads(state)
    (envelope[part] if part else envelope).update(edits)
    forged = canonical(resealed(stream, version, topic, envelope))
    change(written, "UPDATE stored_events SET state=? WHERE rowid=?", forged, position)
    assert any(line.startswith("event 1 ") for line in findings(written))
    with closing(Ledger(written)) as ledger, pytest.raises(DamageError, match="event 1 "):
        ledger.events()


@pytest.mark.parametrize(("one", "two"), [(1, 2), (2, 3), (4, 5), (8, 9), (1, 9)])
def test_rows_that_changed_places_are_found(written: Path, one: int, two: int) -> None:
    for old, new in ((one, 100), (two, one), (100, two)):
        change(written, "UPDATE stored_events SET rowid=? WHERE rowid=?", new, old)
    assert any("the order was changed" in line or "another order" in line for line in findings(written))


def test_a_row_that_was_added_by_hand_is_found(written: Path) -> None:
    state = stored(written)[0][4]
    change(written, "INSERT INTO stored_events VALUES (?,?,?,?)", "file-x", 1, "whyhot:RawFileSealed", state)
    assert any("event 10" in line and "its digest differs" in line for line in findings(written))


def test_a_topic_that_is_not_ours_is_found_and_never_imported(written: Path, tmp_path: Path) -> None:
    position, stream, version, _, state = stored(written)[7]
    topic = "antigravity:fly"
    envelope = json.loads(state)
    envelope = resealed(stream, version, topic, envelope)
    change(written, "UPDATE stored_events SET topic=?, state=? WHERE rowid=?", topic, canonical(envelope), position)
    says = "'antigravity:fly' is not an event of this whyhot: it was forged, or a newer one wrote it"
    assert any(says in line for line in findings(written))
    with closing(Ledger(written)) as ledger, pytest.raises(DamageError, match="antigravity:fly"):
        ledger.events()
    assert "antigravity" not in sys.modules


def test_parts_of_a_forged_event_that_others_read_are_of_their_type() -> None:
    done = {"diagnosis": "d", "key": {"train": ["s"], "code": "c", "new": 1}, "artefact": "a"}
    made = {"of_model": {"m": {"b": "b2"}, "m2": "b3"}, "parent": "b"}
    for inside, fits in (({"benches": made}, True), ({"benches": -0.5}, False), ({"benches": {"of_model": []}}, False)):
        assert _fits(done | {"summary": {"motor": "m", "causes": []} | inside}, DiagnosisCompleted) is fits
    assert not _fits(done | {"summary": {}, "key": {"train": "s"}}, DiagnosisCompleted)


@pytest.mark.parametrize("edit", [{"v": 2}, {"body": {"strange": 1}}])
def test_an_event_of_a_newer_whyhot_is_said_to_be_one(written: Path, edit: dict[str, Any]) -> None:
    position, stream, version, topic, state = stored(written)[7]
    envelope = json.loads(state) | edit
    envelope = resealed(stream, version, topic, envelope)
    change(written, "UPDATE stored_events SET state=? WHERE rowid=?", canonical(envelope), position)
    assert any("does not fit this whyhot (it knows 1): update whyhot" in line for line in findings(written))


def test_a_payload_rewritten_with_a_new_digest_breaks_chain_and_seal(written: Path) -> None:
    forge(written, 1, chain=False, size=77)
    found = findings(written)
    assert any("does not follow the event before it in its stream" in line for line in found)
    assert any("the seal does not fit: something in events 1 to 3 was changed" in line for line in found)


def test_a_version_left_out_is_found_even_where_the_digests_fit(written: Path) -> None:
    position, stream, version, topic, state = stored(written)[8]
    forged = canonical(resealed(stream, version + 5, topic, json.loads(state)))
    change(
        written, "UPDATE stored_events SET originator_version=?, state=? WHERE rowid=?", version + 5, forged, position
    )
    (found,) = findings(written)
    assert found.endswith("follows version 1 of its stream: events are missing or in another order")


def test_rows_on_both_sides_of_one_that_cannot_be_read_at_all_are_still_checked(written: Path) -> None:
    for position in (2, 8):
        change(written, "UPDATE stored_events SET topic='whyhot:Other' WHERE rowid=?", position)
    change(written, "UPDATE stored_events SET topic=CAST(x'ff' AS TEXT) WHERE rowid=6")
    found = findings(written)
    for position in (2, 8):
        assert any(line.startswith(f"event {position} ") for line in found)
    (unread,) = [line for line in found if "Could not decode to UTF-8" in line]
    assert unread.endswith("event 6 could not be read")
    assert not any("are missing" in line for line in found)


def test_the_last_row_that_cannot_be_read_is_said(written: Path) -> None:
    change(written, "UPDATE stored_events SET topic=CAST(x'ff' AS TEXT) WHERE rowid=9")
    (found,) = findings(written)
    assert found.endswith("what follows event 8 could not be checked")


def test_a_whole_chain_recomputed_is_found_by_the_seals(written: Path) -> None:
    forge(written, 1, chain=True, size=77)
    assert any(
        "(position 4)" in line or "event 4 ('ledger-0' version 1): the seal" in line for line in findings(written)
    )


def test_a_whole_history_recomputed_is_found_against_a_head_noted_before(written: Path) -> None:
    head = head_of(written)
    rewrite(written, 1, name="other.blf")
    assert findings(written) == []  # nothing in the store says so
    assert findings(written, head) == [
        "event 9: the root differs from the head given: the history up to here was changed"
    ]


def test_all_damage_is_listed_not_only_the_first(written: Path) -> None:
    for position in (1, 5, 8):
        change(written, "UPDATE stored_events SET state=CAST('{}' AS BLOB) WHERE rowid=?", position)
    found = findings(written)
    for position in (1, 5, 8):
        assert any(line.startswith(f"event {position} ") and "its digest differs" in line for line in found)


def test_a_writer_does_not_build_on_a_damaged_event(written: Path) -> None:
    change(written, "UPDATE stored_events SET topic='whyhot:LedgerSealed' WHERE rowid=9")
    with closing(Ledger(written, write=True)) as ledger, pytest.raises(DamageError, match="event 9"):
        ledger.append("file-a", raw("a"))


@pytest.mark.parametrize("content", [b"", b"not a database at all" * 100])
def test_a_file_that_is_no_ledger_is_said_in_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "ledger.sqlite").write_bytes(content)
    assert findings(tmp_path)
    with (
        pytest.raises(IngestError, match=r"ledger.sqlite: cannot be read or written") as caught,
        closing(Ledger(tmp_path)) as it,
    ):
        it.events()
    assert "\n" not in str(caught.value)


def test_a_missing_ledger_is_not_made_anew(tmp_path: Path) -> None:
    for write in (False, True):
        with pytest.raises(LedgerError, match="unable to open"), closing(Ledger(tmp_path, write=write)) as ledger:
            ledger.events()
    assert not (tmp_path / "ledger.sqlite").exists()


@pytest.mark.parametrize(
    ("version", "affected"),
    [
        ((3, 6, 23), False),
        ((3, 7, 0), True),
        ((3, 40, 1), True),
        ((3, 44, 5), True),
        ((3, 44, 6), False),
        ((3, 45, 0), True),
        ((3, 50, 6), True),
        ((3, 50, 7), False),
        ((3, 51, 2), True),
        ((3, 51, 3), False),
        ((4, 0, 0), False),
    ],
)
def test_versions_with_the_wal_reset_bug_are_known(version: tuple[int, int, int], affected: bool) -> None:
    assert has_wal_reset_bug(version) is affected
