"""`python -m analytics.reference` prints docs/sql.md: the comments of the views, and the queries in `sql/examples`."""

from __future__ import annotations

from importlib.resources import files

import duckdb

from analytics import warehouse

INTRODUCTION = """# SQL reference

`whyhot sql "SELECT ..."` queries the views below; `analytics.warehouse.connect(folder)` opens them in a notebook. They
are read-only, and made again whenever the ledger has changed. A unit is part of a column's name; times are int64
nanoseconds UTC (`_ns`) or seconds since the start of the session (`t_s`). With `--as-of` the views hold what was known
at that event or time. A query gets 60 s (`--seconds`), a million rows (`--rows`) and 2 GiB of memory; an answer that
meets a limit says which. Where a Parquet file is missing or cannot be read, a line (`left_out` with `--json`) says
which, and how to make it again. Where a file that a query reads is not, byte for byte, the one that its event names,
there is no answer but a line that names it. In a notebook all files are held against their events as the store is
opened; of files in a bucket, of which a question fetches parts, only `whyhot verify --read` does so. The dialect is
[DuckDB's](https://duckdb.org/docs/stable/sql/introduction).

This page is generated: `python -m analytics.reference > docs/sql.md`.
"""


def page() -> str:
    """The whole page, Markdown."""
    with duckdb.connect(":memory:") as connection:
        warehouse.fill(connection, {})
        parts = [INTRODUCTION, "## Views\n", *(_view(connection, view) for view in warehouse.VIEWS)]
        parts += ["## Macros\n", *(_macro(connection, macro) for macro in warehouse.MACROS)]
    return "\n".join([*parts, "## Examples\n", *(_example(text) for text in examples())])


def examples() -> list[str]:
    """The example queries, in order; the first line of each is a comment that says what it answers."""
    folder = files("analytics").joinpath("sql", "examples")
    return [part.read_text(encoding="utf-8") for part in sorted(folder.iterdir(), key=lambda part: part.name)]


def _view(connection: duckdb.DuckDBPyConnection, view: str) -> str:
    comment = connection.execute(
        "SELECT comment FROM duckdb_views() WHERE schema_name = 'main' AND view_name = ?", [view]
    ).fetchall()
    columns = connection.execute(
        "SELECT column_name, data_type, comment FROM duckdb_columns() "
        "WHERE schema_name = 'main' AND table_name = ? ORDER BY column_index",
        [view],
    ).fetchall()
    rows = [f"| `{column}` | {kind} | {_cell(said)} |" for column, kind, said in columns]
    return "\n".join([f"### {view}\n", f"{comment[0][0]}\n", "| column | type | what |", "|---|---|---|", *rows, ""])


def _macro(connection: duckdb.DuckDBPyConnection, macro: str) -> str:
    found = connection.execute(
        "SELECT parameters, comment FROM duckdb_functions() WHERE function_name = ? AND NOT internal", [macro]
    ).fetchall()
    parameters, comment = found[0]
    return f"### {macro}({', '.join(parameters)})\n\n{comment}\n"


def _example(text: str) -> str:
    title, _, query = text.partition("\n")
    return f"### {title.removeprefix('-- ')}\n\n```sql\n{query.strip()}\n```\n"


def _cell(said: str | None) -> str:
    return (said or "").replace("|", "\\|")


if __name__ == "__main__":
    print(page(), end="")
