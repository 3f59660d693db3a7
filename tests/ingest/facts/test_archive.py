from __future__ import annotations

import errno
import hashlib
import logging
import os
import stat
from pathlib import Path
from typing import Any

import pytest

from ingest.errors import ChangingFileError, DamageError, StoreError
from ingest.facts import archive as archive_module
from ingest.facts.archive import Archive
from made.places import on_disk

DATA = bytes(range(256)) * 20
SHA = hashlib.sha256(DATA).hexdigest()


@pytest.fixture
def archive(tmp_path: Path) -> Archive:
    (tmp_path / "archive").mkdir()
    (tmp_path / "tmp").mkdir()
    return Archive(tmp_path / "archive", tmp_path / "tmp")


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "1_s1.blf"
    path.write_bytes(DATA)
    return path


def leftovers(archive: Archive) -> list[Path]:
    return list((on_disk(archive.folder).parent / "tmp").iterdir())


def test_bytes_and_files_are_sealed_under_their_sha256(archive: Archive, log: Path) -> None:
    assert archive.seal(DATA) == archive.seal(log) == SHA
    assert on_disk(archive.path(SHA)) == archive.folder / SHA[:2] / SHA
    assert archive.has(SHA)
    assert archive.read(SHA) == DATA
    assert list(archive) == [SHA]
    assert leftovers(archive) == []


def test_a_file_longer_than_a_chunk_and_an_empty_one_are_sealed(archive: Archive, log: Path) -> None:
    log.write_bytes(DATA * 700)
    assert archive.read(archive.seal(log)) == DATA * 700
    assert archive.read(archive.seal(b"")) == b""


def test_sealed_files_cannot_be_written_to(archive: Archive) -> None:
    assert on_disk(archive.path(archive.seal(DATA))).stat().st_mode & 0o222 == 0


def test_sealing_the_same_bytes_again_keeps_the_file_that_is_there(archive: Archive) -> None:
    archive.seal(DATA)
    before = on_disk(archive.path(SHA)).stat()
    archive.seal(DATA)
    after = on_disk(archive.path(SHA)).stat()
    assert (before.st_ino, before.st_mtime_ns) == (after.st_ino, after.st_mtime_ns)


