"""The viewer as a program: on this machine's screen, or served to a browser on this machine alone."""

from __future__ import annotations

import getpass
import os
import shlex
import socket
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import quote

from replay.errors import ViewerError
from replay.show.viewer.seen import MISSING

HERE = "127.0.0.1"
STARTS_S = 2.0  # a viewer that runs this long has started
SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")


def view(paths: Sequence[Path]) -> None:
    """Open layers in the viewer and return; it listens on this machine only, and its usage statistics are switched off.
    Raises ViewerError where rerun is not installed, there is no display, or the viewer stops at once."""
    program = _program()
    if not has_display(sys.platform, os.environ):
        raise ViewerError("there is no display here: add --web to serve the viewer to a browser, or --write-only.")
    again = f"rerun {shlex.join(map(str, paths))}"
    _start([program, "--bind", HERE, "--port", "auto", *map(str, paths)], f"To try again: {again}")


def has_display(platform: str, environment: Mapping[str, str]) -> bool:
    """Whether a window can open: on Linux a display server must be named."""
    return platform in ("win32", "darwin") or any(environment.get(name) for name in SCREENS)


def serve(paths: Sequence[Path]) -> str:
    """Serve layers to a browser and return, with what to do: the address, and how to reach it from another machine.
    Raises ViewerError as `view` does."""
    web, data = _free_port(), _free_port()
    command = [_program(), "--serve-web", "--bind", HERE, "--web-viewer-port", str(web), "--port", str(data)]
    pid = _start([*command, *map(str, paths)], "Is another viewer running?")
    address = f"http://{HERE}:{web}/?url={quote(f'rerun+http://{HERE}:{data}/proxy', safe='')}"
    through = f"ssh -N -L {web}:{HERE}:{web} -L {data}:{HERE}:{data} {getpass.getuser()}@{socket.gethostname()}"
    return f"{address}\nfrom another machine first: {through}\nto end it: kill {pid}"


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((HERE, 0))
        return int(probe.getsockname()[1])


def _start(command: Sequence[str], then: str) -> int:
    """Start the viewer and leave it running; returns its process id. `then`: what to do where it stops at once."""
    subprocess.run([command[0], "analytics", "disable"], capture_output=True, check=False)
    with tempfile.TemporaryFile() as said:  # not a pipe: the viewer outlives this process
        viewer = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=said, stderr=said, start_new_session=True)
        try:
            code = viewer.wait(STARTS_S)
        except subprocess.TimeoutExpired:
            viewer.returncode = 0  # left running on purpose
            return viewer.pid
        said.seek(0)
        why = (said.read().decode(errors="replace").strip().splitlines() or ["no reason given"])[-1]
    if code:
        raise ViewerError(f"the rerun viewer stopped at once: {why}. {then}")
    return viewer.pid


def _program() -> str:
    """The viewer itself: `rerun` on the path is a Python wrapper, and killing that leaves the viewer behind."""
    found = find_spec("rerun_cli")
    if found is None or found.origin is None:
        raise ViewerError(MISSING)
    return str(Path(found.origin).with_name("rerun.exe" if sys.platform == "win32" else "rerun"))
