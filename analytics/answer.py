"""An answer as text for people, as JSON, as CSV."""

from __future__ import annotations

import csv
import datetime
import decimal
import io
import json
import math
import re
from typing import Any

from analytics.query import QueryResult
from ingest.texts.cells import cell, places
from ingest.texts.plain import plain_line

NUMBERS = ("BIGINT", "DECIMAL", "DOUBLE", "FLOAT", "HUGEINT", "INTEGER", "SMALLINT", "TINYINT", "UBIGINT")
PLAN = ("explain_key", "explain_value")  # the columns of EXPLAIN: a drawing of many lines
WRAPPED = re.compile(r"""('(?:[^']|'')*')|"([A-Za-z_]\w*)"|count_star\(\)""")  # in an expression that has no name
NARROWEST = 12  # characters that a text is cut to at most
GAP = "  "


def to_text(result: QueryResult, width: int = 100) -> str:
    """The answer as a table; long texts are cut so that a line stays within `width` characters, as far as that goes."""
    if result.columns == PLAN:
        return "\n".join(str(value) for _, value in result.rows).rstrip()
    heads = [_head(name) for name in result.columns]
    cells = [[_cell(value) for value in row] for row in result.rows]
    widths = [max(places(row[i]) for row in [heads, *cells]) for i in range(len(heads))]
    right = [kind.startswith(NUMBERS) for kind in result.types]
    whole = [kind.startswith((*NUMBERS, "TIME", "DATE")) for kind in result.types]  # half a number is another number
    least = [wide if keep else min(wide, NARROWEST) for wide, keep in zip(widths, whole, strict=True)]
    widths = _fit(widths, least, width)
    lines = [
        GAP.join(map(cell, row, widths, right)).rstrip() for row in [heads, ["-" * wide for wide in widths], *cells]
    ]
    count = f"the first {len(cells):,} rows" if result.more else f"{len(cells):,} row{'s' * (len(cells) != 1)}"
    return "\n".join([*lines, f"({count})"])


def to_json(result: QueryResult) -> dict[str, Any]:
    """The answer as plain JSON values, times as ISO 8601 text.

    `{"columns": [{"name", "type"}], "rows": [{name: value}], "more": whether there were more rows}`
    """
    names = [{"name": name, "type": kind} for name, kind in zip(result.columns, result.types, strict=True)]
    rows = [
        {name: _json(value, kind) for name, kind, value in zip(result.columns, result.types, row, strict=True)}
        for row in result.rows
    ]
    return {"columns": names, "rows": rows, "more": result.more}


def to_csv(result: QueryResult) -> str:
    """Comma-separated values with a line of names; null is empty, every digit of a number is kept."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(result.columns)
    for row in result.rows:
        plain = [_json(value, "") for value in row]
        writer.writerow([json.dumps(value) if isinstance(value, dict | list) else value for value in plain])
    return text.getvalue()


def _head(name: str) -> str:
    """A column's name to read: of an expression that got none, DuckDB's `"left"((a ->> 'b'), 3)` and `count_star()` as
    people write them."""
    return plain_line(WRAPPED.sub(lambda found: found[1] or found[2] or "count(*)", name))


def _fit(widths: list[int], least: list[int], width: int) -> list[int]:
    """The width of each column in a table that is too wide: the widest columns give way first, none below its least."""
    fitted = list(widths)
    spare = width - len(GAP) * (len(widths) - 1)
    while sum(fitted) > spare and (loose := [i for i, wide in enumerate(fitted) if wide > least[i]]):
        fitted[max(loose, key=lambda i: fitted[i])] -= 1
    return fitted


def _cell(value: Any) -> str:
    if value is None:
        return "null"
    if isinstance(value, float):
        text = f"{value:.7g}"
        return text if set(text) & set(".en") else f"{text}.0"  # 0.0 beside 3.5; 1e+20, inf and nan stay
    return plain_line(str(value))


def _json(value: Any, kind: str) -> Any:
    match value:
        case str() if kind == "JSON":
            return json.loads(value)
        case float():
            return value if math.isfinite(value) else None
        case decimal.Decimal():
            return float(value)
        case datetime.datetime():
            return value.isoformat() + ("Z" if value.tzinfo is None else "")
        case datetime.timedelta():
            return value.total_seconds()
        case bytes():
            return value.hex()
        case dict():
            return {str(key): _json(one, "") for key, one in value.items()}
        case list() | tuple():
            return [_json(one, "") for one in value]
        case None | bool() | int() | str():
            return value
        case _:
            return str(value)
