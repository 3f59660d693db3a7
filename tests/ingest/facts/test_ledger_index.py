"""Facts that are looked up are those that all events give, and nothing that was changed is hidden by the index."""

from __future__ import annotations

import os
import random
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from ingest.errors import DamageError, UnknownSessionError
from ingest.facts import facts as facts_module
from ingest.facts import ledger_row
from ingest.facts.events import (
    ClockAligned,
    Event,
    FactReinstated,
    FactRetracted,
    HeldOutOpened,
    QualityFlagged,
    ReplayCompleted,
    SessionRegrouped,
)
from ingest.facts.facts import Facts, LookedUp
from ingest.facts.ledger import INDEX, Ledger
from ingest.facts.ledger_audit import audit
from ingest.facts.ledger_history import LedgerHistory
from ingest.facts.ledger_index import LedgerIndex
from ingest.facts.ledger_place import SqliteFile
from ingest.facts.store import Store
from made.events import decode, raw, session
from made.lines_of_damage import damage

MAPPINGS = ("files", "decodes", "joined", "old_names", "runs", "flags", "clocks", "opened", "inspections", "benches")
SESSIONS = 12


def run(number: str, of: str) -> ReplayCompleted:
    given: dict[str, Any] = {key: {} for key in ("key", "environment", "artefacts", "summary")}
    return ReplayCompleted(
        run=number, session=of, model="m", motor="m", level="testing", bench=None, digest="d", **given
    )


def events(chance: random.Random, k: int) -> list[tuple[str, Event]]:
    """What might be appended next, about a few sessions again and again."""
    one, other = (f"{chance.randrange(SESSIONS):04x}00" for _ in range(2))
    log = raw(f"log{chance.randrange(6)}.blf", data=one.encode())
    begun = chance.choice([None, chance.randrange(2**40)])
    made = session(one, f"name{chance.randrange(8)}", start_ns=begun)
    made.files.append({"raw": log.sha256, "decode": f"d{one}", "first_record": 0, "last_record": 2})
    why = chance.choice([None, "ends before its end"])
    outcome = "quarantined" if chance.random() < 0.2 else "decoded"
    zero: dict[str, Any] = dict.fromkeys(("offset_sd_s", "drift_ppm", "drift_sd_ppm", "correlation"), 0.0)
    clock = ClockAligned(
        session=one, clock=f"can{k % 2}", reference="can3", by=[], at_ns=k, offset_s=0.1 * k, says="late", **zero
    )
    return [
        (f"file-{log.sha256}", log),
        (f"file-{log.sha256}", decode(f"d{one}", log.sha256, outcome=outcome, why=why)),
        (f"session-{one}", made),
        (f"session-{one}", SessionRegrouped(session=one, into=other, why="a late file joined")),
        (f"session-{one}", QualityFlagged(flag="gap", says=f"gap {k}")),
        (f"session-{one}", clock),
        (f"run-{one}{k % 2}", run(f"{one}{k % 2}", one)),
        ("diagnosis-d", HeldOutOpened(diagnosis=f"d{k}", sessions=[one])),
    ]


def assert_as_folded(found: Facts, folded: Facts) -> None:
    """Every question is answered as all events answer it; those that are looked up before those that read all."""
    assert isinstance(found, LookedUp)
    for count in (1, 3, 100):
        last, of = found.last_sessions(count)
        assert (list(last), of) == (list(folded.sessions[-count:]), len(folded.sessions))
    assert found.unread() == folded.unread()
    for one in folded.sessions:
        assert found.clocks_of(one) == folded.clocks_of(one)
        assert sorted(one.run for one in found.runs_of(one)) == sorted(one.run for one in folded.runs_of(one))
        assert one in found.sessions
    for sha256, log in folded.files.items():
        assert found.decodes_of(sha256) == folded.decodes_of(sha256)
        assert sorted(found.called(log.name), key=str) == sorted(folded.called(log.name), key=str)
        assert found.holding([sha256]) == folded.holding([sha256])
    names = {one.name for one in folded.sessions} | {*folded.joined, "nothing", "000", "0", "name"}
    for text in sorted({*names, *(name[:5] for name in names)}):
        assert answer(found, text) == answer(folded, text), text
    for name in MAPPINGS:
        looked, whole = getattr(found, name), getattr(folded, name)
        assert {key: looked[key] for key in whole} == whole, name
        assert looked.get("nothing") is None
    assert list(found.sessions) == list(folded.sessions)
    assert all(dict(getattr(found, name)) == getattr(folded, name) for name in MAPPINGS)


def answer(facts: Facts, text: str) -> object:
    try:
        return facts.session(text)
    except UnknownSessionError as error:
        return str(error)


