"""TDMS: which rows come of groups, waveforms, stamps and scalings, and what is kept of a damaged file."""

from __future__ import annotations

import builtins
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import nptdms
import numpy as np
import pytest
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from nptdms.timestamp import TdmsTimestamp

from ingest.errors import UnreadableLogError
from ingest.formats import Rows, TimeSpec, open_log
from ingest.log.decode import decode_file
from ingest.log.unread import findings
from made.places import LOGS
from made.readings import record
from made.tables import read

EXAMPLES = Path(nptdms.__file__).parent / "test" / "data"
START = np.datetime64("2025-12-24T08:00:00")
START_NS = int(START.astype("M8[ns]").astype(np.int64))
S_NS = 1_000_000_000
MS_NS = 1_000_000
Segment = Sequence[Any]


def write(path: Path, *segments: Segment) -> Path:
    with TdmsWriter(path) as writer:
        for segment in segments:
            writer.write_segment(list(segment))
    return path


def wave(
    group: str, name: str, data: Any, increment: float | None = 1.0, start: Any = START, **more: Any
) -> ChannelObject:
    """A channel with the properties that LabVIEW gives a waveform."""
    timing: dict[str, Any] = {} if increment is None else {"wf_increment": increment, "wf_start_offset": 0.0}
    timing |= {} if start is None or increment is None else {"wf_start_time": start}
    return ChannelObject(group, name, np.asarray(data), timing | more)


def plain(group: str, name: str, data: Any, **properties: Any) -> ChannelObject:
    return ChannelObject(group, name, np.asarray(data), properties)


def write_sample(path: Path) -> None:
    """`files/sample.tdms`: two time bases and a stamp that is none."""
    stamps = START + np.array([0, 60, -(10**10), 180]).astype("m8[s]")
    write(
        path,
        [
            RootObject({"title": "oven"}),
            GroupObject("Oven"),
            plain("Oven", "Time", stamps),
            plain("Oven", "T1", [20.5, 120.25, 200.0, 230.0], unit_string="degC"),
            plain("Oven", "Note", ["", "door", "open", ""]),
            wave("Power", "U", [12.0, 12.5, 13.0], 0.5, unit_string="V"),
        ],
        [wave("Power", "U", [13.5], 0.5, unit_string="V")],
    )


