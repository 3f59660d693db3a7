"""MDF of version 3: files laid out by hand, with the values that the standard's formulas give by hand."""

import struct
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec
from made.mdf3 import (
    DOUBLE,
    FLOAT,
    SECONDS,
    SIGNED,
    SIGNED_LITTLE,
    TEXT,
    UNSIGNED,
    UNSIGNED_BIG,
    Channel3,
    Mdf3File,
)
from made.tables import START_NS, columns_of, same

table = partial(columns_of, "mdf")

NAN = float("nan")
RAW = Channel3("x", SIGNED, 64, 16)


def records(file: Mdf3File, *rows: tuple[float, int]) -> bytes:
    return b"".join(struct.pack(f"{file.order}dh", *row) for row in rows)


def one_group(file: Mdf3File, channel: Channel3, *raw: int) -> int:
    rows = records(file, *enumerate(raw))
    return file.data_group(file.group("Engine", (SECONDS, channel), len(raw), 10), rows)


@pytest.mark.parametrize("order", ["<", ">"])
def test_groups_with_times_of_their_own_are_one_table(order: str, tmp_path: Path) -> None:
    file = Mdf3File(order)
    slow = one_group(file, Channel3("a name that is longer than thirty-one characters", SIGNED, 64, 16), -1, 2)
    law = file.law(0, 2, file.numbers(-40, 0.5), "°C")
    fast = file.group("Oven", (SECONDS, Channel3("T", SIGNED, 64, 16, law=law)), 3, 10)
    group = file.data_group(fast, records(file, (0, 100), (0.5, 102), (1, 104)), after=slow)
    log, columns = table(file.save(tmp_path / "log", group, start=(START_NS + 7200 * 10**9, 2)))
    assert columns["t"] == [0, 0.5, 1]
    assert columns["T"] == [10, 11, 12]
    assert same(columns["a name that is longer than thirty-one characters"], [-1, NAN, 2])
    assert log.units == {"T": "°C"} and log.absolute and log.cut is None
    assert log.settings["groups"] == {"Oven": 3, "Engine": 2} and log.settings["version"] == "3.30"


@pytest.mark.parametrize(
    ("kind", "count", "rest", "raw", "expected"),
    [
        (0, 2, lambda f: f.numbers(1, 2), [3], [7]),
        (1, 2, lambda f: f.numbers(0, 10, 4, 30), [-1, 1, 9], [10, 15, 30]),
        (2, 2, lambda f: f.numbers(0, 10, 4, 30), [1, 3], [10, 30]),
        (6, 6, lambda f: f.numbers(2, 3, 0, 4, 1, 1), [5], [(3 - 4 * (5 - 2)) / -2]),
        (9, 6, lambda f: f.numbers(0, 1, 2, 0, 0, 4), [2], [1]),
        (10, 1, lambda f: b"2*(X1-1)^2\0", [4], [18]),
        (65535, 0, lambda f: b"", [7], [7]),
    ],
    ids=["linear", "interpolated", "nearest", "polynomial", "rational", "formula", "none"],
)
def test_conversions_are_applied(
    kind: int, count: int, rest: Callable[[Mdf3File], bytes], raw: list[int], expected: list[float], tmp_path: Path
) -> None:
    file = Mdf3File()
    law = file.law(kind, count, rest(file))
    group = one_group(file, Channel3("x", SIGNED, 64, 16, law=law), *raw)
    log, columns = table(file.save(tmp_path / "log", group, start=(START_NS, 0)))
    assert columns["x"] == expected and "unconverted" not in log.settings


def test_tables_of_texts_are_columns_of_texts(tmp_path: Path) -> None:
    """The first entry of a table of ranges is for all other values."""
    file = Mdf3File()
    entries = b"".join(struct.pack("<d32s", key, text) for key, text in ((0, b"off"), (1, b"on")))
    places = [file.text(text) for text in ("else", "low", "high")]
    ranges = struct.pack("<2dI2dI2dI", 0, 0, places[0], 0, 3, places[1], 4, 9, places[2])
    some = (
        SECONDS,
        Channel3("state", SIGNED, 64, 16, law=file.law(11, 2, entries)),
        Channel3("level", SIGNED, 64, 16, law=file.law(12, 3, ranges)),
    )
    group = file.data_group(file.group("g", some, 3, 10), records(file, (0, 1), (1, 4), (2, 10)))
    _, columns = table(file.save(tmp_path / "log", group, start=(START_NS, 0)))
    assert columns["state"] == ["on", "4", "10"] and columns["level"] == ["low", "high", "else"]


def test_a_conversion_that_is_not_read_leaves_its_channel_out_and_says_why(tmp_path: Path) -> None:
    file = Mdf3File()
    odd = Channel3("odd", SIGNED, 64, 16, law=file.law(7, 7, file.numbers(*range(7))))
    group = file.data_group(file.group("g", (SECONDS, RAW, odd), 1, 10), records(file, (0, 5)))
    log, columns = table(file.save(tmp_path / "log", group, start=(START_NS, 0)))
    assert columns == {"t": [0], "x": [5]}
    assert log.settings["unconverted"] == {"g/odd": "conversion of kind 7 of MDF 3 is not read"}


