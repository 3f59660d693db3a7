"""How the rerun viewer opens a session: temperatures by region over residuals over inputs, the answer beside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ingest.catalogue.channels import ChannelData
from replay.engine.results.run import Run
from replay.show.words import words
from replay.show.words.palette import SERIES

APPLICATION = "whyhot"
INPUTS: Mapping[str, tuple[str, ...]] = {  # title of a view -> quantities in it; a motor is driven by one of the loads
    "speed [rpm]": ("speed",),
    "current [A]": ("current", "current_d", "current_q"),
    "torque [Nm]": ("torque",),
    "boundaries [°C]": ("temperature",),
}


def path(*parts: str) -> str:
    """An entity path; whatever a part holds stays one part."""
    import rerun as rr

    return "/".join(rr.escape_entity_path_part(part) for part in parts)


def colour(index: int, dark: bool = True) -> int:
    """0xRRGGBBAA of the node or channel at `index`; `dark`: the lighter shade, for measured lines on dark ground."""
    return int(list(SERIES.values())[index % len(SERIES)][dark][1:] + "ff", 16)


def view_of(quantity: str) -> str:
    """The title of the view of an input, or its quantity where none shows it."""
    return next((title for title, quantities in INPUTS.items() if quantity in quantities), quantity)


def of_channels(channels: Sequence[ChannelData]) -> Any:
    """The layout of a session that has no replay yet."""
    import rerun.blueprint as rrb

    by_region: dict[str, list[str]] = {}
    for spec in (channel.spec for channel in channels):
        if spec.quantity == "temperature" and spec.role == "observed":
            contents = f"+ /{path('measured', spec.node or spec.name)}/**"
            by_region.setdefault(spec.region or "temperatures", []).append(contents)
    quantities = {channel.spec.quantity for channel in channels}
    regions = [_series(f"{region} [°C]", sorted(set(paths))) for region, paths in by_region.items()]
    states = [_states("phases", "+ /phase/**")] if "state" in quantities else []
    rows = [_grid(regions), _inputs(quantities), *states]
    page = rrb.Vertical(*rows, row_shares=[3, 1, 0.6][: len(rows)], name="recording")
    return _page([page], path("answer", "recording"))


def of_run(run: Run, extended: Run | None = None) -> Any:
    """The layout of a session with its replay; the measured and the filtered layer show in it where they are open, and
    `extended`, a replay of the same session with an extended model."""
    import rerun.blueprint as rrb

    model = words.short(run.model)
    models = [("open_loop", model), *([("extended", words.short(extended.model))] if extended else [])]
    models += [("filtered", model)] if run.filtered else []
    residuals = [f"+ /{path('residual', id_)}/**" for layer, id_ in models if layer != "filtered"]
    seen = {run.regions[o.node] for o in run.observed if o.node in run.regions}
    unseen = sorted(set(run.regions.values()) - seen)
    masked = not all(o.used.all() for o in run.observed)
    temperatures = rrb.Vertical(
        _grid([_region(run, models, region) for region in dict.fromkeys(run.regions.values()) if region in seen]),
        _series("measured − model [K]", residuals),
        _inputs_of(run),
        *([_states("masked samples and phases", f"+ /{path('masked', model)}/**", "+ /phase/**")] if masked else []),
        row_shares=[4, 2, 2, 1][: 3 + masked],
        name="temperatures",
    )
    heat = _series("the network's heat [W]", [f"+ /{path('heat', model)}"])
    rest = _grid([heat, *(_region(run, models, region) for region in unseen)], "heat and nodes without a sensor")
    tabs = [temperatures, *_estimated_loss(run, models), rest]
    return _page(tabs, path("answer", words.short((extended or run).model)))


def _estimated_loss(run: Run, models: Sequence[tuple[str, str]]) -> list[Any]:
    """The filter's tab: the heat that it estimates, and the temperatures around it."""
    import rerun.blueprint as rrb

    if run.filtered is None:
        return []
    node = run.filtered.node
    heat = _series(f"loss of the {words.name(node)} [W]", [f"+ /{path('loss', words.short(run.model), node)}/**"])
    around = _region(run, models, run.regions[node])
    return [rrb.Vertical(heat, around, _inputs_of(run), row_shares=[3, 2, 1], name="Estimated loss")]


def _grid(views: Sequence[Any], name: str | None = None) -> Any:
    import rerun.blueprint as rrb

    return rrb.Grid(*views, grid_columns=max(1, min(4, len(views))), name=name)


def _region(run: Run, models: Sequence[tuple[str, str]], region: str) -> Any:
    nodes = [node for node in run.nodes if run.regions[node] == region]
    paths = [f"+ /{path(*parts, node)}/**" for node in nodes for parts in (("measured",), *models)]
    return _series(f"{region} [°C]", paths, _same_colours(run, nodes))


def _same_colours(run: Run, nodes: Sequence[str]) -> dict[str, Any]:
    """Measured lines take the colour of their node, whichever order the other file was written in."""
    import rerun as rr

    return {
        f"/{path('measured', o.node, o.channel)}": rr.SeriesLines.from_fields(colors=[colour(run.nodes.index(o.node))])
        for o in run.observed
        if o.node in nodes
    }


def _series(name: str, contents: Sequence[str], overrides: Any = None) -> Any:
    import rerun.blueprint as rrb

    legend = rrb.PlotLegend(corner=rrb.Corner2D.LeftTop)
    return rrb.TimeSeriesView(
        name=name, origin="/", contents=list(contents), axis_x=_whole(), plot_legend=legend, overrides=overrides
    )


def _inputs_of(run: Run) -> Any:
    return _inputs({column.rpartition("_")[0] for column in run.inputs} | {"temperature"})


def _inputs(quantities: set[str]) -> Any:
    import rerun.blueprint as rrb

    shown = {title: names for title, names in INPUTS.items() if quantities & set(names)}
    if "current [A]" in shown:
        shown.pop("torque [Nm]", None)
    views = [_series(title, [f"+ /{path('inputs', name)}/**" for name in names]) for title, names in shown.items()]
    return rrb.Horizontal(*views, name="inputs")


def _states(name: str, *contents: str) -> Any:
    import rerun.blueprint as rrb

    return rrb.StateTimelineView(name=name, origin="/", contents=list(contents), time_view=_whole())


def _whole() -> Any:
    """An axis over the whole of whichever session is shown: the viewer's default is 30 s around the cursor."""
    import rerun as rr
    import rerun.blueprint as rrb

    ends = rr.TimeRangeBoundary.infinite()
    return rrb.archetypes.TimeAxis(view_range=rr.TimeRange(start=ends, end=ends))


def _page(tabs: Sequence[Any], text: str) -> Any:
    import rerun.blueprint as rrb

    side = rrb.TextDocumentView(name="answer", origin=f"/{text}")
    main = rrb.Tabs(*tabs, active_tab=0)
    return rrb.Blueprint(
        rrb.Horizontal(main, side, column_shares=[4, 1]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed"),  # on the only timeline that the session has
    )
