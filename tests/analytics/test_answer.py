"""Answers as text, JSON and CSV."""

from __future__ import annotations

import datetime
import decimal
import json

from analytics.answer import to_csv, to_json, to_text
from analytics.query import QueryResult

MIXED = QueryResult(
    columns=("node", "error_K", "at", "seen"),
    types=("VARCHAR", "DOUBLE", "TIMESTAMP", "BOOLEAN"),
    rows=[
        ("magnet", 6.1, datetime.datetime(2026, 3, 1, 8, 0, 0), True),
        (None, float("nan"), None, False),
    ],
)


def test_text_sets_numbers_to_the_right() -> None:
    assert to_text(MIXED) == (
        "node    error_K  at                   seen\n"
        "------  -------  -------------------  -----\n"
        "magnet      6.1  2026-03-01 08:00:00  True\n"
        "null        nan  null                 False\n"
        "(2 rows)"
    )


def test_text_shows_every_double_with_its_decimals() -> None:
    values = (0.0, 3.5, -664.0, 1e20, float("inf"), 0.1 + 0.2)
    column = to_text(QueryResult(("a",), ("DOUBLE",), [(value,) for value in values])).splitlines()[2:-1]
    assert [cell.strip() for cell in column] == ["0.0", "3.5", "-664.0", "1e+20", "inf", "0.3"]
    assert to_text(QueryResult(("a",), ("BIGINT",), [(0,)])).splitlines()[2].strip() == "0"


def test_text_heads_an_expression_as_people_write_it() -> None:
    names = ('"left"((payload ->> \'"a"\'), 3)', "count_star()", 'max("value") FILTER (WHERE ("t s" > 3))')
    result = QueryResult(names, ("VARCHAR",) * 3, [])
    head = to_text(result).splitlines()[0]
    assert head == """left((payload ->> '"a"'), 3)  count(*)  max(value) FILTER (WHERE ("t s" > 3))"""
    assert [column["name"] for column in to_json(result)["columns"]] == list(names)  # what programs read stays


def test_text_keeps_to_the_width_and_cuts_no_number() -> None:
    wide = QueryResult(
        columns=("hash", "t_ns", "says", "more_1", "more_2"),
        types=("VARCHAR", "BIGINT", "VARCHAR", "VARCHAR", "VARCHAR"),
        rows=[("f" * 64, 1_760_000_000_000_000_000, "word " * 30, "x" * 30, "y" * 30)],
    )
    lines = to_text(wide, width=80).splitlines()
    assert all(len(line) <= 80 for line in lines)
    assert "1760000000000000000" in lines[2]
    assert lines[2].count("…") == 4
    assert lines[3:] == ["(1 row)"]


def test_text_never_drops_a_column_that_was_asked_for() -> None:
    names = ("session", "channel", "file", *(f"record_{i}" for i in range(6)))
    kinds = (*("VARCHAR",) * 3, *("BIGINT",) * 6)
    result = QueryResult(names, kinds, [("s" * 40, "c" * 40, "f" * 40, *(10**12 + i for i in range(6)))])
    head, _, row, count = to_text(result, width=100).splitlines()
    assert head.split() == list(names) and count == "(1 row)"
    assert row.split()[3:] == [str(10**12 + i) for i in range(6)]
    assert row.startswith("s" * 11 + "…  " + "c" * 11 + "…  ") and len(row) > 100


def test_text_says_that_there_is_more() -> None:
    assert to_text(QueryResult(("a",), ("INTEGER",), [(1,)], more=True)).endswith("(the first 1 rows)")


def test_text_draws_a_plan_as_it_is() -> None:
    plan = QueryResult(("explain_key", "explain_value"), ("VARCHAR", "VARCHAR"), [("physical_plan", "top\n bottom\n")])
    assert to_text(plan) == "top\n bottom"


def test_text_shows_what_a_terminal_would_obey() -> None:
    text = to_text(QueryResult(("a\x1b[2J",), ("VARCHAR",), [("\x1b[31mred\nnext\x07\u202e",)]))
    assert text == "a\\u001b[2J\n-------------------------------\n\\u001b[31mred\\nnext\\u0007\\u202e\n(1 row)"


def test_json_holds_plain_values_only() -> None:
    odd = QueryResult(
        columns=("payload", "amount", "raw", "list", "took"),
        types=("JSON", "DECIMAL(4,2)", "BLOB", "DOUBLE[]", "INTERVAL"),
        rows=[('{"a": 1}', decimal.Decimal("1.5"), b"\x01\xff", [1.0, float("inf")], datetime.timedelta(seconds=90))],
    )
    assert to_json(odd)["rows"] == [
        {"payload": {"a": 1}, "amount": 1.5, "raw": "01ff", "list": [1.0, None], "took": 90.0}
    ]
    json.dumps(to_json(odd), allow_nan=False)


def test_json_names_columns_types_and_times() -> None:
    answer = to_json(MIXED)
    assert answer["columns"][1] == {"name": "error_K", "type": "DOUBLE"}
    assert answer["rows"][0] == {"node": "magnet", "error_K": 6.1, "at": "2026-03-01T08:00:00Z", "seen": True}
    assert answer["rows"][1] == {"node": None, "error_K": None, "at": None, "seen": False}
    assert answer["more"] is False


def test_csv_quotes_and_keeps_every_digit() -> None:
    answer = QueryResult(
        ("a", "b", "c"), ("VARCHAR", "DOUBLE", "JSON"), [('say "hi", you', 0.1 + 0.2, {"x": [1]}), (None, None, None)]
    )
    assert to_csv(answer) == 'a,b,c\n"say ""hi"", you",0.30000000000000004,"{""x"": [1]}"\n,,\n'
