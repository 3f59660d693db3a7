"""The child process: what it gives back, and that nothing it does or suffers reaches the parent as anything but one line."""

import base64
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from ingest import reading
from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec
from ingest.reading import Limits, preview, record
from ingest.recording import Attachment, read, read_contents

FILES = Path(__file__).parent / "files"


def test_a_log_is_read_and_recorded(tmp_path: Path) -> None:
    target = tmp_path / "sample.mcap"
    got = record(FILES / "sample.blf", target, TimeSpec(), [Attachment("bench.dbc", b"VERSION \xff", "text/plain")])
    assert (got.format, got.holds, got.absolute, got.cut) == ("blf", "frames", True, None)
    assert (got.found, got.written, got.rejected) == (28, 27, 1)
    assert [(entry.record, entry.why, entry.raw[:4]) for entry in got.rejections] == [(14, "error frame", b"LOBJ")]
    assert got.buses == (1, 2)
    assert got.start_ns == 1_700_000_000_000_000_000
    assert sum(len(batch.t_ns) for _, batch in read(target)) == got.written
    assert read_contents(target).found == got.found


def test_a_table_keeps_its_columns_units_and_zone(tmp_path: Path) -> None:
    got = record(FILES / "sample.csv", tmp_path / "sample.mcap", TimeSpec(zone="Europe/Rome"))
    assert (got.holds, got.found, got.rejected, len(got.rejections)) == ("rows", 7, 3, 3)
    assert got.columns == ("T_mag", "Drehzahl", "Kommentar", "n", "n_2")
    assert got.units["T_mag"] == "°C"
    assert got.settings["time"] == "day.month.year in Europe/Rome"
    assert got.start_ns == (1_709_280_000 - 3600) * 1_000_000_000


def test_a_preview_leaves_its_recording_in_the_folder_given(tmp_path: Path) -> None:
    assert preview(FILES / "sample.asc", tmp_path).found == 9
    assert [path.name for path in tmp_path.iterdir()] == ["preview.mcap"]


def test_what_cannot_be_read_is_refused_with_the_line_of_its_reader(tmp_path: Path) -> None:
    path = tmp_path / "stub.blf"
    path.write_bytes(b"LOGG")
    with pytest.raises(UnreadableLogError, match=r"^stub\.blf: is no BLF file, or ends inside its header \(4 bytes\)"):
        record(path, tmp_path / "stub.mcap")
    assert not (tmp_path / "stub.mcap").exists()


def test_a_full_disk_is_not_the_fault_of_the_log(tmp_path: Path) -> None:
    target = tmp_path / "full.mcap"
    target.symlink_to("/dev/full")
    with pytest.raises(OSError, match="No space left on device"):
        record(FILES / "sample.blf", target)
    assert not target.is_symlink()


def test_a_target_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"no/such\.mcap"):
        record(FILES / "sample.blf", tmp_path / "no" / "such.mcap")


def test_a_log_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"gone\.blf"):
        record(tmp_path / "gone.blf", tmp_path / "x.mcap")


def endless(folder: Path) -> Path:
    """A file that is never there to read: the child waits for it."""
    path = folder / "endless.csv"
    os.mkfifo(path)
    return path


def test_a_reader_that_takes_too_long_is_stopped(tmp_path: Path) -> None:
    began = time.monotonic()
    with pytest.raises(UnreadableLogError, match=r"^endless\.csv: reading it was stopped after 1 s: "):
        record(endless(tmp_path), tmp_path / "x.mcap", limits=Limits(seconds=1.0))
    assert time.monotonic() - began < 10


def test_a_reader_that_needs_too_much_memory_is_stopped(tmp_path: Path) -> None:
    path = tmp_path / "wide.csv"
    path.write_text("t,T\n" + "0,20\n" * 300_000)
    with pytest.raises(
        UnreadableLogError, match=r"^wide\.csv: reading it needs more than 150 MiB of memory: stopped\."
    ):
        record(path, tmp_path / "x.mcap", limits=Limits(memory_bytes=150 << 20))


def test_an_interrupt_ends_the_child_as_well(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    children: list[subprocess.Popen[bytes]] = []

    class Watched(subprocess.Popen[bytes]):
        def __init__(self, *words: Any, **more: Any) -> None:
            super().__init__(*words, **more)
            children.append(self)

    monkeypatch.setattr(subprocess, "Popen", Watched)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            record(endless(tmp_path), tmp_path / "x.mcap", limits=Limits(seconds=60.0))
    finally:
        timer.cancel()
        signal.signal(signal.SIGINT, before)
    (child,) = children
    assert child.returncode is not None  # ended, and waited for


def test_a_reader_that_crashes_is_one_line_not_a_traceback() -> None:
    err = b"Traceback (most recent call last):\n  File ...\nKeyError: 'size'\n"
    line = reading._ended("log.blf", 1, err, Limits())
    assert line == (
        "log.blf: the reader ended with exit code 1 (KeyError: 'size'). This is a defect of the reader: report it with "
        "the file."
    )
    assert "ended with signal 11." in reading._ended("log.blf", -signal.SIGSEGV, b"", Limits())
    assert "was stopped after 60 s" in reading._ended("log.blf", -signal.SIGXCPU, b"", Limits())


def test_the_limit_of_time_grows_with_the_log(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(bytes(5_000_000))
    assert Limits.of(path).seconds == 80.0


def test_the_child_imports_no_numerics_that_reading_does_not_need(tmp_path: Path) -> None:
    request = {
        "path": str(FILES / "sample.asc"),
        "target": str(tmp_path / "x.mcap"),
        "time": vars(TimeSpec()),
        "attachments": [{"name": "a", "data": base64.b64encode(b"b").decode(), "media_type": "text/plain"}],
        "limits": {"memory_bytes": 4 << 30, "seconds": 60.0},
    }
    code = (
        "import sys, ingest.reading; ingest.reading.main(); "
        "heavy = {'numba', 'scipy', 'pint', 'cantools', 'duckdb', 'matplotlib', 'eventsourcing'} & set(sys.modules); "
        "assert not heavy, heavy"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], input=json.dumps(request).encode(), capture_output=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["found"] == 9
