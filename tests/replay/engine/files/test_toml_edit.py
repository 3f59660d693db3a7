from __future__ import annotations

import tomllib
from copy import deepcopy
from typing import Any

import pytest

from ingest.texts.toml_spans import spans
from replay.engine.files.toml_edit import edited

TEXT = """\
# above
name = 'a # no comment'   # a comment, [x]
scale = {speed_rpm = 16_000.0, "current A"=450}
"quoted.key" = 3
[[source]]
node="magnet"
terms = [   # one, two
  {coefficient = 9.5, speed = 2},   # with a comma, and ]

  {coefficient = 1e-3} # the last
]
temperature.node = "yoke"
temperature.slope = 0.5
  [source.deep]
  list = [[1, 2], [3]]
  text = \"\"\"two
lines ] " \"\"\"
[[ source ]]
node = "yoke"
[[source.terms]]
coefficient = 4
[[source.terms]]
coefficient = 5   # behind
[other]
day = 2024-03-01 08:00:00
"""


def _edited(text: str, *path: str | int, value: Any) -> str:
    """The text with one value set, in data and in text; both must say the same then."""
    before = tomllib.loads(text)
    after = deepcopy(before)
    inner: Any = after
    for part in path[:-1]:
        inner = inner[part]
    if isinstance(inner, list) and path[-1] == len(inner):
        inner.append(value)
    else:
        inner[path[-1]] = value
    result = edited(text, before, after, "why")
    assert tomllib.loads(result) == after
    return result


@pytest.mark.parametrize(
    ("path", "is_"),
    [
        (("name",), "'a # no comment'"),
        (("scale", "speed_rpm"), "16_000.0"),
        (("scale", "current A"), "450"),
        (("quoted.key",), "3"),
        (("source", 0, "node"), '"magnet"'),
        (("source", 0, "terms", 1, "coefficient"), "1e-3"),
        (("source", 0, "terms", 0), "{coefficient = 9.5, speed = 2}"),
        (("source", 0, "temperature", "slope"), "0.5"),
        (("source", 0, "deep", "list", 0, 1), "2"),
        (("source", 0, "deep", "text"), '"""two\nlines ] " """'),
        (("source", 1, "terms", 1), "[[source.terms]]\ncoefficient = 5"),
        (("other",), "[other]\nday = 2024-03-01 08:00:00"),
    ],
)
def test_every_value_and_headed_table_has_its_place(path: tuple[str | int, ...], is_: str) -> None:
    span = spans(TEXT)[path]
    assert TEXT[span.start : span.end] == is_


def test_tables_of_dotted_keys_and_arrays_of_headed_tables_have_no_place() -> None:
    found = spans(TEXT)
    assert ("source", 0, "temperature") not in found
    assert ("source",) not in found
    assert ("source", 1, "terms") not in found


@pytest.mark.parametrize(
    ("path", "value", "old", "new"),
    [
        (("scale", "speed_rpm"), 12000, "16_000.0", "12000"),
        (("source", 0, "terms", 0, "coefficient"), 8.25, "{coefficient = 9.5,", "{coefficient = 8.25,"),
        (("source", 0, "terms", 1, "on"), True, "{coefficient = 1e-3} #", "{coefficient = 1e-3, on = true} #"),
        (("scale", "hours.x"), 1, '"current A"=450}', '"current A"=450, "hours.x" = 1}'),
        (("source", 0, "temperature", "ref"), 20, "slope = 0.5\n", "slope = 0.5\ntemperature.ref = 20\n"),
        (("source", 1, "terms", 1, "shape"), {"at": [1, 2]}, "# behind\n", "# behind\nshape = {at = [1, 2]}\n"),
        (("source", 0, "deep", "list"), [[7]], "[[1, 2], [3]]", "[[7]]"),
        (("source", 0, "deep", "more"), "x", 'lines ] " """\n', 'lines ] " """\n  more = "x"\n'),
        (
            ("source", 0, "terms", 2),
            {"coefficient": 7},
            "{coefficient = 1e-3} # the last\n]",
            "{coefficient = 1e-3}, # the last\n  # added: why\n  {coefficient = 7},\n]",
        ),
        (
            ("source", 1, "terms", 2),
            {"coefficient": 7},
            "# behind\n",
            "# behind\n\n# added: why\n[[source.terms]]\ncoefficient = 7\n",
        ),
        (
            ("source", 2),
            {"node": "x", "terms": [{"a": 1}, {"a": 2}]},
            "# behind\n",
            '# behind\n\n# added: why\n[[source]]\nnode = "x"\nterms = [\n  {a = 1},\n  {a = 2},\n]\n',
        ),
        (("link",), [{"a": 1}], "08:00:00\n", "08:00:00\n\n# added: why\n[[link]]\na = 1\n"),
    ],
)
def test_one_change_is_made_in_its_place(path: tuple[str | int, ...], value: Any, old: str, new: str) -> None:
    found = _edited(TEXT, *path, value=value)
    assert TEXT.count(old) == 1
    assert found == TEXT.replace(old, new)


