"""MDF of measured channels: files laid out by hand, with the values that the standard's formulas give by hand."""

import struct
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from ingest import formats
from ingest.errors import UnreadableLogError
from ingest.formats import Log, _mdf_log, _mdf_records, open_log, recognise
from ingest.formats._mdf_records import FileBytes
from ingest.intake.inspection import inspect
from ingest.log.unread import findings
from made.mdf import (
    FLOAT,
    FLOAT_BIG,
    FORMULA,
    INTERPOLATED,
    LINEAR,
    MAY_BE_INVALID,
    NEAREST,
    NEVER_VALID,
    RANGE_TEXTS,
    RANGES,
    RATIONAL,
    SECONDS,
    SIGNED,
    SIGNED_BIG,
    TEXT,
    TEXTS,
    UNSIGNED,
    UNSIGNED_BIG,
    VARIABLE,
    VIRTUAL_MASTER,
    Channel,
    Mdf4,
)
from made.mf4 import IN_RECORD, PARTS, in_small_parts, record
from made.places import LOGS
from made.tables import START_NS, columns_of, same
from replay.show.verbs.inspection import inspection_text

table = partial(columns_of, "mdf")

RAW = Channel("x", SIGNED, 8, 16)


def records(*rows: tuple[float, int]) -> bytes:
    """Records of `SECONDS` and `RAW`."""
    return b"".join(struct.pack("<dh", *row) for row in rows)


def converted(tmp_path: Path, law: Callable[[Mdf4], int], raw: list[int]) -> tuple[Log, list[Any]]:
    """The values of a channel with a conversion, where these are stored."""
    file = Mdf4()
    channel = Channel("x", SIGNED, 8, 16, law=law(file))
    group = file.stored("g", (SECONDS, channel), records(*enumerate(raw)), 10)
    log, columns = table(file.save(tmp_path / "log.mf4", group, start_ns=START_NS))
    return log, columns["x"]


def test_a_row_is_what_all_groups_say_at_one_time(tmp_path: Path) -> None:
    file = Mdf4()
    slow = file.stored("slow", (SECONDS, RAW, Channel("slow_only", SIGNED, 8, 16)), records((0, 1), (2, 2)), 10)
    oven = Channel("x", FLOAT, 8, 32, unit="degC")
    fast = b"".join(struct.pack("<df", t, t / 2) for t in (0.0, 1.0, 2.0))
    group = file.stored("Oven", (SECONDS, oven), fast, 12, after=slow)
    log, columns = table(file.save(tmp_path / "log", group, start_ns=START_NS))
    nan = float("nan")
    assert columns["t"] == [0, 1, 2]
    assert columns["Oven/x"] == [0, 0.5, 1]
    assert same(columns["slow/x"], [1, nan, 2]) and same(columns["slow_only"], [1, nan, 2])
    assert (log.found, list(log.rejected), log.cut, log.absolute) == (3, [], None, True)
    assert log.units == {"Oven/x": "degC"}
    assert log.settings["groups"] == {"Oven": 3, "slow": 2}


def test_records_of_one_group_are_read_a_part_at_a_time_packed_or_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = records(*((0.5 * k, k) for k in range(3000)))
    file = Mdf4()
    cuts = [content[first : first + 7001] for first in range(0, len(content), 7001)]
    pieces = [file.block(b"DT", (), cut) if k % 2 else file.packed(cut) for k, cut in enumerate(cuts)]
    listed = file.block(b"DL", (0, *pieces), struct.pack("<B3xI", 0, len(pieces)))
    channels = file.measured("g", (SECONDS, RAW), 3000, 10)
    path = file.save(tmp_path / "log.mf4", file.data_group(channels, listed), start_ns=START_NS)
    read, most = FileBytes.read, 0

    def counted(part: FileBytes, start: int = 0, stop: int | None = None) -> bytes:
        nonlocal most
        found = read(part, start, stop)
        most = max(most, len(found))
        return found

    monkeypatch.setattr(FileBytes, "read", counted)
    for module, name, most_bytes in (
        (_mdf_records, "AT_ONCE", 555),
        (_mdf_log, "IN_MEMORY", 100),
        (formats, "BATCH_ROWS", 1000),
    ):
        monkeypatch.setattr(module, name, most_bytes)
    log, columns = table(path)
    assert columns["t"] == [0.5 * k for k in range(3000)] and columns["x"] == [*range(3000)]
    assert (log.found, len(log.rejected), log.cut) == (3000, 0, None) and most <= 550


