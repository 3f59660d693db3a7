"""Decoding: values as cantools has them, units, derived channels, and a balance of every record."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pyarrow as pa
import pytest

from ingest.bench.bench_file import Bench, read_bench
from ingest.bench.resolving import resolve
from ingest.errors import BenchFileError, IngestError
from ingest.facts.events import DecodeCompleted
from ingest.formats import EXTENDED, RASTERS, REMOTE, Frames, Log, Rejected, Rows, TimeSpec
from ingest.log import recording, samples
from ingest.log.databases import Database, load
from ingest.log.decode import RECORDING, decode_file, decode_id
from ingest.log.frames import FrameBatch
from ingest.log.j1939 import Explained
from ingest.log.plan import groups_of
from ingest.log.reading import LogReading

START_NS = 1_700_000_000_000_000_000
RAW = "ab" * 32
DBC = """VERSION ""

NS_ :

BS_:

BU_: BENCH

BO_ 291 Motor: 8 BENCH
 SG_ Speed : 7|16@0- (0.5,0) [0|0] "1/min" BENCH
 SG_ IdFbk : 16|16@1- (0.05,0) [0|0] "A" BENCH
 SG_ IqFbk : 32|16@1- (0.05,0) [0|0] "A" BENCH

BO_ 292 Temperatures: 4 BENCH
 SG_ Page M : 0|4@1+ (1,0) [0|0] "" BENCH
 SG_ T_0 m0 : 8|16@1- (0.1,0) [0|0] "K" BENCH
 SG_ T_1 m1 : 8|16@1- (0.1,0) [0|0] "K" BENCH

BO_ 2566844672 Torque: 4 BENCH
 SG_ Shaft : 0|32@1- (1,0) [0|0] "kNm" BENCH