@pytest.mark.parametrize(
    ("order", "channel", "packed", "expected"),
    [
        ("<", Channel3("x", UNSIGNED, 64, 12), b"\xff\x0f", 4095),
        (">", Channel3("x", UNSIGNED, 64, 16), b"\x01\x02", 0x0102),
        ("<", Channel3("x", UNSIGNED_BIG, 64, 16), b"\x01\x02", 0x0102),
        (">", Channel3("x", SIGNED_LITTLE, 64, 16), b"\xfe\xff", -2),
        ("<", Channel3("x", FLOAT, 64, 32), struct.pack("<f", 1.5), 1.5),
        (">", Channel3("x", DOUBLE, 64, 64), struct.pack(">d", 2.5), 2.5),
        ("<", Channel3("x", UNSIGNED, 0, 8, byte=9), b"\x00\x07", 7),
    ],
)
def test_numbers_of_any_form_are_read(
    order: str, channel: Channel3, packed: bytes, expected: float, tmp_path: Path
) -> None:
    file = Mdf3File(order)
    content = struct.pack(order + "d", 1.0) + packed
    group = file.data_group(file.group("g", (SECONDS, channel), 1, len(content)), content)
    assert table(file.save(tmp_path / "log", group, start=(START_NS, 0)))[1]["x"] == [expected]


@pytest.mark.parametrize("ids", [1, 2])
def test_records_of_two_groups_one_among_the_other_are_read(ids: int, tmp_path: Path) -> None:
    file = Mdf3File()
    other = file.group("other", (SECONDS, Channel3("y", SIGNED, 64, 16)), 1, 10, number=2)
    group = file.group("one", (SECONDS, RAW), 2, 10, number=1, after=other)
    rows = ((1, (0.0, 1)), (2, (0.5, 2)), (1, (1.0, 3)))
    content = b"".join(bytes([kind]) + records(file, row) + bytes([kind]) * (ids - 1) for kind, row in rows)
    log, columns = table(file.save(tmp_path / "log", file.data_group(group, content, ids), start=(START_NS, 0)))
    assert same(columns["x"], [1, NAN, 3]) and same(columns["y"], [NAN, 2, NAN])
    assert log.cut is None


def test_a_start_without_an_offset_is_local_time(tmp_path: Path) -> None:
    file = Mdf3File()
    path = file.save(tmp_path / "log", one_group(file, RAW, 5), date="14:11:2023 22:13:20")
    assert table(path)[1]["t"] == [0]
    assert table(path, TimeSpec(zone="Europe/Berlin"))[1]["t"] == [-3600]
    path = file.save(tmp_path / "log", one_group(file, RAW, 5), date="99:99:2023 22:13:20")
    assert not table(path)[0].absolute


def test_texts_and_arrays_are_left_out_and_named(tmp_path: Path) -> None:
    file = Mdf3File()
    some = (SECONDS, RAW, Channel3("text", TEXT, 64, 16), Channel3("matrix", SIGNED, 64, 16, parts=64))
    group = file.data_group(file.group("g", some, 1, 10), records(file, (0, 5)))
    log, columns = table(file.save(tmp_path / "log", group, start=(START_NS, 0)))
    assert columns["x"] == [5] and log.settings["left_out"] == ["g/text (1 values)", "g/matrix (1 values)"]


def test_a_file_that_is_cut_keeps_what_comes_before(tmp_path: Path) -> None:
    file = Mdf3File()
    blocks = file.group("g", (SECONDS, RAW), 3, 10)
    group = file.block(b"DG", "4I2H", 0, blocks, 0, len(file.data) + 28, 1, 0, rest=bytes(4))
    file.data += records(file, (0, 1), (1, 2), (2, 3))
    path = file.save(tmp_path / "log", group, start=(START_NS, 0))
    whole = path.read_bytes()
    path.write_bytes(whole[:-5])
    log, columns = table(path)
    assert columns["x"] == [1, 2]
    assert log.cut is not None and log.cut.startswith(f"ends at byte {len(whole) - 5:,} of {len(whole):,}: 2 rows")


def test_blocks_in_a_circle_and_damaged_bytes_are_read_or_refused(tmp_path: Path) -> None:
    file = Mdf3File()
    group = one_group(file, RAW, 5)
    struct.pack_into("<I", file.data, group + 4, group)
    log, columns = table(file.save(tmp_path / "log", group, start=(START_NS, 0)))
    assert columns["x"] == [5] and log.cut is not None and log.cut.startswith(f"is damaged at byte {group:,}")
    whole = (tmp_path / "log").read_bytes()
    for at in range(64, len(whole)):
        (tmp_path / "log").write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
        try:
            table(tmp_path / "log")
        except UnreadableLogError as error:
            assert str(error).startswith("log: ") and "\n" not in str(error)