@pytest.mark.parametrize("bad", [b"", DATA[:-1], b"x" + DATA[1:]])
def test_a_damaged_file_is_replaced_by_the_true_bytes_and_said(
    archive: Archive, bad: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    archive.seal(DATA)
    on_disk(archive.path(SHA)).chmod(0o644)
    on_disk(archive.path(SHA)).write_bytes(bad)
    with caplog.at_level(logging.WARNING):
        assert archive.seal(DATA) == SHA
    assert archive.read(SHA) == DATA
    assert f"its {len(bad):,} bytes are not those that were sealed" in caplog.text
    assert "replaced by the true bytes just given" in caplog.text


@pytest.mark.parametrize("bad", [b"", DATA[:-1], b"x" + DATA[1:]])
def test_damage_is_found_on_reading_and_says_what_to_do(archive: Archive, bad: bytes) -> None:
    archive.seal(DATA)
    on_disk(archive.path(SHA)).chmod(0o644)
    on_disk(archive.path(SHA)).write_bytes(bad)
    with pytest.raises(DamageError) as caught:
        archive.read(SHA)
    assert str(caught.value) == archive.damage(SHA)
    assert str(caught.value) == (
        f"{on_disk(archive.path(SHA))}: is damaged, its {len(bad):,} bytes are not those that were sealed: "
        "ingest the original again, or restore it from a backup"
    )


def test_a_missing_file_is_damage(archive: Archive) -> None:
    says = f"{on_disk(archive.path(SHA))}: is missing: ingest the original again, or restore it from a backup"
    with pytest.raises(DamageError) as caught:
        archive.read(SHA)
    assert str(caught.value) == says == archive.damage(SHA) == archive.damage(SHA, read=False)
    assert not archive.has(SHA)


def test_without_reading_only_a_missing_file_is_noticed(archive: Archive) -> None:
    archive.seal(DATA)
    on_disk(archive.path(SHA)).chmod(0o644)
    on_disk(archive.path(SHA)).write_bytes(b"")
    assert archive.damage(SHA, read=False) is None
    assert archive.damage(SHA) is not None


@pytest.mark.parametrize("name", ["../../etc/passwd", "", "A" * 64, "a" * 63, SHA + "\n"])
def test_what_is_no_sha256_is_never_a_path(archive: Archive, name: str) -> None:
    with pytest.raises(DamageError, match="is not a SHA-256 in 64 hexadecimal digits"):
        on_disk(archive.path(name))
    assert archive.damage(name)


def test_files_that_are_not_ours_are_not_listed(archive: Archive) -> None:
    archive.seal(DATA)
    (on_disk(archive.folder) / "notes.txt").write_text("hello")
    (on_disk(archive.folder) / SHA[:2] / "notes.txt").write_text("hello")
    assert list(archive) == [SHA]


def test_a_store_opened_for_reading_seals_nothing(archive: Archive) -> None:
    with pytest.raises(StoreError, match="opened for reading"):
        Archive(archive.folder, None).seal(DATA)


def test_a_file_that_grows_while_it_is_read_is_refused(
    archive: Archive, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(archive_module, "CHUNK", 1000)
    true_write = os.write

    def write(handle: int, data: bytes) -> int:
        with log.open("ab") as file:
            file.write(b"more")
        return true_write(handle, data)

    monkeypatch.setattr(os, "write", write)
    with pytest.raises(ChangingFileError, match=r"1_s1.blf: changed while it was read \(5,120 bytes at first"):
        archive.seal(log)
    assert list(archive) == []
    assert leftovers(archive) == []


def test_a_file_rewritten_in_place_while_it_is_read_is_refused(
    archive: Archive, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    true_write = os.write

    def write(handle: int, data: bytes) -> int:
        log.write_bytes(DATA[::-1])
        os.utime(log, ns=(0, 0))
        return true_write(handle, data)

    monkeypatch.setattr(os, "write", write)
    with pytest.raises(ChangingFileError, match="nothing was stored; wait until its recording has ended"):
        archive.seal(log)


def test_a_disk_that_takes_only_some_bytes_at_once_gets_all(archive: Archive, monkeypatch: pytest.MonkeyPatch) -> None:
    true_write = os.write
    monkeypatch.setattr(os, "write", lambda handle, data: true_write(handle, bytes(data)[:777]))
    assert archive.read(archive.seal(DATA)) == DATA


@pytest.mark.parametrize("fault", [errno.ENOSPC, errno.EIO])
@pytest.mark.parametrize("call", ["write", "fsync", "replace"])
def test_a_failing_disk_leaves_nothing_and_the_same_seal_works_after(
    archive: Archive, monkeypatch: pytest.MonkeyPatch, call: str, fault: int
) -> None:
    true_call = getattr(os, call)
    for nth in range(1, 10):
        left = [nth]

        def failing(*given: Any, left: list[int] = left) -> Any:
            left[0] -= 1
            if left[0] == 0:
                raise OSError(fault, os.strerror(fault))
            return true_call(*given)

        data = DATA + bytes([nth])
        with monkeypatch.context() as patch:
            patch.setattr(os, call, failing)
            try:
                archive.seal(data)
            except OSError as error:
                assert error.errno == fault
            else:
                assert left[0] > 0  # every call was made and the fault never came: done
                break
        assert leftovers(archive) == []
        assert all(archive.damage(sha256) is None for sha256 in archive)
        assert archive.read(archive.seal(data)) == data
    assert 2 <= nth <= 9


def test_a_failing_write_after_some_bytes_leaves_nothing(archive: Archive, monkeypatch: pytest.MonkeyPatch) -> None:
    true_write = os.write

    def torn(handle: int, data: bytes) -> int:
        if len(data) < len(DATA):
            raise OSError(errno.ENOSPC, "No space left on device")
        return true_write(handle, bytes(data)[:100])

    with monkeypatch.context() as patch:
        patch.setattr(os, "write", torn)
        with pytest.raises(OSError, match="No space left"):
            archive.seal(DATA)
    assert leftovers(archive) == []
    assert list(archive) == []


def test_bytes_are_on_disk_before_their_name_and_the_name_before_sealing_ends(
    archive: Archive, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []

    def noted(name: str) -> Any:
        true_call = getattr(os, name)

        def call(*given: Any) -> Any:
            is_folder = name == "fsync" and stat.S_ISDIR(os.fstat(given[0]).st_mode)
            calls.append("fsync of a folder" if is_folder else name)
            return true_call(*given)

        return call

    for name in ("write", "fsync", "replace"):
        monkeypatch.setattr(os, name, noted(name))
    archive.seal(DATA)
    assert calls == ["write", "fsync", "replace", "fsync of a folder", "fsync of a folder"]
    calls.clear()
    archive.seal(DATA)  # an earlier command may have been stopped before its folder was on disk
    assert calls == ["write", "fsync", "fsync of a folder", "fsync of a folder"]
