"""What is printed on a terminal and what elsewhere: its width, its colours."""

from __future__ import annotations

import fcntl
import os
import pty
import struct
import sys
import termios
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from io import StringIO
from typing import TextIO

import pytest

from replay.cli import build_parser, main, progress
from replay.cli.answer import Answer, deliver
from replay.cli.colour import coloured
from replay.show.words.terminal import labelled
from replay.show.words.width import width

WRONG = "\n".join([*labelled("Answer", "none"), *labelled("What is wrong", "magnet " * 20), "", "magnet   7.0 K"])


@contextmanager
def terminal(columns: int) -> Iterator[tuple[TextIO, int]]:
    """A terminal of so many columns to print on, and where what was printed is read."""
    reads, writes = pty.openpty()
    fcntl.ioctl(writes, termios.TIOCSWINSZ, struct.pack("HHHH", 30, columns, 0, 0))
    try:
        with os.fdopen(writes, "w", encoding="utf-8") as stream:
            yield stream, reads
    finally:
        os.close(reads)


def shown(stream: TextIO, reads: int) -> str:
    """All that was printed on a terminal. It hands on what is there in parts, so an end is written and read up to."""
    stream.write("\0")
    stream.flush()
    text = b""
    while not text.endswith(b"\0"):
        text += os.read(reads, 1000)
    return text[:-1].decode()


@pytest.mark.parametrize(("columns", "text"), [(80, 80), (20, 60), (300, 140), (0, 100)])
def test_text_is_as_wide_as_the_terminal_within_reason(
    columns: int, text: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    with terminal(columns) as (stream, _), monkeypatch.context() as patched:
        patched.setattr(sys, "stdout", stream)
        lines = labelled("Answer", "word " * 100)
        found = width()
    assert found == text
    assert text - 5 < max(map(len, lines)) <= text


def test_elsewhere_text_is_100_columns_wide() -> None:
    assert width(StringIO()) == 100


@pytest.mark.parametrize(
    ("asked", "found"), [("60", 60), ("20", 60), ("300", 140), ("0", 100), ("wide", 100), ("", 100)]
)
def test_columns_of_the_environment_are_kept_to_in_a_pipe(
    asked: str, found: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", asked)
    assert width(StringIO()) == found


def test_help_is_as_wide_as_all_else(monkeypatch: pytest.MonkeyPatch) -> None:
    for asked in (60, 100):
        monkeypatch.setenv("COLUMNS", str(asked))
        lines = build_parser("ingest").format_help().splitlines()
        assert asked - 15 < max(map(len, lines)) <= asked


def test_what_is_wrong_stands_out_on_a_terminal_line_by_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    with terminal(100) as (stream, _):
        answer, *wrong, empty, row = coloured(WRONG, stream).split("\n")
    assert answer.startswith("\033[1mAnswer") and answer.endswith("none\033[0m")
    assert len(wrong) == 2 and all(line.startswith("\033[1;33m") and line.endswith("\033[0m") for line in wrong)
    assert (empty, row) == ("", "magnet   7.0 K")


@pytest.mark.parametrize("said", [{"NO_COLOR": "1"}, {"TERM": "dumb"}])
def test_no_colour_where_it_is_not_wanted(said: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in ({"TERM": "xterm", "NO_COLOR": ""} | said).items():
        monkeypatch.setenv(name, value)
    with terminal(100) as (stream, _):
        assert coloured(WRONG, stream) == WRONG


def test_no_colour_in_a_pipe() -> None:
    assert coloured(WRONG, StringIO()) == WRONG


def test_a_refusal_is_red_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    with terminal(100) as (stream, reads), monkeypatch.context() as patched:
        patched.setattr(sys, "stderr", stream)
        assert main(["replya"]) == 2
        printed = shown(stream, reads)
    assert printed.strip() == "\033[1;31mwhyhot: replya is no verb. Nearest: replay. whyhot --help lists all\033[0m"


def test_a_note_of_what_was_done_is_not_red(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    args = Namespace(json=None, store=None)
    with terminal(100) as (stream, reads), monkeypatch.context() as patched:
        patched.setattr(sys, "stderr", stream)
        for code in (0, 1):
            deliver(args, Answer({}, "", code, ["day.csv"]))
        printed = shown(stream, reads)
    assert printed.replace("\r\033[K", "").split() == ["day.csv", "\033[1;31mday.csv\033[0m"]


def test_progress_tells_pace_and_time_left_beside_its_count(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    now = iter([10.0, 14.0, 18.0, 19.0, 20.0, 20.5])
    monkeypatch.setattr("replay.cli.progress.monotonic", lambda: next(now))
    with terminal(100) as (stream, reads), monkeypatch.context() as patched:
        patched.setattr(sys, "stderr", stream)
        for line in (
            "reading 1 of 12: a",
            "reading 2 of 12: b",
            "reading",
            "reading 4 of 12: c of 2",
            "reading 1 of 12: a",
        ):
            progress.tell(line)
        for line in ("event 1 of 2,000", "event 1,001 of 2,000"):
            progress.tell(line)
        printed = shown(stream, reads).split("\r\033[K")[1:]
    assert printed == [
        "reading 1 of 12: a",
        "reading 2 of 12 (4.0 s each, 44 s left): b",
        "reading",
        "reading 4 of 12 (2.7 s each, 24 s left): c of 2",
        "reading 1 of 12: a",
        "event 1 of 2,000",
        "event 1,001 of 2,000 (2,000 a second, 0 s left)",
    ]


def test_elsewhere_there_is_no_progress(capsys: pytest.CaptureFixture[str]) -> None:
    for number in (1, 2):
        progress.tell(f"reading {number} of 12")
    assert capsys.readouterr() == ("", "")
