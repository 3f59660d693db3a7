"""A record of a log is found again where it stands in the file's own bytes."""

from __future__ import annotations

import gzip
import io
import re
import sqlite3
import struct
import zlib
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Chunk
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import CompressionType, Writer

from ingest.errors import DamageError
from ingest.facts import facts
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.formats import Frames, Log, Rows, open_log
from ingest.intake.intake import take_in
from ingest.intake.located import Located, locate
from ingest.intake.setup import MotorFile, prepare
from made.mdf import FLOAT, SECONDS, Channel, Mdf4
from made.mdf3 import DOUBLE, Channel3, Mdf3File
from made.mdf3 import SECONDS as SECONDS3
from made.places import LOGS, on_disk

ALL = range(100)


def read(name: str) -> tuple[Log, dict[int, str]]:
    """A sample read with the places of all records noted, and the payload of each frame in hexadecimal."""
    log = open_log(LOGS / f"sample.{name}")
    log.sought = ALL
    payloads = {}
    for batch in log.batches():
        if isinstance(batch, Frames):
            for i, record in enumerate(batch.record.tolist()):
                payloads[record] = batch.data[batch.offsets[i] : batch.offsets[i + 1]].tobytes().hex()
    return log, payloads


def test_at_the_byte_that_is_told_of_a_packed_log_stands_the_frame() -> None:
    log, payloads = read("blf")
    data, whole = log.path.read_bytes(), 0
    for record, payload in payloads.items():
        place = re.fullmatch(r"byte ([0-9,]+), unpacked \+([0-9,]+)", log.places[record])
        assert place
        at, inside = (int(number.replace(",", "")) for number in place.groups())
        assert data[at : at + 4] == b"LOBJ", "an outer object of the file"
        unpacked = zlib.decompressobj().decompress(data[at + 32 :])
        assert unpacked[inside : inside + 4] == b"LOBJ", "the frame's own object in it"
        size = int.from_bytes(unpacked[inside + 8 : inside + 12], "little")
        if inside + size <= len(unpacked):  # one goes on in the next outer object
            assert bytes.fromhex(payload) in unpacked[inside : inside + size]
            whole += 1
    assert whole > 2


LINE = re.compile(r"line ([0-9,]+)(?:, (byte |unpacked \+)([0-9,]+))?")
BYTE = re.compile(r"(?:(\w[^:]*): )?byte ([0-9,]+)(?:, unpacked \+([0-9,]+))?")


def number(text: str) -> int:
    return int(text.replace(",", ""))


@pytest.mark.parametrize("name", ["asc", "candump", "trc", "gvret", "can_csv", "css_csv"])
def test_the_line_and_the_byte_that_are_told_of_a_text_hold_the_frame(name: str) -> None:
    log, payloads = read(name)
    data = log.path.read_bytes()
    for record, payload in payloads.items():
        place = LINE.fullmatch(log.places[record])
        assert place and place[2] == "byte "
        line = data[number(place[3]) :].splitlines()[0]
        assert line == data.splitlines()[number(place[1]) - 1]
        if name != "can_csv":  # which holds its bytes in base64
            assert payload.upper() in line.decode("latin-1").upper().replace(" ", "").replace(",", "")
    assert len(payloads) > 2


def test_the_byte_of_a_line_counts_in_the_file_or_in_what_it_unpacks_to(tmp_path: Path) -> None:
    data = (LOGS / "sample.asc").read_bytes()
    path, plain = tmp_path / "a.asc", dict(read("asc")[0].places)
    for packed, before in (
        (b"\xef\xbb\xbf" + data, 3),
        (gzip.compress(data), 0),
        (data.decode().encode("utf-16"), None),
    ):
        path.write_bytes(packed)
        log = open_log(path)
        log.sought = ALL
        assert sum(len(batch.record) for batch in log.batches()) == len(plain)
        for record, place in log.places.items():
            line, was = LINE.fullmatch(place), LINE.fullmatch(plain[record])
            assert line and was and line[1] == was[1]
            assert line[3] is None if before is None else number(line[3]) == number(was[3]) + before
            assert line[2] == ("unpacked +" if packed.startswith(b"\x1f\x8b") else None if before is None else "byte ")


def unpacked_mdf(data: bytes, at: int) -> bytes:
    """What the packed block of an MDF file at this byte holds."""
    assert data[at : at + 4] == b"##DZ"
    method, columns, packed = data[at + 26], *struct.unpack_from("<I8xQ", data, at + 28)
    plain = zlib.decompress(data[at + 48 : at + 48 + packed])
    lines = len(plain) // columns if method else 0
    turned = np.frombuffer(plain, np.uint8, lines * columns).reshape(columns, lines).T.tobytes() if method else b""
    return turned + plain[len(turned) :]


