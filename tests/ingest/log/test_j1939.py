"""J1939: messages by their group, of several packets, and values without a number, against what was sent."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ingest.bench.bench_file import read_bench
from ingest.bench.resolving import resolve
from ingest.facts.events import DecodeCompleted
from ingest.formats import EXTENDED
from ingest.intake.setup import signals_in
from ingest.log import samples
from ingest.log.databases import Database, load
from ingest.log.decode import RECORDING, decode_file
from ingest.log.j1939 import explained, findings
from ingest.log.parameter_groups import BROKEN, group_of, identifier
from ingest.log.reading import Reader

DBC = """VERSION ""

NS_ :

BS_:

BU_: BENCH

BO_ 2364540158 EEC1: 8 BENCH
 SG_ EngineSpeed : 24|16@1+ (0.125,0) [0|8031] "rpm" BENCH
 SG_ State : 0|2@1+ (1,0) [0|3] "" BENCH

BO_ 2566839294 Long: 10 BENCH
 SG_ Early : 0|8@1+ (1,0) [0|250] "" BENCH
 SG_ Late : 64|16@1+ (1,0) [0|64255] "" BENCH

BO_ 291 Plain: 8 BENCH
 SG_ All : 0|8@1+ (1,0) [0|255] "" BENCH

BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "J1939PG";
BA_ "VFrameFormat" BO_ 2364540158 3;
BA_ "VFrameFormat" BO_ 2566839294 3;
BA_ "VFrameFormat" BO_ 291 0;
"""
EEC1 = 2364540158
LONG = group_of(2566839294)
DATABASE = load(DBC.encode(), "truck.dbc")
Sent = tuple[float, int, bytes]  # seconds, 29-bit identifier, payload


def decoded(
    folder: Path, sent: list[Sent], bench: str | None = None, database: Database = DATABASE
) -> tuple[DecodeCompleted, dict[str, list[Any]]]:
    """The decode of frames, and the columns of its groups: "group.column" -> values."""
    path = folder / "log"
    lines = (
        f"({1_700_000_000 + t:.6f}) can1 {can_id:0{8 if can_id > 0x7FF else 3}X}#{data.hex()}"
        for t, can_id, data in sent
    )
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    with closing(Reader()) as reader:
        reading = reader.record(path, folder / RECORDING)
    said = read_bench(bench.encode(), "bench.toml") if bench else None
    channels = resolve(said, signals_in([database], [reading])) if said else []
    event = decode_file(reading, "ab" * 32, [database], said, channels, folder)
    found: dict[str, list[Any]] = {}
    for group in event.groups:
        table = samples.read(folder / group["file"])
        found |= {
            f"{group['name']}.{name}": table[name].to_pylist()
            for name in table.column_names
            if name in group["columns"]
        }
    assert event.balance["found"] == len(sent) == sum(event.balance.values()) - event.balance["found"]
    return event, found


def speed(rpm: float, state: int = 0) -> bytes:
    return bytes([0xFC | state, 0, 0]) + int(rpm * 8).to_bytes(2, "little") + bytes(3)


def packets(payload: bytes, source: int = 0x21, at: float = 0.0, target: int = 0xFF) -> list[Sent]:
    """A message to all, or with what the receiver answers."""
    count, group = -(-len(payload) // 7), LONG.to_bytes(3, "little")
    manage = 0x18EC0000 | target << 8 | source
    announced = (
        bytes([32 if target == 0xFF else 16]) + len(payload).to_bytes(2, "little") + bytes([count, 0xFF]) + group
    )
    frames = [(at, manage, announced)]
    back = 0x18EC0000 | source << 8 | target
    if target != 0xFF:
        frames.append((at + 0.01, back, bytes([17, count, 1, 0xFF, 0xFF]) + group))
    for i in range(count):
        data = payload[7 * i : 7 * i + 7].ljust(7, b"\xff")
        frames.append((at + 0.05 * (i + 1), 0x18EB0000 | target << 8 | source, bytes([i + 1]) + data))
    if target != 0xFF:
        size = len(payload).to_bytes(2, "little")
        frames.append((at + 0.9, back, bytes([19]) + size + bytes([count, 0xFF]) + group))
    return frames


PAYLOAD = bytes([7, 0, 0, 0, 0, 0, 0, 0]) + (1234).to_bytes(2, "little")


def test_a_message_is_known_by_its_group_whatever_priority_and_sender(tmp_path: Path) -> None:
    sent = [(0.0, 0x0CF00400, speed(1000)), (0.1, 0x18F00400, speed(1200)), (0.2, 0x0CF00500, speed(1))]
    event, columns = decoded(tmp_path, sent)
    assert columns["EEC1.EngineSpeed_rpm"] == [1000, 1200]
    assert event.balance == {"found": 3, "decoded": 2, "unknown_id": 1, "wrong_length": 0, "rejected": 0}
    assert event.unknown_ids == {"can1:0x0CF00500": 1}


def test_what_several_addresses_send_is_a_message_of_each(tmp_path: Path) -> None:
    bench = (
        'schema = "whyhot.bench/1"\n[[channel]]\nsignal = "EEC1_SA03.EngineSpeed"\nquantity = "speed"\nunit = "rpm"\n'
    )
    event, columns = decoded(tmp_path, [(0.0, 0x0CF00400, speed(1000)), (0.1, 0x0CF00403, speed(50))], bench)
    assert columns["EEC1_SA00.EngineSpeed_rpm"] == [1000]
    assert columns["EEC1_SA03.EngineSpeed_rpm"] == [50]
    assert [one["group"] for one in event.channels if one["role"] == "input"] == ["EEC1_SA03"]


def test_an_identifier_of_a_database_that_is_no_j1939_means_just_that() -> None:
    """A source address of 0xFE says that a message is one of J1939, as its format does."""
    assert DATABASE.messages[EEC1].is_j1939 and not DATABASE.messages[0x123].is_j1939
    extended = DBC.replace("BO_ 2364540158 3;", "BO_ 2364540158 1;")
    assert load(extended.encode(), "x").messages[EEC1].is_j1939
    exact = load(extended.replace("2364540158", str(EEC1 & ~0xFF)).encode(), "x").messages
    assert not exact[EEC1 & ~0xFF].is_j1939
    assert not explained(exact, {EEC1 & ~0xFF | 3}).knows(EEC1 & ~0xFF | 3)


@pytest.mark.parametrize("attribute", ['BA_ "ProtocolType" "J1939";', 'BA_DEF_DEF_ "ProtocolType" "J1939";'])
def test_a_database_may_say_that_all_of_it_is_j1939(attribute: str) -> None:
    text = (
        DBC[: DBC.index("BA_DEF_")].replace("2364540158", "2364539904")
        + f'BA_DEF_ "ProtocolType" STRING ;\n{attribute}\n'
    )
    database = load(text.encode(), "x.dbc")
    assert database.messages[0x8CF00400].is_j1939
    assert not database.messages[0x123].is_j1939


@pytest.mark.parametrize("target", [0xFF, 0x42])
def test_a_message_of_several_packets_is_put_together(target: int, tmp_path: Path) -> None:
    sent = packets(PAYLOAD, target=target)
    event, columns = decoded(tmp_path, sent)
    assert (columns["Long.Early"], columns["Long.Late"]) == ([7], [1234])
    assert event.balance["decoded"] == len(sent)
    table = samples.read(tmp_path / event.groups[0]["file"])
    assert table["t_ns"].to_pylist() == [1_700_000_000_100_000_000], "at the time of its last packet"


def test_messages_of_two_senders_may_come_one_among_the_other(tmp_path: Path) -> None:
    other = PAYLOAD[:8] + (77).to_bytes(2, "little")
    sent = sorted(packets(PAYLOAD) + packets(other, source=0x33, at=0.01))
    _, columns = decoded(tmp_path, sent)
    assert columns["Long_SA21.Late"] == [1234] and columns["Long_SA33.Late"] == [77]


def test_a_derived_channel_may_need_a_message_of_several_packets(tmp_path: Path) -> None:
    bench = """schema = "whyhot.bench/1"