def text_refs(file: Mdf4, *texts: str) -> list[int]:
    return [file.text(text) for text in texts]


@pytest.mark.parametrize(
    ("law", "raw", "expected"),
    [
        (lambda file: file.conversion(LINEAR, (-40, 0.5)), [0, 2, -2], [-40, -39, -41]),
        (lambda file: file.conversion(RATIONAL, (0, 1, 2, 0, 0, 4)), [2, 6], [1, 2]),
        (lambda file: file.conversion(RATIONAL, (0, 0, 1, 0, 1, 0)), [4, 0], [0.25, float("nan")]),
        (lambda file: file.conversion(FORMULA, (), [file.text("(X1 - 32) * 5 / 9")]), [212, 32], [100, 0]),
        (lambda file: file.conversion(FORMULA, (), [file.text("X^2 / 4")]), [3, -4], [2.25, 4]),
        (lambda file: file.conversion(FORMULA, (), [file.text("1/(1/300+ln(X/100)/3000)")]), [100], [300]),
        (
            lambda file: file.conversion(FORMULA, (), [file.text("ln(X1/X1)+pow(X1,2)+exp(0)")]),
            [10, 0],
            [101, float("nan")],
        ),
        (lambda file: file.conversion(FORMULA, (), [file.text("log(exp(X1/100))")]), [0, 100], [0, 1]),
        (lambda file: file.conversion(INTERPOLATED, (0, 10, 4, 30)), [-1, 1, 4, 9], [10, 15, 30, 30]),
        (lambda file: file.conversion(NEAREST, (0, 10, 4, 30)), [-1, 1, 2, 3, 9], [10, 10, 10, 30, 30]),
        (lambda file: file.conversion(RANGES, (0, 1, 5, 2, 3, 6, 99)), [0, 1, 2, 3, 4, -1], [5, 5, 6, 6, 99, 99]),
        (lambda file: file.conversion(0), [7], [7]),
    ],
    ids=[
        "linear",
        "rational",
        "by zero",
        "formula",
        "power",
        "NTC",
        "functions",
        "natural",
        "interpolated",
        "nearest",
        "ranges",
        "identity",
    ],
)
def test_conversions_are_applied(
    law: Callable[[Mdf4], int], raw: list[int], expected: list[float], tmp_path: Path
) -> None:
    log, found = converted(tmp_path, law, raw)
    assert same(found, expected)
    assert "unconverted" not in log.settings


def test_a_table_of_texts_is_a_column_of_texts(tmp_path: Path) -> None:
    """A value without a text stays a number, said as a text."""
    law = lambda file: file.conversion(TEXTS, (0, 1), [*text_refs(file, "off", "on"), 0])
    assert converted(tmp_path, law, [1, 0, 7])[1] == ["on", "off", "7"]
    ranges = lambda file: file.conversion(RANGE_TEXTS, (0, 3, 4, 9), text_refs(file, "low", "high", "none"))
    assert converted(tmp_path, ranges, [3, 4, 10])[1] == ["low", "high", "none"]


