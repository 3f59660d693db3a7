"""Sessions over one another on one axis: from their starts, or from where the motor was driven alike."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ingest.catalogue.channels import ChannelData
from ingest.morning.matching import block_length, blocks, driven_by, match, operating
from ingest.texts.quantities import STORED_UNIT
from ingest.texts.units import as_written
from replay.errors import ViewerError
from replay.show.viewer import beside
from replay.show.viewer.layer_file import LayerFile
from replay.show.viewer.passes import passes
from replay.show.viewer.seen import SessionSeen, path, sdk, unit
from replay.show.words import words
from replay.show.words.palette import SERIES
from replay.show.words.thin import open_holes

MEASURED_WIDTH, MODEL_WIDTH = 2.4, 1.0
COLOURS = [dark for _, dark in SERIES.values()]
SECOND_NS = 1_000_000_000
WAYS = {
    "start": "from their starts",
    "test": "laid where they were driven alike for longest",
    "cycle": "each from its start",
}


def write_aligned(sessions: Sequence[SessionSeen], way: str, folder: Path) -> Path:
    """One .rrd with the courses of `sessions` by time since their starts (`way` "start"), since the first one's, each
    shifted to where it was driven alike for longest ("test"), or of their cycles, each since its own ("cycle"): a
    colour a session or cycle, a panel a node, measured thick, the last model thin; residuals with zero and the sensors'
    bands, phases below. Of more than 7 cycles the first, the last and some between. Raises ViewerError where there are
    more than 7 sessions, no such stretch, or no cycles."""
    whole = [one.session for one in sessions]
    says = WAYS[way]
    if way == "cycle":
        every = [part for one in sessions for part in passes(one)]
        sessions = [every[i] for i in np.unique(np.linspace(0, len(every) - 1, len(COLOURS)).round().astype(int))]
        says += f", {len(sessions)} of {len(every)}" if len(sessions) < len(every) else ""
    if len(sessions) > len(COLOURS):
        raise ViewerError(f"--align shows {len(COLOURS)} sessions at most: leave {len(sessions) - len(COLOURS)} out.")
    zeros = [one.session.start_ns for one in sessions]
    if way == "test":
        zeros = [zeros[0], *(zeros[0] + _later(sessions[0], other) for other in sessions[1:])]
    names = [one.session.name for one in sessions]
    sdk()
    folder.mkdir(parents=True, exist_ok=True)
    title = "+".join(one.name for one in whole) + (" by cycle" if way == "cycle" else "")
    target = folder / f"{title}.rrd"
    id_ = "+".join(one.session for one in whole) + (way if way == "cycle" else "")
    with LayerFile.open(id_, " over ".join(names), target, _layout(sessions), absolute=False) as to:
        to.key("lines", dict(zip(names, COLOURS, strict=False)))
        rows = [f"- {one.session.name}: {one.session.kind}" for one in sessions]
        to.text("answer", f"**{words.joined(names)}, {says}.**\n\nMeasured thick, model thin.\n\n" + "\n".join(rows))
        for one, zero, colour in zip(sessions, zeros, COLOURS, strict=False):
            _session(to, one, zero, colour)
    return target


def _later(first: SessionSeen, other: SessionSeen) -> int:
    """How much later [ns] by its stamps the other was driven as the first, in the longest such stretch."""
    by = driven_by(first.channels, other.channels)
    names = f"{first.session.name} and {other.session.name}"
    again = "--align start lays their starts over one another."
    if not by:
        raise ViewerError(f"--align test: {names} have no speed or load in common: {again}")
    runs = [first.channels, other.channels]
    length = block_length(runs)
    found = match(blocks(runs[0], length, by), blocks(runs[1], length, by), by)
    if not found.stretch.size:
        raise ViewerError(f"--align test: {names} were nowhere driven alike for a minute: {again}")
    at = int(np.flatnonzero(found.stretch == np.bincount(found.stretch).argmax())[0])
    begins = [max(int(one.t_ns[0]) for name, one in operating(run).items() if name in by) for run in runs]
    indices = (int(found.first[at]), int(found.second[at]))
    stamps = [begin + index * length * SECOND_NS for begin, index in zip(begins, indices, strict=True)]
    return stamps[1] - stamps[0]


def _session(to: LayerFile, seen: SessionSeen, zero: int, colour: str) -> None:
    name = seen.session.name
    for channel in (channel for channel in seen.channels if channel.t_ns.size):
        beside.phases(to, channel, name, zero=zero)
        says = f"{name}: {channel.spec.name} [{unit(channel.spec)}]"
        if where := _where(channel):
            place, t_ns = path(*where, name, channel.spec.name), channel.t_ns - zero
            to.line(place, says, colour, MEASURED_WIDTH, *open_holes(t_ns, channel.value))
    if not seen.last:
        return
    role, run = seen.last
    observed = {o.node for o in run.observed}
    for i, node in enumerate(run.nodes):
        if node not in observed:
            says, where_ = f"{name}: {words.name(node)} {seen.label(role)}", path("node", node, name, "model")
            to.line(where_, says, colour, MODEL_WIDTH, run.t_ns - zero, run.temperatures[:, i])
    for o in run.observed:  # what the model says that the sensor would read: measured minus that is the residual
        says, where_ = f"{name}: {o.channel} {seen.label(role)}", path("node", o.node, name, o.channel, "model")
        to.line(where_, says, colour, MODEL_WIDTH, o.t_ns - zero, o.modelled)
        residual = np.where(o.used, seen.recorded(o).residual, np.nan)
        to.line(path("residual", o.node, name, o.channel), f"{name} [K]", colour, MODEL_WIDTH, o.t_ns - zero, residual)
        beside.band(to, o, name, zero=zero)
        beside.masked(to, o, name, zero)


def _where(channel: ChannelData) -> tuple[str, str] | None:
    """The panel that a channel is in; None of those that are in none."""
    spec = channel.spec
    if spec.role == "observed" and spec.quantity == "temperature":
        return "node", spec.node or spec.name
    return ("inputs", spec.quantity) if spec.role == "input" and spec.quantity != "state" else None


def _layout(sessions: Sequence[SessionSeen]) -> Any:
    import rerun.blueprint as rrb

    from replay.show.viewer.blueprint import FIRST, key, page, phases, series

    nodes = list(dict.fromkeys(node for one in sessions for node in one.observed))[: 2 * FIRST]
    columns = []
    for node in nodes:
        above = series(f"{words.capital(words.name(node))} [°C]", [f"+ /{path('node', node)}/**"])
        below = series("measured − model [K]", [f"+ /{path('residual', node)}/**", f"+ /{path('band', node)}/**"])
        replayed = any(one.last for one in sessions)
        columns.append(rrb.Vertical(above, below, row_shares=[3, 2]) if replayed else above)
    driven = {channel.spec.quantity for one in sessions for channel in operating(one.channels).values()}
    drive = [
        series(f"{quantity} [{as_written(STORED_UNIT[quantity])}]", [f"+ /{path('inputs', quantity)}/**"])
        for quantity in sorted(driven)
    ]
    grid = rrb.Grid(*columns, grid_columns=min(FIRST, max(1, len(columns))))
    rows = [key("lines"), grid, rrb.Horizontal(*drive), phases()]
    tab = rrb.Vertical(*rows, row_shares=[0.8, 6, 1.7, 1.0 + 0.5 * len(sessions)], name="temperatures")
    return page([tab], [rrb.TextDocumentView(name="answer", origin="/answer")])
