"""How the viewer opens a session: a panel a node with all layers in it, the residual below, inputs and phases under
them; the answer and what happened when beside. Colours are told in a strip above: no legend lies over a line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rerun.blueprint as rrb

from ingest.catalogue.channels import ChannelData
from ingest.texts.plain import plain_line
from ingest.texts.units import with_unit
from replay.show.viewer.seen import TIMELINES, SessionSeen, of_model, path, sdk, unit
from replay.show.words import words

DRIVING = ("speed", "current", "current_d", "current_q", "torque", "temperature", "flow")  # a load is enough
INPUTS = 6  # panels at most
FIRST = 4  # nodes on the first tab
PANELS = 24  # on another; what is more is shown region by region
KEY = (1200.0, 26.0)  # width and height of a key, about as many points on a screen
OPEN = 0  # the tab that is seen first


def of(seen: SessionSeen) -> Any:
    """The layout of a session, the same whichever of its layers is read first."""
    tabs = [_first(seen), *_rest(seen), *_estimated_loss(seen), *_motor(seen)]
    return page(tabs, [rrb.TextDocumentView(name="answer", origin="/answer"), *_what_happened(seen)])


def page(tabs: Sequence[Any], side: Sequence[Any]) -> Any:
    """Tabs with texts beside them."""
    beside = rrb.Vertical(*side, row_shares=[3, 1][: len(side)])
    return rrb.Blueprint(
        rrb.Horizontal(rrb.Tabs(*tabs, active_tab=OPEN), beside, column_shares=[4, 1]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed"),  # on the only timeline that the session has
    )


def _first(seen: SessionSeen) -> Any:
    """The nodes that the first model is furthest off at, what drove the motor, and its phases."""
    columns = [_node(seen, node) for node in seen.observed[:FIRST]]
    rows = [key("lines"), rrb.Horizontal(*columns), inputs(seen.channels), phases()]
    return rrb.Vertical(*rows, row_shares=[0.8, 6, 1.7, 1.0], name="temperatures")


def _node(seen: SessionSeen, node: str) -> Any:
    """A node's temperatures over its residuals."""
    if not seen.runs:
        return temperatures(seen, words.capital(words.name(node)), [node])
    models = [words.short(run.model) for run in seen.runs.values()]
    contents = [f"+ /{path('residual', model, node)}/**" for model in models] + [f"+ /{path('band', node)}/**"]
    below = series("measured − model [K]", contents)
    return rrb.Vertical(temperatures(seen, words.capital(words.name(node)), [node]), below, row_shares=[3, 2])


def temperatures(seen: SessionSeen, title: str, nodes: Sequence[str]) -> Any:
    """What was measured at nodes and what each model has the channels there read, so that the lines are as far apart
    as the residual says; of nodes without a channel their temperatures."""
    contents = []
    for node in nodes:
        layers: list[tuple[str, ...]] = [("measured",)]
        for role, run in seen.runs.items():
            model = words.short(run.model)
            layers += [("reads", model), ("corrected", model)] if node in seen.observed else [of_model(role, run)]
        contents += [f"+ /{path(*parts, node)}/**" for parts in layers]
    return series(f"{title} [°C]", contents)


def _rest(seen: SessionSeen) -> list[Any]:
    """The other nodes with a sensor, each with its residual; then those without one, and the whole heat."""
    found = []
    if more := seen.observed[FIRST:]:
        found.append(rrb.Vertical(key("lines"), _grid([_node(seen, node) for node in more]), row_shares=[0.8, 8]))
        found[-1].name = "more temperatures"
    if seen.first:
        heat = series("Heat, all nodes [W]", ["+ /heat/**"])
        panels = [heat, *(temperatures(seen, title, nodes) for title, nodes in _panels(seen).items())]
        found.append(rrb.Vertical(key("lines"), _grid(panels), row_shares=[0.8, 8], name="without a sensor"))
    return found


def _panels(seen: SessionSeen) -> dict[str, list[str]]:
    """Title -> nodes without a sensor: one a panel, or all of a region where that would be too many."""
    if len(seen.others) <= PANELS or seen.first is None:
        return {words.capital(words.name(node)): [node] for node in seen.others}
    regions: dict[str, list[str]] = {}
    for node in seen.others:
        regions.setdefault(seen.first.regions[node], []).append(node)
    return regions