def test_a_text_among_numbers_is_a_missing_number_and_counted(tmp_path: Path) -> None:
    """As of a sensor that says "not available" with one of its values, and has a law for all others."""

    def law(file: Mdf4) -> int:
        return file.conversion(TEXTS, (255, 254), [*text_refs(file, "SNA", "error"), file.conversion(LINEAR, (0, 2))])

    log, found = converted(tmp_path, law, [1, 255, 2, 254, 255])
    nan = float("nan")
    assert same(found, [2, nan, 4, nan, nan])
    assert log.settings["texts"] == {"g/x": 3}


@pytest.mark.parametrize(
    ("formula", "says"),
    [
        ("__import__('os').system('touch gone')", '"__import__" is no function'),
        ("atan(X)", '"atan" is no function'),
        ("X + Y", "names more than the value X"),
        ("(" * 100 + "X" + ")" * 100, "nested deeper"),
        ("", "the expression ends"),
    ],
)
def test_a_formula_that_is_not_read_leaves_its_channel_out_and_says_why(
    formula: str, says: str, tmp_path: Path
) -> None:
    file = Mdf4()
    odd = Channel("odd", SIGNED, 8, 16, law=file.conversion(FORMULA, (), [file.text(formula)]))
    log, columns = table(
        file.save(tmp_path / "log", file.stored("g", (SECONDS, RAW, odd), records((0, 5)), 10), start_ns=START_NS)
    )
    assert columns["x"] == [5] and "odd" not in columns
    (why,) = log.settings["unconverted"].items()
    assert why[0] == "g/odd" and says in why[1] and "\n" not in why[1]


@pytest.mark.parametrize(
    ("channel", "packed", "expected"),
    [
        (Channel("x", UNSIGNED, 8, 64), struct.pack("<Q", (1 << 64) - 2048), (1 << 64) - 2048),
        (Channel("x", UNSIGNED_BIG, 8, 24), bytes([1, 2, 3]), 0x010203),
        (Channel("x", SIGNED, 8, 12, bit=4), struct.pack("<h", -5 << 4), -5),
        (Channel("x", SIGNED_BIG, 8, 32), struct.pack(">i", -70_000), -70_000),
        (Channel("x", FLOAT, 8, 16), struct.pack("<e", 0.5), 0.5),
        (Channel("x", FLOAT, 8, 32), struct.pack("<f", -1.5), -1.5),
        (Channel("x", FLOAT_BIG, 8, 64), struct.pack(">d", 1e300), 1e300),
        (Channel("x", UNSIGNED, 8, 64, bit=3), struct.pack("<QB", 5 << 3, 0), 5),
        (Channel("x", UNSIGNED, 8, 1, bit=7), b"\x80", 1),
    ],
)
def test_numbers_of_any_form_are_read(channel: Channel, packed: bytes, expected: float, tmp_path: Path) -> None:
    file = Mdf4()
    content = struct.pack("<d", 1.0) + packed
    group = file.stored("g", (SECONDS, channel), content, len(content))
    assert table(file.save(tmp_path / "log", group, start_ns=START_NS))[1]["x"] == [expected]


def test_values_that_the_file_calls_invalid_are_missing_and_counted(tmp_path: Path) -> None:
    file = Mdf4()
    some = (
        SECONDS,
        Channel("x", UNSIGNED, 8, 8, flags=MAY_BE_INVALID, invalid=9),
        Channel("never", UNSIGNED, 8, 8, flags=NEVER_VALID),
    )
    content = b"".join(struct.pack("<dBH", t, 7, 0x200 * (t == 1)) for t in range(3))
    group = file.data_group(file.measured("g", some, 3, 9, invalid=2), file.block(b"DT", (), content))
    log, columns = table(file.save(tmp_path / "log", group, start_ns=START_NS))
    assert same(columns["x"], [7, float("nan"), 7]) and same(columns["never"], [float("nan")] * 3)
    assert log.settings["invalid"] == {"g/never": 3, "g/x": 1}