def mdf_bytes(path: Path, place: str) -> bytes:
    """The bytes of an MDF file that begin at a place."""
    found, data = BYTE.fullmatch(place), path.read_bytes()
    assert found
    return unpacked_mdf(data, number(found[2]))[number(found[3]) :] if found[3] else data[number(found[2]) :]


VALUES = [(0.0, 20.123), (0.5, 21.456), (1.0, -3.789), (1.5, 1e6 / 7)]
T = Channel("T", FLOAT, 8, 64)
T3 = Channel3("T", DOUBLE, 64, 64)


def in_pieces(path: Path, columns: int | None) -> Path:
    """Records in two blocks of a list; packed, by columns or not, where `columns` says so."""
    file = Mdf4()
    halves = [b"".join(struct.pack("<dd", *row) for row in some) for some in (VALUES[:2], VALUES[2:])]
    blocks = [file.block(b"DT", (), one) if columns is None else file.packed(one, columns) for one in halves]
    pieces = file.block(b"DL", (0, *blocks), struct.pack("<B3xIQQ", 0, 2, 0, 32))
    group = file.measured("fast", [SECONDS, T], 4, 16)
    return file.save(path, file.data_group(group, pieces))


def of_two_kinds(path: Path, columns: int | None) -> Path:
    """Records of two groups, one among the other."""
    file = Mdf4()
    one = file.measured("odd", [SECONDS, T], 2, 16, number=1)
    file.follows(one, file.measured("even", [SECONDS, T], 2, 16, number=2))
    content = b"".join(struct.pack("<Bdd", 1 + k % 2, *row) for k, row in enumerate(VALUES))
    at = file.block(b"DT", (), content) if columns is None else file.packed(content, columns)
    return file.save(path, file.data_group(one, at, id_size=1))


def of_version_3(path: Path, columns: int | None) -> Path:
    file = Mdf3File()
    ids = columns is not None
    group = file.group("fast", [SECONDS3, T3], 4, 16, number=1)
    content = b"".join(ids * b"\1" + struct.pack("<dd", *row) for row in VALUES)
    return file.save(path, file.data_group(group, content, int(ids)))


@pytest.mark.parametrize("columns", [None, 0, 16])
@pytest.mark.parametrize("make", [in_pieces, of_two_kinds, of_version_3], ids=lambda make: make.__name__)
def test_at_the_byte_that_is_told_of_an_mdf_record_stands_its_value(
    make: Callable[[Path, int | None], Path], columns: int | None, tmp_path: Path
) -> None:
    path = make(tmp_path / "a.mf4", columns)
    log = open_log(path)
    log.sought = [1, 3]
    assert sum(len(batch.record) for batch in log.batches()) == 4
    assert sorted(log.places) == [1, 3]
    for record in (1, 3):
        assert struct.pack("<dd", *VALUES[record]) == mdf_bytes(path, log.places[record])[:16]
    assert ("unpacked" in log.places[1]) == (columns is not None and make is not of_version_3)


def test_at_the_byte_that_is_told_of_a_frame_in_mf4_stands_its_record() -> None:
    log, payloads = read("mf4")
    places = {record: mdf_bytes(log.path, log.places[record]) for record in payloads}
    assert all(bytes.fromhex(payload) in places[record][:84] for record, payload in payloads.items())
    assert len({place[:84] for place in places.values()}) == len(payloads) > 2


def test_the_row_group_that_is_told_of_a_parquet_row_begins_there_and_holds_it(tmp_path: Path) -> None:
    values = np.array([20.123, 21.456, -3.789, 1e6 / 7, 42.5])
    stamps = pa.array(range(1_700_000_000, 1_700_000_005), pa.timestamp("s"))
    path = tmp_path / "a.parquet"
    table = pa.table({"T": values, "time": stamps})
    pq.write_table(table, path, row_group_size=3, compression="NONE", use_dictionary=False)
    log = open_log(path)
    log.sought = ALL
    assert sum(len(batch.record) for batch in log.batches()) == 5
    data = path.read_bytes()
    for record, value in enumerate(values):
        place = re.fullmatch(r"byte ([0-9,]+), row (\d) of row group (\d) there", log.places[record])
        assert place
        group = (values[:3], values[3:])[int(place[3]) - 1]
        assert group[int(place[2]) - 1] == value
        stored = group.tobytes()
        assert stored in data[number(place[1]) : number(place[1]) + len(stored) + 128], "behind the head of its page"