SIG_VALTYPE_ 2566844672 Shaft : 1;
"""
TORQUE = 0x18FEF100 | int(EXTENDED)
CHANNELS = """
[[channel]]
signal = "T_0"
quantity = "temperature"
unit = "K"
node = "winding"
[[channel]]
signal = "Shaft"
quantity = "torque"
unit = "kNm"
[[channel]]
signal = "IdFbk"
quantity = "current_d"
unit = "A"
convention = "peak"
"""


class Given(Log):
    """A log whose batches are given."""

    def __init__(self, given: Sequence[Frames | Rows], **fields: Any) -> None:
        super().__init__(Path("given.log"), TimeSpec(), **fields)
        self.given = given

    def batches(self) -> Iterator[Frames] | Iterator[Rows]:
        yield from self.given


Frame = tuple[float, int, int, int, bytes]  # s, bus, can_id, flags, payload


def frames(given: Sequence[Frame]) -> Frames:
    """CAN frames, their records counted from 0."""
    seconds, bus, can_id, flags, payloads = zip(*given, strict=True)
    return Frames(
        t_ns=START_NS + np.round(np.array(seconds) * 1e9).astype(np.int64),
        bus=np.array(bus, np.uint8),
        can_id=np.array(can_id, np.uint32),
        flags=np.array(flags, np.uint8),
        offsets=np.cumsum([0, *(len(payload) for payload in payloads)]),
        data=np.frombuffer(b"".join(payloads), np.uint8),
        record=np.arange(len(given)),
    )


def drive(count: int = 3000, seed: int = 2) -> list[Frame]:
    """Frames of three messages on one bus with any payload, 1 ms apart."""
    random = np.random.default_rng(seed)
    lengths = {0x123: 8, 0x124: 4, TORQUE: 4}
    ids = random.choice(list(lengths), count).tolist()
    payloads = [random.bytes(lengths[can_id]) for can_id in ids]
    for i, payload in enumerate(payloads):
        if ids[i] == 0x124:
            payloads[i] = bytes([payload[0] & 1]) + payload[1:]  # a page that there is
    return [(i / 1000, 1, ids[i], 0, payloads[i]) for i in range(count)]


def record(folder: Path, batch: Frames | Rows, **fields: Any) -> LogReading:
    """What `ingest.log.reading` gives for a log of this one batch."""
    folder.mkdir(exist_ok=True)
    log = Given([batch], **{"found": len(batch.t_ns) + len(fields.get("rejected", ())), **fields})
    contents = recording.write(folder / RECORDING, log)
    holds = "rows" if isinstance(batch, Rows) else "frames"
    return LogReading(format="given", holds=holds, rejections=tuple(log.rejected), **vars(contents))


def decoded(
    folder: Path, reading: LogReading, databases: Sequence[Database] = (), bench: str | None = None
) -> DecodeCompleted:
    read = read_bench(bench.encode(), "bench.toml") if bench else None
    return decode_file(reading, RAW, databases, read, channels(reading, databases, read), folder)


def channels(reading: LogReading, databases: Sequence[Database], bench: Bench | None) -> list[Any]:
    messages = {can_id: message for database in databases for can_id, message in database.messages.items()}
    signals = [signal for group in groups_of(reading, Explained(messages)) for signal in group.signals]
    return resolve(bench, signals) if bench else []


def table(folder: Path, event: DecodeCompleted, group: str) -> pa.Table:
    [entry] = [entry for entry in event.groups if entry["name"] == group]
    return samples.read(folder / entry["file"])


def channel(event: DecodeCompleted, name: str) -> Mapping[str, Any]:
    [entry] = [entry for entry in event.channels if entry["name"] == name]
    return entry


def dbc(text: str = DBC, name: str = "motor.dbc") -> Database:
    return load(text.encode(), name)


# ---- values --------------------------------------------------------------------------------------------------------


def test_every_value_is_that_of_cantools(tmp_path: Path) -> None:
    given = drive()
    event = decoded(tmp_path, record(tmp_path, frames(given)), [dbc()])
    assert {group["name"] for group in event.groups} == {"Motor", "Temperatures", "Torque"}
    reference: Any = cantools.database.load_string(DBC, "dbc")
    for group in event.groups:
        rows = table(tmp_path, event, group["name"]).to_pydict()
        message = reference.get_message_by_name(group["name"])
        assert rows["record"] == [i for i, frame in enumerate(given) if frame[2] & 0x1FFFFFFF == message.frame_id]
        for i, at in enumerate(rows["record"]):
            expected = message.decode(given[at][4], decode_choices=False)
            for signal in message.signals:
                value = rows[channel(event, signal.name)["column"]][i]
                np.testing.assert_equal(value, float(expected.get(signal.name, np.nan)))
        assert rows["t_ns"] == [START_NS + at * 1_000_000 for at in rows["record"]]
        assert rows["log_t_ns"] == rows["t_ns"]
        assert set(rows["file_id"]) == {RAW}


def test_a_multiplexed_signal_is_undefined_where_it_is_absent(tmp_path: Path) -> None:
    pages = [(i / 10, 1, 0x124, 0, bytes([i % 3, i, 0, 0])) for i in range(9)]
    event = decoded(tmp_path, record(tmp_path, frames(pages)), [dbc()])
    rows = table(tmp_path, event, "Temperatures")
    first, second = (np.isnan(rows[f"{name}_K"].to_numpy()) for name in ("T_0", "T_1"))
    assert first.tolist() == [i % 3 != 0 for i in range(9)]
    assert second.tolist() == [i % 3 != 1 for i in range(9)]
    assert event.balance["decoded"] == 9


CASCADED = """VERSION ""
BU_: B
BO_ 1 Two: 4 B
 SG_ Outer M : 0|4@1+ (1,0) [0|0] "" B
 SG_ Inner m2M : 4|4@1+ (1,0) [0|0] "" B
 SG_ Deep m3 : 8|8@1+ (1,0) [0|0] "" B
 SG_ Ranged m1 : 16|8@1+ (1,0) [0|0] "" B

