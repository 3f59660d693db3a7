"""What every row of FORMATS keeps, unasked. A new format brings one file: `files/sample.` with its name."""

import gzip
import json
import pickle
import random
import re
import tracemalloc
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import (
    FORMATS,
    Format,
    Frames,
    Rejected,
    Rejections,
    open_log,
    recognise,
)
from ingest.formats._no_logs import NO_LOGS
from made.damaged import check_account, read, read_damaged, sample
from made.every_format import LIBRARIES
from made.places import LOGS


def with_its_library(entry: Format) -> Any:
    """The format as a case, left out where the extra is not installed that reads it."""
    missing = entry.name in LIBRARIES and find_spec(LIBRARIES[entry.name]) is None
    return pytest.param(entry, id=entry.name, marks=pytest.mark.skipif(missing, reason="its extra is not installed"))


each_format = pytest.mark.parametrize("entry", [with_its_library(entry) for entry in FORMATS])


@each_format
def test_each_record_of_the_sample_comes_out_once(entry: Format) -> None:
    assert sample(entry).exists(), f"a new format brings a small log: {sample(entry)}"
    log, batches = read(sample(entry))
    assert log.found > len(log.rejected) > 0  # a sample holds records of both kinds
    check_account(log, batches)


@each_format
def test_each_rejected_record_says_where_and_why(entry: Format) -> None:
    log, _ = read(sample(entry))
    for one in log.rejected:
        assert one.where and one.why and one.raw
        assert "\n" not in one.where + one.why


@each_format
def test_arrays_have_the_types_and_lengths_of_the_contract(entry: Format) -> None:
    for batch in read(sample(entry))[1]:
        count = len(batch.t_ns)
        assert count > 0
        assert [batch.t_ns.dtype.name, batch.record.dtype.name] == ["int64", "int64"]
        assert len(batch.record) == count
        if isinstance(batch, Frames):
            assert entry.holds == "frames"
            arrays = (batch.bus, batch.can_id, batch.flags, batch.offsets, batch.data)
            assert [array.dtype.name for array in arrays] == ["uint8", "uint32", "uint8", "int64", "uint8"]
            assert {len(batch.bus), len(batch.can_id), len(batch.flags), len(batch.offsets) - 1} == {count}
            assert batch.offsets[0] == 0 and batch.offsets[-1] == len(batch.data)
            assert (np.diff(batch.offsets) >= 0).all()
        else:
            assert entry.holds == "rows"
            assert all(
                values.dtype in (np.float64, object) and len(values) == count for values in batch.columns.values()
            )


@each_format
def test_settings_and_units_are_plain_json(entry: Format) -> None:
    log, _ = read(sample(entry))
    assert json.loads(json.dumps([log.settings, log.units])) == [log.settings, log.units]


@each_format
def test_a_log_read_twice_gives_the_same(entry: Format) -> None:
    (first, some), (second, others) = read(sample(entry)), read(sample(entry))
    assert (first.rejected, first.settings, first.cut) == (second.rejected, second.settings, second.cut)
    for one, other in zip(some, others, strict=True):
        np.testing.assert_array_equal(one.t_ns, other.t_ns)


@each_format
def test_an_empty_file_is_refused_with_what_to_do(entry: Format, tmp_path: Path) -> None:
    path = tmp_path / f"nothing.{entry.name}"
    path.touch()
    with pytest.raises(UnreadableLogError, match=r"is empty \(0 bytes\): nothing to read\. Copy the file again\."):
        open_log(path)