def test_the_segment_that_is_told_of_a_tdms_row_begins_there_and_holds_it(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    parts = [np.array([20.123, 21.456]), np.array([-3.789, 1e6 / 7, 42.5]), np.array([1.25])]
    path = tmp_path / "a.tdms"
    with nptdms.TdmsWriter(path) as writer:
        for part in parts:
            writer.write_segment([nptdms.ChannelObject("Oven", "T", part, {"wf_increment": 0.5})])
    log = open_log(path)
    log.sought = ALL
    assert sum(len(batch.record) for batch in log.batches()) == 6
    data = path.read_bytes()
    for record, value in enumerate(np.concatenate(parts)):
        place = re.fullmatch(r'byte ([0-9,]+), value (\d) of "T" in the segment there', log.places[record])
        assert place
        at = number(place[1])
        assert data[at : at + 4] == b"TDSm"
        (begin,) = struct.unpack_from("<Q", data, at + 20)
        assert struct.unpack_from("<d", data, at + 28 + begin + 8 * (int(place[2]) - 1)) == (value,)


@pytest.mark.parametrize("packed", [CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE])
@pytest.mark.parametrize("chunks", [True, False])
def test_at_the_byte_that_is_told_of_an_mcap_message_it_stands(
    packed: CompressionType, chunks: bool, tmp_path: Path
) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=100, compression=packed, use_chunking=chunks)
        writer.start()
        channel = writer.register_channel("/motor", "json", 0)
        for k in range(9):
            writer.add_message(channel, k, f'{{"T": {20.125 + k}}}'.encode(), k)
        writer.finish()  # type: ignore[no-untyped-call]
    log = open_log(path)
    log.sought = [0, 8]
    assert sum(len(batch.record) for batch in log.batches()) == 9
    for record in (0, 8):
        found, data = BYTE.fullmatch(log.places[record]), path.read_bytes()
        assert found and bool(found[3]) == chunks
        at = number(found[2])
        if chunks:
            (length,) = struct.unpack_from("<Q", data, at + 1)
            assert data[at] == Opcode.CHUNK
            chunk = Chunk.read(ReadDataStream(io.BytesIO(data[at + 9 : at + 9 + length])))
            data, at = get_chunk_data_stream(chunk)[0].read(chunk.uncompressed_size), number(found[3])
        (length,) = struct.unpack_from("<Q", data, at + 1)
        assert (data[at], data[at + 9 + 22 : at + 9 + length]) == (
            Opcode.MESSAGE,
            f'{{"T": {20.125 + record}}}'.encode(),
        )


@pytest.mark.parametrize(("name", "column"), [("csv", 1), ("lvm", 1)])
def test_the_line_and_the_byte_that_are_told_of_a_table_are_the_row(name: str, column: int) -> None:
    log = open_log(LOGS / f"sample.{name}")
    log.sought = ALL
    values: dict[int, float] = {}
    for batch in log.batches():
        assert isinstance(batch, Rows)
        first = next(own for own in batch.columns.values() if own.dtype == np.float64)
        values |= dict(zip(batch.record.tolist(), first.tolist(), strict=True))
    data = log.path.read_bytes()
    for record, value in values.items():
        place = LINE.fullmatch(log.places[record])
        assert place and place[2] == "byte "
        line = data[number(place[3]) :].splitlines()[0]
        assert line == data.splitlines()[number(place[1]) - 1]
        cell = re.split(rb"[\t;]", line)[column].strip(b'"').replace(b",", b".").decode()
        assert np.isnan(value) if cell in ("", "-") else float(cell) == value
    assert len(values) > 2


def test_the_row_that_is_told_of_a_workbook_is_the_row() -> None:
    calamine = pytest.importorskip("python_calamine")
    log = open_log(LOGS / "sample.xlsx")
    log.sought = ALL
    values: dict[int, float] = {}
    for batch in log.batches():
        assert isinstance(batch, Rows)
        values |= dict(zip(batch.record.tolist(), next(iter(batch.columns.values())).tolist(), strict=True))
    book = calamine.load_workbook(str(log.path))
    for record, value in values.items():
        place = re.fullmatch(r'row (\d+) of sheet "(.+)"', log.places[record])
        assert place
        row = book.get_sheet_by_name(place[2]).to_python(skip_empty_area=False)[int(place[1]) - 1]
        german = f"{value:.1f}".replace(".", ",")
        assert value in row or german in row or np.isnan(value)
    assert len(values) > 2


