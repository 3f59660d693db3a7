"""The viewer started: on this machine alone, never without a display, and what is then on the screen."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest

from made.seen import seen
from replay.errors import ViewerError
from replay.show.viewer import program
from replay.show.viewer.layers import write_layers
from replay.show.viewer.seen import COLOUR, MEASURED

posix = pytest.mark.skipif(sys.platform == "win32", reason="the stand-in for the viewer is a shell script")


def stand_in(tmp_path: Path, script: str) -> str:
    file = tmp_path / "rerun"
    file.write_text(f"#!/bin/sh\necho $@ >> {tmp_path / 'said'}\n[ $1 = analytics ] && exit 0\n{script}\n")
    file.chmod(0o755)
    return str(file)


@posix
def test_the_viewer_is_started_on_this_machine_only_with_its_statistics_off(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    found = stand_in(tmp_path, "exit 0")
    monkeypatch.setattr(program, "_program", lambda: found)
    monkeypatch.setenv("DISPLAY", ":0")
    program.view([Path("a.rrd"), Path("b.rrd")])
    said = (tmp_path / "said").read_text().splitlines()
    assert said == ["analytics disable", "--bind 127.0.0.1 --port auto a.rrd b.rrd"]


@posix
def test_a_viewer_that_stops_at_once_is_refused_with_its_own_last_words(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    found = stand_in(tmp_path, "echo first; echo no screen; exit 1")
    monkeypatch.setattr(program, "_program", lambda: found)
    monkeypatch.setenv("DISPLAY", ":0")
    with pytest.raises(ViewerError, match=r"at once: no screen\. To try again: rerun a\.rrd$"):
        program.view([Path("a.rrd")])


def test_without_a_display_the_viewer_is_not_even_started() -> None:
    assert not program.has_display("linux", {"DISPLAY": ""})
    assert program.has_display("linux", {"WAYLAND_DISPLAY": "wayland-0"})
    assert program.has_display("darwin", {}) and program.has_display("win32", {})


@posix
def test_served_it_listens_here_alone_and_says_how_to_come_from_elsewhere(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    found = stand_in(tmp_path, "exit 0")
    monkeypatch.setattr(program, "_program", lambda: found)
    address, through, _ = program.serve([Path("a.rrd")]).splitlines()
    served = (tmp_path / "said").read_text().splitlines()[1].split()
    web, data = (served[served.index(flag) + 1] for flag in ("--web-viewer-port", "--port"))
    assert served[:3] == ["--serve-web", "--bind", "127.0.0.1"]
    assert address == f"http://127.0.0.1:{web}/?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A{data}%2Fproxy"
    assert f"ssh -N -L {web}:127.0.0.1:{web} -L {data}:127.0.0.1:{data} " in through


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    """A screen that nobody sees, so large that the pointer, in its middle, is not over the viewer."""
    if shutil.which("Xvfb") is None:
        pytest.skip("Xvfb is not installed: apt install xvfb")
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "4000x4000x24"]
    screen = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as says:
        number = says.readline().strip()
    yield f":{number}"
    screen.terminate()
    screen.wait()


@pytest.fixture
def layers(tmp_path: Path) -> list[Path]:
    """Of a session whose models are 8 K apart, so that each line is on its own."""
    pytest.importorskip("rerun")
    one = seen()
    runs = {
        role: replace(run, observed=tuple(replace(o, modelled=o.modelled - 8 * k) for o in run.observed))
        for k, (role, run) in enumerate(one.runs.items(), 1)
    }
    return write_layers(replace(one, runs=runs), tmp_path)


def screenshot(layers: list[Path], display: str) -> Any:
    """What the viewer shows of layers, (height, width, 3) from 0 to 255."""
    target = layers[0].with_name("shot.png")
    environment = os.environ | {"DISPLAY": display, "LIBGL_ALWAYS_SOFTWARE": "1"}
    size = ("--port", "auto", "--window-size", "1600x1000", "--screenshot-to", target)
    subprocess.run([program._program(), *layers, *size], env=environment, capture_output=True, timeout=120, check=True)
    return np.round(255 * matplotlib.image.imread(target)[:, :, :3])


def columns_with(picture: Any, colour: str) -> Any:
    """Whether a colour is in each column of a part of a picture."""
    wanted = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return (np.abs(picture - wanted).max(axis=2) <= 24).any(axis=0)


def test_every_model_and_the_answer_are_on_the_screen_and_nothing_covers_a_line(
    layers: list[Path], display: str
) -> None:
    picture = screenshot(layers, display)
    height, width, _ = picture.shape
    second = picture[int(0.16 * height) : int(0.47 * height), int(0.285 * width) : int(0.53 * width)]  # the winding
    for colour in (MEASURED, *COLOUR.values()):
        there = columns_with(second, colour)
        assert there.mean() > 0.9, f"{colour} is there over {100 * there.mean():.0f} % of the panel's width"
    beside = picture[: int(0.25 * height), int(0.81 * width) :]
    assert (beside.min(axis=2) > 150).sum() > 500, "the answer is written beside the plots"
