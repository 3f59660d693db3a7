"""Layers for the rerun viewer, one .rrd each. Those of a session lie over one another: all have its id as the id of
their recording, and each has entity paths of its own.

Paths: `measured/<node>/<channel>`, `inputs/<quantity>/<channel>`, `ignored/<quantity>/<channel>`,
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
from replay.show.plots.compare import as_recorded
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
    """What was recorded, at its own rate: temperatures of nodes, inputs by quantity, states as phases. `run`: the
    replay that is opened along, so that both layers bring the same layout, whichever is read first."""
    rr = _rerun()
    full = [channel for channel in channels if channel.t_ns.size]
    with _recording(session.session, session.name, target, of_run(run) if run else of_channels(full)) as stream:
        _write_text(stream, path("answer", "recording"), _about(session, full))
        beside: Counter[str] = Counter()  # lines already in the same view
        for channel in full:
            where, absolute = measured_path(channel), session.absolute
            if channel.spec.quantity == "state":
                changes = np.flatnonzero(np.r_[True, np.diff(channel.value) != 0])
                states = [words.number(value) for value in channel.value[changes]]
                times = [_times(channel.t_ns[changes], absolute)]
                stream.send_columns(where, times, rr.StateChange.columns(state=states))
                continue
            name = f"{channel.spec.name} [{channel.spec.stored_unit}]"
            view_name = where.split("/")[0] + view_of(channel.spec.quantity)
            style = (name, colour(beside[view_name]), MEASURED_WIDTH)
            beside[view_name] += 1
            _line(stream, where, style, channel.t_ns, channel.value, absolute)


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
    model before, which then is shown in the same views and whose readings are those as recorded that residuals are of;
    `says`: the text panel (Markdown), else what the run got wrong.
    """
    _rerun()
    model = words.short(run.model)
    called = "model" if layer == "open_loop" else f"{words.name(layer)} model"
    blueprint = of_run(over, run) if over else of_run(run)
    recorded = {o.channel: o for o in over.observed} if over else {}
    with _recording(run.session, run.session_name, target, blueprint) as stream:
        _write_text(stream, path("answer", model), says or _findings(run))
        for i, node in enumerate(run.nodes):
            style = (f"{words.name(node)} {called}", colour(i, dark=False), MODEL_WIDTH)
            _line(stream, path(layer, model, node), style, run.t_ns, run.temperatures[:, i], run.absolute)
        for o in run.observed:
            style = (f"{o.channel} − model [K]", colour(_index(run, o.node)), MODEL_WIDTH)
            residual = np.where(o.used, as_recorded(recorded.get(o.channel, o), o).residual, np.nan)
            _line(stream, path("residual", model, o.node, o.channel), style, o.t_ns, residual, run.absolute)
            if not o.used.all():
                _write_masked(stream, path("masked", model, o.channel), o.t_ns, o.used, run.absolute)
        style = ("the network's heat [W]", colour(1), MODEL_WIDTH)
        _line(stream, path("heat", model), style, run.t_ns[:-1], run.losses_W, run.absolute)


def write_filtered(run: Run, target: Path) -> None:
    """What filter and smoother say: every node's temperature, and the heat that they estimate with a band, beside the
    modelled one. Raises ValueError for a run without a filter."""
    _rerun()
    model, filtered = words.short(run.model), run.filtered
    if filtered is None:
        raise ValueError(f"run {run.run} has no filter")
    smoothed, begins, ends = filtered.smoothed, run.t_ns[:-1], run.t_ns[1:]
    with _recording(run.session, run.session_name, target, of_run(run)) as stream:
        for i, node in enumerate(run.nodes):
            style = (f"{words.name(node)} filtered", colour(i, dark=False), FILTERED_WIDTH)
            where = path("filtered", model, node)
            _line(stream, where, style, run.t_ns, filtered.temperatures[:, i], run.absolute)
            if smoothed is not None:
                style = (f"{words.name(node)} smoothed", colour(i, dark=False), MODEL_WIDTH)
                where = path("filtered", model, node, "smoothed")
                _line(stream, where, style, run.t_ns, smoothed.temperatures[:, i], run.absolute)
        band = BAND_SD * filtered.heat_sd_W
        heats = {  # the filter knows a step's heat at its end
            "modelled": (ends, filtered.nominal_W, 1, MODEL_WIDTH),
            "from": (ends, filtered.heat_W - band, 0, BAND_WIDTH),
            "to": (ends, filtered.heat_W + band, 0, BAND_WIDTH),
            "estimated": (ends, filtered.heat_W, 0, MEASURED_WIDTH),
        }
        if smoothed is not None:  # the smoother's holds in the step that begins there
            band = BAND_SD * smoothed.heat_sd_W
            heats["smoothed"] = (begins, smoothed.heat_W, 3, MEASURED_WIDTH)
            heats["smoothed_from"] = (begins, smoothed.heat_W - band, 3, BAND_WIDTH)
            heats["smoothed_to"] = (begins, smoothed.heat_W + band, 3, BAND_WIDTH)
        for name, (t_ns, watts, index, width) in heats.items():
            says = f"loss of the {words.name(filtered.node)}, {name.replace('_', ' ')} [W]"
            where = path("loss", model, filtered.node, name)
            _line(stream, where, (says, colour(index), width), t_ns, watts, run.absolute)


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
    """The timeline `time` in UTC, or `since_start` without absolute time: a timeline's name has one type."""
    rr = _rerun()
    if absolute:
        return rr.TimeColumn("time", timestamp=t_ns.astype("datetime64[ns]"))
    return rr.TimeColumn("since_start", duration=t_ns.astype("timedelta64[ns]"))


def _line(
    stream: Any,
    where: str,
    style: tuple[str, int, float],
    t_ns: NDArray[np.int64],
    values: NDArray[np.float64],
    absolute: bool,
) -> None:
    """A line of the viewer. `style`: its name, colour 0xRRGGBBAA and width."""
    rr, (name, rgba, width) = _rerun(), style
    stream.log(where, rr.SeriesLines(colors=[rgba], widths=[width], names=[name]), static=True)
    stream.send_columns(where, [_times(t_ns, absolute)], rr.Scalars.columns(scalars=values))


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
    model, digest = f"Model {run.motor} {words.short(run.model)}", f"digest {words.short(run.digest)}"
    source = f"{model}, open loop; {digest}. Residual: measured minus model."
    return f"# {run.session_name}\n{answer([run.summary])}\n\n{rows}\n\n{source}\n"


def view(paths: Sequence[Path]) -> None:
    """Open layers in the viewer and return; it listens on this machine only, and its usage statistics are switched off.
    Raises ViewerError where rerun is not installed or the viewer stops at once."""
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
        again = f"rerun {' '.join(map(str, paths))}"
        raise ViewerError(f"the rerun viewer stopped at once: {why}. Is there a display? To try again: {again}")


def _program() -> str:
    """The viewer itself: `rerun` on the path is a Python wrapper, and killing that leaves the viewer behind."""
    found = find_spec("rerun_cli")
    if found is None or found.origin is None:
        raise ViewerError(MISSING)
    return str(Path(found.origin).with_name("rerun.exe" if sys.platform == "win32" else "rerun"))
