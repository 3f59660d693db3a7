"""The warehouse holds what the ledger and the Parquet files say, and is thrown away without regret."""

from __future__ import annotations

import os
import random
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import duckdb
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from analytics import scans, tables, warehouse
from analytics.errors import WarehouseError
from ingest.errors import LedgerError
from ingest.facts import facts
from ingest.facts.events import SessionRecorded, SessionRegrouped
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import take_in
from ingest.intake.setup import prepare
from made.insulation_logs import decoded_anew
from made.places import on_disk
from made.tables import ONE_CHANNEL

SECOND = 1_000_000_000
START = 1_760_000_000 * SECOND
NewSession = Callable[..., SessionRecorded]


def ask(store: Store, sql: str, as_of: str | None = None) -> list[tuple[Any, ...]]:
    with warehouse.refresh(store, as_of) as opened:
        return opened.connection.execute(sql).fetchall()


def test_sessions_say_what_was_recorded(shared_store: Store) -> None:
    rows = ask(
        shared_store,
        "SELECT name, kind, specimen, duration_s, files, channels, quarantined, motor, bench FROM sessions",
    )
    assert rows == [
        ("1_s1", "s1", None, 11.0, 1, 4, 1, "reference", "bench.toml"),
        ("oven_a", "ageing", "stator-07", 4.0, 1, 1, 0, "reference", "bench.toml"),
        ("oven_b", "ageing", "stator-08", 4.0, 1, 1, 0, "reference", "bench.toml"),
    ]


def test_a_session_without_absolute_time_has_no_start(shared_store: Store) -> None:
    rows = ask(shared_store, "SELECT start IS NULL, start_ns FROM sessions WHERE name <> '1_s1'")
    assert rows == [(False, START), (True, START + 5 * SECOND)]


def test_rows_of_one_table_are_shared_out_to_its_sessions(shared_store: Store) -> None:
    rows = ask(shared_store, "SELECT session_name, min(record), max(record), min(t_s), max(value) FROM samples "
                      "WHERE channel = 'oven' GROUP BY ALL ORDER BY ALL")  # fmt: skip
    assert rows == [("oven_a", 0, 4, 0.0, 184.0), ("oven_b", 5, 9, 0.0, 189.0)]