def test_the_rowid_that_is_told_of_a_database_is_that_of_the_frame(tmp_path: Path) -> None:
    path = tmp_path / "sample.db"
    path.write_bytes((LOGS / "sample.can_db").read_bytes())
    with closing(sqlite3.connect(path)) as database:
        (table,) = database.execute("SELECT name FROM sqlite_schema WHERE type = 'table'").fetchone()
        database.execute(f"DELETE FROM {table} WHERE rowid = 2")  # from here on the number of the record is another
        database.commit()
        log = open_log(path)
        log.sought = ALL
        found = 0
        for batch in log.batches():
            assert isinstance(batch, Frames)
            for i, record in enumerate(batch.record.tolist()):
                place = re.fullmatch(rf'rowid (\d+) of table "{table}"', log.places[record])
                assert place
                (data,) = database.execute(f"SELECT data FROM {table} WHERE rowid = {place[1]}").fetchone()
                assert (data or b"") == batch.data[batch.offsets[i] : batch.offsets[i + 1]].tobytes()
                found += int(place[1]) != record + 1
    assert found > 2


def test_the_record_batch_that_is_told_of_an_arrow_row_begins_there_and_holds_it(tmp_path: Path) -> None:
    parts = [np.array([20.123, 21.456]), np.array([-3.789, 1e6 / 7, 42.5])]
    schema = pa.schema([("time", pa.timestamp("s")), ("T", pa.float64())])
    for name, writer_of in (("a.arrow", pa.ipc.new_file), ("a.arrows", pa.ipc.new_stream)):
        with writer_of(tmp_path / name, schema) as writer:
            for k, part in enumerate(parts):
                stamps = pa.array(range(1_700_000_000 + 10 * k, 1_700_000_000 + 10 * k + len(part)), pa.timestamp("s"))
                writer.write_batch(pa.record_batch([stamps, part], schema=schema))
        log = open_log(tmp_path / name)
        log.sought = ALL
        assert sum(len(batch.record) for batch in log.batches()) == 5
        data = (tmp_path / name).read_bytes()
        for record, value in enumerate(np.concatenate(parts)):
            place = re.fullmatch(r"byte ([0-9,]+), row (\d) of record batch (\d) there", log.places[record])
            assert place
            part = parts[int(place[3]) - 1]
            assert part[int(place[2]) - 1] == value
            at = number(place[1])
            assert data[at : at + 4] == b"\xff\xff\xff\xff", "a message of Arrow's"
            assert part.tobytes() in data[at : at + 500]


@pytest.mark.parametrize("path", sorted(LOGS.iterdir()), ids=lambda path: path.suffix[1:])
def test_asking_for_places_changes_nothing_that_is_read(path: Path) -> None:
    plain, asked = open_log(path), open_log(path)
    asked.sought = ALL
    counts = [[len(batch.record) for batch in log.batches()] for log in (plain, asked)]
    assert counts[0] == counts[1]
    assert (plain.found, plain.settings, plain.places) == (asked.found, asked.settings, {})
    assert set(asked.places) <= set(range(plain.found))


def _no_motor(path: Path) -> MotorFile:
    raise AssertionError(f"{path} should not be read")


def test_a_record_is_read_from_sealed_bytes_and_damage_is_told(tmp_path: Path) -> None:
    log = tmp_path / "a.csv"
    log.write_text("time,T\n2026-01-01T08:00:00Z,20.5\n2026-01-01T08:00:10.5Z,bad\n2026-01-01T08:00:20.5Z,21.5\n" * 1)
    with Store.open(tmp_path / "s", create=True) as store:
        take_in(store, [log], prepare([log], None, [], _no_motor), Override())
        known = facts.at(store.ledger)
        (decode,) = known.decodes.values()
        log.unlink()
        first, bad, last = locate(store, known, decode, [2, 0, 1, 9])
        assert (first.where, first.holds, first.stamp(True)) == ("line 2, byte 7", "T 20.5", "2026-01-01 08:00:00")
        assert (bad.t_ns, bad.where, bad.stamp(True)) == (None, "line 3, column T", "rejected")
        assert bad.holds.startswith('text "bad" where numbers are: 32 30')
        assert (last.where, last.stamp(True)) == ("line 4, byte 60", "2026-01-01 08:00:20.5")
        sealed = on_disk(store.archive.path(decode.raw))
        sealed.chmod(0o644)
        sealed.write_bytes(b"other")
        with pytest.raises(DamageError, match=r"a\.csv: .*is damaged"):
            locate(store, known, decode, [0])


def test_a_stamp_without_absolute_time_is_in_seconds() -> None:
    assert Located(0, None, 1_500_000_000, "").stamp(False) == "1.5 s"
