"""Recordings as log files: BLF, ASC, and CSV as a data logger writes it.

BLF: CAN_MESSAGE objects (type 1) in deflated containers, as python-can reads them; made with array operations, so
that an hour and a half at 10 Hz takes a fraction of a second.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from plant.sensors import Block, Message, Recording

FILE_HEADER = struct.Struct("<4sLBBBBBBBBQQLL8H8H")
HEADER_BYTES = 144
CONTAINER_HEADER = struct.Struct("<4sHHLLH6xL4x")
CONTAINER_BYTES = 128 * 1024
OBJECT = np.dtype(
    [
        *(("magic", "S4"), ("header", "<u2"), ("version", "<u2"), ("size", "<u4"), ("type", "<u4")),
        *(("flags", "<u4"), ("client", "<u2"), ("object_version", "<u2"), ("stamp", "<u8")),
        *(("bus", "<u2"), ("direction", "u1"), ("dlc", "u1"), ("id", "<u4"), ("data", "V8")),
    ]
)
NANOSECONDS = 2  # flag of an object's stamp


def frames(recording: Recording) -> tuple[NDArray[np.int64], NDArray[np.void]]:
    """Stamps [ns] and objects of all messages, in the order of time."""
    parts = []
    for block in recording.blocks:
        objects = np.zeros(block.t_ns.size, OBJECT)
        objects["bus"], objects["id"], objects["dlc"] = block.message.bus, block.message.identifier, 8
        objects["data"] = _payload(block)
        parts.append(objects)
    stamps = np.concatenate([block.t_ns for block in recording.blocks])
    order = np.argsort(stamps, kind="stable")
    return stamps[order], np.concatenate(parts)[order]


def _payload(block: Block) -> NDArray[np.void]:
    """The payload of each frame, four signed 16-bit values; absent ones are zero."""
    message = block.message
    raw = np.zeros((block.t_ns.size, 4), ">i2" if message.motorola else "<i2")
    factors = np.array([factor for _, _, factor in message.signals])
    raw[:, : len(factors)] = np.round(block.values / factors)
    return raw.view("V8")[:, 0]


def write_blf(path: Path, recording: Recording) -> None:
    """Write a recording as BLF."""
    stamps, objects = frames(recording)
    begin = int(stamps[0]) // 10**6 * 10**6  # the header has milliseconds
    objects["magic"], objects["header"], objects["version"] = b"LOBJ", 32, 1
    objects["size"], objects["type"], objects["flags"] = OBJECT.itemsize, 1, NANOSECONDS
    objects["stamp"] = stamps - begin
    stream = objects.tobytes()
    body, unpacked = [], HEADER_BYTES
    for at in range(0, len(stream), CONTAINER_BYTES):
        piece = stream[at : at + CONTAINER_BYTES]
        packed = zlib.compress(piece, 6)
        head = CONTAINER_HEADER.pack(b"LOBJ", 16, 1, CONTAINER_HEADER.size + len(packed), 10, 2, len(piece))
        body.append(head + packed + bytes(len(packed) % 4))
        unpacked += CONTAINER_HEADER.size + len(piece)
    size = HEADER_BYTES + sum(map(len, body))
    times = (*_system_time(begin), *_system_time(int(stamps[-1])))
    header = FILE_HEADER.pack(b"LOGG", HEADER_BYTES, 5, 0, 0, 0, 2, 6, 8, 1, size, unpacked, len(stamps), 0, *times)
    path.write_bytes(header.ljust(HEADER_BYTES, b"\0") + b"".join(body))


def _system_time(ns: int) -> tuple[int, ...]:
    t = datetime.fromtimestamp(ns // 10**6 / 1000, UTC)
    return (t.year, t.month, t.isoweekday() % 7, t.day, t.hour, t.minute, t.second, round(t.microsecond / 1000))


def write_asc(path: Path, recording: Recording) -> None:
    """Write a recording as ASC."""
    stamps, objects = frames(recording)
    begin = int(stamps[0]) // 10**6 * 10**6
    t = datetime.fromtimestamp(begin / 1e9, UTC)
    when = f"{t:%a %b %d %I:%M:%S}.{t.microsecond // 1000:03d} {'am' if t.hour < 12 else 'pm'} {t.year}"
    lines = [f"date {when}", "base hex  timestamps absolute", "internal events logged", f"Begin Triggerblock {when}"]
    for stamp, frame in zip((stamps - begin).tolist(), objects, strict=True):
        data = bytes(frame["data"]).hex(" ").upper()
        lines.append(f"{stamp / 1e9:12.6f} {frame['bus']}  {frame['id']:X}             Rx   d 8 {data}")
    path.write_text("\n".join([*lines, "End TriggerBlock", ""]), encoding="ascii")


def write_csv(path: Path, recording: Recording, german: bool = False) -> None:
    """A table with a row of units and one row each 0.5 s: what each signal said last; German: `;`, decimal comma,
    day.month.year."""
    end = min(int(block.t_ns[-1]) for block in recording.blocks)
    begin = max(int(block.t_ns[0]) for block in recording.blocks)
    rows = np.arange(begin, end, 500_000_000)
    header, units, columns = ["Time"], [""], [_stamps(rows, german)]
    for block in recording.blocks:
        place = np.searchsorted(block.t_ns, rows, side="right") - 1
        for k, (name, unit, factor) in enumerate(block.message.signals):
            digits = max(0, -int(np.floor(np.log10(factor) + 1e-9)))
            header.append(name)
            units.append(unit)
            columns.append([f"{value:.{digits}f}" for value in block.values[place, k].tolist()])
    delimiter = ";" if german else ","
    text = "\n".join(
        [
            delimiter.join(header),
            delimiter.join(units),
            *(delimiter.join(row) for row in zip(*columns, strict=True)),
            "",
        ]
    )
    if german:
        names, units_row, table = text.split("\n", 2)
        text = "\n".join([names, units_row, _decimal_commas(table)])
    path.write_text(text, encoding="cp1252")


def _stamps(rows: NDArray[np.int64], german: bool) -> list[str]:
    form = "%d.%m.%Y %H:%M:%S" if german else "%Y-%m-%dT%H:%M:%S"
    return [
        f"{datetime.fromtimestamp(ns // 10**9, UTC):{form}}.{ns % 10**9 // 10**6:03d}" + ("" if german else "Z")
        for ns in rows.tolist()
    ]


def _decimal_commas(table: str) -> str:
    """Decimal points of the values, not those of the stamps."""
    lines = []
    for line in table.split("\n"):
        stamp, _, values = line.partition(";")
        lines.append(
            stamp.rpartition(".")[0] + "," + stamp.rpartition(".")[2] + ";" + values.replace(".", ",")
            if values
            else line
        )
    return "\n".join(lines)


def dbc(messages: tuple[Message, ...]) -> str:
    """The signal database of the bench: four signed 16-bit signals in each frame."""
    lines = ['VERSION ""', "NS_ :", "BS_:", "BU_: Bench"]
    for message in messages:
        lines.append(f"BO_ {message.identifier} {message.name}: 8 Bench")
        for k, (name, unit, factor) in enumerate(message.signals):
            at, order = (16 * k + 7, 0) if message.motorola else (16 * k, 1)
            low, high = -32768 * factor, 32767 * factor
            lines.append(f' SG_ {name} : {at}|16@{order}- ({factor:g},0) [{low:g}|{high:g}] "{unit}" Vector__XXX')
    return "\n".join([*lines, ""])


WRITERS: Mapping[str, tuple[str, Callable[[Path, Recording], None]]] = {
    "blf": ("{name}.blf", write_blf),
    "asc": ("{name}.asc", write_asc),
    "csv": ("{name}.csv", write_csv),
    "csv_de": ("{name}.csv", lambda path, recording: write_csv(path, recording, german=True)),
}