@pytest.mark.parametrize("seed", range(4))
def test_facts_that_are_looked_up_are_those_that_all_events_give(tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    for k in range(6):
        with closing(Ledger(tmp_path, write=True, create=k == 0)) as ledger:
            for _ in range(8):
                ledger.append_all(chance.sample(events(chance, k), 3))
                known = facts_module.at(ledger)
            ledger.append_all(chance.sample(events(chance, k), 3))
            then = facts_module.fold(ledger.events(as_of=ledger.head().position - 3))
            assert list(known.sessions) == list(then.sessions)  # what comes later is not seen
        with closing(Ledger(tmp_path)) as ledger:
            assert_as_folded(facts_module.at(ledger), facts_module.fold(ledger.events()))


def test_an_index_that_was_interrupted_before_it_was_made_ends_in_silence() -> None:
    LedgerIndex.__new__(LedgerIndex).__del__()


def test_where_something_was_taken_back_every_event_is_read(written: Path) -> None:
    with closing(Ledger(written, write=True)) as ledger:
        one = facts_module.at(ledger).session("s3")
        ledger.append(f"session-{one.session}", FactRetracted(fact=f"session-{one.session}", name="s3", why="wrong"))
        assert facts_module.at(ledger) == facts_module.fold(ledger.events())
        with pytest.raises(UnknownSessionError, match="is not in this store"):
            facts_module.at(ledger).session("s3")
        ledger.append(f"session-{one.session}", FactReinstated(fact=f"session-{one.session}", why="right"))
        assert facts_module.at(ledger).session("s3") == one


@pytest.fixture
def written(tmp_path: Path) -> Path:
    """The folder of a closed ledger with twenty sessions, s0 to s19, and a seal."""
    with closing(Ledger(tmp_path, write=True, create=True)) as ledger:
        ledger.append_all([(f"session-{k:04x}", session(f"{k:04x}", f"s{k}", start_ns=k)) for k in range(20)])
        ledger.seal()
    assert (tmp_path / INDEX).is_file()
    return tmp_path


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """Positions of the events that are decoded from here on."""
    positions: list[int] = []
    decoded = ledger_row.decode

    def count(row: Any, position: int) -> Any:
        positions.append(position)
        return decoded(row, position)

    monkeypatch.setattr("ingest.facts.ledger.decode", count)
    monkeypatch.setattr("ingest.facts.ledger_history.decode", count)
    yield positions


def name_of(folder: Path, text: str) -> str:
    with closing(Ledger(folder)) as ledger:
        return facts_module.at(ledger).session(text).name


def test_a_command_reads_the_events_that_it_asks_for_and_no_others(written: Path, read: list[int]) -> None:
    assert name_of(written, "s7") == "s7"
    assert set(read) == {8, 20, 21}  # the session, the last event that the index knows, and the seal behind it


def test_a_writer_decodes_what_it_appends_and_not_what_was_there(written: Path, read: list[int]) -> None:
    with closing(Ledger(written, write=True)) as ledger:
        ledger.append("session-0014", session("0014", "s20", start_ns=20))
        assert facts_module.at(ledger).session("s20").start_ns == 20
        ledger.seal()
    assert set(read) <= {0, 20, 21, 22, 23}  # 0: before it has its place
    assert read.count(22) <= 2  # as the one before the seal, and when the head is taken
    assert name_of(written, "s20") == "s20"


def update(folder: Path, statement: str, *values: Any) -> None:
    with closing(sqlite3.connect(folder / "ledger.sqlite")) as connection, connection:
        connection.execute(statement, values)


def test_an_event_changed_by_another_program_is_found_by_the_next_command(written: Path) -> None:
    update(written, "UPDATE stored_events SET state = CAST(replace(state, 's4', 's5') AS BLOB) WHERE rowid = 5")
    with pytest.raises(DamageError, match=r"event 5 .* is not what was written"):
        name_of(written, "s7")


def test_a_change_that_leaves_size_and_time_of_the_file_is_found_by_verify_and_where_it_is_read(written: Path) -> None:
    path = written / "ledger.sqlite"
    before = path.stat()
    path.write_bytes(path.read_bytes().replace(b'"name":"s4"', b'"name":"s5"'))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert name_of(written, "s7") == "s7"
    assert name_of(written, "s6") == "s6"
    with pytest.raises(DamageError, match=r"event 5 .* is not what was written"):
        name_of(written, "s4")
    with closing(Ledger(written)) as ledger:
        assert any("event 5 " in one.says for one in audit(ledger).findings)


def test_a_seal_after_a_hidden_change_is_one_of_what_was_written(written: Path) -> None:
    path = written / "ledger.sqlite"
    before = path.stat()
    path.write_bytes(path.read_bytes().replace(b'"name":"s4"', b'"name":"s5"'))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    with closing(Ledger(written, write=True)) as ledger:
        ledger.append("session-0014", session("0014", "s20", start_ns=20))
        ledger.seal()
    with closing(Ledger(written)) as ledger:
        says = [one.says for one in audit(ledger).findings]
    assert [line.split(" (")[0] for line in says] == ["event 5", "event 21", "event 23"]  # and both seals do not fit


def cut(data: bytes) -> bytes:
    return data[: len(data) // 2]


def flip(data: bytes) -> bytes:
    place = random.Random(1).randrange(len(data))
    return data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :]


def strange(data: bytes) -> bytes:
    return b"no index" * len(data)


@pytest.mark.parametrize("harm", [cut, flip, strange], ids=lambda harm: harm.__name__)
def test_a_harmed_index_is_made_again_and_says_nothing_wrong(written: Path, harm: Callable[[bytes], bytes]) -> None:
    path = written / INDEX
    path.write_bytes(harm(path.read_bytes()))
    stamp = SqliteFile(written / "ledger.sqlite", False, False).stamp()
    assert LedgerIndex.load(path, stamp) is None
    assert name_of(written, "s7") == "s7"
    assert LedgerIndex.load(path, stamp) is not None


def test_the_index_of_another_ledger_or_of_an_older_one_is_not_believed(written: Path, tmp_path: Path) -> None:
    older = (written / INDEX).read_bytes()
    with closing(Ledger(written, write=True)) as ledger:
        ledger.append("session-0014", session("0014", "s20", start_ns=20))
        head = ledger.head()
    (written / INDEX).write_bytes(older)
    assert name_of(written, "s20") == "s20"
    (tmp_path / "other").mkdir()
    with closing(Ledger(tmp_path / "other", write=True, create=True)) as ledger:
        ledger.append("session-1", session("0001", "s20"))
        ledger.seal()
    (tmp_path / "other" / INDEX).replace(written / INDEX)
    assert name_of(written, "s20") == "s20"
    with closing(Ledger(written)) as ledger:
        assert ledger.head() == head


def test_an_index_that_was_made_to_hide_a_session_is_found_by_verify(tmp_path: Path) -> None:
    with Store.open(tmp_path / "s", create=True) as store:
        store.ledger.append_all([(f"session-{k:04x}", session(f"{k:04x}", f"s{k}", start_ns=k)) for k in range(9)])
    with Store.open(tmp_path / "s") as store:
        assert damage(store) == []
    path = tmp_path / "s" / INDEX
    index = LedgerIndex.load(path, SqliteFile(tmp_path / "s" / "ledger.sqlite", False, False).stamp())
    assert index is not None
    index._connection.execute("DELETE FROM place WHERE position = 3")
    index.save(path, index.known)
    with Store.open(tmp_path / "s") as store:
        (line,) = damage(store)
        assert line.endswith(
            "ledger.index: does not say where the events lie: delete it, the next command makes it again"
        )
        assert facts_module.at(store.ledger).session("s2").name == "s2"  # what is not found is looked for in all events
    path.unlink()
    assert name_of(tmp_path / "s", "s2") == "s2"
    with Store.open(tmp_path / "s") as store:
        assert damage(store) == []


def test_without_an_index_or_a_place_for_it_all_is_read(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (written / INDEX).unlink()
    monkeypatch.setattr(Path, "write_bytes", lambda *_: (_ for _ in ()).throw(PermissionError))
    assert name_of(written, "s7") == "s7"
    assert not (written / INDEX).exists()


def test_an_interrupt_while_an_event_is_taken_in_leaves_no_index_of_half_of_it(
    written: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), closing(Ledger(written, write=True)) as ledger:
        ledger.index()
        monkeypatch.setattr(LedgerHistory, "_grow", interrupt)
        ledger.append("session-0014", session("0014", "s20", start_ns=20))
        ledger.index()
    monkeypatch.undo()
    assert name_of(written, "s20") == "s20"
    with closing(Ledger(written)) as ledger:
        assert audit(ledger).findings == []


def test_what_a_killed_writer_appended_is_seen(written: Path) -> None:
    kept = (written / INDEX).read_bytes()
    with closing(Ledger(written, write=True)) as ledger:
        ledger.append("session-0014", session("0014", "s20", start_ns=20))
        reader = name_of(written, "s20")
    (written / INDEX).write_bytes(kept)  # it was killed before it could keep its own
    assert reader == name_of(written, "s20") == "s20"


def test_facts_of_a_closed_ledger_are_still_read_and_leave_no_connection(written: Path) -> None:
    with closing(Ledger(written, write=True)) as ledger:
        known = facts_module.at(ledger)
    assert known.session("s7").name == "s7"
    assert len(known.sessions) == 20
    assert ledger.place._recorder is None
