"""A ledger in a PostgreSQL server: as one in a file, and several programs at once lose and double nothing."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from ingest.errors import DamageError, LedgerError, OvertakenError, ServerError
from ingest.facts import facts as facts_module
from ingest.facts.bucket import Place
from ingest.facts.chain import Head
from ingest.facts.events import DecodeCompleted, RawFileSealed, SessionRecorded
from ingest.facts.ledger import INDEX, Ledger, settled
from ingest.facts.ledger_audit import audit
from ingest.facts.ledger_row import encode
from ingest.facts.ledger_server import Server, ServerTable
from ingest.facts.move import move
from ingest.facts.sessions import Override
from ingest.facts.store import MARK, Store, mark_of
from ingest.intake import grouping
from ingest.intake.intake import take_in
from ingest.intake.setup import MotorFile, prepare
from made.events import put, raw, session
from made.lines_of_damage import damage
from made.postgres import PostgresServer, why_none
from made.tables import ONE_CHANNEL

if why := why_none():
    pytest.skip(why, allow_module_level=True)


@pytest.fixture
def folder(server: PostgresServer, tmp_path: Path) -> Path:
    """A store of two logs, a session and two seals, its ledger in the server."""
    folder = tmp_path / "store"
    with Store.open(folder, create=True) as store:
        put(store, "a")
        put(store, "b")
    with Store.open(folder, write=True) as store:
        store.ledger.append("session-0001", session("0001", "s1", start_ns=5))
    move(folder, server.url)
    return folder


def names(folder: Path) -> list[str]:
    with Store.open(folder) as store:
        return [one.event.name for one in store.ledger.events() if isinstance(one.event, RawFileSealed)]


def findings(folder: Path, since: Head | None = None) -> list[str]:
    with Store.open(folder) as store:
        return damage(store, since=since)


def audited(folder: Path) -> list[str]:
    """What is wrong with the events, whatever they cite."""
    with Store.open(folder) as store:
        return [one.says for one in audit(store.ledger).findings]


def head_of(folder: Path) -> Head:
    with Store.open(folder) as store:
        return store.ledger.head()


def table(folder: Path) -> str:
    server = mark_of(folder).ledger
    assert server
    return server.table


def test_a_ledger_in_a_server_is_read_and_appended_to_as_one_in_a_file(folder: Path) -> None:
    with Store.open(folder, write=True) as store:
        put(store, "c")
        assert [one.position for one in store.ledger.events()] == [1, 2, 3, 4, 5, 6]
        assert [one.position for one in store.ledger.events(as_of="2")] == [1, 2]
        assert facts_module.at(store.ledger).session("s1").name == "s1"
    assert names(folder) == ["a", "b", "c"]
    with Store.open(folder) as store:
        assert len(store.ledger.events()) == 7, "sealed at the end"
        with pytest.raises(LedgerError, match=r"opened for reading"):
            store.ledger.append("file-a", raw("a"))
    assert findings(folder, head_of(folder)) == []
    assert not (folder / "ledger.sqlite").exists()


def test_the_index_is_believed_while_others_append_and_no_longer_when_rows_were_changed(
    folder: Path, server: PostgresServer
) -> None:
    head = head_of(folder)  # makes the index
    with Store.open(folder, write=True) as store:
        put(store, "c")
    kept = (folder / INDEX).read_bytes()
    with closing(Ledger(folder, write=True, server=mark_of(folder).ledger)) as other:
        other.append("session-0002", session("0002", "s2", start_ns=6))
    (folder / INDEX).write_bytes(kept)
    read: list[int | None] = []
    rows = Ledger.rows

    def counted(ledger: Ledger, start: int | None = None, *more: Any, **named: Any) -> Any:
        read.append(start)
        return rows(ledger, start, *more, **named)

    with patch.object(Ledger, "rows", counted), Store.open(folder) as store:
        assert facts_module.at(store.ledger).session("s2").name == "s2"
    assert head.position == 5
    assert {None, 1, 2, 3, 4}.isdisjoint(read), "of what the index knows, only the end and the seal before are read"
    server.sql(f"UPDATE {table(folder)} SET state = %s WHERE notification_id = 2", b"x")
    with Store.open(folder) as store, pytest.raises(DamageError, match=r"event 2 .*is not what was written"):
        facts_module.at(store.ledger)


STEPS: dict[str, str] = {
    "a byte": "UPDATE {t} SET state = set_byte(state, 40, get_byte(state, 40) # 1) WHERE notification_id = 2",
    "a stream": "UPDATE {t} SET originator_id = 'file-x' WHERE notification_id = 2",
    "a version": "UPDATE {t} SET originator_version = 7 WHERE notification_id = 2",
    "a topic": "UPDATE {t} SET topic = 'whyhot:MotorRegistered' WHERE notification_id = 2",
    "no state": "UPDATE {t} SET state = NULL WHERE notification_id = 2",
    "no topic": "UPDATE {t} SET topic = NULL WHERE notification_id = 2",
    "one removed": "DELETE FROM {t} WHERE notification_id = 2",
    "the first removed": "DELETE FROM {t} WHERE notification_id = 1",
    "the last removed": "DELETE FROM {t} WHERE notification_id = 5",
    "all removed": "TRUNCATE {t}",
    "two exchanged": "UPDATE {t} SET notification_id = -notification_id WHERE notification_id IN (1, 2);"
    "UPDATE {t} SET notification_id = 3 + notification_id WHERE notification_id < 0",
    "moved to the end": "UPDATE {t} SET notification_id = 6 WHERE notification_id = 2",
    "before the first": "UPDATE {t} SET notification_id = 0 WHERE notification_id = 1",
    "one added": "INSERT INTO {t} SELECT originator_id, 2, topic, state FROM {t} WHERE notification_id = 1",
    "one in between": "UPDATE {t} SET notification_id = notification_id + 10 WHERE notification_id > 2;"
    "UPDATE {t} SET notification_id = notification_id - 9 WHERE notification_id > 10;"
    "INSERT INTO {t} SELECT 'file-y', 1, topic, state, 3 FROM {t} WHERE notification_id = 1",
}


def test_each_change_that_was_planted_in_the_table_is_found(folder: Path, server: PostgresServer) -> None:
    name, head = table(folder), head_of(folder)
    server.sql(f"CREATE TABLE kept AS SELECT * FROM {name}")
    unseen = []
    for what, steps in STEPS.items():
        for step in steps.split(";"):
            server.sql(step.format(t=name))
        if not findings(folder, head):
            unseen.append(what)
        server.sql(f"TRUNCATE {name}")
        server.sql(f"INSERT INTO {name} SELECT * FROM kept")
    server.sql("DROP TABLE kept")
    assert unseen == []
    assert findings(folder, head) == []


def test_positions_have_no_gap_where_an_append_failed(folder: Path) -> None:
    with Store.open(folder, write=True) as store:
        place = store.ledger.place
        (first,) = [*store.ledger.rows(1, 1)]
        with pytest.raises(LedgerError, match=r"duplicate key"), place.plain_words():
            place.insert([first], 5)
        assert store.ledger.append("file-c", raw("c")).position == 6
    assert audited(folder) == []


def test_rows_that_were_committed_when_the_connection_broke_are_not_stored_twice(folder: Path) -> None:
    with Store.open(folder, write=True) as store:
        last = store.ledger.events()[-1]
        after = store.ledger.events()[-1].recorded.replace("20", "30", 1)
        row, _ = encode(raw("c"), "file-c", None, after, None)
        other, _ = encode(raw("d"), "file-d", None, after, None)
        assert store.ledger.place.insert([row], last.position) == [6]
        assert store.ledger.place.insert([row], last.position) == [6]
        assert store.ledger.place.insert([other], last.position) is None
        assert len(store.ledger.events()) == 6


def test_what_another_program_recorded_since_the_facts_were_asked_for_is_not_gone_over(folder: Path) -> None:
    with Store.open(folder, write=True) as one, Store.open(folder, write=True) as two:
        for store in (one, two):
            facts_module.at(store.ledger)
        first = two.ledger.append("file-c", raw("c"))
        assert one.ledger.append("file-d", raw("d")).position == first.position + 1, "of another stream"
        with pytest.raises(OvertakenError, match=r"recorded the same meanwhile: run the same command again"):
            one.ledger.append("file-c", raw("c"))
        two.ledger.append("session-0002", session("0002", "s2", start_ns=7))
        with pytest.raises(OvertakenError):
            one.ledger.append_all([("session-0003", session("0003", "s3"))], rests_on=(SessionRecorded,))
        tries = []

        def decide() -> int:
            tries.append(len(facts_module.at(one.ledger).sessions))
            batch = [("session-0003", session("0003", "s3"))]
            return one.ledger.append_all(batch, rests_on=(SessionRecorded,))[0].version

        assert (settled(decide), tries) == (1, [2])
    assert audited(folder) == []


def test_times_rise_with_the_position_whatever_the_clocks_of_the_writers_say(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Store.open(folder, write=True) as store:
        after = "2099-01-01T00:00:00.000000Z"
        row, _ = encode(raw("c"), "file-c", None, after, None)
        store.ledger.place.insert([row], 5)
        assert store.ledger.append("file-d", raw("d")).recorded == "2099-01-01T00:00:00.000001Z"
    assert audited(folder) == []


TOGETHER = """
import json, os, signal, sys, time
from pathlib import Path
from ingest.errors import IngestError
from ingest.facts.events import RawFileSealed
from ingest.facts.store import Store
import ingest.facts.ledger_table as t

