"""The motor coloured by its temperatures over time: its network as a graph, and itself cut open."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray

from replay.engine.results.run import Run
from replay.show.plots.network_plot import places
from replay.show.viewer.cut import HalfRing, mesh, parts
from replay.show.viewer.layer_file import LayerFile
from replay.show.viewer.seen import GUIDE, path, rgba, sdk
from replay.show.words import words
from twin.motor.features import stream_places
from twin.motor.network import Network

Floats = NDArray[np.float64]

INSTANTS = 240  # of a session at which colours change
SCALE = colormaps["turbo"]
LOWEST, HIGHEST = 0.12, 0.9  # of the scale: its ends vanish on dark or light ground
STEPS = 6  # of the scale's key
INCH = 130.0  # of the network's picture, in units of the graph
TALL = 0.8  # of its height: names are wide, so boxes may stand closer over one another


def draw_motor(to: LayerFile, network: Network, run: Run, begins_ns: int) -> None:
    """Graph, cut motor and scale of colours, by the temperatures of `run`. The first stand from `begins_ns` on, where
    the viewer opens: before a run's first step the motor would have no colour."""
    at = np.unique(np.linspace(0, run.t_ns.size - 1, INSTANTS).astype(np.intp))
    degC = {node: run.temperatures[at, i] for i, node in enumerate(run.nodes)}
    for boundary in network.boundaries:
        column = run.inputs.get(f"{boundary.name}_degC")
        if column is not None:
            degC[boundary.name] = column[np.minimum(at, column.size - 1)]
    low, high = (float(f([f(values) for values in degC.values()])) for f in (np.nanmin, np.nanmax))
    steps = np.linspace(low, high, STEPS)
    to.key("temperature", dict(zip((f"{step:.0f} °C" for step in steps), map(_hex, _share(steps)), strict=True)))
    colours = {name: [rgba(_hex(share)) for share in _share(values, low, high)] for name, values in degC.items()}
    t_ns = np.r_[min(begins_ns, int(run.t_ns[0])), run.t_ns[at[1:]]]
    _graph(to, network, t_ns, degC, colours)
    for part in parts(network):
        _part(to, part, t_ns, colours[part.node])


def _share(values: Floats, low: float | None = None, high: float | None = None) -> Floats:
    """Temperatures as shares of the scale, NaN as its lowest."""
    low, high = values[0] if low is None else low, values[-1] if high is None else high
    share: Floats = np.nan_to_num((values - low) / max(high - low, 1e-9))
    return share


def _hex(share: float) -> str:
    red, green, blue = (round(255 * part) for part in SCALE(LOWEST + (HIGHEST - LOWEST) * float(share))[:3])
    return f"#{red:02x}{green:02x}{blue:02x}"


def _graph(
    to: LayerFile, network: Network, t_ns: NDArray[np.int64], degC: dict[str, Floats], colours: dict[str, list[int]]
) -> None:
    rr, place = sdk(), places(network) * np.array([1.0, -TALL]) * INCH
    edges = [(link.a, link.b) for link in network.links] + list(stream_places(network))
    to.stream.log("network", rr.GraphEdges(edges=edges, graph_type="undirected"), static=True)
    to.stream.log("network", rr.GraphNodes(node_ids=network.names, positions=place, show_labels=True), static=True)
    unknown = [rgba(GUIDE)] * t_ns.size
    rgbas = np.array([colours.get(name, unknown) for name in network.names]).T
    labels = [[_label(name, degC, i) for name in network.names] for i in range(t_ns.size)]
    columns = rr.GraphNodes.columns(colors=rgbas.ravel(), labels=[one for row in labels for one in row])
    to.columns("network", t_ns, columns.partition([len(network.names)] * t_ns.size))


def _label(name: str, degC: dict[str, Floats], i: int) -> str:
    told = f" {degC[name][i]:.0f} °C" if name in degC else ""
    return f"{words.name(name)}{told}"


def _part(to: LayerFile, part: HalfRing, t_ns: NDArray[np.int64], colours: list[int]) -> None:
    rr, where = sdk(), path("cut", part.node)
    corners, triangles, normals = mesh(part)
    static = rr.Mesh3D(vertex_positions=corners, triangle_indices=triangles, vertex_normals=normals)
    to.stream.log(where, static, static=True)
    to.columns(where, t_ns, rr.Mesh3D.columns(albedo_factor=colours))
