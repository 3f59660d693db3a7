"""What logs say of insulation, kept in partitions: equal to what a rebuild makes, and made once."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterable, Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.dataset as ds
import pyarrow.parquet as pq
import pytest

from analytics import partitions, warehouse
from analytics.errors import AnalyticsError
from analytics.query import run
from ingest.facts.durable import write_file
from ingest.facts.store import Store
from made.insulation_logs import Columns, add_log, decoded_anew
from made.places import on_disk

MONTH_h = 31 * 24.0
CHECK: Columns = {
    "P": ("power", None, np.full(241, 1000.0)),
    "EW": ("temperature", "winding_a", np.full(241, 100.0)),
    "TC": ("temperature", "teeth", np.full(241, 60.0)),
}


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store.open(tmp_path / "store", create=True) as made:
        yield made


def oven(*degC: float) -> Columns:
    """A temperature each 10 s."""
    return {"EW": ("temperature", "winding_a", degC)}


def ask(store: Store, sql: str = "SELECT name, dose_h, resistance_K_per_W FROM dc_checks") -> list[tuple[Any, ...]]:
    with warehouse.refresh(store) as opened:
        return run(opened.connection, sql).rows


def kept(store: Store) -> dict[str, str]:
    """The partitions as they lie there, by place, with their SHA-256."""
    folder = store.folder / partitions.FOLDER
    files = [file for file in folder.rglob("*") if file.is_file()]
    return {str(file.relative_to(folder)): sha256(file.read_bytes()).hexdigest() for file in files}


def places(of: dict[str, str]) -> set[str]:
    return {str(Path(file).parent) for file in of}


def made_anew(store: Store) -> dict[str, str]:
    """The partitions made from nothing."""
    shutil.rmtree(store.folder / partitions.FOLDER)
    (store.folder / warehouse.FILE).unlink()
    ask(store)
    return kept(store)


def test_partitions_after_any_ingests_are_those_that_a_rebuild_makes(store: Store) -> None:
    random = np.random.default_rng(22)
    for number in range(7):
        kind = str(random.choice(["ageing", "dc_check", "insulation_check", "drive"]))
        at_h = None if random.random() < 0.2 else MONTH_h * int(random.integers(4)) + number
        insulation: Columns = {"R": ("insulation_resistance", None, 1e9 * (1 + random.random(20)))}
        heat = oven(*(150.0 + 60.0 * random.random(30)))
        columns = {"dc_check": CHECK, "insulation_check": insulation}.get(kind, heat)
        add_log(store, f"log_{number}", kind, at_h, columns, specimen=f"M{random.integers(3)}")
        ask(store)
        if number in (3, 6):
            grown, answers = kept(store), [ask(store, f"FROM {view}") for view in ("cycles", "dc_checks")]
            assert made_anew(store) == grown
            assert [ask(store, f"FROM {view}") for view in ("cycles", "dc_checks")] == answers


def test_a_new_log_touches_its_own_partitions_and_no_other_log_is_read(store: Store) -> None:
    add_log(store, "oven_1", "ageing", 0.0, oven(*[200.0] * 361), specimen="M1")
    add_log(store, "check_1", "dc_check", 2.0, CHECK, specimen="M1")
    assert ask(store) == [("check_1", 1.0, 0.04)]
    before = kept(store)
    log = on_disk(store.decoded(b"oven_1".hex())) / "rows.parquet"
    cooler = pq.read_table(log).drop_columns("EW").append_column("EW", [np.full(361, 20.0)])
    pq.write_table(cooler, log)  # under its old name: it would be seen if it were read
    decoded_anew(store, b"oven_1".hex().ljust(64, "0"))
    add_log(store, "check_2", "dc_check", 1.5 * MONTH_h, CHECK, specimen="M1")
    assert ask(store) == [("check_1", 1.0, 0.04), ("check_2", 1.0, 0.04)]
    after = kept(store)
    assert {file: after.get(file) for file in before} == before
    assert {Path(file).parts[2] for file in set(after) - set(before)} == {"month=2025-11"}
    assert ask(store, "SELECT hours_above_180degC FROM cycles") == [(1.0,)]
    made_anew(store)
    assert ask(store, "SELECT hours_above_180degC FROM cycles") == [(0.0,)]


def test_the_first_check_of_a_specimen_brings_in_the_heat_of_its_earlier_drives(store: Store) -> None:
    add_log(store, "drive", "drive", 0.0, oven(*[200.0] * 361), specimen="M1")
    assert (ask(store), kept(store)) == ([], {})
    add_log(store, "check", "dc_check", MONTH_h, CHECK, specimen="M1")
    assert ask(store) == [("check", 1.0, 0.04)]
    assert {Path(place).parts[0] for place in places(kept(store))} == {"hours", "measured_checks"}


def test_a_damaged_partition_is_made_again_and_what_is_not_its_own_goes(store: Store) -> None:
    add_log(store, "check", "dc_check", 0.0, CHECK)
    ask(store)
    whole = kept(store)
    folder = store.folder / partitions.FOLDER
    for file in whole:
        content = bytearray((folder / file).read_bytes())
        content[len(content) // 3] ^= 1
        (folder / file).write_bytes(content)
    (folder / "hours" / "killed.unfinished").write_bytes(b"half")
    (store.folder / warehouse.FILE).unlink()
    assert ask(store) == [("check", 0.0, 0.04)]
    assert kept(store) == whole


def test_two_versions_that_make_the_tables_of_one_store_at_once_both_answer(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_log(store, "check", "dc_check", 0.0, CHECK)
    others: list[list[tuple[Any, ...]]] = []

    def written_while_another_works(folder: Path, chunks: Iterable[bytes]) -> Path:
        made = write_file(folder, chunks)
        with pytest.MonkeyPatch.context() as other:
            other.setattr(partitions, "write_file", write_file)
            other.setattr(warehouse, "_own_hash", lambda: "another version")
            others.append(ask(store))
        return made

    with monkeypatch.context() as beside:
        beside.setattr(partitions, "write_file", written_while_another_works)
        own = ask(store)
    assert [own, *others] == [[("check", 0.0, 0.04)]] * (1 + len(others)) and others
    assert ask(store) == own  # what the other left is not taken for ours
    read = Path.read_bytes

    def gone(file: Path) -> bytes:
        if file.suffix == ".parquet":
            file.unlink()
        return read(file)

    (store.folder / warehouse.FILE).unlink()
    monkeypatch.setattr(Path, "read_bytes", gone)  # the other removes what is about to be read
    assert ask(store) == own


def test_nothing_is_kept_of_a_log_whose_samples_are_damaged(store: Store) -> None:
    add_log(store, "oven", "ageing", 0.0, oven(*[190.0] * 40))
    path = on_disk(store.decoded(b"oven".hex())) / "rows.parquet"
    whole = path.read_bytes()
    for place in range(4, len(whole), len(whole) // 6):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 4]) + whole[place + 1 :])
        (store.folder / warehouse.FILE).unlink(missing_ok=True)
        with contextlib.suppress(AnalyticsError):
            (row,) = ask(store, "SELECT highest_degC, why_no_hours FROM cycles")
            assert row[1], f"{row} where byte {place} is another"  # it could not be read, and is left out
    path.write_bytes(whole)
    assert ask(store, "SELECT highest_degC FROM cycles") == [(190.0,)]


def test_logs_read_a_few_at_a_time_give_the_same_partitions(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in range(4):
        add_log(store, f"oven_{number}", "ageing", number * 1.0, oven(*[190.0 + number] * 40), specimen="M1")
        add_log(store, f"check_{number}", "dc_check", number + 0.5, CHECK, specimen=f"M{number}")
    ask(store)
    at_once = kept(store)
    monkeypatch.setattr(partitions, "RECORDS", 1)
    assert made_anew(store) == at_once


def test_other_programs_read_partitions_by_their_names(store: Store) -> None:
    add_log(store, "check", "dc_check", 0.0, CHECK, specimen="M7", batch="B1")
    ask(store)
    folder = store.folder / partitions.FOLDER / "measured_checks"
    (row,) = ds.dataset(folder, partitioning="hive").to_table(filter=ds.field("month") == "2025-10").to_pylist()
    assert (row["specimen"], row["batch"], row["resistance_K_per_W"]) == ("M7", "B1", 0.04)
