"""Archives: what is unpacked of them and how it is called, and the line where one is damaged, locked or too large."""

from __future__ import annotations

import errno
import gzip
import os
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
import zstandard

from ingest.errors import IngestError, UnreadableLogError
from ingest.intake.archives import is_archive, unpacked
from made.places import LOGS

BLF = (LOGS / "sample.blf").read_bytes()
CSV = (LOGS / "sample.csv").read_bytes()
NOISE = os.urandom(200_000)  # cannot be packed


def zipped(path: Path, **contents: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in contents.items():
            archive.writestr(name.replace("_dot_", ".").replace("_in_", "/"), data)
    return path


def packed(path: Path, pack: Callable[[bytes], bytes], data: bytes) -> Path:
    path.write_bytes(pack(data))
    return path


@pytest.mark.parametrize(
    ("name", "archive"),
    [
        ("log.zip", zipfile.ZipFile),
        ("log.blf.gz", gzip.compress),
        ("log.csv.zst", zstandard.ZstdCompressor().compress),
    ],
)
def test_archives_are_known_by_what_they_hold(tmp_path: Path, name: str, archive: object) -> None:
    path = tmp_path / "log.csv"
    if archive is zipfile.ZipFile:
        zipped(path, a=BLF)
    else:
        packed(path, archive, CSV if ".zst" in name else BLF)  # type: ignore[arg-type]
    assert is_archive(path)


def test_what_a_reader_unpacks_or_reads_itself_is_no_archive(tmp_path: Path) -> None:
    for sample in LOGS.glob("sample.*"):
        assert not is_archive(sample), sample.name
    assert not is_archive(packed(tmp_path / "a", gzip.compress, CSV))
    assert is_archive(zipped(tmp_path / "b"))  # an empty one


def test_each_log_of_a_zip_file_is_a_file_that_says_where_it_is_from(tmp_path: Path) -> None:
    contents = {"S1_dot_blf": BLF, "night_in_S1_dot_csv": CSV, "day_in_S1_dot_csv": CSV + b"\n"}
    hidden = {"_dot_hidden": CSV, "__MACOSX_in_S1_dot_csv": CSV}
    path = zipped(tmp_path / "night.zip", **contents, **hidden)
    files, lines = unpacked(path, tmp_path / "work")
    assert [file.name for file in files] == [f"{name} in night.zip" for name in ("S1.blf", "S1.csv", "S1.csv")]
    assert ([file.read_bytes() for file in files], lines) == ([BLF, CSV, CSV + b"\n"], [])


@pytest.mark.parametrize(
    ("suffix", "pack"), [("gz", gzip.compress), ("zst", zstandard.ZstdCompressor(write_checksum=True).compress)]
)
def test_one_packed_file_is_unpacked_and_what_is_before_a_cut_is_kept(
    tmp_path: Path, suffix: str, pack: Callable[[bytes], bytes]
) -> None:
    path = packed(tmp_path / f"S1.blf.{suffix}", pack, NOISE)
    (file,), lines = unpacked(path, tmp_path / "whole")
    assert (file.name, file.read_bytes(), lines) == (f"S1.blf in S1.blf.{suffix}", NOISE, [])
    path.write_bytes(path.read_bytes()[:150_000])
    (file,), lines = unpacked(path, tmp_path / "cut")
    assert NOISE.startswith(file.read_bytes()) and file.stat().st_size > 60_000
    cut = "was cut inside its packed contents: what comes before is used. Copy the archive again."
    assert lines == [f"{file.name}: {cut}"]


def test_a_damaged_file_does_not_take_the_others_with_it(tmp_path: Path) -> None:
    path = zipped(tmp_path / "night.zip", a=NOISE, b=CSV)
    data = bytearray(path.read_bytes())
    data[1000] ^= 255
    path.write_bytes(data)
    files, (line,) = unpacked(path, tmp_path / "work")
    assert [file.name for file in files] == ["b in night.zip"]
    assert line.startswith("a in night.zip: is damaged (") and line.endswith("Copy the archive again.")
    path.write_bytes(data[:-40])
    with pytest.raises(UnreadableLogError, match=r"^night\.zip: is no whole archive \(.+\)\. Copy it again\.$"):
        unpacked(path, tmp_path / "again")


def test_a_name_that_is_too_long_for_a_file_system_keeps_its_end(tmp_path: Path) -> None:
    path = tmp_path / f"{'n' * 150}.zip"
    with zipfile.ZipFile(path, "w") as packed:
        for name in (f"{'x' * 300}.csv", f"{'ö' * 100}.csv", "S1.csv"):
            packed.writestr(name, CSV)
    files, lines = unpacked(path, tmp_path / "work")
    assert [file.read_bytes() for file in files] == [CSV] * 3 and lines == []
    assert re.fullmatch(r"…x+\.csv in …n+\.zip", files[0].name)
    assert re.fullmatch(r"…ö+\.csv in …n+\.zip", files[1].name)
    assert files[2].name == f"S1.csv in {path.name}"


def test_a_gzip_file_with_a_flipped_byte_is_not_half_believed(tmp_path: Path) -> None:
    path = packed(tmp_path / "S1.blf.gz", gzip.compress, NOISE)
    data = bytearray(path.read_bytes())
    data[-6] ^= 255  # of its checksum
    path.write_bytes(data)
    files, (line,) = unpacked(path, tmp_path / "work")
    assert files == [] and line.startswith("S1.blf in S1.blf.gz: is damaged (CRC check failed")


def test_a_file_with_a_password_is_named(tmp_path: Path) -> None:
    path = zipped(tmp_path / "night.zip", a=CSV, b=CSV)
    data = bytearray(path.read_bytes())
    central = data.index(b"PK\x01\x02")
    data[6] |= 1  # encrypted, as the local header of the first file and the directory say it
    data[central + 8] |= 1
    path.write_bytes(data)
    files, lines = unpacked(path, tmp_path / "work")
    assert [file.name for file in files] == ["b in night.zip"]
    assert lines == ["a in night.zip: has a password. Unpack it first (7z x asks for it)."]


@pytest.mark.parametrize("suffix", ["zip", "gz", "zst"])
def test_what_unpacks_to_far_more_than_logs_do_is_one_line(
    tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ingest.formats.ALWAYS", 1 << 20)
    monkeypatch.setattr("ingest.intake.archives.BLOCK", 1 << 18)
    path, zeros = tmp_path / f"bomb.{suffix}", bytes(30 << 20)
    if suffix == "zip":
        zipped(path, **{f"a{k}": zeros[: 10 << 20] for k in range(3)})
    else:
        packed(path, gzip.compress if suffix == "gz" else zstandard.ZstdCompressor().compress, zeros)
    limit = max(1 << 20, 200 * path.stat().st_size)
    with pytest.raises(UnreadableLogError) as refused:
        unpacked(path, tmp_path / "work")
    assert str(refused.value) == (
        f"bomb.{suffix}: unpacks to more than {limit:,} bytes: nothing of it is used. Unpack the logs in it first."
    )
    written = sum(file.stat().st_size for file in (tmp_path / "work").rglob("*") if file.is_file())
    assert written <= limit + (1 << 19)


def test_an_archive_of_too_many_files_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ingest.intake.archives.MEMBERS", 5)
    path = zipped(tmp_path / "many.zip", **{f"a{k}": CSV for k in range(9)})
    with pytest.raises(UnreadableLogError, match=r"^many\.zip: holds over 5 files: nothing of it is used\."):
        unpacked(path, tmp_path / "work")


def test_a_full_disk_is_no_damage_of_the_archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = zipped(tmp_path / "night.zip", a=CSV)

    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("ingest.intake.archives._copy", full)
    with pytest.raises(IngestError, match=r"^night\.zip: there is no room to unpack it in "):
        unpacked(path, tmp_path / "work")


def test_what_takes_much_memory_to_unpack_is_no_damage(tmp_path: Path) -> None:
    far = zstandard.ZstdCompressionParameters.from_level(3, window_log=30)
    packing = zstandard.ZstdCompressor(compression_params=far).compressobj()  # does not say its size
    path = packed(tmp_path / "a.blf.zst", lambda data: packing.compress(data) + packing.flush(), BLF)
    files, lines = unpacked(path, tmp_path / "out")
    assert (files, len(lines)) == ([], 1) and lines[0].endswith("Unpack it first (unzstd --long=31).")
