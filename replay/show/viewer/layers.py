"""Layers for the rerun viewer, one .rrd each. Those of a session lie over one another: all have its id as the id of
their recording, each has entity paths of its own, and all carry one layout, whichever is read first.

Paths: `measured/<node>/<channel>`, `inputs/<quantity>/<channel>`, `ignored/<quantity>/<channel>`,
`phase/<channel>`; `open_loop/<model>/<node>` (`extended/...` of a model with a cause),
`reads/<model>/<node>/<channel>` (what the model has a channel read), `residual/<model>/<node>/<channel>`,
`masked/<model>/<channel>`, `heat/<model>`; `band/<node>/<channel>/zero`, `from` and `to`; `filtered/<model>/<node>`,
`loss/<model>/<node>/estimated`, `from`, `to` and `modelled`; `event` and `answer` for text, `key/...` for what colours
mean. All raise ViewerError where rerun is not installed.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData
from ingest.texts.times import clock
from ingest.texts.units import with_unit
from replay.engine.results.run import Run
from replay.show.viewer import beside
from replay.show.viewer.layer_file import LayerFile
from replay.show.viewer.network_layer import draw_motor
from replay.show.viewer.seen import (
    COLOUR,
    CORRECTED,
    ESTIMATED,
    MEASURED,
    SMOOTHED,
    SessionSeen,
    of_model,
    path,
    sdk,
    unit,
)
from replay.show.words import words
from replay.show.words.findings import answer, finding, worst_first
from replay.show.words.thin import open_holes

BAND_SD = 2.0  # the band holds 95 % where the errors are normal
WIDE, MIDDLE, THIN = 2.4, 1.5, 0.8  # of lines


def write_layers(seen: SessionSeen, folder: Path) -> list[Path]:
    """A file for what was recorded, one a model, one for filter and smoother and one for the motor's network, where
    there is such a thing: `<session>.measured.rrd`, `.open_loop.rrd`, `.recalibrated.rrd`, `.extended.rrd`,
    `.filtered.rrd`, `.network.rrd`."""
    layers: dict[str, Callable[[LayerFile], None]] = {"measured": lambda to: _measured(to, seen)}
    for role, run in seen.runs.items():
        name = "open_loop" if role == "published" else role
        layers[name] = lambda to, role=role, run=run: _model(to, seen, role, run)  # type: ignore[misc]
    if (first := seen.first) and first.filtered:
        layers["filtered"] = lambda to: _filtered(to, first)
    if seen.network and seen.last:
        network, (_, last) = seen.network, seen.last
        layers["network"] = lambda to: draw_motor(to, network, last, seen.session.start_ns)
    sdk()
    from replay.show.viewer import blueprint  # made of the SDK

    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, write in layers.items():
        paths.append(folder / f"{seen.session.name}.{name}.rrd")
        session = seen.session
        with LayerFile.open(session.session, session.name, paths[-1], blueprint.of(seen), session.absolute) as to:
            to.text("answer", seen.says or _says(seen))
            to.key("lines", seen.key)
            write(to)
    return paths


def _measured(to: LayerFile, seen: SessionSeen) -> None:
    """What was recorded, at its own rate: temperatures of nodes, inputs by quantity, states as phases."""
    for channel in (channel for channel in seen.channels if channel.t_ns.size):
        beside.phases(to, channel)
        if channel.spec.quantity != "state":
            where, says = measured_path(channel), with_unit(channel.spec.name, unit(channel.spec))
            to.line(where, says, MEASURED, WIDE, *open_holes(channel.t_ns, channel.value))


def measured_path(channel: ChannelData) -> str:
    """Entity path of a recorded channel."""
    spec = channel.spec
    if spec.quantity == "state":
        return path("phase", spec.name)
    if spec.quantity == "temperature" and spec.role == "observed":
        return path("measured", spec.node or spec.name, spec.name)
    return path("ignored" if spec.role == "ignored" else "inputs", spec.quantity, spec.name)


def _model(to: LayerFile, seen: SessionSeen, role: str, run: Run) -> None:
    """What a model says: every node's temperature, what each channel would read, its residual against the reading as
    recorded, the network's heat; of the first also the sensors' bands, the masked stretches and what happened when."""
    layer, label, colour = of_model(role, run), seen.label(role), COLOUR[role]
    for i, node in enumerate(run.nodes):
        to.line(path(*layer, node), f"{words.name(node)} {label}", colour, MIDDLE, run.t_ns, run.temperatures[:, i])
    for o in run.observed:
        reads = path("reads", layer[1], o.node, o.channel)
        to.line(reads, f"{o.channel} {label}", colour, MIDDLE, o.t_ns, o.modelled)
        residual = np.where(o.used, seen.recorded(o).residual, np.nan)
        to.line(path("residual", layer[1], o.node, o.channel), f"{label} [K]", colour, MIDDLE, o.t_ns, residual)
        if seen.moved(o):
            where = path("corrected", layer[1], o.node, o.channel)
            to.line(where, f"{o.channel} as corrected for {label}", CORRECTED, THIN, o.t_ns, o.measured)
    to.line(path("heat", layer[1]), f"the network's heat {label} [W]", colour, MIDDLE, run.t_ns[:-1], run.losses_W)
    if run is seen.first:
        for o in run.observed:
            beside.band(to, o)
            beside.masked(to, o, layer[1])
        _events(to, run)


def _events(to: LayerFile, run: Run) -> None:
    """What happened when, as text that one can click: the worst error of each channel, and limits that were passed."""
    events: list[tuple[int, str]] = []
    for one in run.observed:
        if one.usable.any():
            i = int(np.argmax(np.where(one.usable, np.abs(one.residual), -1.0)))
            says = f"{words.name(one.node)} {words.signed_kelvin(one.residual[i])}, the worst of {one.channel}"
            events.append((int(one.t_ns[i]), says))
    for node, limit in run.limits_degC.items():
        over = run.temperatures[:, run.nodes.index(node)] > limit
        for i in np.flatnonzero(np.diff(over.astype(int)) > 0).tolist():
            events.append((int(run.t_ns[i + 1]), f"{words.name(node)} above its limit of {limit:g} °C"))
    begin = int(run.t_ns[0])
    to.log_texts("event", [(at, f"{clock((at - begin) / 1e9)}  {says}") for at, says in sorted(events)])


def _filtered(to: LayerFile, run: Run) -> None:
    """What filter and smoother say: every node's temperature, and the heat that they estimate with a band, beside the
    modelled one."""
    filtered, model = run.filtered, words.short(run.model)
    assert filtered is not None, "asked for where there is one"
    smoothed, begins, ends = filtered.smoothed, run.t_ns[:-1], run.t_ns[1:]
    for i, node in enumerate(run.nodes):
        where, name = path("filtered", model, node), words.name(node)
        to.line(where, f"{name} filtered", ESTIMATED, MIDDLE, run.t_ns, filtered.temperatures[:, i])
        if smoothed is not None:
            to.line(f"{where}/smoothed", f"{name} smoothed", SMOOTHED, MIDDLE, run.t_ns, smoothed.temperatures[:, i])
    heats = _with_band("estimated", ESTIMATED, ends, filtered.heat_W, filtered.heat_sd_W)
    if smoothed is not None:  # the smoother's holds in the step that begins there
        heats |= _with_band("smoothed", SMOOTHED, begins, smoothed.heat_W, smoothed.heat_sd_W)
    heats["modelled"] = (ends, filtered.nominal_W, COLOUR["published"], MIDDLE)
    for name, (t_ns, watts, colour, width) in heats.items():
        says = f"loss of the {words.name(filtered.node)}, {name.replace('_', ' ')} [W]"
        to.line(path("loss", model, filtered.node, name), says, colour, width, t_ns, watts)
    lines = {"measured": MEASURED, "modelled": COLOUR["published"], "filter's estimate with its band": ESTIMATED}
    to.key("estimates", lines | ({"smoother's": SMOOTHED} if smoothed else {}))


def _with_band(
    name: str, colour: str, t_ns: NDArray[np.int64], watts: NDArray[np.float64], sd: NDArray[np.float64]
) -> dict[str, tuple[Any, ...]]:
    """Name of a line -> time, values, colour and width, of an estimate and the two ends of its band."""
    prefix = "" if name == "estimated" else f"{name}_"
    return {
        f"{prefix}from": (t_ns, watts - BAND_SD * sd, colour, THIN),
        f"{prefix}to": (t_ns, watts + BAND_SD * sd, colour, THIN),
        name: (t_ns, watts, colour, WIDE),
    }


def _says(seen: SessionSeen) -> str:
    """The text panel of a session that no diagnosis is about: what its replay got wrong, else what it holds."""
    run, session = seen.first, seen.session
    if run is None:
        length = words.duration((session.end_ns - session.start_ns) / 1e9)
        full = [one for one in seen.channels if one.t_ns.size]
        rows = "\n".join(f"- {c.spec.name}: {c.spec.quantity}, {c.t_ns.size:,} samples" for c in full)
        return f"# {session.name}\n{session.kind} ({session.kind_why}), {length}\n\n{rows}\n"
    rows = "\n".join(f"- {finding(error, run.summary)}" for error in worst_first(run.summary))
    model, digest = f"Model {run.motor} {words.short(run.model)}", f"digest {words.short(run.digest)}"
    source = f"{model}, open loop; {digest}. Residual: measured minus model."
    source += "".join(f"\n\n{words.capital(note)}." for note in (run.summary.note, seen.corrected) if note)
    return f"# {run.session_name}\n{answer([run.summary])}\n\n{rows}\n\n{source}\n"