def _estimated_loss(seen: SessionSeen) -> list[Any]:
    """The filter's tab: the heat that it estimates, and the temperature there."""
    run = seen.first
    if run is None or run.filtered is None:
        return []
    node, model = run.filtered.node, words.short(run.model)
    heat = series(f"loss of the {words.name(node)} [W]", [f"+ /{path('loss', model, node)}/**"])
    there = [f"+ /{path(*parts, node)}/**" for parts in (("measured",), ("open_loop", model), ("filtered", model))]
    around = series(f"{words.capital(words.name(node))} [°C]", there)
    rows = [key("estimates"), heat, around, inputs(seen.channels)]
    return [rrb.Vertical(*rows, row_shares=[0.8, 3, 2.5, 1.5], name="estimated loss")]


def _motor(seen: SessionSeen) -> list[Any]:
    """The network as a graph and the motor cut open, coloured by temperature, with a line to move the cursor on."""
    if seen.network is None or not seen.last:
        return []
    label = seen.label(seen.last[0])
    graph = rrb.GraphView(
        name=f"network, {label}",
        origin="/network",
        force_link=rrb.archetypes.ForceLink(enabled=False),
        force_many_body=rrb.archetypes.ForceManyBody(enabled=False),
        force_collision_radius=rrb.archetypes.ForceCollisionRadius(enabled=False),
        force_center=rrb.archetypes.ForceCenter(enabled=False),
        force_position=rrb.archetypes.ForcePosition(enabled=False),
    )
    eye = rrb.archetypes.EyeControls3D(position=[1.2, -2.1, 1.1], look_target=[0.0, 0.0, 0.0], eye_up=[0.0, 0.0, 1.0])
    cut = rrb.Spatial3DView(name=f"motor cut open, {label}", origin="/cut", eye_controls=eye, line_grid=False)
    found = []
    for view, name in ((graph, "network"), (cut, "motor cut open")):
        rows = [key("temperature"), view, inputs(seen.channels)]
        found.append(rrb.Vertical(*rows, row_shares=[0.8, 6, 1.7], name=name))
    return found


def _what_happened(seen: SessionSeen) -> list[Any]:
    hidden = [rrb.encodings.TimelineColumn(name, visible=False) for name in TIMELINES]
    body = [rrb.encodings.TextLogColumn("body")]
    columns = rrb.archetypes.TextLogColumns(timeline_columns=hidden, text_log_columns=body)
    return [rrb.TextLogView(name="what happened when", origin="/event", columns=columns)] if seen.runs else []


def key(name: str) -> Any:
    """A strip that says what colours mean."""
    title = "temperature" if name == "temperature" else "lines"
    bounds = rrb.VisualBounds2D(x_range=[0.0, KEY[0]], y_range=[-8.0, KEY[1] - 8.0])
    return rrb.Spatial2DView(name=title, origin=f"/key/{name}", visual_bounds=bounds)


def _grid(views: Sequence[Any]) -> Any:
    return rrb.Grid(*views, grid_columns=max(1, min(5, len(views))))


def series(name: str, contents: Sequence[str]) -> Any:
    """A plot over time of the whole session; names are at the cursor, not in a legend over the lines."""
    legend = rrb.PlotLegend(visible=False)
    shown = {"axis_x": _whole(), "plot_legend": legend}
    return rrb.TimeSeriesView(name=plain_line(name), origin="/", contents=list(contents), **shown)


def inputs(channels: Sequence[ChannelData]) -> Any:
    """What drove the motor, a panel a channel."""
    own = [one.spec for one in channels if one.spec.role == "input" and one.t_ns.size]
    there = {spec.quantity for spec in own}
    if "current" in there:
        there -= {"current_d", "current_q", "torque"}
    shown = [spec for quantity in DRIVING if quantity in there for spec in own if spec.quantity == quantity]
    views = [
        series(with_unit(spec.name, unit(spec)), [f"+ /{path('inputs', spec.quantity, spec.name)}"])
        for spec in shown[:INPUTS]
    ]
    return rrb.Horizontal(*views, name="inputs")


def phases() -> Any:
    """When the motor turned, what state channels said, and which samples are not used."""
    contents = ["+ /phase/**", "+ /masked/**"]
    return rrb.StateTimelineView(name="phases and masked samples", origin="/", contents=contents, time_view=_whole())


def _whole() -> Any:
    """An axis over the whole of whichever session is shown: the viewer's default is 30 s around the cursor."""
    ends = sdk().TimeRangeBoundary.infinite()
    return rrb.archetypes.TimeAxis(view_range=sdk().TimeRange(start=ends, end=ends))