def unsorted(file: Mdf4) -> int:
    """Records of two groups one after the other, each behind its number, in a packed block."""
    one = file.measured("one", (SECONDS, RAW), 2, 10, number=1)
    other = file.measured("other", (SECONDS, Channel("y", SIGNED, 8, 16)), 1, 10, number=2)
    file.follows(one, other)
    content = b"\1" + records((0, 1)) + b"\2" + records((0.5, 2)) + b"\1" + records((1, 3))
    return file.data_group(one, file.packed(content), id_size=1)


def transposed(file: Mdf4) -> int:
    one = file.data_group(file.measured("one", (SECONDS, RAW), 2, 10), file.packed(records((0, 1), (1, 3)), 10))
    other = file.measured("other", (SECONDS, Channel("y", SIGNED, 8, 16)), 1, 10)
    return file.data_group(other, file.packed(records((0.5, 2))), after=one)


@pytest.mark.parametrize("stored", [unsorted, transposed], ids=lambda one: one.__name__)
def test_records_are_read_however_they_are_stored_a_part_at_a_time(
    stored: Callable[[Mdf4], int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = Mdf4()
    path = file.save(tmp_path / "log", stored(file), start_ns=START_NS)
    for parts in (None, in_small_parts):
        taken = parts(monkeypatch) if parts else []
        log, columns = table(path)
        nan = float("nan")
        assert columns["t"] == [0, 0.5, 1]
        assert same(columns["x"], [1, nan, 3]) and same(columns["y"], [nan, 2, nan])
        assert log.cut is None and max(taken, default=0) <= 40


def test_texts_and_arrays_are_left_out_named_and_counted_and_parts_are_channels(tmp_path: Path) -> None:
    file = Mdf4()
    part = file.channels((Channel("whole.part", UNSIGNED, 9, 8),))
    array = file.block(b"CA", (0,), bytes(16))
    some = (
        SECONDS,
        Channel("whole", 10, 8, 16, part=part),
        Channel("matrix", UNSIGNED, 8, 8, part=array),
        Channel("comment", TEXT, 8, 64, kind=VARIABLE),
    )
    group = file.stored("g", some, records((0, 0x0300), (1, 0x0400)), 10)
    log, columns = table(file.save(tmp_path / "log", group, start_ns=START_NS))
    assert columns == {"t": [0, 1], "whole.part": [3, 4]}
    assert log.settings["left_out"] == ["g/whole (2 values)", "g/matrix (2 values)", "g/comment (2 values)"]


def test_a_time_may_be_counted_and_not_stored(tmp_path: Path) -> None:
    file = Mdf4()
    clock = Channel("t", UNSIGNED, 0, 0, kind=VIRTUAL_MASTER, sync=1, law=file.conversion(LINEAR, (1, 0.25)))
    group = file.stored("g", (clock, Channel("x", UNSIGNED, 0, 8)), bytes([4, 5, 6]), 1)
    _, columns = table(file.save(tmp_path / "log", group, start_ns=START_NS))
    assert columns == {"t": [1, 1.25, 1.5], "x": [4, 5, 6]}


def test_a_time_since_1970_is_one_whatever_the_start_says(tmp_path: Path) -> None:
    """As of loggers whose start is that of a clock that was never set."""
    file = Mdf4()
    group = file.stored("g", (SECONDS, RAW), records((START_NS / 1e9 + 1, 1), (START_NS / 1e9 + 2, 2)), 10)
    log, columns = table(file.save(tmp_path / "log", group, start_ns=315_543_600 * 10**9))
    assert columns["t"] == [1, 2]
    assert log.absolute and log.settings["time"] == "s since 1970"


def test_a_group_keeps_the_order_of_its_records(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock that steps back is not sorted away, and of two records with one stamp none is lost."""
    in_small_parts(monkeypatch)
    file = Mdf4()
    other = file.stored("other", (SECONDS, Channel("y", SIGNED, 8, 16)), records((2, 7), (4, 8)), 10)
    group = file.stored("g", (SECONDS, RAW), records((1, 1), (2, 2), (2, 3), (1.5, 4), (3, 5)), 10, after=other)
    log, columns = table(file.save(tmp_path / "log", group, start_ns=START_NS))
    nan = float("nan")
    assert columns["t"] == [1, 2, 2, 1.5, 3, 4]
    assert same(columns["x"], [1, 2, 3, 4, 5, nan]) and same(columns["y"], [nan, 7, nan, nan, nan, 8])
    assert log.found == 6


@pytest.mark.parametrize("seconds", [float("nan"), 1e12, float("-inf")])
def test_a_record_without_a_time_is_rejected(seconds: float, tmp_path: Path) -> None:
    file = Mdf4()
    group = file.stored("g", (SECONDS, RAW), records((0, 1), (seconds, 2), (1, 3)), 10)
    log, columns = table(file.save(tmp_path / "log", group, start_ns=START_NS))
    assert columns == {"t": [0, 1], "x": [1, 3]}
    assert [(one.record, one.where, one.why) for one in log.rejected] == [
        (1, 'group "g", record 2', "has a stamp that no log can reach")
    ]


def test_records_of_a_group_without_a_time_are_rejected(tmp_path: Path) -> None:
    file = Mdf4()
    timeless = file.stored("angles", (Channel("y", SIGNED, 0, 16),), bytes(4), 2)
    group = file.stored("g", (SECONDS, RAW), records((0, 1)), 10, after=timeless)
    log, columns = table(file.save(tmp_path / "log", group, start_ns=START_NS))
    assert columns["x"] == [1]
    assert {one.why for one in log.rejected} == {"no time: its group has no channel of time"}
    assert log.found == 3 and len(log.rejected) == 2


def test_a_file_that_is_cut_keeps_what_comes_before(tmp_path: Path) -> None:
    file = Mdf4()
    path = file.save(tmp_path / "log", file_with(file, 3), start_ns=START_NS)
    whole = path.read_bytes()
    path.write_bytes(whole[:-15])
    log, columns = table(path)
    assert columns["x"] == [0]
    assert log.cut is not None and log.cut.startswith(f"ends at byte {len(whole) - 15:,} of {len(whole):,}: 1 rows")


def file_with(file: Mdf4, count: int) -> int:
    group = file.data_group(file.measured("g", (SECONDS, RAW), count, 10), 0)
    file.holds(group, file.block(b"DT", (), records(*((i, i) for i in range(count)))))
    return group


def test_blocks_that_name_each_other_in_a_circle_are_refused(tmp_path: Path) -> None:
    """A conversion within itself, and a part that is its own part."""
    file = Mdf4()
    law = file.conversion(TEXTS, (1,), [0, 0])
    struct.pack_into("<Q", file.data, law + 24 + 8 * 4, law)
    path = file.save(tmp_path / "log", file.stored("g", (SECONDS, Channel("x", SIGNED, 8, 16, law=law)), b"", 10))
    with pytest.raises(UnreadableLogError, match=rf"is damaged at byte {law:,}\. Look at the file"):
        table(path)


def test_a_channel_outside_its_record_is_said_and_the_others_are_read(tmp_path: Path) -> None:
    file = Mdf4()
    group = file.stored("g", (SECONDS, RAW, Channel("far", SIGNED, 9, 16)), records((0, 1)), 10)
    log, columns = table(file.save(tmp_path / "log", group, start_ns=START_NS))
    assert columns == {"t": [0], "x": [1]}
    assert log.cut is not None and log.cut.startswith('is damaged: channel "far" lies outside its records: 1 rows')


def test_records_that_a_group_says_it_has_and_that_lie_nowhere_are_said(tmp_path: Path) -> None:
    file = Mdf4()
    lost = file.data_group(file.measured("lost", (SECONDS, Channel("y", SIGNED, 8, 16)), 7, 10), 0)
    group = file.stored("g", (SECONDS, RAW), records((0, 5)), 10, after=lost)
    log, columns = table(file.save(tmp_path / "log", group, start_ns=START_NS))
    assert columns == {"t": [0], "x": [5]}
    assert log.cut is not None and log.cut.startswith("holds 7 records fewer than it says: 1 rows were read")


def test_a_file_of_groups_over_and_over_is_told_at_once(tmp_path: Path) -> None:
    """Ten thousand data groups that all name the same ten thousand groups of channels."""
    file, group, data_group = Mdf4(), 0, 0
    for _ in range(10_000):
        group = file.block(b"CG", (group, 0, 0, 0, 0, 0), bytes(32))
    for _ in range(10_000):
        data_group = file.data_group(group, 0, after=data_group)
    path = file.save(tmp_path / "log", data_group)
    began = time.monotonic()
    assert recognise(path).name == "mdf"
    assert time.monotonic() - began < 5


def test_a_file_without_channels_of_numbers_is_refused(tmp_path: Path) -> None:
    file = Mdf4()
    group = file.stored("g", (SECONDS, Channel("comment", TEXT, 8, 16)), records((0, 1)), 10)
    with pytest.raises(UnreadableLogError, match="no row of it can be read: it holds no channel of numbers"):
        table(file.save(tmp_path / "log", group, start_ns=START_NS))


def test_a_file_with_frames_and_channels_is_one_of_frames(tmp_path: Path) -> None:
    file = Mdf4()
    measured = file.stored("g", (SECONDS, RAW), records((0, 1)), 10)
    frames = file.group((*PARTS, IN_RECORD), 1)
    group = file.data_group(frames, file.block(b"DT", (), record(1, 0x100, b"\1")), after=measured)
    path = file.save(tmp_path / "log", group, start_ns=START_NS)
    assert recognise(path).name == "mf4"
    log = open_log(path)
    assert len(list(log.batches())) == 1
    assert log.settings["other_records"] == {"measured": 1}
    (says,) = (flag.says for flag in findings("log", log.settings))
    assert says.startswith(
        f"log: holds frames and measured channels: these are not read ({log.settings['channels_unread'][0]}"
    )


def test_the_sample_holds_a_group_at_ten_hertz_and_one_a_second() -> None:
    log, columns = table(LOGS / "sample.mdf")
    assert log.found == 12 and len(log.rejected) == 1
    assert columns["T_winding"][:3] == [20, pytest.approx(20.1), pytest.approx(20.2)]
    assert [state for state in columns["pump"] if state] == ["off", "on"]
    assert log.units == {"T_winding": "degC", "speed": "rpm"}


def test_a_channel_that_goes_missing_is_said_before_anything_is_stored(tmp_path: Path) -> None:
    file = Mdf4()
    law = file.conversion(TEXTS, (5,), [file.text("SNA"), file.conversion(LINEAR, (0, 1))])
    odd = Channel("odd", SIGNED, 8, 16, law=file.conversion(FORMULA, (), [file.text("tan(X)")]))
    some = (SECONDS, Channel("x", SIGNED, 8, 16, law=law), odd)
    path = file.save(tmp_path / "log.mf4", file.stored("g", some, records((0, 5), (1, 6)), 10), start_ns=START_NS)
    text = inspection_text(inspect([path], [], None))
    assert "log.mf4   mdf   2 rows in" in text
    assert "missing, a text in place of a number: g/x (1)" in text
    assert 'left out: g/odd: expression "tan(X)", position 1: "tan" is no function' in text


def test_a_file_that_is_encrypted_behind_its_head_is_refused_with_a_way_out(tmp_path: Path) -> None:
    path = tmp_path / "log.mf4"
    path.write_bytes(b"MDF     4.10    CANape  " + bytes(4) + b"\x9a\x01" + bytes(34) + bytes(range(256)) * 8)
    with pytest.raises(UnreadableLogError) as refused:
        [*open_log(path).batches()]
    assert "its first block, at byte 64, is damaged or encrypted" in str(refused.value)
