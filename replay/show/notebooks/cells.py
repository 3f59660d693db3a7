"""What the cells of a notebook show: alive in marimo; in Jupyter plain HTML and SVG that need no network."""

from __future__ import annotations

import html
import os
import sys
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

import marimo as mo
import pyarrow as pa

from ingest.errors import IngestError
from ingest.texts.plain import plain
from replay.show.words import words
from replay.show.words.onward import DEFAULT_STORE

WIDE = 860  # px: the plots of a chart, side by side; with their axes they fill marimo's page
ROWS = 50  # of a table in Jupyter
UNITS = {  # end of a column's name -> unit as people write it; the longest first
    "percent_per_100h": "% per 100 h",
    "K_per_W": "K/W",
    "percent": "%",
    "degC": "°C",
    "rpm": "rpm",
    "K": "K",
    "A": "A",
    "h": "h",
    "s": "s",
}
SAID = {  # columns whose name says too little
    "mae_K": "mean absolute error [K]",
    "max_K": "largest error [K]",
    "bias_K": "mean error [K]",
    "minutes": "length [min]",
    "start": "start (UTC)",
    "recorded": "recorded (UTC)",
    "soak_start": "soak begins (UTC)",
    "happened": "when (UTC)",
    "version": "model",
    "kind_why": "why this kind",
    "session_name": "session",
    "worst_node": "worst place",
    "at_s": "after [s]",
    "number": "no.",
    "percent": "R [% of the first]",
    "reach": "two standard deviations [% of the first]",
    "low": "R from [% of the first]",
    "high": "R to [% of the first]",
    "resistance_K_per_W": "R [K/W]",
    "sd_K_per_W": "standard deviation of R [K/W]",
    "why": "why not told",
    "hours_above_180degC": "hours above 180 °C [h]",
    "unknown_h": "not known [h]",
    "dose_h": "dose, above 180 °C [h]",
    "equivalent_low_h": "worth at 180 °C, from [h]",
    "equivalent_high_h": "worth at 180 °C, to [h]",
    "slope_percent_per_100h": "slope of R [% per 100 h]",
    "slope_low": "slope from [% per 100 h]",
    "slope_high": "slope to [% per 100 h]",
    "fleet_slope_percent_per_100h": "slope, with the fleet's [% per 100 h]",
    "fleet_low": "that from [% per 100 h]",
    "fleet_high": "that to [% per 100 h]",
    "course": "course of R",
    "score": "from the others [sd]",
    "outlying": "not as its batch",
    "batch_outlying": "its batch not as the others",
    "significant": "changes beyond repeatability",
    "life_used_low": "life used, from [%]",
    "life_used_high": "life used, to [%]",
    "remaining_low_h": "dose left, from [h]",
    "remaining_high_h": "dose left, to [h]",
    "modelled_at_s": "hottest after [s]",
    "modelled_hottest_degC": "hottest by the model [°C]",
    "measured_hottest_degC": "hottest measured [°C]",
}


def _still() -> bool:
    """Whether neither marimo nor a script runs the cells: Jupyter does, where nothing can be moved."""
    return mo.app_meta().mode not in ("edit", "run", "script")


def connected() -> tuple[str, Any]:
    """The folder of the store that is asked for and a connection to its warehouse; what stands against it is said in
    one line, and nothing more of the notebook runs."""
    from analytics import warehouse
    from analytics.errors import AnalyticsError

    asked = None if _still() else mo.cli_args().get("store")
    folder = str(asked or os.environ.get("WHYHOT_STORE") or DEFAULT_STORE)
    try:
        return folder, warehouse.connect(folder)
    except (IngestError, AnalyticsError) as error:
        if mo.running_in_notebook():
            raise mo.MarimoStopError(mo.callout(str(error), kind="danger")) from None
        print(plain(str(error)), file=sys.stderr)
        sys.exit(2)


def answered(lines: Sequence[str]) -> mo.Html:
    """The answer; a script prints it, and nothing else."""
    if mo.app_meta().mode == "script":
        print(plain("\n".join(lines)))
    return mo.md("## Answer\n\n" + "\n".join(f"- {line}" for line in lines))


def head(column: str) -> str:
    """The head of a column in words, with its unit: "highest_degC" -> "highest [°C]"."""
    if column in SAID:
        return SAID[column]
    unit = next((unit for unit in UNITS if column.endswith(f"_{unit}")), None)
    if unit is None:
        return words.name(column)
    return f"{words.name(column.removesuffix(f'_{unit}'))} [{UNITS[unit]}]"


def tabled(table: pa.Table, *left_out: str) -> mo.Html:
    """A table with its heads in words, numbers to four digits; without the columns `left_out` and those of nothing."""
    empty = [name for name in table.column_names if table[name].null_count == table.num_rows]
    shown = table.drop_columns([*left_out, *(name for name in empty if name not in left_out)])
    shown = shown.rename_columns([head(name) for name in shown.column_names])
    numbers = [field.name for field in shown.schema if pa.types.is_floating(field.type)]
    if not _still():
        formats: Any = dict.fromkeys(numbers, _number)
        return mo.ui.table(
            shown, selection=None, show_column_summaries=False, show_data_types=False, format_mapping=formats
        )
    rows = shown.slice(0, ROWS).to_pylist()
    cells = [_row("th", shown.column_names), *(_row("td", [_cell(value) for value in row.values()]) for row in rows)]
    rest = f"<p>and {shown.num_rows - ROWS:,} more</p>" if shown.num_rows > ROWS else ""
    return mo.Html(f"<table>{''.join(cells)}</table>{rest}")


def _number(value: float | None) -> str:
    return "" if value is None else words.digits(value, 4)


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, datetime):
        return value.isoformat(" ", "minutes")
    return "" if value is None else str(value)


def _row(tag: str, texts: Sequence[str]) -> str:
    return f"<tr>{''.join(f'<{tag}>{html.escape(text)}</{tag}>' for text in texts)}</tr>"


def drawn(chart: Any) -> mo.Html:
    """An altair chart: alive in marimo, else as an SVG."""
    chart = chart.configure_legend(orient="top", columns=8, labelLimit=400).configure_axis(labelLimit=300)
    if not _still():
        return mo.ui.altair_chart(chart, chart_selection=False, legend_selection=False)
    import vl_convert

    svg = vl_convert.vegalite_to_svg(chart.to_dict())
    return mo.Html(svg.replace("<svg ", '<svg style="max-width: 100%; height: auto" ', 1))


def choice(options: dict[str, Any] | list[str], first: str | None = None) -> Any:
    """A dropdown that begins with `first`, else with the first of `options`."""
    return mo.ui.dropdown(options, value=first or next(iter(options), None), searchable=True)


def offered(choices: Mapping[str, Any]) -> mo.Html:
    """What can be chosen, by label; Jupyter cannot change it, so there it says what is."""
    if not _still():
        return mo.hstack([part for label, element in choices.items() for part in (label, element)], justify="start")
    return mo.md(
        f"{', '.join(map(_chosen, choices, choices.values()))}. For another, change it in this cell, run those below."
    )


def _chosen(label: str, element: Any) -> str:
    return f"{label}: **{element.selected_key if isinstance(element, mo.ui.dropdown) else element.value}**"
