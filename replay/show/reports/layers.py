"""Layers for the rerun viewer: one .rrd a layer, all of one session in one recording, so that they lie over one
another.

Files with the same application and recording id and different entity paths overlay; so the recording id is the
session's. Paths: `measured/<node>/<channel>`, `inputs/<quantity>/<channel>`, `ignored/<quantity>/<channel>`,
`phase/<channel>`; `open_loop/<model>/<node>`, `residual/<model>/<node>/<channel>`, `masked/<model>/<channel>`,
`heat/<model>`; `filtered/<model>/<node>`, `loss/<model>/<node>/estimated`, `from`, `to` and `modelled`;
`extended/<model>/<node>`; `answer/...` for text. Every function raises ViewerError where rerun is not installed.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData
from ingest.errors import not_installed
from ingest.facts.events import SessionRecorded
from replay.engine.results.run import Run
from replay.errors import ViewerError
from replay.show.reports.blueprint import APPLICATION, colour, of_channels, of_run, path, view_of
from replay.show.words import words
from replay.show.words.findings import answer, finding, worst_first

if TYPE_CHECKING:
    import rerun

MEASURED_WIDTH, MODEL_WIDTH, FILTERED_WIDTH, BAND_WIDTH = 2.2, 1.4, 1.0, 0.6
BAND_SD = 2.0  # the band holds 95 % where the errors are normal
STARTS_S = 2.0  # a viewer that runs this long has started
MISSING = not_installed("the rerun viewer")


def write_measured(
    session: SessionRecorded, channels: Sequence[ChannelData], target: Path, run: Run | None = None
) -> None:
    """What was recorded, at its own rate: temperatures of nodes, inputs by quantity, states as phases.

    `run`: the replay that is opened along; both layers then bring the same layout, whichever is read first.
    """
    rr = _rerun()
    full = [channel for channel in channels if channel.t_ns.size]
    with _recording(session.session, session.name, target, of_run(run) if run else of_channels(full)) as stream:
        _write_text(stream, path("answer", "recording"), _about(session, full))
        beside: Counter[str] = Counter()  # lines already in the same view
        for channel in full:
            where, times = measured_path(channel), _times(channel.t_ns, session.absolute)
            if channel.spec.quantity == "state":
                changes = np.flatnonzero(np.r_[True, np.diff(channel.value) != 0])
                states = [words.number(value) for value in channel.value[changes]]
                stream.send_columns(
                    where, [_times(channel.t_ns[changes], session.absolute)], rr.StateChange.columns(state=states)
                )
                continue
            name = f"{channel.spec.name} [{channel.spec.stored_unit}]"
            view_name = where.split("/")[0] + view_of(channel.spec.quantity)
            _style(stream, where, name, colour(beside[view_name]), MEASURED_WIDTH)
            beside[view_name] += 1
            stream.send_columns(where, [times], rr.Scalars.columns(scalars=channel.value))


def measured_path(channel: ChannelData) -> str:
    """Entity path of a recorded channel."""
    spec = channel.spec
    if spec.quantity == "state":
        return path("phase", spec.name)
    if spec.quantity == "temperature" and spec.role == "observed":
        return path("measured", spec.node or spec.name, spec.name)
    return path("ignored" if spec.role == "ignored" else "inputs", spec.quantity, spec.name)


def write_open_loop(run: Run, target: Path, layer: str = "open_loop", over: Run | None = None, says: str = "") -> None:
    """What the model says: every node's temperature, each channel's residual and masked stretches, the network's heat.

    `layer`: the first part of the temperatures' paths, `extended` for a model that was extended; `over`: the run of the
    model before, which then is shown in the same views; `says`: the text panel (Markdown), else what the run got wrong.
    """
    _rerun()
    model = words.short(run.model)
    called = "model" if layer == "open_loop" else f"{words.name(layer)} model"
    blueprint = of_run(over, run) if over else of_run(run)
    with _recording(run.session, run.session_name, target, blueprint) as stream:
        _write_text(stream, path("answer", model), says or _findings(run))
        for i, node in enumerate(run.nodes):
            where = path(layer, model, node)
            _style(stream, where, f"{words.name(node)} {called}", colour(i, dark=False), MODEL_WIDTH)
            _send(stream, where, run.t_ns, run.temperatures[:, i], run.absolute)
        for observed in run.observed:
            where = path("residual", model, observed.node, observed.channel)
            _style(stream, where, f"{observed.channel} − model [K]", colour(_index(run, observed.node)), MODEL_WIDTH)
            _send(stream, where, observed.t_ns, np.where(observed.used, observed.residual, np.nan), run.absolute)
            if not observed.used.all():
                _write_masked(
                    stream, path("masked", model, observed.channel), observed.t_ns, observed.used, run.absolute
                )
        _style(stream, path("heat", model), "the network's heat [W]", colour(1), MODEL_WIDTH)
        _send(stream, path("heat", model), run.t_ns[:-1], run.losses_W, run.absolute)


def write_filtered(run: Run, target: Path) -> None:
    """What filter and smoother say: every node's temperature, and the heat that they estimate with a band, beside the
    modelled one.

    Raises ValueError for a run without a filter.
    """
    _rerun()
    model, filtered = words.short(run.model), run.filtered
    if filtered is None:
        raise ValueError(f"run {run.run} has no filter")
    with _recording(run.session, run.session_name, target, of_run(run)) as stream:
        for i, node in enumerate(run.nodes):
            where = path("filtered", model, node)
            _style(stream, where, f"{words.name(node)} filtered", colour(i, dark=False), FILTERED_WIDTH)
            _send(stream, where, run.t_ns, filtered.temperatures[:, i], run.absolute)
            if filtered.smoothed is not None:
                smooth = path("filtered", model, node, "smoothed")
                _style(stream, smooth, f"{words.name(node)} smoothed", colour(i, dark=False), MODEL_WIDTH)
                _send(stream, smooth, run.t_ns, filtered.smoothed.temperatures[:, i], run.absolute)
        band = BAND_SD * filtered.heat_sd_W
        lines = {
            "modelled": (filtered.nominal_W, 1, MODEL_WIDTH),
            "from": (filtered.heat_W - band, 0, BAND_WIDTH),
            "to": (filtered.heat_W + band, 0, BAND_WIDTH),
            "estimated": (filtered.heat_W, 0, MEASURED_WIDTH),
        }
        for name, (watts, index, width) in lines.items():
            where = path("loss", model, filtered.node, name)
            _style(stream, where, f"loss of the {words.name(filtered.node)}, {name} [W]", colour(index), width)
            _send(stream, where, run.t_ns[1:], watts, run.absolute)  # known at the end of each step
        if filtered.smoothed is not None:
            smoothed, band = filtered.smoothed.heat_W, BAND_SD * filtered.smoothed.heat_sd_W
            heats = {"smoothed": smoothed, "smoothed_from": smoothed - band, "smoothed_to": smoothed + band}
            for name, watts in heats.items():
                where = path("loss", model, filtered.node, name)
                says = f"loss of the {words.name(filtered.node)}, {name.replace('_', ' ')} [W]"
                _style(stream, where, says, colour(3), MEASURED_WIDTH if name == "smoothed" else BAND_WIDTH)
                _send(stream, where, run.t_ns[:-1], watts, run.absolute)  # holds in the step that begins there


def _rerun() -> Any:
    try:
        import rerun
    except ImportError as error:
        raise ViewerError(MISSING) from error
    return rerun


@contextmanager
def _recording(recording_id: str, name: str, target: Path, blueprint: Any) -> Iterator[rerun.RecordingStream]:
    rr = _rerun()
    stream = rr.RecordingStream(APPLICATION, recording_id=recording_id)
    stream.save(target, default_blueprint=blueprint)
    stream.send_recording_name(name)
    try:
        yield stream
    finally:
        stream.flush()
        stream.disconnect()


def _times(t_ns: NDArray[np.int64], absolute: bool) -> Any:
    """The timeline `time` in UTC, or `since_start` without absolute time: one application holds one type under one
    name."""
    rr = _rerun()
    if absolute:
        return rr.TimeColumn("time", timestamp=t_ns.astype("datetime64[ns]"))
    return rr.TimeColumn("since_start", duration=t_ns.astype("timedelta64[ns]"))


def _send(stream: Any, where: str, t_ns: NDArray[np.int64], values: NDArray[np.float64], absolute: bool) -> None:
    stream.send_columns(where, [_times(t_ns, absolute)], _rerun().Scalars.columns(scalars=values))


def _style(stream: Any, where: str, name: str, rgba: int, width: float) -> None:
    rr = _rerun()
    stream.log(where, rr.SeriesLines(colors=[rgba], widths=[width], names=[name]), static=True)


def _write_masked(stream: Any, where: str, t_ns: NDArray[np.int64], used: NDArray[np.bool_], absolute: bool) -> None:
    rr = _rerun()
    changes = np.flatnonzero(np.r_[True, np.diff(used)])
    states = ["used" if used[i] else "masked" for i in changes]
    stream.log(where, rr.StateConfiguration(values=["used", "masked"], colors=[colour(2), colour(1)]), static=True)
    stream.send_columns(where, [_times(t_ns[changes], absolute)], rr.StateChange.columns(state=states))


def _write_text(stream: Any, where: str, markdown: str) -> None:
    stream.log(where, _rerun().TextDocument(markdown, media_type="text/markdown"), static=True)


def _index(run: Run, node: str) -> int:
    return run.nodes.index(node) if node in run.nodes else len(run.nodes)


def _about(session: SessionRecorded, channels: Sequence[ChannelData]) -> str:
    seconds = (session.end_ns - session.start_ns) / 1e9
    rows = "\n".join(f"- {c.spec.name}: {c.spec.quantity}, {c.t_ns.size:,} samples" for c in channels)
    return f"# {session.name}\n{session.kind} ({session.kind_why}), {words.duration(seconds)}\n\n{rows}\n"


def _findings(run: Run) -> str:
    rows = "\n".join(f"- {finding(error)}" for error in worst_first(run.summary))
    source = (
        f"Model {run.motor} {words.short(run.model)}, open loop; digest {words.short(run.digest)}. Residual: measured "
        "minus model."
    )
    return f"# {run.session_name}\n{answer([run.summary])}\n\n{rows}\n\n{source}\n"


def view(paths: Sequence[Path]) -> None:
    """Open layers in the viewer and return; it listens on this machine only, and its usage statistics are switched off.

    Raises ViewerError where rerun is not installed or the viewer stops at once.
    """
    program = _program()
    subprocess.run([program, "analytics", "disable"], capture_output=True, check=False)
    command = [program, "--bind", "127.0.0.1", "--port", "auto", *map(str, paths)]
    with tempfile.TemporaryFile() as said:  # not a pipe: the viewer outlives this process
        viewer = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=said, stderr=said, start_new_session=True)
        try:
            code = viewer.wait(STARTS_S)
        except subprocess.TimeoutExpired:
            viewer.returncode = 0  # left running on purpose
            return
        said.seek(0)
        why = (said.read().decode(errors="replace").strip().splitlines() or ["no reason given"])[-1]
    if code:
        raise ViewerError(
            f"the rerun viewer stopped at once: {why}. Is there a display? To try again: rerun "
            f"{' '.join(map(str, paths))}"
        )


def _program() -> str:
    """The viewer itself: `rerun` on the path is a Python wrapper, and killing that leaves the viewer behind."""
    found = find_spec("rerun_cli")
    if found is None or found.origin is None:
        raise ViewerError(MISSING)
    return str(Path(found.origin).with_name("rerun.exe" if sys.platform == "win32" else "rerun"))