@each_format
def test_a_sample_cut_anywhere_is_read_or_refused(entry: Format, tmp_path: Path) -> None:
    whole = sample(entry).read_bytes()
    path = tmp_path / sample(entry).name
    for length in range(1, len(whole), max(1, len(whole) // 150)):
        path.write_bytes(whole[:length])
        read_damaged(path)


@each_format
def test_a_sample_with_bytes_changed_is_read_or_refused(entry: Format, tmp_path: Path) -> None:
    whole = sample(entry).read_bytes()
    path = tmp_path / sample(entry).name
    chance = random.Random(20)
    for _ in range(150):
        damaged = bytearray(whole)
        for _ in range(chance.choice((1, 1, 4))):
            damaged[chance.randrange(len(damaged))] = chance.choice((0, 10, 255, chance.randrange(256)))
        path.write_bytes(damaged)
        read_damaged(path)


@pytest.mark.parametrize(
    "entry", [one for one in FORMATS if any(name.endswith(".gz") for name in one.suffixes)], ids=lambda one: one.name
)
def test_a_packed_sample_that_is_damaged_at_its_beginning_is_read_or_refused(entry: Format, tmp_path: Path) -> None:
    whole = gzip.compress(sample(entry).read_bytes(), mtime=0)
    path = tmp_path / f"{sample(entry).name}.gz"
    for length in range(1, 40):
        path.write_bytes(whole[:length])
        read_damaged(path)
    for at in range(20):
        for octet in (0, 1, 4, 8, 16, 255):
            path.write_bytes(whole[:at] + bytes([octet]) + whole[at + 1 :])
            read_damaged(path)


@each_format
def test_a_file_of_random_bytes_is_read_or_refused(entry: Format, tmp_path: Path) -> None:
    path = tmp_path / f"noise.{entry.name}"
    for seed in range(10):
        path.write_bytes(entry.magic + random.Random(seed).randbytes(20_000))
        read_damaged(path)


def test_a_file_is_recognised_by_its_mark_before_its_name(tmp_path: Path) -> None:
    path = tmp_path / "renamed.csv"
    path.write_bytes((LOGS / "sample.blf").read_bytes())
    assert recognise(path).name == "blf"


def test_a_file_of_no_known_format_is_refused_with_those_that_are(tmp_path: Path) -> None:
    path = tmp_path / "noise.csv"
    path.write_bytes(random.Random(1).randbytes(100))
    with pytest.raises(UnreadableLogError, match=r"noise\.csv: is none of the known log formats \(\.blf \.asc .*\.csv"):
        recognise(path)


HEADS = {  # of files that programs beside loggers write -> what a person does there
    b"%PDF-1.4": "as CSV",
    b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1": "soffice --convert-to xlsx",
    b"PK\x03\x04" + bytes(26) + b"mimetypeapplication/vnd.oasis.opendocument.spreadsheet": "soffice --convert-to xlsx",
    b"PK\x03\x04" + bytes(26) + b"[Content_Types].xml" + bytes(300) + b"word/document.xml": "as XLSX or CSV",
    b"PK\x03\x04" + bytes(26) + b"a.npy": "numpy.load",
    b"MATLAB 7.3 MAT-file, Platform: GLNXA64": "save(FILE, '-v7')",
    b"\x89HDF\r\n\x1a\n": "to_parquet",
    b"CDF\x01": "to_parquet",
    b"\x93NUMPY\x01\0": "numpy.savetxt('log.csv'",
    pickle.dumps(np.ones(2)): "read_pickle",
    b"|CF,2,1,1;|CK,1,3,1,1;": "as MDF4, or as CSV",
    b"DIAEXTENDED  {@:ENGLISH": "File, Save as",
    b"<?xml version='1.0'?>\n<usi:tdm": "File, Save as",
    b"    -1\n    58\n": "as CSV or MDF4",
    b"PARE": "without encryption",
    b"FEA1": "as version 2",
    b"\x0a\x0d\x0d\x0a": "candump -l",
    b"\xd4\xc3\xb2\xa1\x02\0": "candump -l",
    b"#ROSBAG V2.0\n": "mcap convert log.bag log.mcap",
    b"RRF2": "as MCAP or Parquet",
    b"RIFF\0\0\0\0WAVEfmt ": "as TDMS or CSV",
    b"#9000500346WAVEDESC\0\0": "Data Format: ASCII",
    b":WFMP:NR_P 10000;:CURV #520000": "as CSV",
    b"\x0f\x0f:WFM#003": "as CSV",
    b"AG10\0": "as CSV",
    b"File created on 28/11/2026 at 10:00:00\r\n\r\n[header]\r\ntime\r\n": "VBOX Test Suite",
    b"Kvaser Memorator Log\n            Time, Channel,         ID,   Flags, DLC, D0, D1": "as ASC, BLF or MF4",
    b"motor,host=a T_wdg=20.1,n=1000 1764324000000000000\n": "as CSV",
    b"ULog\x01\x12\x35\x01": "ulog2csv",
    b"ORC\x08": "to_parquet",
    b"Obj\x01": "log.parquet",
    bytes(8) + b"DUCK": "log.parquet",
    b'{"t": [0, 1]}': "read_json",
    b"<!DOCTYPE html>\n<html>": "as CSV",
    b'<?xml version="1.0"?>\n<Workbook xmlns="urn:schemas-microsoft-com:office:spreadsheet">': "--convert-to xlsx",
    b"{\\rtf1\\ansi": "as CSV",
    b"\x89PNG\r\n\x1a\n": "whyhot attach",
    b"\xff\xd8\xff\xe0\0\x10JFIF": "whyhot attach",
    b"\0\0\0\x20ftypisom": "whyhot attach",
    b"<?xml version='1.0'?>\n<svg": "whyhot attach",
    b"        Kvaser Memorator Log\r\n        ====================\r\n": "MF4",
    b"Line,Abs Time(Sec),Rel Time (Sec),Status,Er,Tx,Description,Network,Node,Arb ID,Remote\r\n1,0.0,0,4,F,F": "ASC",
    b"   Chn Identifier Flg   DLC  D0...1...2...3...4...5...6..D7       Time     Dir\n": "MF4",
    b"ASCII Trace IXXAT Automation CAN-Bus\nDate: 5.3.2025\n": "as ASC there",
    b"Timestamp: 1741168800.000000    ID:      123    S Rx                DL:  8    00 01": "can_logger -f log.blf",
    b"1741168800.000000 1R11 123 01 02 03\n": "GVRET CSV",
    b"\x1b[31m (1741168800.000001)  can0  123   [2]  01 02\x1b[0m\n": "candump -l",
    b"Bus,Time,Type,ID,DLC,Data\n1,0.1,DT,0x123,2,01 02\n": "ASC, BLF, TRC or MF4",
    b"  can0  123   [8]  01 02 03 04 05 06 07 08\n": "candump -l",
    b"x.csv".ljust(257, b"\0") + b"ustar": "tar xf",
    b"7z\xbc\xaf\x27\x1c": "7z x",
    b"Rar!\x1a": "7z x",
    b"BZh9": "7z x",
    b"\xfd7zXZ\0": "7z x",
}


@pytest.mark.parametrize(("head", "todo"), HEADS.items())
def test_a_file_that_is_known_and_no_log_is_refused_with_the_command_that_exports_it(
    head: bytes, todo: str, tmp_path: Path
) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(head + b"\0" * 100)
    with pytest.raises(UnreadableLogError, match=r"log\.csv: is .+\. (Export|Save|Unpack|Record|Keep) .+") as refused:
        recognise(path)
    assert todo in str(refused.value) and "\n" not in str(refused.value)


def test_a_file_of_zeros_has_lost_what_it_held(tmp_path: Path) -> None:
    path = tmp_path / "log.blf"
    path.write_bytes(bytes(100_000))
    with pytest.raises(UnreadableLogError, match="begins with 4,096 bytes of 0: what stood there is lost"):
        recognise(path)


def test_each_kind_of_file_that_is_no_log_is_tried() -> None:
    assert all(any(re.match(looks, head, re.DOTALL) for head in HEADS) for looks in NO_LOGS)


@pytest.mark.parametrize(
    ("name", "todo"),
    [
        ("a.MFE", "mdf2finalized, with passwords.json"),
        ("a.dxd", "In DewesoftX open it and export it (Analyse, Export) as MDF4 or CSV."),
        ("a.psdata", "In PicoScope save it as CSV"),
        ("a.gbd", "In GL-Connection convert it to CSV."),
        ("a.xyz", "Export it as one of these."),
    ],
)
def test_a_file_that_is_known_by_its_name_alone_is_refused_with_what_its_program_exports(
    name: str, todo: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(random.Random(1).randbytes(200))
    with pytest.raises(UnreadableLogError) as refused:
        recognise(tmp_path / name)
    assert todo in str(refused.value)


def test_a_table_with_the_name_of_a_can_log_is_a_table(tmp_path: Path) -> None:
    path = tmp_path / "catman.asc"
    path.write_text(
        "Zeit\tT_W\tn\ns\t°C\tU/min\n" + "".join(f"{k},0\t20,{k}\t{k}\n" for k in range(9)), encoding="cp1252"
    )
    assert recognise(path).name == "csv"


def test_a_log_with_the_name_of_a_locked_file_is_what_it_begins_like(tmp_path: Path) -> None:
    path = tmp_path / "log.mfm"
    path.write_bytes((LOGS / "sample.mf4").read_bytes())
    assert recognise(path).name == "mf4"


@pytest.mark.parametrize("entry", [one for one in FORMATS if one.magic or one.looks], ids=lambda one: one.name)
@pytest.mark.parametrize("name", ["log", "log.csv", "log.bin", "log.blf"])
def test_a_format_is_recognised_whatever_its_file_is_called(entry: Format, name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(sample(entry).read_bytes())
    assert recognise(path) == entry


@pytest.mark.parametrize(
    "entry", [one for one in FORMATS if one.holds == "frames" and not one.magic], ids=lambda one: one.name
)
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_text_of_frames_is_read_as_an_editor_saves_it(entry: Format, encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "log"
    path.write_bytes(sample(entry).read_bytes().decode().encode(encoding))
    (saved, some), (log, others) = read(path), read(sample(entry))
    assert (saved.found, len(saved.rejected)) == (log.found, len(log.rejected))
    np.testing.assert_array_equal(some[0].t_ns, others[0].t_ns)


def test_a_text_that_looks_like_no_format_is_a_table(tmp_path: Path) -> None:
    path = tmp_path / "log.dat"
    for packed in (bytes, gzip.compress):
        path.write_bytes(packed("t;T in °C\n0;20\n".encode("cp1252")))
        assert recognise(path).name == "csv"


def test_rejected_records_are_as_they_were_however_many_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Rejections, "HELD", 4)
    entries = [Rejected(i, f"line {i}", "no time \ud800", bytes([i, 255])) for i in range(11)]
    found = Rejections()
    for i, entry in enumerate(entries, 1):
        found.append(entry)
        assert len(found) == i and list(found) == entries[:i]
    assert found == entries and found != entries[:-1]
    assert (found[0], found[6], found[-1], found[:5]) == (entries[0], entries[6], entries[-1], entries[:5])
    with pytest.raises(IndexError):
        found[11]
    assert not Rejections() and Rejections()[:3] == []


def test_memory_hardly_grows_with_the_records_that_are_rejected() -> None:
    peaks = []
    for count in (20_000, 60_000):
        tracemalloc.start()
        found = Rejections()
        found.extend(Rejected(i, f"byte {i:,}", "error frame", bytes(64)) for i in range(count))
        assert sum(entry.record for entry in found) == count * (count - 1) // 2
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert (peaks[1] - peaks[0]) / 40_000 < 5, f"bytes a record, at peaks of {peaks}"
