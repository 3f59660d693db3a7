"""What the machine refuses is one line and exit code 2: reading, writing, and saying the answer."""

from __future__ import annotations

import ctypes
import errno
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import duckdb
import pyarrow as pa
import pytest

from ingest.facts.events import ModelPublished
from ingest.facts.store import Store
from made.places import EXAMPLES
from replay.cli import build_parser, main

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    Store.open(tmp_path / "store", create=True).close()
    monkeypatch.setenv("WHYHOT_STORE", str(tmp_path / "store"))
    return tmp_path / "store"


def _os_error(number: int, name: str | None = None) -> OSError:
    return OSError(number, os.strerror(number), name) if name else OSError(number, os.strerror(number))


@pytest.mark.parametrize(
    ("error", "says"),
    [
        (_os_error(errno.EIO), "input/output error"),
        (_os_error(errno.EIO, "recording.mcap"), "recording.mcap: input/output error"),
        (_os_error(errno.ESTALE), "stale file handle"),
        (_os_error(errno.EMFILE), "too many files are open"),
        (_os_error(errno.EMFILE, "a.blf"), "a.blf: too many files are open"),
        (_os_error(errno.EROFS), "Read-only file system"),
        (_os_error(errno.ENOSPC), "the disk is full"),
        (OSError("Couldn't deserialize thrift: TProtocolException"), "Couldn't deserialize thrift"),
        (OSError("[Errno 28] Error writing bytes to file. Detail: No space left on device"), "the disk is full"),
        (pa.ArrowInvalid("Parquet magic bytes not found in footer.\nEither the file is corrupted"), "magic bytes"),
        (duckdb.IOException("IO Error: could not read"), "could not read"),
        (MemoryError(), "too little memory"),
    ],
)
def test_what_the_machine_refuses_is_one_line(
    store: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch, error: Exception, says: str
) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr("ingest.facts.facts.at", fail)
    assert main(["sessions"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line
    assert line.endswith((".", "again", "checks"))


def test_a_defect_of_ours_keeps_its_traceback(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise KeyError("x")

    monkeypatch.setattr("ingest.facts.facts.at", fail)
    with pytest.raises(KeyError):
        main(["sessions"])


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
@pytest.mark.parametrize("words", [["sessions"], ["sessions", "--json"], ["show", "none", "--json"]])
def test_an_answer_that_cannot_be_written_is_one_line(store: Path, words: list[str]) -> None:
    command = [sys.executable, "-c", "import sys; from replay.cli import main; sys.exit(main(sys.argv[1:]))", *words]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
        unsaid = subprocess.run(command, stdout=full, stderr=full, check=False)
    assert done.returncode == unsaid.returncode == 2
    lines = done.stderr.splitlines()
    assert "the disk is full" in lines[-1]
    assert len(lines) == 1 + (words[0] == "show")


def test_an_answer_that_a_limit_cuts_says_so(store: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analytics.query.ROWS", 5)
    for code, words in ((1, []), (0, ["--rows", "5"]), (0, ["--rows", "7"])):
        assert main(["sql", "FROM range(6)", "--csv", *words]) == code
        assert ("the first 5 rows, there are more: allow more with --rows" in capsys.readouterr().err) == (
            words != ["--rows", "7"]
        )


def test_a_mistyped_verb_names_the_nearest(capsys: Capture) -> None:
    assert main(["replya", "1_s1"]) == 2
    assert capsys.readouterr().err == "whyhot: replya is no verb. Nearest: replay. whyhot --help lists all\n"
    assert main(["xyzzy"]) == 2
    assert capsys.readouterr().err == "whyhot: xyzzy is no verb. whyhot --help lists all\n"


@pytest.mark.parametrize("words", [["--store", "s", "sessions"], ["--store=s"]])
def test_an_option_before_its_verb_says_where_it_stands(words: list[str], capsys: Capture) -> None:
    assert main(words) == 2
    assert capsys.readouterr().err == "whyhot: --store stands behind a verb: whyhot VERB --store. See whyhot --help\n"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["diagnose", "--on", "a", "--holdout", "b"], "diagnose: --holdout b is not understood. Nearest: --hold-out."),
        (["show", "a", "b"], "show: b is not understood."),
        (["replay", "--bogus"], "replay: --bogus is not understood."),
    ],
)
def test_words_that_a_verb_does_not_know_are_refused_by_the_verb(words: list[str], says: str, capsys: Capture) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(words)
    assert stopped.value.code == 2
    assert capsys.readouterr().err == f"whyhot {says} See whyhot {words[0]} --help\n"


@pytest.mark.parametrize(
    ("words", "schema"),
    [
        (["sessions", "--lsat", "2", "--json"], "sessions"),
        (["plan", "--json"], "plan"),
        (["motor", "plot", "m.toml", "--json", "-o", "m.png"], "motor_plot"),
        (["diagnose", "--on", "nothing", "--json"], "diagnosis"),
        (["accept", "d-4f0c", "--json"], "acceptance"),
        (["bench", "export", "b.toml", "-o", "c.toml", "--json"], "bench_export"),
    ],
)
def test_the_json_of_a_refusal_is_called_as_the_answer_would_be(
    store: Path, words: list[str], schema: str, capsys: Capture
) -> None:
    try:
        assert main(words) == 2
    except SystemExit as stopped:
        assert stopped.code == 2
    out, err = capsys.readouterr()
    answer = json.loads(out)
    assert answer["schema"] == f"whyhot.{schema}/1"
    assert answer["error"] == err.rstrip("\n")


def test_options_stand_between_names(capsys: Capture) -> None:
    words = ["retract", "1_s1", "--json=a.json", "2_s2", "--reason", "x", "3_wltp", "--store", "s"]
    assert build_parser("retract").parse_args(words).what == ["1_s1", "2_s2", "3_wltp"]
    assert build_parser("show").parse_args(["show", "--store", "s", "--", "-1_s1"]).session == "-1_s1"
    assert main(["motor", "check", "--json", str(EXAMPLES / "reference_motor" / "motor.toml")]) == 0
    assert json.loads(capsys.readouterr().out)["nodes"] == 21


def test_a_mistyped_motor_names_the_nearest(store: Path, capsys: Capture) -> None:
    with Store.open(store, write=True) as opened:
        opened.ledger.append("motor-servo", ModelPublished(model="4f0c", motor="servo-5kW", file="m.toml", parent=None))
    assert main(["motor", "export", "servo-5W", "-o", "m.toml"]) == 2
    assert "is no model of this store. Nearest: servo-5kW. Known: servo-5kW 4f0c." in capsys.readouterr().err


@pytest.mark.parametrize("error", [MemoryError(), RuntimeError("can't start new thread")])
def test_too_little_memory_is_one_line(
    store: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr("ingest.facts.facts.at", fail)
    assert main(["sessions"]) == 2
    said = "whyhot sessions: there is too little memory: close other programs, or give it less at once."
    assert capsys.readouterr().err.strip().removeprefix("error: ") == said


def test_an_interrupt_while_the_warehouse_computes_is_an_interrupt(
    store: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("Query interrupted")

    monkeypatch.setattr("ingest.facts.facts.at", fail)
    assert main(["sessions"]) == 130
    assert capsys.readouterr().err.startswith("interrupted: what was finished is kept")


def test_an_interrupt_that_a_callback_swallows_comes_again(
    store: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped() -> None:
        raise KeyboardInterrupt

    callback = ctypes.CFUNCTYPE(None)(stopped)

    def swallows(*_: object) -> None:
        callback()
        for _number in range(500):
            time.sleep(0.01)

    monkeypatch.setattr("ingest.facts.facts.at", swallows)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # workers of the tests ignore it
    began = time.monotonic()
    try:
        assert main(["sessions"]) == 130
    finally:
        signal.signal(signal.SIGINT, before)
    assert time.monotonic() - began < 4.0
    assert capsys.readouterr().err.count("\n") == 1