folder, tries, kill = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
if kill == "server":
    t.AGAIN_S = 0.3

def put(store, name):
    sha256 = store.archive.seal(name.encode())
    store.ledger.append(f"file-{sha256}", RawFileSealed(sha256=sha256, name=name, size=len(name), format="blf"))

def write(who, said):
    for k in range(10**6 if kill == "server" or (kill, who) == ("client", "p") else tries):
        with Store.open(folder, write=True) as store:
            put(store, f"{who}-{k}")
            os.write(said, f"{who}-{k}\\n".encode())

reading, said = os.pipe()
pids = []
for who in "pq":
    pid = os.fork()
    if pid == 0:
        os.close(reading)
        code = 0
        try:
            write(who, said)
        except IngestError as error:
            os.write(said, f"! {error}\\n".encode())
            code = 2
        os._exit(code)
    pids.append(pid)
os.close(said)
heard = b""
while chunk := os.read(reading, 65536):
    heard += chunk
    if kill == "client" and heard.count(b"\\n") >= 3:
        os.kill(pids[0], signal.SIGKILL)
    if kill == "server" and heard.count(b"\\n") == 3:
        print("stop", flush=True)
        kill = ""
codes = [os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) for pid in pids]
print(json.dumps({"said": heard.decode().splitlines(), "codes": codes}))
"""


def together(folder: Path, tries: int, kill: str = "", at_stop: Callable[[], None] = lambda: None) -> dict[str, Any]:
    """Two processes that each open the store, append a log and close it, `tries` times or until they are stopped."""
    command = [sys.executable, "-c", TOGETHER, str(folder), str(tries), kill]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as started:
        assert started.stdout and started.stderr
        said = started.stdout.readline()
        if said == "stop\n":
            at_stop()
            said = started.stdout.readline()
        assert said, started.stderr.read()
        result: dict[str, Any] = json.loads(said)
    return result


def test_two_writers_at_once_lose_and_double_nothing(folder: Path) -> None:
    result = together(folder, 12)
    assert result["codes"] == [0, 0]
    assert sorted(names(folder)) == sorted(["a", "b", *result["said"]])
    assert len(result["said"]) == 24
    assert findings(folder) == []


def test_ingests_that_overtake_each_other_record_what_one_after_the_other_does(
    server: PostgresServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Logs of one run, each 30 s after the one before it. While 0 becomes a session another program takes in 1, which
    belongs to it; and right before 2 is recorded another one records it."""
    (tmp_path / "bench.toml").write_text(ONE_CHANNEL)
    logs = [tmp_path / f"{k}.csv" for k in range(3)]
    for k, log in enumerate(logs):
        rows = [f"2026-01-01 10:{2 * k + s // 60:02}:{s % 60:02},{20 + s / 10 + k}" for s in range(0, 91, 10)]
        log.write_text("\n".join(["time,T", *rows]) + "\n")
    alone, shared = tmp_path / "alone", tmp_path / "shared"
    take(alone, logs)
    Store.open(shared, create=True).close()
    move(shared, server.url)
    looked, publish = grouping._looked, Store.publish
    another = [1]

    def meanwhile() -> None:
        if another:
            take(shared, [logs[another.pop()]])

    def after_decision(*given: Any) -> Any:
        meanwhile()
        return looked(*given)

    def before_recording(store: Store, made: Path, name: str) -> Place:
        done = publish(store, made, name)
        meanwhile()
        return done

    with monkeypatch.context() as patched:
        patched.setattr(grouping, "_looked", after_decision)
        take(shared, logs[:1])
    with Store.open(shared) as store:
        assert [one.name for one in facts_module.at(store.ledger).sessions] == ["0"], "of both logs"
    another = [2]
    with monkeypatch.context() as patched:
        patched.setattr(Store, "publish", before_recording)
        take(shared, logs[2:])
    assert another == []
    known = []
    for folder in (alone, shared):
        with Store.open(folder) as store:
            assert damage(store) == []
            found = facts_module.at(store.ledger)
            known.append(([one.session for one in found.sessions], dict(found.decodes), dict(found.files)))
            recorded = store.ledger.events()
    assert known[0] == known[1]
    assert len([one for one in recorded if isinstance(one.event, RawFileSealed)]) == len(logs)
    assert len([one for one in recorded if isinstance(one.event, DecodeCompleted)]) == len(logs)


