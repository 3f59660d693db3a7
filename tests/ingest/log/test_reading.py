"""The child process: what it gives back, and that nothing it does or suffers reaches the parent as anything but one
line."""

import base64
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec
from ingest.log import reading
from ingest.log.reading import Limits, Reader
from ingest.log.recording import Attachment, read
from made import readers
from made.places import LOGS
from made.readings import record


@pytest.fixture(autouse=True)
def _own_children(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "_Child", readers.Child)


def test_a_log_is_read_and_recorded(tmp_path: Path) -> None:
    target = tmp_path / "sample.mcap"
    got = record(LOGS / "sample.blf", target, TimeSpec(), [Attachment("bench.dbc", b"VERSION \xff", "text/plain")])
    assert (got.format, got.holds, got.absolute, got.cut) == ("blf", "frames", True, None)
    assert (got.found, got.written, got.rejected) == (28, 27, 1)
    assert [(entry.record, entry.why, entry.raw[:4]) for entry in got.rejections] == [(14, "error frame", b"LOBJ")]
    assert got.buses == (1, 2)
    assert got.start_ns == 1_700_000_000_000_000_000
    assert sum(len(batch.t_ns) for _, batch in read(target)) == got.written


def test_a_table_keeps_its_columns_units_and_zone(tmp_path: Path) -> None:
    got = record(LOGS / "sample.csv", tmp_path / "sample.mcap", TimeSpec(zone="Europe/Rome"))
    assert (got.holds, got.found, got.rejected, len(got.rejections)) == ("rows", 7, 3, 3)
    assert got.columns == ("T_mag", "Drehzahl", "Kommentar", "n", "n_2")
    assert got.units["T_mag"] == "°C"
    assert got.settings["time"] == "day.month.year in Europe/Rome"
    assert got.start_ns == (1_709_280_000 - 3600) * 1_000_000_000


def test_a_preview_leaves_its_recording_in_the_folder_given(tmp_path: Path) -> None:
    assert record(LOGS / "sample.asc", tmp_path / "preview.mcap").found == 9
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
        record(LOGS / "sample.blf", target)
    assert not target.is_symlink()


def test_a_target_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"no/such\.mcap"):
        record(LOGS / "sample.blf", tmp_path / "no" / "such.mcap")


def test_a_log_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"gone\.blf"):
        record(tmp_path / "gone.blf", tmp_path / "x.mcap")


@pytest.fixture
def children(monkeypatch: pytest.MonkeyPatch) -> list[subprocess.Popen[bytes]]:
    """The child processes that are started from here on."""
    started: list[subprocess.Popen[bytes]] = []

    class Watched(subprocess.Popen[bytes]):
        def __init__(self, *words: Any, **more: Any) -> None:
            super().__init__(*words, **more)
            started.append(self)

    monkeypatch.setattr(subprocess, "Popen", Watched)
    return started


@pytest.fixture
def at_open(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], None]:
    """Lets the child do something where it opens a file of this name."""

    def arrange(name: str, what: str) -> None:
        (tmp_path / "early").mkdir()
        (tmp_path / "early" / "sitecustomize.py").write_text(
            "import os, signal, sys\n"
            "def hook(event, words):\n"
            f"    if event == 'open' and str(words[0]).endswith({name!r}):\n"
            f"        {what}\n"
            "sys.addaudithook(hook)\n"
        )
        monkeypatch.setenv("PYTHONPATH", str(tmp_path / "early"))

    return arrange


def test_small_logs_are_read_by_one_child_in_turn_and_each_as_if_it_were_alone(
    tmp_path: Path, children: list[subprocess.Popen[bytes]]
) -> None:
    logs = [LOGS / "sample.blf", LOGS / "sample.csv", LOGS / "sample.asc", LOGS / "sample.blf"]
    with closing(Reader()) as reader:
        together = [reader.record(log, tmp_path / f"{k}.mcap") for k, log in enumerate(logs)]
    assert len(children) == 1
    assert children[0].returncode is not None  # ended, and waited for
    for k, log in enumerate(logs):
        assert record(log, tmp_path / "alone.mcap") == together[k]
        assert (tmp_path / "alone.mcap").read_bytes() == (tmp_path / f"{k}.mcap").read_bytes()


def test_a_log_that_cannot_be_read_leaves_the_child_to_the_next(
    tmp_path: Path, children: list[subprocess.Popen[bytes]]
) -> None:
    (tmp_path / "stub.blf").write_bytes(b"LOGG")
    with closing(Reader()) as reader:
        with pytest.raises(UnreadableLogError, match=r"^stub\.blf: is no BLF file"):
            reader.record(tmp_path / "stub.blf", tmp_path / "x.mcap")
        assert reader.record(LOGS / "sample.asc", tmp_path / "y.mcap").found == 9
    assert len(children) == 1


def test_a_log_that_kills_the_child_is_refused_with_its_line_and_the_others_are_read(
    tmp_path: Path, children: list[subprocess.Popen[bytes]], at_open: Callable[[str, str], None]
) -> None:
    at_open("killer.csv", "os.kill(os.getpid(), signal.SIGSEGV)")
    (tmp_path / "killer.csv").write_text("t,T\n0,20\n")
    with closing(Reader()) as reader:
        assert reader.record(LOGS / "sample.blf", tmp_path / "a.mcap").found == 28
        with pytest.raises(UnreadableLogError, match=r"^killer\.csv: the reader ended with signal 11"):
            reader.record(tmp_path / "killer.csv", tmp_path / "b.mcap")
        assert reader.record(LOGS / "sample.asc", tmp_path / "c.mcap").found == 9
    assert [child.returncode for child in children[:2]] == [-signal.SIGSEGV] * 2  # the used one, and a new one
    assert len(children) == 3
    assert not (tmp_path / "b.mcap").exists()