[[channel]]
signal = "EngineSpeed"
quantity = "speed"
unit = "rpm"
[[derived]]
name = "sum"
quantity = "speed"
unit = "rpm"
expression = "EngineSpeed + Late"
"""
    _, columns = decoded(tmp_path, [*packets(PAYLOAD), (1.0, 0x0CF00400, speed(1000))], bench)
    assert columns["EEC1.sum_rpm"] == [2234]


def test_packets_sent_again_are_taken_once(tmp_path: Path) -> None:
    sent = packets(PAYLOAD, target=0x42)
    announce, go, first, second, received = sent
    again = (0.12, go[1], bytes([17, 1, 2, 0xFF, 0xFF]) + LONG.to_bytes(3, "little"))
    repeated = (0.15, second[1], second[2])
    event, columns = decoded(tmp_path, [announce, go, first, again, repeated, received])
    assert columns["Long.Late"] == [1234] and event.balance["decoded"] == 6


@pytest.mark.parametrize(
    ("lost", "rejected"),
    [([0], 2), ([1], 2), ([2], 2)],
    ids=["announcement", "first packet", "last packet"],
)
def test_a_message_that_is_not_whole_is_counted_and_never_mixed(lost: list[int], rejected: int, tmp_path: Path) -> None:
    sent = packets(PAYLOAD)
    cut = [one for i, one in enumerate(sent) if i not in lost]
    event, columns = decoded(tmp_path, [*cut, *packets(PAYLOAD, at=0.5)])
    assert columns["Long.Late"] == [1234]
    assert event.balance["rejected"] == rejected
    assert event.settings["rejected"] == {BROKEN: rejected}
    assert event.outcome == "decoded", "the bus's way, no damage of the log"
    (flag,) = (one for one in findings("log", event.settings) if one.flag == "packets_lost")
    assert flag.says == f"log: {rejected} frames: each a {BROKEN}"


def test_a_message_that_pauses_too_long_is_not_whole(tmp_path: Path) -> None:
    sent = packets(PAYLOAD)
    late = [*sent[:2], (sent[2][0] + 2, *sent[2][1:])]
    event, _ = decoded(tmp_path, late)
    assert (event.balance["decoded"], event.balance["rejected"]) == (0, 3)


def test_packets_of_a_group_that_nobody_knows_are_unknown(tmp_path: Path) -> None:
    sent = [
        (t, can_id, data[:5] + bytes([0, 0xEE, 0]) if can_id >> 16 & 0xFF == 0xEC else data)
        for t, can_id, data in packets(PAYLOAD)
    ]
    event, _ = decoded(tmp_path, sent)
    assert event.unknown_ids == {"can1:0x18EEFF21": 3}


def test_a_message_shorter_than_the_database_says_has_the_wrong_length(tmp_path: Path) -> None:
    event, _ = decoded(tmp_path, packets(PAYLOAD[:9]))
    assert event.balance["wrong_length"] == 3
    assert list(event.settings["wrong_length"].values()) == [3]


def test_values_that_say_that_there_is_none_are_missing_and_counted(tmp_path: Path) -> None:
    """A speed of 0xFExx is an error, 0xFFxx not available; a state has 2 and 3. Others than J1939 are numbers."""
    raw = [
        bytes([state, 0, 0, low, high, 0, 0, 0])
        for state, low, high in ((0, 0, 0xFA), (2, 0x12, 0xFE), (3, 0x34, 0xFF))
    ]
    sent = [(0.1 * i, 0x0CF00400, data) for i, data in enumerate(raw)] + [(1.0, 0x123, b"\xff" * 8)]
    event, columns = decoded(tmp_path, sent)
    nan = float("nan")
    assert np.array_equal(columns["EEC1.EngineSpeed_rpm"], [8000, nan, nan], equal_nan=True)
    assert np.array_equal(columns["EEC1.State"], [0, nan, nan], equal_nan=True)
    assert columns["Plain.All"] == [255]
    assert event.settings["errors"] == event.settings["not_available"] == {"EEC1.EngineSpeed": 1, "EEC1.State": 1}
    assert [one.says for one in findings("log", event.settings)] == [
        'log: 2 values of EEC1.EngineSpeed and 1 more signals say "not available" in place of a number: missing',
        'log: 2 values of EEC1.EngineSpeed and 1 more signals say "error" in place of a number: missing',
    ]


@pytest.mark.parametrize(
    ("can_id", "group"), [(0x18FEF121, 0xFEF1), (0x0CF00400, 0xF004), (0x18EA2100, 0xEA00), (0x19F00400, 0x1F004)]
)
def test_a_group_has_no_receiver(can_id: int, group: int) -> None:
    assert group_of(can_id | int(EXTENDED)) == group
    assert group_of(identifier(group, 5)) == group