def _no_motor(path: Path) -> MotorFile:
    raise AssertionError(f"{path} should not be read")


def take(folder: Path, logs: Sequence[Path]) -> None:
    with Store.open(folder, create=True) as store:
        take_in(store, logs, prepare(logs, logs[0].with_name("bench.toml"), [], _no_motor), Override())


def test_a_killed_client_takes_nothing_with_it_and_holds_up_nobody(folder: Path) -> None:
    result = together(folder, 8, "client")
    assert result["codes"] == [-9, 0]
    there = names(folder)
    assert len(set(there)) == len(there)
    assert {f"q-{k}" for k in range(8)} <= {*result["said"]} <= {*there}
    assert findings(folder) == []


def test_a_server_that_is_killed_is_one_line_and_the_store_verifies_after_its_start(
    folder: Path, server: PostgresServer
) -> None:
    try:
        result = together(folder, 0, "server", server.stop)
    finally:
        server.start()
    assert result["codes"] == [2, 2]
    lines = [line for line in result["said"] if line.startswith("! ")]
    assert len(lines) == 2
    there, acknowledged = names(folder), {*result["said"]} - {*lines}
    assert len(set(there)) == len(there)
    assert acknowledged <= {*there}
    assert findings(folder) == []
    for line in lines:
        assert "does not answer" in line or "cannot be used" in line