def test_no_log_is_refused_for_a_child_that_ended_before_it(
    tmp_path: Path, children: list[subprocess.Popen[bytes]]
) -> None:
    with closing(Reader()) as reader:
        reader.record(LOGS / "sample.blf", tmp_path / "a.mcap")
        children[0].kill()
        children[0].wait()
        assert reader.record(LOGS / "sample.asc", tmp_path / "b.mcap").found == 9


def test_a_child_that_took_too_long_is_replaced(tmp_path: Path, children: list[subprocess.Popen[bytes]]) -> None:
    with closing(Reader()) as reader:
        reader.record(LOGS / "sample.blf", tmp_path / "a.mcap")
        with pytest.raises(UnreadableLogError, match=r"^endless\.csv: reading it was stopped after 1 s: "):
            reader.record(endless(tmp_path), tmp_path / "b.mcap", limits=Limits(seconds=1.0))
        assert reader.record(LOGS / "sample.asc", tmp_path / "c.mcap").found == 9
    assert len(children) == 2  # what is slow is not tried twice


def test_the_limit_of_memory_is_that_of_each_log(tmp_path: Path) -> None:
    path = tmp_path / "wide.csv"
    path.write_text("t,T\n" + "0,20\n" * 300_000)
    with closing(Reader()) as reader:
        reader.record(LOGS / "sample.blf", tmp_path / "a.mcap")
        with pytest.raises(UnreadableLogError, match=r"^wide\.csv: reading it needs more than 150 MiB of memory"):
            reader.record(path, tmp_path / "b.mcap", limits=Limits(memory_bytes=150 << 20))
        assert reader.record(path, tmp_path / "c.mcap", TimeSpec(rate_hz=1.0)).found == 300_000


def test_the_limit_of_computing_is_that_of_each_log() -> None:
    code = (
        "import resource, time; from ingest.log import reading\n"
        "while time.process_time() < 1.1: pass\n"
        "reading._limit(4 << 30, 1.0); print(resource.getrlimit(resource.RLIMIT_CPU)[0])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert int(done.stdout) >= 3  # s of its whole life: 1.1 and a bit spent, 1 to come


def test_a_large_log_is_read_by_a_child_of_its_own(
    tmp_path: Path, children: list[subprocess.Popen[bytes]], monkeypatch: pytest.MonkeyPatch
) -> None:
    small, large = LOGS / "sample.csv", LOGS / "sample.asc"
    monkeypatch.setattr(reading, "SMALL_BYTES", small.stat().st_size)
    assert large.stat().st_size > small.stat().st_size
    with closing(Reader()) as reader:
        for k, log in enumerate((small, small, large, small, large, large)):
            reader.record(log, tmp_path / f"{k}.mcap")
    assert len(children) == 5


def test_what_a_library_prints_is_no_answer(tmp_path: Path, at_open: Callable[[str, str], None]) -> None:
    at_open("chatty.csv", "os.write(1, b'{}\\n'); print('{}', flush=True)")
    (tmp_path / "chatty.csv").write_bytes((LOGS / "sample.csv").read_bytes())
    with closing(Reader()) as reader:
        assert reader.record(tmp_path / "chatty.csv", tmp_path / "a.mcap").found == 7
        assert reader.record(LOGS / "sample.asc", tmp_path / "b.mcap").found == 9


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


def test_memory_that_ends_inside_an_import_is_memory(tmp_path: Path, at_open: Callable[[str, str], None]) -> None:
    at_open("late.csv", "raise ValueError(\"field 'target' is required for AnnAssign\")")
    (tmp_path / "late.csv").write_bytes((LOGS / "sample.csv").read_bytes())
    with pytest.raises(UnreadableLogError, match=r"^late\.csv: reading it needs more than 4,?096 MiB of memory"):
        record(tmp_path / "late.csv", tmp_path / "x.mcap")


def test_an_interrupt_ends_the_child_as_well(tmp_path: Path, children: list[subprocess.Popen[bytes]]) -> None:
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
        "log.blf: the reader ended with exit code 1 (KeyError: 'size'). This is a defect of the reader: "
        "report it with the file."
    )
    assert "ended with signal 11." in reading._ended("log.blf", -signal.SIGSEGV, b"", Limits())
    assert "was stopped after 60 s" in reading._ended("log.blf", -signal.SIGXCPU, b"", Limits())


def test_the_limit_of_time_grows_with_the_log(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(bytes(5_000_000))
    assert Limits.of(path).seconds == 80.0


@pytest.mark.parametrize(("name", "found"), [("sample.asc", 9), ("sample.csv", 7)])
def test_the_child_imports_nothing_heavy_that_reading_does_not_need(tmp_path: Path, name: str, found: int) -> None:
    (tmp_path / "pandas.py").write_text("")  # pyarrow imports it where it is installed
    request = {
        "path": str(LOGS / name),
        "target": str(tmp_path / "x.mcap"),
        "time": vars(TimeSpec()),
        "attachments": [{"name": "a", "data": base64.b64encode(b"b").decode(), "media_type": "text/plain"}],
        "limits": {"memory_bytes": 4 << 30, "seconds": 60.0},
    }
    code = (
        f"import sys, ingest.log.reading; sys.path.insert(0, {str(tmp_path)!r}); ingest.log.reading.main(); "
        "heavy = {'numba', 'scipy', 'pint', 'cantools', 'duckdb', 'matplotlib', 'eventsourcing', 'pandas'}; "
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], input=json.dumps(request).encode(), capture_output=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["found"] == found