def test_a_table_of_many_sessions_has_the_same_samples_by_another_join(
    shared_store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = str(shared_store.ledger.head().position)
    with warehouse.refresh(shared_store, now) as few:
        expected = warehouse.digest(few.connection)
    monkeypatch.setattr(scans, "MANY", 1)
    with warehouse.refresh(shared_store, now) as many:
        assert many.connection.execute("SELECT count(*) > 0 FROM base.values_of_many").fetchall() == [(True,)]
        assert warehouse.digest(many.connection) == expected


def test_a_value_that_another_file_of_the_session_has_too_is_flagged_in_one_of_them(tmp_path: Path) -> None:
    """A log of ten seconds, and another one of its first six with a channel more; each lacks a value."""
    head, table, channel = ONE_CHANNEL.partition("[[channel]]")
    bench = head + table + channel + table + channel.replace('"T"', '"t"')
    (tmp_path / "bench.toml").write_text(bench, encoding="utf-8")
    tables = {"long.csv": ["time,T"], "short.csv": ["time,T,t"]}
    for i in range(10):
        tables["long.csv"].append(f"2025-10-09T08:00:0{i}Z,{'' if i == 3 else i}")
    for i in range(6):
        tables["short.csv"].append(f"2025-10-09T08:00:0{i}Z,{'' if i == 0 else i},{i}")
    for name, rows in tables.items():
        (tmp_path / name).write_text("\n".join(rows) + "\n", encoding="utf-8")
    logs = [tmp_path / name for name in tables]
    with Store.open(tmp_path / "store", create=True) as store:
        take_in(
            store, logs, prepare(logs, tmp_path / "bench.toml", [], lambda path: pytest.fail(str(path))), Override()
        )
        twice = ask(store, "SELECT channel, name, record FROM samples JOIN files USING (file_id) WHERE doubled")
        assert sorted(twice) == [("T", "short.csv", record) for record in (1, 2, 4, 5)]
        left = "SELECT session, channel, count(*), count(DISTINCT t_ns) FROM samples WHERE NOT doubled GROUP BY ALL"
        assert sorted(one[1:] for one in ask(store, left)) == [("T", 10, 10), ("t", 6, 6)]


def test_a_stamp_of_another_specimen_of_the_same_table_doubles_nothing(tmp_path: Path) -> None:
    bench = ONE_CHANNEL.replace('specimen = "stator-07"', 'specimen_column = "serial"')
    (tmp_path / "bench.toml").write_text(bench, encoding="utf-8")
    rows = ["2025-10-09T08:00:00Z,M1,1", "2025-10-09T08:00:00Z,M2,2", "2025-10-09T08:00:00Z,M2,3"]
    (tmp_path / "checks.csv").write_text("\n".join(["time,serial,T", *rows]) + "\n", encoding="utf-8")
    logs = [tmp_path / "checks.csv"]
    with Store.open(tmp_path / "store", create=True) as store:
        setup = prepare(logs, tmp_path / "bench.toml", [], lambda path: pytest.fail(str(path)))
        take_in(store, logs, setup, Override())
        assert ask(store, "SELECT value, doubled FROM samples ORDER BY value") == [(1, False), (2, False), (3, True)]


def test_rows_of_one_stamp_that_say_other_channels_double_nothing(tmp_path: Path) -> None:
    """As a logger writes a row for each channel that it has read: the last row says one channel again."""
    head, table, channel = ONE_CHANNEL.partition("[[channel]]")
    bench = head + table + channel + table + channel.replace('"T"', '"t"')
    (tmp_path / "bench.toml").write_text(bench, encoding="utf-8")
    rows = ["00Z,1,", "00Z,,2", "01Z,3,4", "01Z,5,", "01Z,,", "02Z,6,"]
    text = "\n".join(["time,T,t", *(f"2025-10-09T08:00:{row}" for row in rows)])
    (tmp_path / "log.csv").write_text(text + "\n", encoding="utf-8")
    logs = [tmp_path / "log.csv"]
    with Store.open(tmp_path / "store", create=True) as store:
        setup = prepare(logs, tmp_path / "bench.toml", [], lambda path: pytest.fail(str(path)))
        take_in(store, logs, setup, Override())
        found = ask(store, "SELECT channel, value, doubled FROM samples ORDER BY value")
    assert found == [
        ("T", 1, False), ("t", 2, False), ("T", 3, False), ("t", 4, False), ("T", 5, True), ("T", 6, False)
    ]  # fmt: skip


@pytest.mark.parametrize("condition", ["true", "value <= 28", "value < 1e9", "NOT isnan(value)", "value <> 0.5"])
def test_an_absent_value_has_no_row_whatever_is_asked(shared_store: Store, condition: str) -> None:
    rows = ask(
        shared_store, f"SELECT count(*), max(value), max(record) FROM samples WHERE channel = 'MAG_1' AND {condition}"
    )
    assert rows == [(9, 28.0, 8)]


def test_channels_that_differ_in_case_only_keep_their_own_values(shared_store: Store) -> None:
    rows = ask(
        shared_store, "SELECT channel, sum(value) FROM samples WHERE group_name = 'temps' GROUP BY ALL ORDER BY ALL"
    )
    assert rows == [("MAG_1", sum(range(20, 29))), ("mag_1", 0.0)]


def test_a_text_column_is_a_channel_without_samples(shared_store: Store) -> None:
    assert ask(shared_store, "SELECT channel, column_name FROM channels WHERE channel = 'mode'") == [("mode", "mode")]
    assert ask(shared_store, "SELECT count(*) FROM samples WHERE channel = 'mode'") == [(0,)]


def test_files_say_what_became_of_each_record(shared_store: Store) -> None:
    rows = ask(shared_store, "SELECT name, outcome, found, decoded, unknown_id, wrong_length, rejected, why FROM files")
    assert rows == [
        ("1_s1.blf", "decoded", 12, 10, 1, 0, 1, None),
        ("oven.csv", "decoded", 10, 10, 0, 0, 0, None),
        ("bad.blf", "quarantined", 0, 0, 0, 0, 0, "bad.blf: is empty"),
    ]


def test_runs_sum_up_their_errors(shared_store: Store) -> None:
    rows = ask(shared_store, "SELECT run, session_name, mae_K, max_K, worst_node, key->>'seed' FROM runs")
    assert rows == [("r1", "1_s1", 1.0, 3.0, "magnet", "0")]


def test_a_run_of_a_regrouped_session_is_found_under_the_new_one(store: Store, new_session: NewSession) -> None:
    joined = new_session("1_joined", "1" * 64, "d1", "b" * 64, 0, 11)
    store.ledger.append("session-1_joined-id", joined)
    store.ledger.append("session-1_s1-id", SessionRegrouped(session="1_s1-id", into="1_joined-id", why="a file came"))
    assert ask(store, "SELECT session, session_name FROM runs") == [("1_joined-id", "1_joined")]
    assert ask(store, "SELECT DISTINCT session_name FROM residuals") == [("1_joined",)]


def test_of_several_models_of_a_session_the_run_that_a_report_shows_is_told(store: Store) -> None:
    """Before, a mean over the residuals of a session mixed all models that it was replayed with."""
    known = facts.at(store.ledger)
    (session,) = (one for one in known.sessions if one.session == "1_s1-id")
    first = known.runs["r1"]
    for run, model in (("r2", "n"), ("r3", "m")):
        store.ledger.append(f"run-{run}", replace(first, run=run, model=model * 64))

    def current(view: str) -> set[str]:
        return {run for (run,) in ask(store, f"SELECT DISTINCT run FROM {view} WHERE is_current")}

    assert current("runs") == current("residuals") == current("temperatures") == {"r3"}
    store.ledger.append(f"session-{session.session}", replace(session, model="n" * 64))
    shown = facts.at(store.ledger).current_run(replace(session, model="n" * 64))
    assert shown is not None and {shown.run} == current("runs") == {"r2"}


def test_residuals_have_null_where_the_run_has_no_such_column_or_number(shared_store: Store) -> None:
    rows = ask(shared_store, "SELECT channel, t_s, residual_K, used, speed_rpm, torque_Nm, current_A FROM residuals")
    assert sorted(rows) == [("MAG_1", 1.0, 0.5, True, 1000.0, 5.0, None), ("MAG_1", 6.0, 3.0, True, 2000.0, None, None)]
    assert ask(shared_store, "SELECT count(*) FROM residuals WHERE torque_Nm <= 5") == [(1,)]


def test_temperatures_name_each_node(shared_store: Store) -> None:
    rows = ask(shared_store, "SELECT node, t_s, temperature_degC FROM temperatures ORDER BY ALL")
    assert rows == [("magnet", 1.0, 20.5), ("magnet", 6.0, 23.0), ("shaft", 1.0, 30.0), ("shaft", 6.0, 31.0)]


def test_events_are_the_ledger(shared_store: Store) -> None:
    rows = ask(
        shared_store, "SELECT position, stream, version, topic, payload->>'name' FROM events WHERE position <= 2"
    )
    assert rows == [
        (1, f"bench-{'b' * 64}", 1, "whyhot:BenchRegistered", "bench.toml"),
        (2, f"file-{'1' * 64}", 1, "whyhot:RawFileSealed", "1_s1.blf"),
    ]


def test_resample_takes_a_name_or_an_id(shared_store: Store) -> None:
    by_name = ask(shared_store, "FROM resample('1_s1', 'MAG_1', 5)")
    assert by_name == [
        ("1_s1-id", "MAG_1", 0.0, 22.0, 20.0, 24.0, 5, "degC"),
        ("1_s1-id", "MAG_1", 5.0, 26.5, 25.0, 28.0, 4, "degC"),
    ]
    assert ask(shared_store, "FROM resample('1_s1-id', 'MAG_1', 5)") == by_name


def test_a_named_channel_reads_one_column_of_one_kind_of_file(shared_store: Store) -> None:
    plans = [
        ask(shared_store, f"EXPLAIN SELECT value FROM samples {where}")[0][1]
        for where in ("", "WHERE channel = 'speed'")
    ]
    every, named = (plan.upper().replace("_", " ").count("READ PARQUET") for plan in plans)
    assert every == 4 * named > 0
    assert "speed_rpm" in plans[1]
    assert "oven_degC" not in plans[1]


def test_an_empty_store_has_all_views_without_rows(tmp_path: Path) -> None:
    with Store.open(tmp_path / "new", create=True) as store, warehouse.refresh(store) as opened:
        assert set(warehouse.digest(opened.connection)) == set(warehouse.VIEWS)
        assert all(digest == "0-0" for digest in warehouse.digest(opened.connection).values())


def test_every_view_column_and_macro_is_explained(shared_store: Store) -> None:
    silent = ask(
        shared_store,
        "SELECT table_name, column_name FROM duckdb_columns() WHERE schema_name = 'main' AND NOT internal "
        "AND database_name = 'warehouse' AND comment IS NULL",
    )
    assert silent == []
    views = ask(
        shared_store, "SELECT view_name, comment FROM duckdb_views() WHERE schema_name = 'main' AND NOT internal"
    )
    assert {view for view, comment in views if comment} == set(warehouse.VIEWS)
    macros = ask(shared_store, "SELECT function_name, comment FROM duckdb_functions() WHERE NOT internal")
    assert {macro for macro, comment in macros if comment} == set(warehouse.MACROS)


@pytest.mark.parametrize("as_of", [None, "1"])
def test_a_long_question_prints_no_progress_among_its_answer(store: Store, as_of: str | None) -> None:
    with warehouse.refresh(store, as_of) as opened:
        asked = "SELECT value FROM duckdb_settings() WHERE name = 'enable_progress_bar'"
        assert opened.connection.execute(asked).fetchall() == [("false",)]


def test_a_jupyter_that_has_no_widgets_opens_a_store(store: Store) -> None:
    """DuckDB finds out at its import where it runs, and refuses there to leave away the bar that it cannot draw."""
    code = """
import sys, types
from pathlib import Path
shell = types.SimpleNamespace(config={"IPKernelApp": {}})
sys.modules["IPython"], sys.modules["ipywidgets"] = types.SimpleNamespace(get_ipython=lambda: shell), None
from analytics import warehouse
from ingest.facts.store import Store
print(warehouse.refresh(Store.open(Path(sys.argv[1]))).connection.execute("SELECT count(*) FROM sessions").fetchall())
"""
    done = subprocess.run([sys.executable, "-c", code, str(store.folder)], capture_output=True, text=True, check=False)
    assert done.stdout == "[(3,)]\n", done.stderr


def test_nothing_new_means_nothing_is_made(store: Store) -> None:
    warehouse.refresh(store).connection.close()
    before = (store.folder / "warehouse.duckdb").stat()
    assert ask(store, "SELECT count(*) FROM sessions") == [(3,)]
    after = (store.folder / "warehouse.duckdb").stat()
    assert (before.st_ino, before.st_mtime_ns) == (after.st_ino, after.st_mtime_ns)


def test_a_new_event_is_seen_at_once_and_an_open_warehouse_stays_as_it_was(
    store: Store, new_session: NewSession
) -> None:
    with warehouse.refresh(store) as old:
        late = new_session("late", "2" * 64, "d2", None, 0, 9)
        store.ledger.append("session-late-id", late)
        assert ask(store, "SELECT count(*) FROM sessions") == [(4,)]
        assert old.connection.execute("SELECT count(*) FROM sessions").fetchall() == [(3,)]


def test_an_event_that_comes_while_it_is_made_is_seen_the_next_time(
    store: Store, new_session: NewSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    late, rows = new_session("late", "2" * 64, "d2", None, 0, 9), tables.rows

    def slow_rows(*given: Any) -> dict[str, tables.Rows]:
        if not store.ledger.events(stream="session-late-id"):
            store.ledger.append("session-late-id", late)
        return rows(*given)

    monkeypatch.setattr(tables, "rows", slow_rows)
    assert ask(store, "SELECT count(*) FROM sessions") == [(3,)]
    assert ask(store, "SELECT count(*) FROM sessions") == [(4,)]


@pytest.mark.parametrize("what", ["package", "duckdb"])
def test_another_version_of_package_or_duckdb_makes_it_anew(
    store: Store, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    warehouse.refresh(store).connection.close()
    before = (store.folder / "warehouse.duckdb").stat().st_ino
    if what == "package":
        monkeypatch.setattr(warehouse, "_own_hash", lambda: "other")
    else:
        monkeypatch.setattr(duckdb, "__version__", "9.9.9")
    with warehouse.refresh(store) as opened:
        assert opened.notes == ()
    assert (store.folder / "warehouse.duckdb").stat().st_ino != before


def test_a_store_that_was_moved_is_read_where_it_is_now(store: Store, tmp_path: Path) -> None:
    warehouse.refresh(store).connection.close()
    store.close()
    moved = store.folder.rename(tmp_path / "moved")
    with Store.open(moved) as there:
        assert ask(there, "SELECT count(*) FROM samples WHERE channel = 'oven'") == [(10,)]


def test_as_of_shows_what_was_known_then_and_leaves_the_file(store: Store) -> None:
    warehouse.refresh(store).connection.close()
    before = (store.folder / "warehouse.duckdb").stat().st_mtime_ns
    assert ask(store, "SELECT name FROM sessions", as_of="9") == [("1_s1",), ("oven_a",)]
    assert ask(store, "SELECT count(*) FROM residuals", as_of="9") == [(0,)]
    when = ask(store, "SELECT strftime(recorded, '%Y-%m-%dT%H:%M:%S.%fZ') FROM events WHERE position = 8")[0][0]
    assert ask(store, "SELECT name FROM sessions", as_of=when) == [("1_s1",)]
    assert (store.folder / "warehouse.duckdb").stat().st_mtime_ns == before


def test_as_of_an_event_that_is_not_there_is_refused(shared_store: Store) -> None:
    with pytest.raises(LedgerError, match="the ledger ends at event 11"):
        warehouse.refresh(shared_store, as_of="99")


def _damage(path: Path, kind: str) -> None:
    data = bytearray(path.read_bytes())
    if kind == "cut":
        path.write_bytes(data[: len(data) // 2])
    elif kind == "flipped":
        path.write_bytes(bytes(byte ^ 4 if i % 1000 == 0 else byte for i, byte in enumerate(data)))
    elif kind == "empty":
        path.write_bytes(b"")
    elif kind == "text":
        path.write_text("not a database\n" * 1000)
    elif kind == "folder":
        path.unlink()
        path.mkdir()
    elif kind == "log":
        path.with_name("warehouse.duckdb.wal").write_bytes(random.Random(1).randbytes(1000))
    elif kind == "written to":
        with duckdb.connect(str(path)) as connection:
            connection.execute("DROP TABLE base.built_from")


@pytest.mark.parametrize("kind", ["cut", "flipped", "empty", "text", "folder", "log", "written to"])
def test_a_broken_warehouse_is_kept_aside_and_made_again_with_a_note(store: Store, kind: str) -> None:
    with warehouse.refresh(store) as opened:
        before = warehouse.digest(opened.connection)
    _damage(store.folder / "warehouse.duckdb", kind)
    with warehouse.refresh(store) as opened:
        assert warehouse.digest(opened.connection) == before
        (note,) = opened.notes
    assert "was not whole" in note
    assert note.endswith("made again from the ledger, the old one kept as warehouse.duckdb.broken-1")
    assert "\n" not in note
    assert (store.folder / "warehouse.duckdb.broken-1").exists()
    with warehouse.refresh(store) as opened:
        assert opened.notes == ()


def test_ten_damaged_warehouses_answer_as_before(store: Store) -> None:
    path, chance = store.folder / "warehouse.duckdb", random.Random(7)
    with warehouse.refresh(store) as opened:
        before = warehouse.digest(opened.connection)
    whole = path.read_bytes()
    repaired = 0
    for trial in range(10):
        data = bytearray(whole)
        if trial % 2:
            data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
        else:
            del data[chance.randrange(len(data)) :]
        path.write_bytes(data)
        with warehouse.refresh(store) as opened:
            assert warehouse.digest(opened.connection) == before, trial
            repaired += len(opened.notes)
    assert repaired >= 5  # the cut ones at least; a flip may hit a byte that nothing reads


def test_the_second_broken_one_does_not_replace_the_first(store: Store) -> None:
    for number in (1, 2):
        warehouse.refresh(store).connection.close()
        _damage(store.folder / "warehouse.duckdb", "text")
        with warehouse.refresh(store) as opened:
            assert opened.notes[0].endswith(f"broken-{number}")


@pytest.mark.parametrize("harm", ["is missing", "cannot be read as Parquet"])
def test_what_cannot_be_read_is_named_in_a_line_and_the_rest_answers(store: Store, harm: str) -> None:
    path = on_disk(store.decoded("d2")) / "rows.parquet"
    whole, sessions = path.read_bytes(), ask(store, "FROM sessions")
    answered = ask(store, "SELECT count(*) FROM samples WHERE channel <> 'oven'")
    (store.folder / "warehouse.duckdb").unlink()
    path.unlink()
    if harm != "is missing":
        path.write_bytes(b"no parquet")
    for _ in range(2):
        with warehouse.refresh(store) as opened:
            assert opened.left_out is not None and opened.left_out.startswith(f"{path.absolute()}: {harm}")
            assert opened.left_out.endswith(": no answer has what was in it; next: whyhot rebuild")
            with pytest.raises(WarehouseError, match="next: whyhot rebuild"):
                opened.needs("samples")
            opened.needs("residuals")
        assert ask(store, "FROM sessions") == sessions
        assert ask(store, "SELECT count(*) FROM samples") == answered
    path.write_bytes(whole)
    with warehouse.refresh(store) as opened:
        assert opened.left_out is None, "it is there again"
    assert ask(store, "SELECT count(*) FROM samples") > answered


def test_a_missing_file_of_a_run_says_which_replay_makes_it_again(store: Store) -> None:
    for (file,) in ask(store, "SELECT file FROM base.artefacts"):
        Path(file).unlink()
    (store.folder / "warehouse.duckdb").unlink()
    with warehouse.refresh(store) as opened:
        assert re.search("is missing, and 1 more: .*; next: whyhot replay ", opened.left_out or "")
        assert opened.connection.execute("SELECT count(*) FROM residuals").fetchone() == (0,)
        assert opened.connection.execute("SELECT count(*) FROM runs").fetchone() == (1,)


def test_files_of_other_schemas_are_read_beside_each_other(store: Store) -> None:
    path = on_disk(store.decoded("d2")) / "rows.parquet"
    pq.write_table(pa.table({"t_ns": [START], "record": [0], "oven_degC": [200]}), path)  # integers, and fewer columns
    decoded_anew(store, "2" * 64)
    assert ask(store, "SELECT value FROM samples WHERE channel = 'oven'") == [(200.0,)]


def test_a_full_disk_is_one_line(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tempfile, "mkdtemp", full)
    with pytest.raises(WarehouseError, match=r"warehouse\.duckdb: cannot be made \(.*No space left on device\)"):
        warehouse.refresh(store)


def test_a_store_that_may_only_be_read_is_asked_in_memory(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)
    for _ in range(2):
        assert ask(store, "SELECT count(*) FROM sessions") == [(3,)]
        assert not (store.folder / "warehouse.duckdb").exists()


def test_what_a_killed_build_left_is_swept_by_a_later_one(store: Store) -> None:
    old, young = store.folder / "warehouse-old", store.folder / "warehouse-young"
    for folder in (old, young):
        folder.mkdir()
    os.utime(old, (time.time() - 7200, time.time() - 7200))
    warehouse.refresh(store).connection.close()
    assert not old.exists()
    assert young.exists()


def test_what_a_killed_question_left_is_swept_by_a_later_one(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    old, used = tmp_path / f"{warehouse.SPILLING}old", tmp_path / f"{warehouse.SPILLING}used"
    for folder in (old, used):
        folder.mkdir()
        (folder / "a.tmp").touch()
    for one in (old, old / "a.tmp", used):
        os.utime(one, (time.time() - 7200, time.time() - 7200))
    warehouse.refresh(store).connection.close()
    assert not old.exists()
    assert used.exists()  # something was written there a moment ago


def test_a_notebook_gets_a_connection_and_notes_as_warnings(store: Store) -> None:
    with warehouse.connect(store.folder) as connection:
        assert connection.execute("SELECT count(*) FROM sessions").fetchall() == [(3,)]
        assert connection.execute("SELECT count(*) FROM samples").fetchall() != [(0,)]
        assert connection.execute("SELECT count(*) FROM duckdb_logs").fetchall() == [(0,)]  # memory, for ever
    _damage(store.folder / "warehouse.duckdb", "text")
    with pytest.warns(UserWarning, match="was not whole"):
        warehouse.connect(store.folder).close()


def test_the_digest_tells_other_rows_but_not_another_order() -> None:
    digests = []
    for values in ("(1, 'a'), (2, 'b')", "(2, 'b'), (1, 'a')", "(1, 'b'), (2, 'a')", "(1, 'a'), (2, 'b'), (2, 'b')"):
        with duckdb.connect(":memory:") as connection:
            connection.execute(f"CREATE TABLE t AS FROM (VALUES {values})")
            digests.append(warehouse._digest(connection, "t"))
    assert digests[0] == digests[1]
    assert len(set(digests)) == 3


@pytest.mark.skipif(sys.platform == "win32", reason="needs file size limits")
def test_a_disk_that_fills_up_at_any_moment_is_said_in_a_line_and_leaves_no_broken_warehouse(store: Store) -> None:
    import resource

    path, refused = store.folder / "warehouse.duckdb", 0
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    for room in range(0, 600_000, 50_000):
        path.unlink(missing_ok=True)
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, hard))
        try:
            warehouse.refresh(store).connection.close()
        except WarehouseError as error:
            refused += 1
            assert "\n" not in str(error)
            assert "cannot be made" in str(error)
            assert not path.exists()
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert refused >= 2
    with warehouse.refresh(store) as opened:
        assert opened.notes == ()