def test_a_server_that_comes_back_at_once_is_waited_for(folder: Path, server: PostgresServer) -> None:
    def again() -> None:
        server.stop()
        server.start()

    with Store.open(folder, write=True) as store:
        again()
        put(store, "c")
    assert names(folder) == ["a", "b", "c"]
    assert findings(folder) == []


def test_a_verify_without_a_server_says_so_and_finds_no_damage(folder: Path, server: PostgresServer) -> None:
    with Store.open(folder) as store:
        assert isinstance(store.ledger.place, ServerTable)
        store.ledger.place.table()._datastore.pool.timeout = 0.05
        server.stop()
        try:
            with pytest.raises(ServerError, match=r"does not answer .*run the same command again when it is back"):
                audit(store.ledger)
        finally:
            server.start()


def test_a_database_with_the_ledger_of_another_store_is_refused(folder: Path, server: PostgresServer) -> None:
    mark = json.loads((folder / MARK).read_text())
    mark["ledger"]["table"] = "whyhot_0000000000000000"
    (folder / MARK).write_text(json.dumps(mark))
    with pytest.raises(LedgerError, match=r"holds no ledger of this store .* but the ledgers of [0-9]+ others"):
        Store.open(folder)


def test_a_user_without_rights_is_refused_in_one_line(folder: Path, server: PostgresServer) -> None:
    server.sql("DO $$ BEGIN CREATE ROLE guest LOGIN; EXCEPTION WHEN duplicate_object THEN NULL; END $$")
    place = ServerTable(Server(server.url_of("guest"), table(folder)))
    with (
        pytest.raises(LedgerError, match=r"permission denied for table .* the user needs the right to read and append"),
        closing(Ledger(folder, write=True, server=place._server)) as ledger,
    ):
        ledger.append("file-c", raw("c"))
    with pytest.raises(LedgerError, match=r"permission denied for schema public"):
        move(folder, server.url_of("guest"))
    assert findings(folder) == []


def test_a_password_is_found_by_libpq_and_never_kept_or_shown(
    folder: Path, server: PostgresServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server.sql("CREATE ROLE locked LOGIN SUPERUSER PASSWORD 'opensesame'")
    given = server.url_of("locked")
    for wrong in (given.replace("@", ":opensesame@"), f"{given}&password=opensesame"):
        with pytest.raises(LedgerError, match=r"holds a password, .*PGPASSWORD") as caught:
            move(folder, wrong)
        assert "opensesame" not in str(caught.value)
    with pytest.raises(LedgerError, match=r"no password supplied.*a password belongs in"):
        move(folder, given)
    passwords = tmp_path / "pgpass"
    passwords.write_text("*:*:*:locked:opensesame\n")
    passwords.chmod(0o600)
    monkeypatch.setenv("PGPASSFILE", str(passwords))
    head = head_of(folder)
    done = move(folder, given)
    assert (done.head, head_of(folder)) == (head, head)
    assert "opensesame" not in f"{done} {(folder / MARK).read_text()}"
    mark = json.loads((folder / MARK).read_text())
    mark["ledger"]["url"] = given.replace("@", ":opensesame@")
    (folder / MARK).write_text(json.dumps(mark))
    with pytest.raises(LedgerError, match=r"locked:\*\*\*@.*take it out of the URL") as caught:
        Store.open(folder)
    assert "opensesame" not in str(caught.value)
