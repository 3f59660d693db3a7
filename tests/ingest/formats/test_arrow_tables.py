"""Parquet, Feather and Arrow: what each type of column becomes, which one is the time, and what damage leaves."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, date, datetime, time, timedelta
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet
import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec, recognise
from ingest.log.reading import Reader
from made.places import LOGS
from made.tables import read

S_NS = 1_000_000_000
MARCH = datetime(2024, 3, 1, 8, tzinfo=UTC)
MARCH_NS = 1_709_280_000 * S_NS


def write_parquet(table: pa.Table, path: Path) -> None:
    pa.parquet.write_table(table, path, row_group_size=1000, write_page_checksum=True)


def write_arrow(table: pa.Table, path: Path) -> None:
    with pa.ipc.new_file(path, table.schema) as file:
        file.write_table(table, max_chunksize=1000)


def write_stream(table: pa.Table, path: Path) -> None:
    with pa.ipc.new_stream(path, table.schema) as stream:
        stream.write_table(table, max_chunksize=1000)


def write_feather(table: pa.Table, path: Path) -> None:
    pa.feather.write_feather(table, path, compression="zstd", chunksize=1000)


WRITERS: dict[str, Callable[[pa.Table, Path], None]] = {
    "parquet": write_parquet,
    "arrow": write_arrow,
    "stream": write_stream,
    "feather": write_feather,
}
each_writer = pytest.mark.parametrize("write", WRITERS.values(), ids=list(WRITERS))


def write_samples(folder: Path) -> None:
    """The small logs of the contract: a stamp is missing in one row."""
    stamps = [MARCH, MARCH + timedelta(seconds=0.5), None, MARCH + timedelta(seconds=2)]
    table = pa.table(
        {
            "time": pa.array(stamps, pa.timestamp("us", "UTC")),
            "T_mag [degC]": pa.array([20.5, None, 20.7, 20.8]),
            "state": pa.array(["on", "off", "on", None]).dictionary_encode(),
            "n": pa.array([0, 1500, 1500, 1600], pa.int16()),
        }
    )
    write_parquet(table, folder / "sample.parquet")
    write_arrow(table, folder / "sample.arrow")


@pytest.mark.parametrize("suffix", ["parquet", "arrow"])
def test_the_samples_are_what_the_writer_writes_and_read_whole(tmp_path: Path, suffix: str) -> None:
    write_samples(tmp_path)
    path = LOGS / f"sample.{suffix}"
    log, t_ns, columns = read(path)
    assert (tmp_path / path.name).read_bytes() == path.read_bytes()
    assert t_ns == [MARCH_NS, MARCH_NS + S_NS // 2, MARCH_NS + 2 * S_NS]
    np.testing.assert_array_equal(columns["T_mag [degC]"], [20.5, np.nan, 20.8])
    assert (columns["state"], columns["n"]) == (["on", "off", ""], [0, 1500, 1600])
    assert (log.absolute, log.units) == (True, {"T_mag [degC]": "degC"})
    assert log.settings == {"time_column": "time", "time": "stamps in UTC", "backward_steps": 0}
    assert [(one.record, one.where, one.why) for one in log.rejected] == [(2, "row 3, column time", "no time")]
    assert log.rejected[0].raw == b"20.7 on 1500.0"


@each_writer
def test_it_is_recognised_by_what_it_holds(tmp_path: Path, write: Callable[[pa.Table, Path], None]) -> None:
    path = tmp_path / "log.csv"
    write(pa.table({"time": [0.0, 1.0], "T": [20.0, 21.0]}), path)
    assert recognise(path).name == ("parquet" if write is write_parquet else "arrow")
    log, t_ns, columns = read(path)
    assert (t_ns, columns, log.absolute) == ([0, S_NS], {"T": [20.0, 21.0]}, False)
    assert log.settings["time"] == "s from the start"


@each_writer
@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_stamps_of_every_unit_and_zone_are_one_instant(
    tmp_path: Path, write: Callable[[pa.Table, Path], None], unit: str
) -> None:
    if write is write_parquet and unit == "s":
        unit = "ms"  # there is no such unit in Parquet
    stamps = pa.array([MARCH, MARCH + timedelta(seconds=2)], pa.timestamp(unit, "America/New_York"))
    path = tmp_path / "log"
    write(pa.table({"T": [20.0, 21.0], "when": stamps}), path)
    log, t_ns, _ = read(path, TimeSpec(zone="Europe/Rome"))
    assert (t_ns, log.absolute) == ([MARCH_NS, MARCH_NS + 2 * S_NS], True)


def test_stamps_without_a_zone_are_local_ones(tmp_path: Path) -> None:
    local = [datetime(2024, 3, 31, 1, 59, 59), datetime(2024, 3, 31, 2, 30), datetime(2024, 3, 31, 3)]
    write_parquet(pa.table({"t": local, "T": [1.0, 2.0, 3.0]}), tmp_path / "log")
    log, t_ns, columns = read(tmp_path / "log", TimeSpec(zone="Europe/Rome"))
    assert np.diff(t_ns).tolist() == [S_NS] and columns["T"] == [1.0, 3.0]  # the clock went forward
    assert log.settings["time"] == "stamps in Europe/Rome"
    assert read(tmp_path / "log")[1][0] == int((local[0] - datetime(1970, 1, 1)).total_seconds()) * S_NS


def test_an_instant_is_kept_to_the_nanosecond_and_one_that_no_log_is_from_is_rejected(tmp_path: Path) -> None:
    counts = pa.array([MARCH_NS + 1, MARCH_NS + 123_456_789, 0, -1], pa.int64())
    write_arrow(pa.table({"time": counts.cast(pa.timestamp("ns", "UTC")), "T": [1.0, 2.0, 3.0, 4.0]}), tmp_path / "log")
    log, t_ns, _ = read(tmp_path / "log")
    assert t_ns == [MARCH_NS + 1, MARCH_NS + 123_456_789]
    assert [one.where for one in log.rejected] == ["row 3, column time", "row 4, column time"]
    assert log.rejected[0].why == '"0" is no time (stamps in UTC)'


@pytest.mark.parametrize("write", [write_parquet, write_arrow])
def test_durations_count_from_the_start(tmp_path: Path, write: Callable[[pa.Table, Path], None]) -> None:
    since = pa.array([timedelta(0), timedelta(seconds=0.25), None], pa.duration("ms"))
    write(pa.table({"elapsed": since, "T": [1.0, 2.0, 3.0]}), tmp_path / "log")
    log, t_ns, _ = read(tmp_path / "log")
    assert (t_ns, log.absolute, len(log.rejected)) == ([0, S_NS // 4], False, 1)
    log, t_ns, _ = read(tmp_path / "log", TimeSpec(start_ns=MARCH_NS))
    assert (t_ns[1], log.absolute) == (MARCH_NS + S_NS // 4, True)


@pytest.mark.parametrize(
    ("columns", "spec", "first"),
    [
        ({"epoch_ms": [1_709_280_000_000, 1_709_280_001_000]}, None, MARCH_NS),
        ({"stamp": ["2024-03-01 08:00:00", "2024-03-01 08:00:01"]}, None, MARCH_NS),
        ({"stamp": ["01.03.2024 08:00:00", "01.03.2024 08:00:01"]}, None, MARCH_NS),
        ({"stamp": ["3/1/2024 8:00 AM"] * 300 + ["3/13/2024 8:01 AM"]}, None, MARCH_NS),
        ({"day": [date(2024, 3, 1)] * 2, "clock": [time(8), time(8, 0, 1)]}, None, MARCH_NS),
        ({"n": [1, 2]}, TimeSpec(rate_hz=1.0), 0),
        ({"a": [MARCH, MARCH], "b": [5.0, 6.0]}, TimeSpec(column="b", unit="s"), 5 * S_NS),
        ({"a": [MARCH.replace(hour=9)] * 2, "time": [MARCH, MARCH]}, None, MARCH_NS),
        ({"a": [MARCH, MARCH], "time": [MARCH.replace(hour=9)] * 2}, TimeSpec(column="a"), MARCH_NS),
    ],
)
def test_the_time_is_found_or_stated(
    tmp_path: Path, columns: dict[str, list[Any]], spec: TimeSpec | None, first: int
) -> None:
    count = len(next(iter(columns.values())))
    write_parquet(pa.table({**columns, "T": [20.0] * count}), tmp_path / "log")
    log, t_ns, found = read(tmp_path / "log", spec)
    assert t_ns[0] == first and found["T"] == [20.0] * count and not log.rejected


@pytest.mark.parametrize(
    ("columns", "spec", "says"),
    [
        ({"n": [1, 2]}, None, "log: no column is recognised as its time. Under [time] of the bench file say rate_hz"),
        (
            {"time": [MARCH] * 2},
            TimeSpec(column="tiem"),
            'log: column = "tiem" under [time] of the bench file is',
        ),
        ({"time": ["3/1/2024 8:00"] * 2}, None, 'log: "time" holds "3/1/2024 8:00", which may begin with the day or'),
        ({"time": pa.array([], pa.float64())}, None, "log: no row of it can be read: it holds none."),
    ],
)
def test_a_table_without_a_time_is_refused_with_what_to_do(
    tmp_path: Path, columns: dict[str, Any], spec: TimeSpec | None, says: str
) -> None:
    write_parquet(pa.table(columns), tmp_path / "log")
    with pytest.raises(UnreadableLogError) as refused:
        read(tmp_path / "log", spec)
    assert str(refused.value).startswith(says)


def test_columns_of_every_type_are_numbers_or_texts_or_left_out(tmp_path: Path) -> None:
    kinds: dict[str, Any] = {
        "time": [0.0, 1.0],
        "small": pa.array([1, None], pa.uint8()),
        "large": pa.array([2**40, 2], pa.int64()),
        "single": pa.array([0.5, None], pa.float32()),
        "exact": [Decimal("1.25"), None],
        "truth": [True, None],
        "since": pa.array([timedelta(seconds=1.5), None]),
        "null": pa.nulls(2),
        "label": pa.array([7, 8]).dictionary_encode(),
        "text": ["on", None],
        "view": pa.array(["a", None], pa.large_string()),
        "category": pa.array(["x", None]).dictionary_encode(),
        "stamp": [MARCH, None],
        "list": [[1, 2], []],
        "bytes": [b"a", None],
    }
    write_arrow(pa.table(kinds), tmp_path / "log")
    log, _, columns = read(tmp_path / "log", TimeSpec(column="time", unit="s"))
    assert log.settings["left_out"] == ["list", "bytes"]
    numbers = {"small": 1.0, "large": 2.0**40, "single": 0.5, "exact": 1.25, "truth": 1.0, "since": 1.5, "label": 7.0}
    assert {name: columns[name][0] for name in numbers} == numbers
    assert all(np.isnan(columns[name][1]) for name in (*numbers, "null") if name not in ("large", "label"))
    texts = {"text": ["on", ""], "view": ["a", ""], "category": ["x", ""], "stamp": ["2024-03-01 08:00:00.000000Z", ""]}
    assert {name: columns[name] for name in texts} == texts


@each_writer
def test_parts_of_structures_and_of_lists_of_one_length_are_columns(
    tmp_path: Path, write: Callable[[pa.Table, Path], None]
) -> None:
    kelvin = pa.field("T", pa.float64(), metadata={"unit": "K"})
    motor = pa.struct([kelvin, pa.field("phase", pa.struct([("u", pa.float64())]))])
    rows = [{"T": 300.0, "phase": {"u": 1.0}}, None, {"T": None, "phase": None}]
    three = pa.list_(pa.float64(), 3)
    table = pa.table(
        {
            "time": [0.0, 1.0, 2.0],
            "motor": pa.array(rows, motor),
            "I": pa.array([[1.0, 2.0, None], None, [3.0, 4.0, 5.0]], three),
            "long": pa.array([[0.0] * 65] * 3, pa.list_(pa.float64(), 65)),
        }
    )
    write(table, tmp_path / "log")
    log, _, columns = read(tmp_path / "log")
    nan = np.nan
    want = {"motor.T": [300, nan, nan], "motor.phase.u": [1, nan, nan]}
    want |= {"I.0": [1, nan, 3], "I.1": [2, nan, 4], "I.2": [nan, nan, 5]}
    assert list(columns) == list(want) and log.settings["left_out"] == ["long"]
    for name, values in want.items():
        np.testing.assert_array_equal(columns[name], values)
    assert log.units == {"motor.T": "K"}


def test_what_would_be_more_columns_than_a_log_has_is_left_out_whole(tmp_path: Path) -> None:
    matrix = pa.FixedSizeListArray.from_arrays(pa.FixedSizeListArray.from_arrays(pa.array(np.zeros(64**2)), 64), 64)
    deep: pa.Array = pa.array([1.0])
    for _ in range(20):
        deep = pa.StructArray.from_arrays([deep], ["a"])
    table = pa.table(
        {"time": [0.0], "T": [20.0], "matrix": matrix, "deep": deep, "none": pa.array([{}], pa.struct([]))}
    )
    write_arrow(table, tmp_path / "log")
    log, _, columns = read(tmp_path / "log")
    assert (columns, log.settings["left_out"]) == ({"T": [20.0]}, ["matrix", "deep", "none"])


def test_columns_called_alike_are_made_unique_and_units_are_read(tmp_path: Path) -> None:
    fields = [pa.field("time", pa.float64()), pa.field("T", pa.float64(), metadata={"unit": "K"}), ("T", pa.float64())]
    table = pa.table([pa.array([0.0, 1.0])] * 3, schema=pa.schema(fields))
    write_arrow(table, tmp_path / "log")
    log, _, columns = read(tmp_path / "log")
    assert list(columns) == ["T", "T_2"] and log.units == {"T": "K"}
    assert log.settings["renamed"] == {"T": ["T", "T_2"]}


@each_writer
def test_many_batches_are_read_through(
    tmp_path: Path, write: Callable[[pa.Table, Path], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ingest.formats.BATCH_ROWS", 700)
    time_s = np.arange(3500.0)
    time_s[[1500, 2600]] = np.nan
    write(pa.table({"time": time_s, "T": np.arange(3500.0)}), tmp_path / "log")
    log, t_ns, columns = read(tmp_path / "log")
    assert (log.found, len(t_ns), t_ns[-1], columns["T"][-1]) == (3500, 3498, 3499 * S_NS, 3499.0)
    assert [one.record for one in log.rejected] == [1500, 2600] and log.cut is None


# ---- damage ---------------------------------------------------------------------------------------------------------

LONG = pa.table({"time": np.arange(5000.0), "T": np.random.default_rng(4).normal(size=5000)})


def test_stamps_of_numbers_and_texts_are_those_of_a_text_table(tmp_path: Path) -> None:
    days = {"Date": ["2025/12/24"] * 2, "Time": ["08:00:00"] * 2}
    for columns in (days | {"ms": [0, 500]}, {"Time": [20251224080000, 20251224080001]}):
        write_parquet(pa.table(columns | {"T": [20.0, 21.0]}), tmp_path / "log.parquet")
        log, t_ns, values = read(tmp_path / "log.parquet")
        assert (log.absolute, list(values), t_ns[0]) == (True, ["T"], 1_766_563_200_000_000_000)
        assert t_ns[1] - t_ns[0] in (500_000_000, 1_000_000_000)


@pytest.mark.parametrize("write", [write_arrow, write_stream, write_feather])
def test_an_arrow_file_that_was_cut_keeps_its_rows(tmp_path: Path, write: Callable[[pa.Table, Path], None]) -> None:
    path = tmp_path / "log"
    write(LONG, path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    log, t_ns, _ = read(path)
    assert len(t_ns) == log.found == 2000
    assert log.cut and log.cut.startswith("is damaged, or was cut, below row 2,000: 2,000 rows were read")


def test_an_arrow_file_without_its_end_says_so(tmp_path: Path) -> None:
    path = tmp_path / "log"
    write_arrow(LONG, path)
    size = path.stat().st_size - 10
    path.write_bytes(path.read_bytes()[:size])
    log, t_ns, _ = read(path)
    assert len(t_ns) == 5000 and log.cut and log.cut.startswith(f"ends at byte {size:,}, before its end: 5,000 rows")


def test_a_parquet_file_that_was_cut_is_refused_with_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    write_parquet(LONG, path)
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(UnreadableLogError, match=r"log\.parquet: was cut: the index .* Copy the file again\."):
        read(path)


def test_a_parquet_file_with_a_damaged_group_keeps_those_before(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    write_parquet(LONG, path)
    data = bytearray(path.read_bytes())
    at = pa.parquet.read_metadata(path).row_group(2).column(1).data_page_offset + 200
    data[at : at + 8] = bytes(8)
    path.write_bytes(data)
    log, t_ns, _ = read(path)
    assert len(t_ns) == log.found == 2000
    assert log.cut and log.cut.startswith("is damaged in row group 3 of 5: 2,000 rows were read and kept")
    data[4:300] = bytes(296)
    path.write_bytes(data)
    with pytest.raises(UnreadableLogError, match=r"log\.parquet: is damaged \(.+\): nothing of it is used\. Copy"):
        read(path)


def test_tables_of_zeros_are_stopped_at_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ingest.formats._arrow_rows.LONG_LOG", 1 << 20)
    monkeypatch.setattr("ingest.formats._arrow_rows.RATIO", 1)
    table = pa.table({"t_s": np.arange(100_000.0), "T": np.zeros(100_000)})
    parquet, feather = tmp_path / "bomb.parquet", tmp_path / "bomb.feather"
    pa.parquet.write_table(table, parquet, use_dictionary=False, compression="zstd")
    with pytest.raises(UnreadableLogError, match="its 100,000 rows of 2 columns unpack to more than 1,048,576 bytes"):
        read(parquet)
    write_feather(table, feather)
    log, t_ns, _ = read(feather)
    assert (log.cut or "").startswith("unpacks to more than 1,048,576 bytes, in row 65,000: ")
    assert len(t_ns) == 65_000


@pytest.mark.parametrize("name", ["sample.parquet", "sample.arrow"])
def test_it_goes_through_the_child_process(tmp_path: Path, name: str) -> None:
    reader = Reader()
    try:
        reading = reader.record(LOGS / name, tmp_path / "recording.mcap")
    finally:
        reader.close()
    assert (reading.format, reading.holds) == (name.split(".")[1], "rows")
    assert (reading.found, reading.written, reading.rejected) == (4, 3, 1)


@each_writer
def test_numbers_that_are_stored_as_texts_are_named(write: Callable[[pa.Table, Path], None], tmp_path: Path) -> None:
    columns = {"t_s": [0.0, 0.5, 1.0], "T": ["20", "20.5", ""], "p": ["1,2", "1,3", "1,4"], "serial": ["7", "8", "9"]}
    write(pa.table(columns | {"says": ["1.5", "on", "off"]}), tmp_path / "log")
    log, *_ = read(tmp_path / "log")
    assert log.settings["numbers_with_units"] == {"T": "20.5", "p": "1,2"}
