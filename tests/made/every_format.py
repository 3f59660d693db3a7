"""One temperature, `TC_winding`, as a log of every format: written by other libraries, or laid out by hand.

A log of frames has it in message 512 of `can_bench.DBC`, a table in a column of this name.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import can
import numpy as np
import pyarrow as pa
from mcap.writer import Writer
from scipy.io import savemat

from made import mdf, mdf3, mf4
from made.can_bench import START
from made.frames import write as write_messages

Record = tuple[float, float]  # seconds since START, temperature in steps of 0.01 [degC]
NAME = "TC_winding"
LIBRARIES = {"tdms": "nptdms", "xlsx": "python_calamine"}  # which read the formats that are an extra
SECONDS_1904 = 2_082_844_800  # from the beginning of LabVIEW's count to 1970


def stamp_ns(t_s: float) -> int:
    """Nanoseconds UTC."""
    return round((START + t_s) * 1e6) * 1000


def raw(value: float) -> int:
    """As the bus says it."""
    return round(100 * value)


def payload(value: float) -> bytes:
    return raw(value).to_bytes(2, "little") + bytes(6)


def utc(t_s: float) -> datetime:
    return datetime.fromtimestamp(START + t_s, UTC)


def by_python_can(writer: Callable[[Path], can.Listener]) -> Callable[[Path, Sequence[Record]], None]:
    def write(path: Path, records: Sequence[Record]) -> None:
        write_messages(writer(path), messages(records))

    return write


def messages(records: Sequence[Record]) -> Iterator[can.Message]:
    for t_s, value in records:
        yield can.Message(
            timestamp=START + t_s, arbitration_id=512, is_extended_id=False, data=payload(value), channel=0
        )


def write_gvret(path: Path, records: Sequence[Record]) -> None:
    rows = (f"{stamp_ns(t_s) // 1000},00000200,false,Rx,0,8,{payload(v).hex(',')},\n" for t_s, v in records)
    path.write_text("Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n" + "".join(rows))


def write_css_csv(path: Path, records: Sequence[Record]) -> None:
    rows = (f"{START + t_s:.6f};1;200;0;8;8;0;0;0;{payload(value).hex()}\n" for t_s, value in records)
    path.write_text("TimestampEpoch;BusChannel;ID;IDE;DLC;DataLength;Dir;EDL;BRS;DataBytes\n" + "".join(rows))


def write_busmaster(path: Path, records: Sequence[Record]) -> None:
    head = f"***BUSMASTER Ver 3.2.2***\n***START DATE AND TIME {utc(0):%d:%m:%Y %H:%M:%S}:0***\n***HEX***\n"
    times = ((divmod(round(t_s * 1e4), 10_000), value) for t_s, value in records)
    rows = (
        f"{s // 3600}:{s // 60 % 60:02d}:{s % 60:02d}:{part:04d} Rx 1 0x200 s 8 {payload(value).hex(' ')}\n"
        for (s, part), value in times
    )
    path.write_text(head + "***ABSOLUTE MODE***\n" + "".join(rows))


def write_mf4(path: Path, records: Sequence[Record]) -> None:
    """With stamps of 64 bits, as 32 hold microseconds for an hour."""
    file = mf4.Mf4()
    wide: list[mf4.Part] = [("Timestamp", mf4.TIME, 0, 0, 64)]
    wide += [(name, kind, at + 4, bit, bits) for name, kind, at, bit, bits in (*mf4.PARTS[1:], mf4.IN_RECORD)]
    stored = b"".join(
        struct.pack("<Q", round(t_s * 1e6)) + mf4.record(0, 512, payload(value))[4:] for t_s, value in records
    )
    group = file.group(wide, len(records), size=mf4.SIZE + 4)
    file.save(path, file.data_group(group, file.block(b"DT", (), stored)), start_ns=stamp_ns(0))


def write_mdf(path: Path, records: Sequence[Record]) -> None:
    file = mdf.Mdf4()
    channel = mdf.Channel(NAME, mdf.SIGNED, 8, 16, unit="degC", law=file.linear(0.0, 0.01))
    stored = b"".join(struct.pack("<dh", t_s, raw(value)) for t_s, value in records)
    file.save(path, file.stored("bench", (mdf.SECONDS, channel), stored, 10), start_ns=stamp_ns(0))


def write_mdf3(path: Path, records: Sequence[Record]) -> None:
    file = mdf3.Mdf3File()
    law = file.law(0, 2, file.numbers(0.0, 0.01), "degC")
    channel = mdf3.Channel3(NAME, mdf3.SIGNED, 64, 16, law=law)
    stored = b"".join(struct.pack("<dh", t_s, raw(value)) for t_s, value in records)
    group = file.group("bench", (mdf3.SECONDS, channel), len(records), 10)
    file.save(path, file.data_group(group, stored), start=(stamp_ns(0), 0))


def write_csv(path: Path, records: Sequence[Record]) -> None:
    lines = [f"{START + t_s:.3f},{value:.2f}\n" for t_s, value in records]
    path.write_text(f"epoch_s,{NAME}\n" + "".join(lines), encoding="utf-8")


def write_twincat(path: Path, records: Sequence[Record]) -> None:
    """Milliseconds since a start that Windows counts from 1601."""
    ticks = stamp_ns(0) // 100 + 116_444_736_000_000_000
    head = (
        f"Name\tYT Scope Project\nFile\tC:\\night.csv\nStarttime of export\t{ticks}\nEndtime of export\t{ticks}\n\n\n"
    )
    rows = (f"{1000 * t_s:.3f}\t{value:.2f}\n" for t_s, value in records)
    path.write_text(f"{head}Name\t{NAME}\nUnit\tdegC (Temperature)\n\n" + "".join(rows))


def write_jsonl(path: Path, records: Sequence[Record]) -> None:
    rows = (json.dumps({"ts": stamp_ns(t_s) // 1_000_000, NAME: round(value, 2), "ok": True}) for t_s, value in records)
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def write_lvm(path: Path, records: Sequence[Record]) -> None:
    tags = {"Writer_Version": 2, "Separator": "Tab", "Decimal_Separator": ".", "Multi_Headings": "No"}
    tags |= {"X_Columns": "One", "Time_Pref": "Absolute", "Date": f"{utc(0):%Y/%m/%d}", "Time": f"{utc(0):%H:%M:%S}"}
    head = "LabVIEW Measurement\t\n" + "".join(f"{tag}\t{value}\n" for tag, value in tags.items())
    segment = f"Channels\t1\nX_Dimension\tTime\nX0\t0.0\nDelta_X\t0.5\n***End_of_Header***\nX_Value\t{NAME}\tComment\n"
    rows = (f"{START + SECONDS_1904 + t_s:.6f}\t{value:.2f}\n" for t_s, value in records)
    path.write_text(f"{head}***End_of_Header***\n\n{segment}" + "".join(rows))


def write_xlsx(path: Path, records: Sequence[Record]) -> None:
    import openpyxl

    book = openpyxl.Workbook()
    for row in [["time", NAME], *([utc(t_s).replace(tzinfo=None), value] for t_s, value in records)]:
        book.active.append(row)
    book.save(path)


def write_tdms(path: Path, records: Sequence[Record]) -> None:
    from nptdms import ChannelObject, TdmsWriter

    stamps = np.array([stamp_ns(t_s) // 1000 for t_s, _ in records], "M8[us]")
    values = np.array([value for _, value in records])
    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("bench", "Time", stamps), ChannelObject("bench", NAME, values)])


def write_mat(path: Path, records: Sequence[Record]) -> None:
    """As `save` of MATLAB writes two vectors of a struct: seconds since 1970 and values."""
    t_s, values = np.array(records).T
    savemat(path, {"bench": {"time": START + t_s, NAME: values}}, do_compression=True)


def table(records: Sequence[Record]) -> pa.Table:
    stamps = pa.array([stamp_ns(t_s) for t_s, _ in records]).cast(pa.timestamp("ns", "UTC"))
    return pa.table({"time": stamps, NAME: [value for _, value in records]})


def write_parquet(path: Path, records: Sequence[Record]) -> None:
    import pyarrow.parquet as pq

    pq.write_table(table(records), path)


def write_arrow(path: Path, records: Sequence[Record]) -> None:
    from pyarrow import feather

    feather.write_feather(table(records), path)


def write_mcap(path: Path, records: Sequence[Record]) -> None:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("test", "test")
        channel: Any = writer.register_channel(NAME, "json", 0)
        for t_s, value in records:
            writer.add_message(channel, stamp_ns(t_s), json.dumps(value).encode(), publish_time=stamp_ns(t_s))
        writer.finish()  # type: ignore[no-untyped-call]


def write_atfx(path: Path, records: Sequence[Record]) -> None:
    """A model in German, as any may call its elements what it likes."""
    model: tuple[tuple[str, str, dict[str, str], dict[str, str]], ...] = (
        ("Messung", "AoMeasurement", {"Id": "id", "Beginn": "measurement_begin"}, {}),
        ("Groesse", "AoMeasurementQuantity", {"Id": "id", "Name": "name"}, {"Einheit": "unit"}),
        ("Matrix", "AoSubmatrix", {"Id": "id", "Name": "name"}, {"Messung": "measurement", "Spalten": "local_columns"}),
        ("Einheit", "AoUnit", {"Id": "id", "Name": "name"}, {}),
        (
            "Spalte",
            "AoLocalColumn",
            {"Id": "id", "Frei": "independent", "Art": "sequence_representation", "Werte": "values", "Gut": "flags"},
            {"Groesse": "measurement_quantity"},
        ),
    )
    elements = "".join(
        f"<application_element><name>{name}</name><basetype>{kind}</basetype>"
        + "".join(
            f"<application_attribute><name>{a}</name><base_attribute>{b}</base_attribute></application_attribute>"
            for a, b in attributes.items()
        )
        + "".join(
            f"<relation_attribute><name>{a}</name><base_relation>{b}</base_relation></relation_attribute>"
            for a, b in relations.items()
        )
        + "</application_element>\n"
        for name, kind, attributes, relations in model
    )
    columns = (
        ("t", 8, 1, [f"{t_s:.6f}" for t_s, _ in records]),
        (NAME, 9, 0, [f"{value:.2f}" for _, value in records]),
    )
    spans = "".join(
        f"<Groesse><Id>{key}</Id><Name>{name}</Name><Einheit>{key}</Einheit></Groesse>"
        f"<Spalte><Id>{key}</Id><Frei>{free}</Frei><Art>explicit</Art><Groesse>{key}</Groesse>"
        f"<Werte><A_FLOAT64>{' '.join(values)}</A_FLOAT64></Werte></Spalte>\n"
        for name, key, free, values in columns
    )
    path.write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n<atfx_file version="atfx_file: V1.3.0" '
        f'xmlns="http://www.asam.net/ODS/5.3.0/Schema">\n<application_model>{elements}</application_model>\n'
        f"<instance_data><Messung><Id>1</Id><Beginn>{utc(0):%Y%m%d%H%M%S%f}</Beginn></Messung>"
        "<Einheit><Id>8</Id><Name>s</Name></Einheit><Einheit><Id>9</Id><Name>degC</Name></Einheit>"
        "<Matrix><Id>2</Id><Name>bench</Name><Messung>1</Messung><Spalten>8 9</Spalten></Matrix>\n"
        f"{spans}</instance_data></atfx_file>\n",
        encoding="utf-8",
    )


WRITERS: dict[str, Callable[[Path, Sequence[Record]], None]] = {
    "blf": by_python_can(can.BLFWriter),
    "asc": by_python_can(can.ASCWriter),
    "trc": by_python_can(can.TRCWriter),
    "candump": by_python_can(can.CanutilsLogWriter),
    "gvret": write_gvret,
    "can_csv": by_python_can(can.CSVWriter),
    "css_csv": write_css_csv,
    "busmaster": write_busmaster,
    "mf4": write_mf4,
    "mdf": write_mdf,
    "mdf3": write_mdf3,
    "can_db": by_python_can(can.SqliteWriter),
    "tdms": write_tdms,
    "mat": write_mat,
    "parquet": write_parquet,
    "arrow": write_arrow,
    "mcap": write_mcap,
    "lvm": write_lvm,
    "twincat": write_twincat,
    "atfx": write_atfx,
    "xlsx": write_xlsx,
    "jsonl": write_jsonl,
    "csv": write_csv,
}


def can_be_read() -> list[str]:
    """The names of `WRITERS` but for those of an extra that is not installed."""
    return [name for name in WRITERS if name not in LIBRARIES or find_spec(LIBRARIES[name])]