def ms(t_ns: Sequence[int]) -> list[int]:
    return [(t - START_NS) // MS_NS for t in t_ns]


def test_the_sample_is_what_the_writer_writes_and_reads_whole(tmp_path: Path) -> None:
    write_sample(tmp_path / "sample.tdms")
    assert (LOGS / "sample.tdms").read_bytes() == (tmp_path / "sample.tdms").read_bytes()
    log, t_ns, columns = read(LOGS / "sample.tdms")
    assert ms(t_ns) == [0, 500, 1000, 1500, 60_000, 180_000]
    nan = [np.nan] * 3
    np.testing.assert_array_equal(columns["T1"], [20.5, *nan, 120.25, 230.0])
    np.testing.assert_array_equal(columns["U"], [12.0, 12.5, 13.0, 13.5, *nan[:2]])
    assert columns["Note"] == ["", "", "", "", "door", ""]
    assert (log.found, log.absolute, log.cut, log.units) == (7, True, None, {"T1": "degC", "U": "V"})
    assert [(one.record, one.where, one.why) for one in log.rejected] == [
        (5, 'group "Oven", record 3', 'no time in channel "Time" of group "Oven"')
    ]
    times = ["2 rows a second", 'channel "Time" of group "Oven"']
    assert log.settings == {"time": times, "rasters": [["T1", "Note"], ["U"]]}


# ---- time bases ----------------------------------------------------------------------------------------------------


def test_channels_of_one_start_and_increment_are_columns_of_one_row_whatever_their_group(tmp_path: Path) -> None:
    path = write(
        tmp_path / "log.tdms",
        [wave("Oven", "T1", [1, 2, 3]), wave("Oven", "T2", [4.0, 5.0]), wave("Iron", "T1", [7.0, 8.0, 9.0])],
    )
    log, t_ns, columns = read(path)
    assert ms(t_ns) == [0, 1000, 2000]
    np.testing.assert_array_equal(columns["Oven/T1"], [1, 2, 3])
    np.testing.assert_array_equal(columns["T2"], [4, 5, np.nan])
    np.testing.assert_array_equal(columns["Iron/T1"], [7, 8, 9])
    assert (log.found, list(log.rejected)) == (3, [])


def test_rows_of_several_rates_come_in_the_order_of_time_and_share_their_stamps(tmp_path: Path) -> None:
    late = START + np.timedelta64(250, "ms")
    path = write(
        tmp_path / "log.tdms",
        [
            wave("A", "slow", [1.0, 2.0]),
            wave("A", "fast", [1.0, 2.0, 3.0], 0.001),
            wave("A", "late", [1.0], start=late),
        ],
    )
    log, t_ns, columns = read(path)
    assert ms(t_ns) == [0, 1, 2, 250, 1000]
    assert log.settings["time"] == ["1 rows a second", "1000 rows a second"]
    np.testing.assert_array_equal(columns["fast"], [1, 2, 3, np.nan, np.nan])
    np.testing.assert_array_equal(columns["slow"], [1, np.nan, np.nan, np.nan, 2])


def test_an_offset_shifts_and_a_start_of_1904_is_none(tmp_path: Path) -> None:
    shifted = wave("A", "x", [1.0], wf_start_offset=2.5)
    assert ms(read(write(tmp_path / "a.tdms", [shifted]))[1]) == [2500]
    unset = wave("A", "x", [1.0, 2.0], start=TdmsTimestamp(0, 0))
    log, t_ns, _ = read(write(tmp_path / "b.tdms", [unset]))
    assert (t_ns, log.absolute) == ([0, S_NS], False)
    log, t_ns, _ = read(tmp_path / "b.tdms", TimeSpec(start_ns=1_766_563_200_000_000_000))
    assert (ms(t_ns), log.absolute) == ([0, 1000], True)


def test_a_start_is_kept_to_the_nanosecond(tmp_path: Path) -> None:
    start = TdmsTimestamp(START_NS // S_NS + 2_082_844_800, (123_456_789 << 64) // S_NS + 1)
    path = write(
        tmp_path / "log.tdms", [wave("A", "x", [1.0], start=start), plain("B", "t", [START]), plain("B", "y", [1.0])]
    )
    assert read(path)[1] == [START_NS, START_NS + 123_456_789]


@pytest.mark.parametrize(
    ("name", "cells", "wanted", "absolute"),
    [
        ("Time", [0.0, 0.5, 2.0], [0, 500 * MS_NS, 2 * S_NS], False),
        ("Zeit [ms]", [0, 500, 2000], [0, 500 * MS_NS, 2 * S_NS], False),
        ("timestamp", [START_NS / S_NS + i for i in range(3)], [START_NS + i * S_NS for i in range(3)], True),
        (
            "Time",
            [START_NS / S_NS + 2_082_844_800 + i for i in range(3)],
            [START_NS + i * S_NS for i in range(3)],
            True,
        ),
    ],
)
def test_a_channel_of_numbers_that_is_called_time_is_the_time_of_its_group(
    tmp_path: Path, name: str, cells: list[float], wanted: list[int], absolute: bool
) -> None:
    path = write(tmp_path / "log.tdms", [plain("Oven", "T", [1.0, 2.0, 3.0]), plain("Oven", name, cells)])
    log, t_ns, columns = read(path)
    assert (t_ns, log.absolute, columns) == (wanted, absolute, {"T": [1.0, 2.0, 3.0]})


def test_a_stated_channel_beats_what_the_file_says(tmp_path: Path) -> None:
    path = write(tmp_path / "log.tdms", [wave("A", "x", [7.0, 8.0]), plain("A", "clock", [10, 20])])
    log, t_ns, columns = read(path, TimeSpec(column="clock", unit="ms", start_ns=1_766_563_200_000_000_000))
    assert (ms(t_ns), columns, log.absolute) == ([10, 20], {"x": [7.0, 8.0]}, True)


def test_a_stated_rate_beats_what_the_file_says(tmp_path: Path) -> None:
    path = write(tmp_path / "log.tdms", [wave("A", "x", [7.0, 8.0]), plain("B", "y", [10, 20])])
    _, t_ns, columns = read(path, TimeSpec(rate_hz=2.0, start_ns=1_766_563_200_000_000_000))
    assert (ms(t_ns), columns) == ([0, 500], {"x": [7.0, 8.0], "y": [10.0, 20.0]})


def test_values_without_any_time_beside_others_that_have_one_are_rejected(tmp_path: Path) -> None:
    path = write(tmp_path / "log.tdms", [wave("A", "x", [1.0, 2.0]), plain("Results", "highest", [231.5])])
    log, t_ns, _ = read(path)
    assert (ms(t_ns), log.found) == ([0, 1000], 3)
    (one,) = log.rejected
    assert (one.record, one.where) == (0, 'group "Results", record 1')
    assert one.why.startswith("no time: the channel has no wf_increment")


def test_a_recorder_that_goes_on_later_in_a_file_says_so(tmp_path: Path) -> None:
    later = START + np.timedelta64(3600, "s")
    parts = [[wave("A", "a", [1.0, 2.0], 0.5, at), wave("A", "b", [3.0, 4.0], 0.5, at)] for at in (START, later)]
    log, t_ns, columns = read(write(tmp_path / "log", [GroupObject("A")], *parts, [plain("A", "a", [5.0])]))
    assert [t - START_NS for t in t_ns] == [0, 5 * S_NS // 10, 3600 * S_NS, 3600 * S_NS + S_NS // 2, 3601 * S_NS]
    assert list(columns["a"]) == [1, 2, 1, 2, 5] and log.settings["time"] == ["2 rows a second"]
    _, t_ns, _ = read(tmp_path / "log", TimeSpec(start_ns=S_NS * 10**9))
    assert t_ns[2] - t_ns[0] == 3600 * S_NS and t_ns[0] == S_NS * 10**9


def test_segments_that_say_when_each_begins_follow_the_first(tmp_path: Path) -> None:
    """Their clock is off by milliseconds: samples come at the rate."""
    parts = [[wave("A", "a", np.arange(4.0), 0.5, START + np.timedelta64(2000 * k + k % 3, "ms"))] for k in range(400)]
    _, t_ns, _ = read(write(tmp_path / "log", *parts))
    assert list(np.diff(t_ns)) == [S_NS // 2] * 1599 and t_ns[0] == START_NS


def test_a_recorder_that_paused_among_many_segments_is_refused(tmp_path: Path) -> None:
    parts = [[wave("A", "a", [0.0], 0.5, START + np.timedelta64(60 * k, "s"))] for k in range(301)]
    with pytest.raises(UnreadableLogError, match="its 301 segments say several times at which"):
        read(write(tmp_path / "log", *parts))


@pytest.mark.parametrize("other", ["waveform", "seconds"])
def test_rows_that_count_from_an_unknown_start_are_rejected_beside_dated_ones(tmp_path: Path, other: str) -> None:
    ticks = [wave("B", "b", [7.0, 8.0], 0.5, None)]
    seconds = [plain("B", "Time (s)", [0.0, 0.5]), plain("B", "b", [7.0, 8.0])]
    path = write(tmp_path / "log", [wave("A", "a", [1.0, 2.0]), *(ticks if other == "waveform" else seconds)])
    log, t_ns, columns = read(path)
    assert (log.absolute, list(t_ns), list(columns["a"])) == (True, [START_NS, START_NS + S_NS], [1, 2])
    assert [one.why.split(":")[0] for one in log.rejected] == ["no date, as other rows of the file have one"] * 2
    log, _, columns = read(path, TimeSpec(start_ns=START_NS))
    assert (log.absolute, len(log.rejected), np.nansum(columns["b"])) == (True, 0, 15)


def test_a_channel_without_times_that_is_as_long_as_the_waveforms_of_its_group_has_theirs(tmp_path: Path) -> None:
    start = np.datetime64("2024-03-01T08:00:00")
    timed = wave("bench", "T", [20.0, 21.0], 0.5, start)
    others = plain("bench", "state", ["on", "off"]), plain("notes", "x", [1.0, 2.0])
    path = write(tmp_path / "log.tdms", [timed, *others])
    log, t_ns, columns = read(path)
    assert [(t - t_ns[0]) // 10**6 for t in t_ns] == [0, 500]
    assert (columns["state"], len(log.rejected)) == (["on", "off"], 2)  # another group is another table


def test_values_that_outlast_the_stamps_of_their_group_are_rejected(tmp_path: Path) -> None:
    path = write(tmp_path / "log.tdms", [plain("A", "t", [START]), plain("A", "x", [1.0, 2.0])])
    log, t_ns, columns = read(path)
    assert (ms(t_ns), columns) == ([0], {"x": [1.0]})
    assert [one.where for one in log.rejected] == ['group "A", value 2']


@pytest.mark.parametrize(
    ("spec", "says"),
    [
        (TimeSpec(),
            "no channel says its time (wf_increment), and none holds it. Under [time] of the bench file say rate_hz"),
        (TimeSpec(column="clok", unit="s"),
            'column = "clok" under [time] of the bench file is no channel of the file. Nearest: clock.'),
        (TimeSpec(column="note"),
            'column = "note" under [time] of the bench file holds text: name a channel of stamps'),
    ],
)  # fmt: skip
def test_a_file_without_time_and_a_stated_time_that_cannot_be_are_refused(
    tmp_path: Path, spec: TimeSpec, says: str
) -> None:
    path = write(tmp_path / "log.tdms", [plain("A", "clock", [1.0, 2.0]), plain("A", "note", ["a", "b"])])
    with pytest.raises(UnreadableLogError) as refused:
        read(path, spec)
    assert str(refused.value).startswith(f"log.tdms: {says}")


# ---- values --------------------------------------------------------------------------------------------------------


def test_scalings_are_applied(tmp_path: Path) -> None:
    scaling: dict[str, Any] = {
        "NI_Number_Of_Scales": 1,
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.5,
        "NI_Scale[0]_Linear_Y_Intercept": -3.0,
        "NI_Scale[0]_Linear_Input_Source": np.uint32(0xFFFFFFFF),
    }
    path = write(tmp_path / "log.tdms", [wave("A", "x", np.array([2, 4], np.int16), **scaling)])
    log, _, columns = read(path)
    assert (columns, "unscaled" in log.settings) == ({"x": [-2.0, -1.0]}, False)


def test_a_scaling_that_cannot_be_used_leaves_raw_values_and_says_so(tmp_path: Path) -> None:
    broken: dict[str, Any] = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear"}
    log, _, columns = read(write(tmp_path / "log.tdms", [wave("A", "x", [2.0, 4.0], **broken)]))
    assert (columns, log.settings["unscaled"]) == ({"x": [2.0, 4.0]}, ["x"])
    (says,) = (flag.says for flag in findings("log", log.settings))
    assert says == "log: its scaling cannot be read of x: the values are as stored, and no quantity"


def test_numbers_of_any_type_truths_texts_and_stamps_become_columns_and_complex_ones_are_left_out(
    tmp_path: Path,
) -> None:
    kinds = {name: wave("A", name, np.array([1, 2], name)) for name in ("int8", "uint16", "int64", "float32")}
    others = [
        wave("A", "bool", np.array([True, False])),
        wave("A", "text", ["a", "ü"]),
        wave("A", "complex", np.array([1j, 2j])),
    ]
    stamps = wave("B", "when", np.array([START, START]))
    log, _, columns = read(write(tmp_path / "log.tdms", [*kinds.values(), *others, stamps]), TimeSpec(rate_hz=1.0))
    assert all(columns[name] == [1.0, 2.0] for name in kinds)
    assert (columns["bool"], columns["text"]) == ([1.0, 0.0], ["a", "ü"])
    assert log.settings["left_out"] == ["A/complex"]


def test_many_segments_and_batches_are_read_through(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ingest.formats.BATCH_ROWS", 7)
    path = write(tmp_path / "log.tdms", *([wave("A", "x", np.arange(5.0) + 5 * k)] for k in range(6)))
    log, t_ns, columns = read(path)
    assert columns["x"] == list(range(30))
    assert ms(t_ns) == [1000 * k for k in range(30)]
    assert [len(batch.t_ns) for batch in open_log(path).batches()] == [7, 7, 7, 7, 2]
    assert log.found == 30


# ---- files of recorders --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["big_endian.tdms", "raw1.tdms", "Digital_Input.tdms"])
def test_files_of_labview_are_read_as_nptdms_reads_them(name: str) -> None:
    path = EXAMPLES / name
    if not path.exists():
        pytest.skip("this nptdms comes without its examples")
    log = open_log(path, TimeSpec(rate_hz=10.0))
    columns: dict[str, list[float]] = {}
    for batch in log.batches():
        assert isinstance(batch, Rows)
        for column, values in batch.columns.items():
            columns.setdefault(column, []).extend(values.tolist())
    with nptdms.TdmsFile.open(path) as whole:
        channels = [channel for group in whole.groups() for channel in group.channels() if len(channel)]
        assert channels
        for channel in channels:
            found = columns.get(channel.name) or columns[f"{channel.group_name}/{channel.name}"]
            raw = "unscaled" in log.settings
            wanted = next(iter(channel.read_data(scaled=False).values())) if raw else channel[:]
            np.testing.assert_array_equal(found[: len(wanted)], np.asarray(wanted, np.float64))


# ---- damage --------------------------------------------------------------------------------------------------------


@pytest.fixture
def segments(tmp_path: Path) -> tuple[Path, list[int]]:
    """A file of six segments of 50 values, each with its own metadata, and where each begins."""
    path = tmp_path / "log.tdms"
    write(path, *([wave("A", "x", np.arange(50.0) + 50 * k, number=k)] for k in range(6)))
    whole = path.read_bytes()
    return path, [at for at in range(len(whole)) if whole.startswith(b"TDSm", at)]


def test_a_file_that_is_cut_in_its_values_keeps_those_before(segments: tuple[Path, list[int]]) -> None:
    path, _ = segments
    whole = path.read_bytes()
    path.write_bytes(whole[:-84])
    log, _, columns = read(path)
    assert columns["x"] == list(range(289))
    assert log.cut == (
        f"ends at byte {len(whole) - 84:,}, inside a segment: 289 rows were read and kept; "
        "copy the file again if the original is whole."
    )


def test_a_file_that_is_cut_in_what_it_says_of_a_segment_keeps_the_segments_before(
    segments: tuple[Path, list[int]],
) -> None:
    path, starts = segments
    whole = path.read_bytes()
    for end in (starts[5] + 2, starts[5] + 20, starts[5] + 40):
        path.write_bytes(whole[:end])
        log, _, columns = read(path)
        assert columns["x"] == list(range(250))
        assert log.cut is not None and log.cut.startswith(("ends at byte", "is damaged at byte"))


@pytest.mark.parametrize("segment", [1, 3, 5])
@pytest.mark.parametrize(("at", "data"), [(0, b"XDSm"), (28, b"\xff\xff\xff\x7f"), (36, b"\xff\xff\xff\xff")])
def test_a_damaged_segment_ends_what_is_read(
    segments: tuple[Path, list[int]], segment: int, at: int, data: bytes
) -> None:
    path, starts = segments
    damaged = bytearray(path.read_bytes())
    damaged[starts[segment] + at : starts[segment] + at + len(data)] = data
    path.write_bytes(damaged)
    log, _, columns = read(path)
    assert columns["x"] == list(range(50 * segment))
    assert log.cut == (
        f"is damaged at byte {starts[segment]:,}: {50 * segment} rows were read and kept; "
        "copy the file again if the original is whole."
    )


def test_texts_that_cannot_be_read_are_left_empty_and_said(tmp_path: Path) -> None:
    path = write(tmp_path / "log.tdms", [wave("A", "x", [1.0, 2.0]), wave("A", "note", ["first", "second"])])
    data = path.read_bytes()
    at = data.index(b"firstsecond") - 8  # where each text ends
    path.write_bytes(data[:at] + struct.pack("<II", 11, 5) + data[at + 8 :])
    log, _, columns = read(path)
    assert columns == {"x": [1.0, 2.0], "note": ["", ""]}
    assert log.cut is not None and log.cut.startswith("holds values that cannot be read (note): 2 rows were read")


def test_a_number_of_scalings_that_no_file_has_is_damage(tmp_path: Path) -> None:
    path = tmp_path / "log.tdms"
    write(path, [wave("A", "x", [1.0])], [wave("A", "x", [2.0], NI_Number_Of_Scales=np.uint32(4_000_000_000))])
    log, _, columns = read(path)
    assert columns == {"x": [1.0]}
    assert log.cut is not None and log.cut.startswith("is damaged at byte")


def test_a_file_whose_first_segment_is_damaged_is_refused(segments: tuple[Path, list[int]]) -> None:
    path, _ = segments
    damaged = bytearray(path.read_bytes())
    damaged[28:32] = b"\xff\xff\xff\x7f"
    path.write_bytes(damaged)
    with pytest.raises(UnreadableLogError, match=r"log\.tdms: is no whole TDMS file: its first segment cannot be read"):
        read(path)


def test_a_file_that_its_recorder_did_not_close_is_read_to_its_end(segments: tuple[Path, list[int]]) -> None:
    path, starts = segments
    data = bytearray(path.read_bytes())
    data[starts[5] + 12 : starts[5] + 20] = struct.pack("<Q", 0xFFFF_FFFF_FFFF_FFFF)
    path.write_bytes(data)
    log, _, columns = read(path)
    assert columns["x"] == list(range(300))
    assert log.cut is not None and log.cut.startswith(
        f"was not closed by its recorder and ends at byte {len(data):,}: 300"
    )


def test_an_index_file_beside_it_is_not_believed(tmp_path: Path) -> None:
    path = write(tmp_path / "log.tdms", [wave("A", "x", [1.0, 2.0])])
    (tmp_path / "log.tdms_index").write_bytes(b"TDSh and nothing that fits")
    assert read(path)[2] == {"x": [1.0, 2.0]}


# ---- the package, and the way on -----------------------------------------------------------------------------------


def test_without_the_package_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    imported = builtins.__import__

    def without(name: str, *rest: Any) -> Any:
        if name.startswith("nptdms"):
            raise ImportError(name)
        return imported(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(UnreadableLogError, match=r"^sample\.tdms: the reader of TDMS files is not installed"):
        read(LOGS / "sample.tdms")


def test_it_goes_through_the_child_process_into_samples(tmp_path: Path) -> None:
    reading = record(LOGS / "sample.tdms", tmp_path / "recording.mcap")
    assert (reading.format, reading.holds, reading.found, reading.written, reading.rejected) == (
        "tdms",
        "rows",
        7,
        6,
        1,
    )
    assert reading.start_ns == START_NS
    decode = decode_file(reading, "f" * 64, [], None, [], tmp_path)
    assert decode.balance == {"found": 7, "decoded": 6, "unknown_id": 0, "wrong_length": 0, "rejected": 1}
    assert {one["name"]: one["unit"] for one in decode.channels} == {"T1": "degC", "U": "V"}
