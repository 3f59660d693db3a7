"""A file that a command was told to write is there whole, or as it was."""

import os
import threading
from pathlib import Path

import pytest

from replay.written import write, written


def test_what_is_not_finished_leaves_the_file_that_was_there(tmp_path: Path) -> None:
    target = tmp_path / "why.html"
    write(target, "<p>yesterday")
    with pytest.raises(KeyboardInterrupt), written(target) as part:
        part.write_text("<p>to")
        assert target.read_text() == "<p>yesterday"
        raise KeyboardInterrupt
    assert target.read_text() == "<p>yesterday"
    assert [*tmp_path.iterdir()] == [target]


def test_a_folder_that_is_not_there_is_made(tmp_path: Path) -> None:
    write(tmp_path / "march" / "3" / "why.html", "<p>T_Rücken")
    assert (tmp_path / "march" / "3" / "why.html").read_bytes() == "<p>T_Rücken".encode()


def test_a_link_stays_one(tmp_path: Path) -> None:
    latest, page = tmp_path / "latest.html", tmp_path / "march.html"
    page.write_text("<p>yesterday")
    latest.symlink_to(page)
    write(latest, "<p>today")
    assert latest.is_symlink()
    assert page.read_text() == "<p>today"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with a name here")
def test_a_pipe_is_written_to_itself(tmp_path: Path) -> None:
    pipe, got = tmp_path / "pipe", list[bytes]()
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()))
    reader.start()
    write(pipe, "<p>today")
    reader.join()
    assert got == [b"<p>today"]
    assert pipe.is_fifo()


def test_an_error_names_the_file_that_was_given(tmp_path: Path) -> None:
    """A name of 250 letters fits; a folder of that name does not take a file."""
    (tmp_path / "plan.csv").mkdir()
    with pytest.raises(OSError, match="Is a directory") as refused:
        write(tmp_path / "plan.csv", "time_s")
    assert refused.value.filename == str(tmp_path / "plan.csv")
    name = "n" * 250 + ".html"
    write(tmp_path / name, "<p>today")
    assert (tmp_path / name).exists()
    with pytest.raises(OSError, match="too long") as refused:
        write(tmp_path / f"{name}{name}", "<p>today")
    assert refused.value.filename == str(tmp_path / f"{name}{name}")
    assert {path.name for path in tmp_path.iterdir()} == {"plan.csv", name}