@pytest.mark.parametrize(
    ("array", "grown"),
    [
        ("[{a = 1}]  # c", "[\n  {a = 1},\n  # added: why\n  {a = 9},\n]  # c"),
        ("[ {a = 1} , {a = 2}, ]", "[\n  {a = 1},\n  {a = 2},\n  # added: why\n  {a = 9},\n]"),
        ("[\n    {a = 1}\n  ]", "[\n    {a = 1},\n    # added: why\n    {a = 9},\n  ]"),
        ("[\n {a = 1}, # ]\n # end\n]", "[\n {a = 1}, # ]\n # added: why\n {a = 9},\n # end\n]"),
        ("[\n {a = 1} # no ,\n , # c\n]", "[\n {a = 1} # no ,\n , # c\n # added: why\n {a = 9},\n]"),
        ("[{a = 1},\n  {a = 2}]", "[{a = 1},\n  {a = 2},\n  # added: why\n  {a = 9},\n]"),
        ("[]", "[\n  # added: why\n  {a = 9},\n]"),
        ("[ # none\n]", "[ # none\n  # added: why\n  {a = 9},\n]"),
    ],
)
def test_an_array_grows_in_the_way_it_is_written(array: str, grown: str) -> None:
    text = f"x = 1\nterms = {array}\ny = 2\n"
    found = _edited(text, "terms", len(tomllib.loads(text)["terms"]), value={"a": 9})
    assert found == f"x = 1\nterms = {grown}\ny = 2\n"


def test_changes_of_one_place_do_not_meet() -> None:
    text = "[[node]]\na = 1\n[[node]]\na = 2"
    after = {"node": [{"a": 1, "b": 3}, {"a": 5, "b": 6, "c": 7}, {"a": 8}], "link": [{"k": 1}]}
    found = edited(text, tomllib.loads(text), {"link": after["link"], "node": after["node"]}, "why")
    assert tomllib.loads(found) == after
    inline = "[t]\nx = [{a = 1}]"
    assert tomllib.loads(
        edited(inline, tomllib.loads(inline), {"t": {"x": [{"a": 2, "b": 3, "c": 4}, {"a": 5}]}}, "why")
    ) == {"t": {"x": [{"a": 2, "b": 3, "c": 4}, {"a": 5}]}}


def test_line_breaks_of_another_system_are_kept() -> None:
    text = "[[node]]\r\na = 1 # c\r\n[[node]]\r\nx = [{a = 1}]\r\n"
    after = {"node": [{"a": 2, "b": 1}, {"x": [{"a": 1}, {"a": 2}]}, {"a": 3}]}
    found = edited(text, tomllib.loads(text), after, "why")
    assert tomllib.loads(found) == after
    assert found.count("\n") == found.count("\r\n") > text.count("\n")


def test_a_value_that_the_text_leaves_to_its_default_is_added_when_it_changes() -> None:
    assert edited("[a]\nx = 1\n", {"a": {"x": 1, "sd": 0.1}}, {"a": {"x": 1, "sd": 0.1}}, "why") == "[a]\nx = 1\n"
    assert (
        edited("[a]\nx = 1\n", {"a": {"x": 1, "sd": 0.1}}, {"a": {"x": 1, "sd": 0.2}}, "why")
        == "[a]\nx = 1\nsd = 0.2\n"
    )


def test_numbers_are_written_to_seven_digits() -> None:
    text = "[a]\nx = 1\ny = 1\nz = [1]\n"
    after = {"a": {"x": 1031.6841234, "y": -0.000012345678, "z": [16000.0, 2e9]}}
    assert (
        edited(text, tomllib.loads(text), after, "why") == "[a]\nx = 1031.684\ny = -1.234568e-05\nz = [16000, 2e+09]\n"
    )


def test_a_list_of_equal_length_keeps_the_comments_within() -> None:
    text = "x = [ # c1\n  1, # c2\n 2.0, # c3\n]\n"
    assert edited(text, {"x": [1, 2]}, {"x": [5, 2]}, "why") == text.replace("1, #", "5, #")
    assert edited(text, {"x": [1, 2]}, {"x": [5]}, "why") == "x = [5]\n"
