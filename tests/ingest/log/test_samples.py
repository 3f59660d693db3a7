"""Parquet of decoded samples: round trip, encodings, page checksums, the same bytes again."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from ingest.errors import DamageError
from ingest.log import samples
from ingest.log.samples import Column, GroupWriter, Samples

COLUMNS = (Column("T_wdg_degC", "T_wdg", "degC", "temperature"), Column("serial", "serial", text=True))


def some(count: int, start: int = 0) -> Samples:
    t_ns = 1_700_000_000_000_000_000 + np.arange(start, start + count) * 1_000_003
    values = np.where(np.arange(count) % 5 == 0, np.nan, 20 + np.arange(count) / 7)
    names = np.array([None if i % 4 == 0 else f"S-{i % 3}" for i in range(count)], object)
    return Samples(t_ns, np.arange(start, start + count), [values, names])


def written(path: Path, *parts: Samples) -> int:
    writer = GroupWriter(path, "ab" * 32, COLUMNS)
    for part in parts:
        writer.add(part)
    return writer.close()


def test_rows_come_back_as_they_went_in(tmp_path: Path) -> None:
    given = some(1000)
    assert written(tmp_path / "Motor.parquet", given) == 1000
    table = samples.read(tmp_path / "Motor.parquet")
    assert table.column_names == ["t_ns", "log_t_ns", "file_id", "record", "T_wdg_degC", "serial"]
    np.testing.assert_array_equal(table["t_ns"].to_numpy(), given.t_ns)
    np.testing.assert_array_equal(table["log_t_ns"].to_numpy(), given.t_ns)
    np.testing.assert_array_equal(table["record"].to_numpy(), given.record)
    np.testing.assert_array_equal(table["T_wdg_degC"].to_numpy(), given.values[0])
    assert table["serial"].to_pylist() == given.values[1].tolist()
    assert set(table["file_id"].to_pylist()) == {"ab" * 32}


def test_each_column_says_unit_quantity_and_signal(tmp_path: Path) -> None:
    written(tmp_path / "Motor.parquet", some(3))
    said = samples.read(tmp_path / "Motor.parquet").schema.field("T_wdg_degC").metadata
    assert said[b"unit"] == b"degC"
    assert said[b"quantity"] == b"temperature"
    assert said[b"signal"] == b"T_wdg"


def test_only_the_columns_asked_for_are_read(tmp_path: Path) -> None:
    written(tmp_path / "Motor.parquet", some(3))
    assert samples.read(tmp_path / "Motor.parquet", ["t_ns", "serial"]).column_names == ["t_ns", "serial"]


def test_encodings_are_those_that_were_measured(tmp_path: Path) -> None:
    written(tmp_path / "Motor.parquet", some(1000))
    group = pq.read_metadata(tmp_path / "Motor.parquet").row_group(0)
    columns = {group.column(i).path_in_schema: group.column(i) for i in range(group.num_columns)}
    for name in ("t_ns", "log_t_ns", "record"):
        assert "DELTA_BINARY_PACKED" in columns[name].encodings
    assert "BYTE_STREAM_SPLIT" in columns["T_wdg_degC"].encodings
    assert columns["file_id"].has_dictionary_page
    assert {column.compression for column in columns.values()} == {"ZSTD"}


def test_the_same_rows_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        written(tmp_path / name, some(500), some(500, start=500))
    digests = {hashlib.sha256((tmp_path / name).read_bytes()).hexdigest() for name in ("a", "b")}
    assert len(digests) == 1


def test_rows_wait_until_they_fill_a_row_group(tmp_path: Path) -> None:
    part = some(samples.ROW_GROUP // 2 + 1)
    assert written(tmp_path / "Motor.parquet", part, part, part) == 3 * len(part)
    metadata = pq.read_metadata(tmp_path / "Motor.parquet")
    assert [metadata.row_group(i).num_rows for i in range(metadata.num_row_groups)] == [2 * len(part), len(part)]


def test_a_group_without_rows_is_a_readable_file(tmp_path: Path) -> None:
    assert written(tmp_path / "Motor.parquet", some(0)) == 0
    assert samples.read(tmp_path / "Motor.parquet").num_rows == 0


def test_a_changed_byte_is_damage_or_changes_nothing_that_is_read(tmp_path: Path) -> None:
    path = tmp_path / "Motor.parquet"
    written(path, some(400))
    whole, expected = path.read_bytes(), repr(samples.read(path).to_pylist())
    random = np.random.default_rng(3)
    data_end = len(whole) - 8 - int.from_bytes(whole[-8:-4], "little")
    refused = 0
    for place in random.choice(np.arange(4, data_end), 150, replace=False).tolist():
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x04]) + whole[place + 1 :])
        try:
            assert repr(samples.read(path).to_pylist()) == expected
        except DamageError:
            refused += 1
    assert refused > 100


def test_a_damaged_file_is_named_with_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "Motor.parquet"
    written(path, some(400))
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(
        DamageError, match=r"Motor\.parquet: the samples are damaged \(.*\)\. Make them again .*rebuild"
    ):
        samples.read(path)