SG_MUL_VAL_ 1 Inner Outer 2-2;
SG_MUL_VAL_ 1 Deep Inner 3-3;
SG_MUL_VAL_ 1 Ranged Outer 1-1, 5-7;
"""


def test_multiplexers_of_multiplexers_and_ranges_are_followed(tmp_path: Path) -> None:
    payloads = [bytes([0x32, 7, 0, 0]), bytes([0x31, 8, 9, 0]), bytes([0x06, 0, 10, 0]), bytes([0x42, 11, 0, 0])]
    given = frames([(i, 1, 1, 0, payload) for i, payload in enumerate(payloads)])
    rows = table(tmp_path, decoded(tmp_path, record(tmp_path, given), [dbc(CASCADED)]), "Two")
    np.testing.assert_array_equal(rows["Deep"].to_numpy(), [7, np.nan, np.nan, np.nan])
    np.testing.assert_array_equal(rows["Ranged"].to_numpy(), [np.nan, 9, 10, np.nan])
    np.testing.assert_array_equal(rows["Inner"].to_numpy(), [3, np.nan, np.nan, 4])


def test_a_signal_behind_the_end_of_its_message_is_read_where_the_frame_is_long_enough(tmp_path: Path) -> None:
    text = 'VERSION ""\nBU_: B\nBO_ 1 M: 2 B\n SG_ a : 0|8@1+ (1,0) [0|0] "" B\n SG_ b : 16|8@1+ (1,0) [0|0] "" B\n'
    given = frames([(0, 1, 1, 0, b"\x01\x02\x03"), (1, 1, 1, 0, b"\x04\x05"), (2, 1, 1, 0, b"\x06")])
    event = decoded(tmp_path, record(tmp_path, given), [dbc(text)])
    rows = table(tmp_path, event, "M")
    np.testing.assert_array_equal(rows["a"].to_numpy(), [1, 4])
    np.testing.assert_array_equal(rows["b"].to_numpy(), [3, np.nan])
    assert event.settings["databases"] == ["motor.dbc:3: The signal b does not fit in message M: read all the same"]
    assert event.settings["wrong_length"] == {"can1:0x1 M": 1}


def test_payloads_of_can_fd_are_decoded_to_their_last_byte(tmp_path: Path) -> None:
    text = 'VERSION ""\nBU_: B\nBO_ 1 Wide: 64 B\n SG_ last : 448|64@1- (1,0) [0|0] "" B\n'
    payload = bytes(56) + (-(2**62) + 2**20).to_bytes(8, "little", signed=True)
    event = decoded(tmp_path, record(tmp_path, frames([(0, 1, 1, 4, payload)])), [dbc(text)])
    assert table(tmp_path, event, "Wide")["last"].to_pylist() == [float(-(2**62) + 2**20)]


def test_a_message_on_two_buses_is_two_groups(tmp_path: Path) -> None:
    given = frames([(i / 10, 1 + i % 2, 0x123, 0, bytes([0, i] + [0] * 6)) for i in range(10)])
    event = decoded(tmp_path, record(tmp_path, given), [dbc()])
    assert [group["name"] for group in event.groups] == ["can1_Motor", "can2_Motor"]
    assert table(tmp_path, event, "can2_Motor")["Speed_rpm"].to_pylist() == [0.5, 1.5, 2.5, 3.5, 4.5]


def test_two_messages_of_one_name_are_told_apart_by_identifier(tmp_path: Path) -> None:
    other = dbc(DBC.replace("BO_ 291 ", "BO_ 290 "), "other.dbc")
    given = frames([(0, 1, 0x123, 0, bytes(8)), (1, 1, 0x122, 0, bytes(8))])
    event = decoded(tmp_path, record(tmp_path, given), [dbc(), other])
    assert {group["name"] for group in event.groups} == {"can1_Motor_0x122", "can1_Motor_0x123"}


def names(event: DecodeCompleted) -> list[str]:
    return [entry["name"] for entry in event.channels]


def test_signals_of_one_name_on_two_buses_are_channels_of_two_names(tmp_path: Path) -> None:
    given = frames([(i / 10, 1 + i % 2, 0x123, 0, bytes(8)) for i in range(10)])
    reading = record(tmp_path, given)
    guessed = decoded(tmp_path, reading, [dbc()])
    both = ["can1:Motor.Speed", "can1:Motor.IdFbk", "can1:Motor.IqFbk"]
    assert names(guessed) == [*both, *(name.replace("can1", "can2") for name in both)]
    assert {entry["signal"]["name"] for entry in guessed.channels} == {"Speed", "IdFbk", "IqFbk"}


def test_a_channel_of_the_bench_file_keeps_its_name_beside_a_signal_of_that_name(tmp_path: Path) -> None:
    given = frames([(i / 10, 1 + i % 2, 0x123, 0, bytes(8)) for i in range(10)])
    bench = '[[channel]]\nsignal = "can1:Motor.Speed"\nquantity = "speed"\nunit = "rpm"\n'
    event = decoded(tmp_path, record(tmp_path, given), [dbc()], bench)
    speeds = [(entry["name"], entry["role"]) for entry in event.channels if entry["signal"]["name"] == "Speed"]
    assert speeds == [("Speed", "input"), ("can2:Motor.Speed", "ignored")]


def test_channels_of_two_messages_of_one_name_on_one_bus_are_told_apart_by_group(tmp_path: Path) -> None:
    other = dbc(DBC.replace("BO_ 291 ", "BO_ 290 "), "other.dbc")
    given = frames([(0, 1, 0x123, 0, bytes(8)), (1, 1, 0x122, 0, bytes(8))])
    event = decoded(tmp_path, record(tmp_path, given), [dbc(), other])
    assert {"can1_Motor_0x122.Speed", "can1_Motor_0x123.Speed"} < set(names(event))
    assert len(set(names(event))) == len(names(event)) == 6


# ---- bench file ----------------------------------------------------------------------------------------------------


def test_channels_are_converted_to_the_stored_unit_and_the_rest_keeps_its_own(tmp_path: Path) -> None:
    reading = record(tmp_path / "a", frames(drive()))
    plain = decoded(tmp_path / "a", reading, [dbc()])
    record(tmp_path / "b", frames(drive()))
    event = decoded(tmp_path / "b", reading, [dbc()], CHANNELS)
    kelvin = table(tmp_path / "a", plain, "Temperatures")["T_0_K"].to_numpy()
    rows = table(tmp_path / "b", event, "Temperatures")
    np.testing.assert_array_equal(rows["T_0_degC"].to_numpy(), kelvin - 273.15)
    np.testing.assert_array_equal(rows["T_1_K"].to_numpy(), table(tmp_path / "a", plain, "Temperatures")["T_1_K"])
    kilo = table(tmp_path / "a", plain, "Torque")["Shaft_kNm"].to_numpy()
    np.testing.assert_array_equal(table(tmp_path / "b", event, "Torque")["Shaft_Nm"].to_numpy(), kilo * 1000)
    peak = table(tmp_path / "a", plain, "Motor")["IdFbk_A"].to_numpy()
    rms = table(tmp_path / "b", event, "Motor")["IdFbk_A"].to_numpy()
    np.testing.assert_allclose(rms, peak / np.sqrt(2), rtol=1e-15)
    assert channel(event, "T_0") == {
        "name": "T_0",
        "group": "Temperatures",
        "column": "T_0_degC",
        "quantity": "temperature",
        "unit": "degC",
        "node": "winding",
        "region": "copper",
        "role": "observed",
        "derived": False,
        "signal": {
            "name": "T_0",
            "message": "Temperatures",
            "bus": "can1",
            "unit": "K",
            "resolution": 0.1,
            "source": "motor.dbc",
        },
    }
    assert (channel(event, "T_1")["role"], channel(event, "T_1")["quantity"]) == ("ignored", None)


def test_fields_say_unit_quantity_and_signal(tmp_path: Path) -> None:
    event = decoded(tmp_path, record(tmp_path, frames(drive(100))), [dbc()], CHANNELS)
    said = table(tmp_path, event, "Torque").schema.field("Shaft_Nm").metadata
    assert {key: said[key] for key in (b"unit", b"quantity", b"signal")} == {
        b"unit": b"Nm",
        b"quantity": b"torque",
        b"signal": b"Shaft",
    }


def test_without_a_bench_file_quantities_are_guessed(tmp_path: Path) -> None:
    event = decoded(tmp_path, record(tmp_path, frames(drive(300))), [dbc()])
    speed = channel(event, "Speed")
    assert (speed["quantity"], speed["unit"], speed["role"], speed["node"]) == ("speed", "rpm", "input", None)
    assert channel(event, "T_0")["quantity"] == "temperature"
    assert channel(event, "Page")["quantity"] is None
    assert event.bench is None


DERIVED = """
[[derived]]
name = "current"
quantity = "current"
unit = "A"
expression = "hypot(IdFbk, IqFbk) / sqrt(2)"
[[derived]]
name = "shaft_power"
quantity = "heat"
unit = "W"
expression = "Shaft * Speed"
"""


def test_a_derived_channel_sees_signals_as_they_stand_in_the_file(tmp_path: Path) -> None:
    event = decoded(tmp_path, record(tmp_path, frames(drive(500))), [dbc()], CHANNELS + DERIVED)
    rows = table(tmp_path, event, "Motor")
    peak_d, peak_q = rows["IdFbk_A"].to_numpy() * np.sqrt(2), rows["IqFbk_A"].to_numpy()
    np.testing.assert_allclose(rows["current_A"].to_numpy(), np.hypot(peak_d, peak_q) / np.sqrt(2), rtol=1e-12)
    entry = channel(event, "current")
    assert (entry["group"], entry["column"], entry["derived"], entry["signal"]) == ("Motor", "current_A", True, None)


def test_signals_of_other_groups_hold_their_last_value(tmp_path: Path) -> None:
    def motor(rpm: int) -> bytes:
        return (2 * rpm).to_bytes(2, "big", signed=True) + bytes(6)

    def torque(value: float) -> bytes:
        return np.float32(value).tobytes()

    given: list[Frame] = [
        (0.0, 2, TORQUE, 0, torque(1.0)),
        (0.1, 1, 0x123, 0, motor(100)),
        (1.5, 2, TORQUE, 0, torque(2.0)),
        (1.5, 1, 0x123, 0, motor(200)),
        (2.5, 2, TORQUE, 0, torque(3.0)),
        (2.6, 2, TORQUE, 0, torque(4.0)),
    ]
    event = decoded(tmp_path, record(tmp_path, frames(given)), [dbc()], DERIVED)
    rows = table(tmp_path, event, "Torque")
    np.testing.assert_array_equal(rows["shaft_power_W"].to_numpy(), [np.nan, 400, 600, 800])


APART = """
[[derived]]
name = "difference"
quantity = "temperature"
unit = "K"
expression = "T_1 - T_0"
node = "gap"
[[derived]]
name = "paged"
quantity = "temperature"
unit = "K"
expression = "Page + T_1"
node = "gap"
"""


def test_signals_of_other_pages_of_a_multiplexer_hold_their_last_value(tmp_path: Path) -> None:
    """A derived channel stands at the page of its first signal that has one; what each frame holds is as it is."""

    def page(number: int, kelvin: float) -> bytes:
        return bytes([number]) + round(10 * kelvin).to_bytes(2, "little") + bytes(1)

    sent = [page(0, 300), page(1, 310), page(1, 320), page(0, 301), page(1, 330)]
    given = frames([(0.1 * i, 1, 0x124, 0, payload) for i, payload in enumerate(sent)])
    event = decoded(tmp_path, record(tmp_path, given), [dbc()], APART)
    rows = table(tmp_path, event, "Temperatures")
    nan, zero = np.nan, -273.15
    np.testing.assert_allclose(rows["difference_degC"].to_numpy(), [nan, 10 + zero, 20 + zero, nan, 29 + zero])
    np.testing.assert_allclose(rows["paged_degC"].to_numpy(), [nan, 311 + zero, 321 + zero, nan, 331 + zero])


def test_columns_of_other_rasters_of_a_table_hold_their_last_value(tmp_path: Path) -> None:
    nan = np.nan
    slow, fast = np.array([1.0, nan, nan, 2.0, nan]), np.array([nan, 10.0, nan, nan, 30.0])
    also = np.array([nan, 100.0, nan, nan, 300.0])  # of the fast raster
    rows = Rows(START_NS + np.arange(5), {"slow": slow, "fast": fast, "also": also}, np.arange(5))
    bench = APART.replace("T_1 - T_0", "fast - slow").replace("Page + T_1", "fast + also")
    reading = record(tmp_path, rows, settings={RASTERS: [["slow"], ["fast", "also"]]})
    found = table(tmp_path, decoded(tmp_path, reading, [], bench), "rows")
    np.testing.assert_allclose(found["difference_degC"].to_numpy() + 273.15, [nan, 9, nan, nan, 28])
    np.testing.assert_allclose(found["paged_degC"].to_numpy() + 273.15, [nan, 110, nan, nan, 330])


def test_a_column_that_the_bench_file_does_not_mean_is_not_called_as_a_signal_that_it_means(tmp_path: Path) -> None:
    bench = read_bench(CHANNELS.encode(), "b.toml")
    known = channels(record(tmp_path / "bus", frames(drive(100))), [dbc()], bench)
    rows = Rows(START_NS + np.arange(2), {"T_0": np.array([1.0, 2.0]), "T_9": np.array([1.0, 2.0])}, np.arange(2))
    event = decode_file(record(tmp_path / "table", rows), RAW, [dbc()], bench, known, tmp_path / "table")
    assert [(one["name"], one["role"]) for one in event.channels] == [("rows.T_0", "ignored"), ("T_9", "ignored")]


def test_a_channel_without_a_frame_in_this_log_is_said_and_stops_nothing(tmp_path: Path) -> None:
    both = frames([(0, 1, 0x123, 0, bytes(8)), (1, 1, 0x124, 0, bytes(4)), (2, 1, TORQUE, 0, bytes(4))])
    known = channels(
        record(tmp_path / "all", both), [dbc()], bench := read_bench((CHANNELS + DERIVED).encode(), "b.toml")
    )
    reading = record(tmp_path / "one", frames([(0, 1, 0x123, 0, bytes(8))]))
    event = decode_file(reading, RAW, [dbc()], bench, known, tmp_path / "one")
    assert event.settings["missing"] == ["T_0", "Shaft", "shaft_power"]
    assert {entry["name"] for entry in event.channels} == {"Speed", "IdFbk", "IqFbk", "current"}


def test_a_batch_of_frames_leaves_memory_as_soon_as_it_is_decoded() -> None:
    batch = FrameBatch(frames([(0, 1, 0x123, 0, bytes(8))]))
    held, (message, *_) = weakref.ref(batch), dbc().messages.values()
    gc.disable()
    try:
        values = batch.signals(message, np.array([0]))
        payloads = weakref.ref(batch._data)
        del batch
        assert len(values) and held() is None and payloads() is None, "a cycle of objects keeps it"
    finally:
        gc.enable()


# ---- tables --------------------------------------------------------------------------------------------------------


def some_rows(count: int = 200) -> Rows:
    columns = {
        "T_K": 300 + np.arange(count) / 10,
        "record": np.arange(count, dtype=float),
        "Serial": np.array([f"S{i // 100}" for i in range(count)], dtype=object),
        "Batch": np.full(count, 7.0),
    }
    return Rows(START_NS + np.arange(count) * 500_000_000, columns, np.arange(count))


TABLE = """
specimen_column = "Serial"
batch_column = "Batch"
[[channel]]
signal = "T_K"
quantity = "temperature"
unit = "K"
node = "winding"
"""


def test_a_table_is_one_group_with_its_text_columns(tmp_path: Path) -> None:
    event = decoded(tmp_path, record(tmp_path, some_rows(), units={"T_K": "K"}), bench=TABLE)
    [group] = event.groups
    assert (group["name"], group["file"], group["rows"]) == ("rows", "rows.parquet", 200)
    assert group["columns"] == ["T_K_degC", "record_2", "Serial", "Batch"]
    rows = table(tmp_path, event, "rows")
    np.testing.assert_allclose(rows["T_K_degC"].to_numpy(), 26.85 + np.arange(200) / 10, rtol=0, atol=1e-12)
    assert rows["Serial"].to_pylist() == ["S0"] * 100 + ["S1"] * 100
    assert [entry["name"] for entry in event.channels] == ["T_K", "record", "Batch"]
    assert event.balance == {"found": 200, "decoded": 200, "unknown_id": 0, "wrong_length": 0, "rejected": 0}


def test_a_table_of_many_specimens_says_which_rows_are_whose(tmp_path: Path) -> None:
    event = decoded(tmp_path, record(tmp_path, some_rows()), bench=TABLE)
    assert [(part["specimen"], part["batch"]) for part in event.parts] == [("S0", "7"), ("S1", "7")]
    assert [(part["first_record"], part["last_record"]) for part in event.parts] == [(0, 99), (100, 199)]


def test_only_within_a_specimen_a_clock_steps_back(tmp_path: Path) -> None:
    rows, half = some_rows(), np.arange(100) * 500_000_000
    each = Rows(START_NS + np.concatenate([half, half]), rows.columns, rows.record)  # two specimens at the same times
    assert decoded(tmp_path, record(tmp_path, each), bench=TABLE).settings["clock"] == {"doubled": ["rows"]}
    back = Rows(each.t_ns - 10**9 * (np.arange(200) >= 150), rows.columns, rows.record)
    found = decoded(tmp_path, record(tmp_path, back), bench=TABLE).settings["clock"]
    assert (found["back_steps"], found["back_ns"], found["other"]) == (1, 500_000_000, 2)


def test_a_specimen_column_that_is_not_there_is_refused_with_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(BenchFileError) as refused:
        decoded(tmp_path, record(tmp_path, some_rows()), bench=TABLE.replace('"Serial"', '"Serail"'))
    assert str(refused.value) == (
        'bench.toml: specimen_column "Serail" is not a column of this log. Nearest: Serial. Correct the name.'
    )


def test_a_text_column_is_refused_as_a_temperature(tmp_path: Path) -> None:
    bench = TABLE.replace('signal = "T_K"', 'signal = "Serial"')
    with pytest.raises(BenchFileError) as refused:
        decoded(tmp_path, record(tmp_path, some_rows()), bench=bench)
    assert str(refused.value) == (
        'bench.toml:4: signal "Serial" holds text in this log: it cannot be a temperature. '
        'Correct the name, or add role = "ignored".'
    )


# ---- balance -------------------------------------------------------------------------------------------------------


def test_every_record_is_decoded_or_counted_with_the_reason(tmp_path: Path) -> None:
    given: list[Frame] = [
        (0, 1, 0x123, 0, bytes(8)),
        (1, 1, 0x123, 0, bytes(7)),
        (2, 1, 0x123, REMOTE, b""),
        (3, 2, 0x555, 0, bytes(8)),
        (4, 2, TORQUE ^ 1, 0, bytes(8)),
        (5, 2, 0x555, 0, b""),
    ]
    refused = [Rejected(6, "byte 800", "error frame"), Rejected(7, "byte 900", "object of 0 bytes")]
    event = decoded(tmp_path, record(tmp_path, frames(given), rejected=refused), [dbc()])
    assert event.balance == {"found": 8, "decoded": 1, "unknown_id": 3, "wrong_length": 1, "rejected": 3}
    assert event.unknown_ids == {"can2:0x555": 2, "can2:0x18FEF101": 1}
    assert event.settings["wrong_length"] == {"can1:0x123 Motor": 1}
    assert event.settings["rejected"] == {
        "remote frame, no data": 1,
        "error frame": 1,
        "object of 0 bytes": 1,
    }
    assert event.rejections == [
        {"record": 2, "where": "can1:0x123", "why": "remote frame, no data"},
        {"record": 6, "where": "byte 800", "why": "error frame"},
        {"record": 7, "where": "byte 900", "why": "object of 0 bytes"},
    ]
    assert (event.outcome, event.why) == (
        "salvaged",
        (
            "1 of 8 records cannot be read and were set aside, the first at byte 900: object of 0 bytes; "
            "copy the file again if the original is whole, or leave it so: the rest is used."
        ),
    )


def test_cells_that_were_set_aside_say_what_to_do(tmp_path: Path) -> None:
    rows = Rows(START_NS + np.arange(3), {"T": np.arange(3.0)}, np.arange(3))
    bad = [Rejected(3, "line 5, column T", 'text "x" where numbers are')]
    event = decoded(tmp_path, record(tmp_path, rows, rejected=bad))
    assert event.why == (
        '1 of 4 records cannot be read and were set aside, the first at line 5, column T: text "x" where numbers are; '
        "correct the cells and ingest the file again, or leave it so: the rest is used."
    )


def test_error_frames_are_rejected_records_but_no_damage(tmp_path: Path) -> None:
    errors = [Rejected(100 + i, f"line {i}", "error frame") for i in range(30)]
    event = decoded(tmp_path, record(tmp_path, frames(drive(100)), rejected=errors), [dbc()])
    assert (event.balance["found"], event.balance["rejected"]) == (130, 30)
    assert (event.outcome, event.why) == ("decoded", None)
    assert event.settings["rejected"] == {"error frame": 30}
    assert [entry["record"] for entry in event.rejections] == list(range(100, 120))


def test_a_lost_record_stops_the_decode(tmp_path: Path) -> None:
    reading = record(tmp_path, frames(drive(100)), found=101)
    with pytest.raises(
        IngestError, match=r"holds 101 records, but decoded 100 \+ unknown_id 0 .* are 100: some were lost"
    ):
        decoded(tmp_path, reading, [dbc()])


def test_a_log_that_is_cut_is_salvaged(tmp_path: Path) -> None:
    event = decoded(tmp_path, record(tmp_path, frames(drive(100)), cut="ends 7 bytes early"), [dbc()])
    assert (event.outcome, event.why) == ("salvaged", "ends 7 bytes early")


@pytest.mark.parametrize(
    ("frame", "databases", "counted", "why"),
    [
        (
            (0, 1, 0x123, 0, bytes(8)),
            [],
            "unknown_id",
            "no frame is of a message that is known: name the signal database of this log with --dbc",
        ),
        (
            (0, 1, 0x123, 0, bytes(7)),
            [dbc()],
            "wrong_length",
            "every frame is shorter than its message: the signal database is not the one of this log",
        ),
        (
            (0, 1, 0x321, 0, bytes(8)),
            [dbc(), dbc(DBC, "other.dbc")],
            "unknown_id",
            "no frame is of a message of motor.dbc, other.dbc: name the signal database of this log with --dbc",
        ),
        ((0, 1, 0x123, REMOTE, b""), [dbc()], "rejected", "no frame holds data: nothing to decode"),
    ],
)
def test_where_nothing_can_be_decoded_the_way_out_is_said(
    tmp_path: Path, frame: Frame, databases: list[Database], counted: str, why: str
) -> None:
    event = decoded(tmp_path, record(tmp_path, frames([frame])), databases)
    assert event.balance == {"found": 1, "decoded": 0, "unknown_id": 0, "wrong_length": 0, "rejected": 0} | {counted: 1}
    assert (event.outcome, event.why, event.groups, event.channels) == ("decoded", why, [], [])


# ---- identity ------------------------------------------------------------------------------------------------------


def test_the_same_log_decodes_to_the_same_bytes(tmp_path: Path) -> None:
    first = decoded(tmp_path / "a", record(tmp_path / "a", frames(drive())), [dbc()], CHANNELS + DERIVED)
    again = decoded(tmp_path / "b", record(tmp_path / "b", frames(drive())), [dbc()], CHANNELS + DERIVED)
    assert first == again
    assert set(first.products) == {RECORDING, "Motor.parquet", "Temperatures.parquet", "Torque.parquet"}


def test_rows_that_wait_are_written_before_memory_fills(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = decoded(tmp_path / "a", record(tmp_path / "a", frames(drive())), [dbc()])
    monkeypatch.setattr("ingest.log.decode.WAITING_VALUES", 0)
    monkeypatch.setattr(recording, "BATCH_RECORDS", 500)
    parts = decoded(tmp_path / "b", record(tmp_path / "b", frames(drive())), [dbc()])
    assert parts.groups == whole.groups
    for group in whole.groups:
        assert str(table(tmp_path / "a", whole, group["name"]).to_pydict()) == str(
            table(tmp_path / "b", parts, group["name"]).to_pydict()
        )


def test_a_decode_is_known_by_all_that_makes_it() -> None:
    ids = {
        decode_id("raw", ["a", "b"], "bench"),
        decode_id("raw", ["b", "a"], "bench"),
        decode_id("raw", ["a"], "bench"),
        decode_id("raw", ["a", "b"], None),
        decode_id("war", ["a", "b"], "bench"),
    }
    assert len(ids) == 5
    assert decode_id("raw", ["a", "b"], "bench") in ids


def test_messages_have_a_file_each_however_they_are_called(tmp_path: Path) -> None:
    names = ("T öl", "T ül", "T__l", "L" * 300)
    messages = "".join(
        f'<Message id="0x{number:X}" length="1" name="{name}"><Signal name="s" offset="0" length="8"/></Message>'
        for number, name in enumerate(names)
    )
    head = '<NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0"><Document/><Bus name="B">'
    database = load(f"{head}{messages}</Bus></NetworkDefinition>".encode(), "bus.kcd")
    given = frames([(0.1 * number, 1, number, 0, bytes([number])) for number in range(len(names))])
    event = decoded(tmp_path, record(tmp_path, given), [database])
    assert [table(tmp_path, event, name)["s"].to_pylist() for name in names] == [[0], [1], [2], [3]]


def test_where_databases_differ_the_first_given_is_used_and_said(tmp_path: Path) -> None:
    other = dbc(DBC.replace("(0.5,0)", "(0.25,0)"), "other.dbc")
    given = frames([(0, 1, 0x123, 0, bytes([0, 4, *[0] * 6]))])
    event = decoded(tmp_path, record(tmp_path, given), [other, dbc()])
    assert table(tmp_path, event, "Motor")["Speed_rpm"].to_pylist() == [1.0]
    assert "motor.dbc: Motor (0x123) differs from Motor in other.dbc" in event.settings["databases"][0]
