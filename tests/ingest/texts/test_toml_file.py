"""Strict TOML: every refusal names file, line, entry, key, what was found and what is wanted."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from time import process_time
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ingest.errors import TomlError
from ingest.texts import toml_file, toml_lines, toml_spans
from ingest.texts.toml_file import (
    BOOLEAN,
    MOMENT,
    NAME,
    NAMED_NUMBERS,
    NAMED_TEXTS,
    NOT_NEGATIVE,
    NUMBER,
    POSITIVE,
    TEXT,
    TEXTS,
    Kind,
    TomlTable,
)

SCHEMA = "whyhot.bench/1"
MOTOR = b"""schema = "whyhot.bench/1"
name = "m"  # [[node]] "not a table"
[copper]
alpha_per_K = 0.00393
[[node]]
name = "magnet"
[[link]]
between = ["rotor", "teeth"]
text = \"\"\"
[[node]] inside a text \\\"""
\"\"\"
terms = [
  {coefficient = 4.0, sd = 0.4},

  # a comment
  {coefficient = "8", speed = 0.8, temperature = {node = "magnet"}},
]
[node.extra]
stamp = 2024-03-01 08:00:00
[[node]]
"name" = "shaft"
a.b."c.d" = 1
"""


def read(text: str | bytes, name: str = "bench.toml") -> TomlTable:
    return toml_file.read(text if isinstance(text, bytes) else text.encode(), name, SCHEMA)


def refusal(act: Callable[[], object]) -> str:
    with pytest.raises(TomlError) as caught:
        act()
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("path", "line"),
    [
        (("name",), 2),
        (("copper",), 3),
        (("copper", "alpha_per_K"), 4),
        (("node",), 5),
        (("node", 0), 5),
        (("node", 0, "name"), 6),
        (("link", 0), 7),
        (("link", 0, "between", 1), 8),
        (("link", 0, "text"), 9),
        (("link", 0, "terms"), 12),
        (("link", 0, "terms", 0, "sd"), 13),
        (("link", 0, "terms", 1), 16),
        (("link", 0, "terms", 1, "temperature", "node"), 16),
        (("node", 0, "extra", "stamp"), 19),
        (("node", 1), 20),
        (("node", 1, "name"), 21),
        (("node", 1, "a", "b", "c.d"), 22),
    ],
)
def test_every_table_key_and_element_knows_its_line(path: toml_spans.Path, line: int) -> None:
    assert toml_lines.lines(MOTOR.decode())[path] == line


def test_windows_line_ends_and_a_byte_order_mark_change_nothing() -> None:
    other = b"\xef\xbb\xbf" + MOTOR.replace(b"\n", b"\r\n")
    assert (read(other).values, read(other).lines) == (read(MOTOR).values, read(MOTOR).lines)


def test_an_error_inside_a_list_of_tables_names_entry_and_term() -> None:
    term = read(MOTOR).tables("link")[0].tables("terms")[1]
    says = refusal(lambda: term.need("coefficient", NUMBER))
    assert says == 'bench.toml:16: [[link]] 1 (rotor-teeth), terms 2: coefficient must be a number, found the text "8".'


def test_an_unknown_key_is_refused_with_the_nearest_and_its_line() -> None:
    table = read('[[channel]]\nsignal = "EW_A_3v"\n\nnois = 0.1\n').tables("channel")[0]
    says = refusal(lambda: table.only({"signal", "noise"}))
    assert says == 'bench.toml:4: [[channel]] 1 (signal "EW_A_3v"): unknown key "nois". Nearest: noise.'


def test_an_unknown_key_like_no_other_is_refused_with_all_that_are_known() -> None:
    assert (
        refusal(lambda: read("zzz = 1").only({"motor"}))
        == 'bench.toml:1: unknown key "zzz". Known here: motor, schema.'
    )


def test_a_key_of_another_table_is_sent_there() -> None:
    says = refusal(lambda: read("rate_hz = 1").only({"motor"}, {"rate_hz": "under [time]"}))
    assert says == 'bench.toml:1: key "rate_hz" does not belong here: it stands under [time].'


def test_a_missing_key_is_reported_at_its_entry() -> None:
    table = read("\n[[channel]]\nunit = 'A'").tables("channel")[0]
    assert refusal(lambda: table.need("signal", TEXT)) == (
        "bench.toml:2: [[channel]] 1: signal is missing: it must be a text in quotes."
    )


GOOD: list[tuple[Kind[Any], str, object]] = [
    (TEXT, '"a"', "a"),
    (NUMBER, "-3", -3.0),
    (NUMBER, "1e3", 1000.0),
    (POSITIVE, "2", 2.0),
    (NOT_NEGATIVE, "0", 0.0),
    (BOOLEAN, "false", False),
    (NAME, '"endwinding_a"', "endwinding_a"),
    (TEXTS, '["a", "b"]', ["a", "b"]),
    (NAMED_TEXTS, '{a = "x"}', {"a": "x"}),
    (NAMED_NUMBERS, "{a = 1}", {"a": 1.0}),
    (MOMENT, "2024-03-01T08:00:00", datetime(2024, 3, 1, 8)),
]


@pytest.mark.parametrize(("kind", "text", "value"), GOOD)
def test_a_value_of_the_right_kind_is_read(kind: Kind[Any], text: str, value: object) -> None:
    assert read(f"x = {text}").get("x", kind) == value
    assert read("").get("x", kind) is None


@pytest.mark.parametrize(
    ("kind", "text", "says"),
    [
        (TEXT, "3", "x must be a text in quotes, found the number 3."),
        (TEXT, '"  "', 'x must be a text in quotes, found the text "  ".'),
        (NUMBER, "true", "x must be a number, found true (true or false)."),
        (NUMBER, "nan", "x must be a number, found the number nan."),
        (NUMBER, "-inf", "x must be a number, found the number -inf."),
        (NUMBER, "[1]", "x must be a number, found a list."),
        (POSITIVE, "0", "x must be a number above 0, found the number 0."),
        (NOT_NEGATIVE, "-1", "x must be a number of 0 or more, found the number -1."),
        (BOOLEAN, "1", "x must be true or false, found the number 1."),
        (TEXTS, '["a", 1]', 'x must be a list of texts, such as ["a", "b"], found a list.'),
        (NAMED_NUMBERS, "[1]", "x must be numbers by name, such as {a = 0.7, b = 0.3}, found a list."),
        (NAMED_NUMBERS, '{a = 1, b = "2"}', 'such as {a = 0.7, b = 0.3}, found the text "2" for "b".'),
        (NAMED_TEXTS, "{a = 1}", 'x must be texts by name, such as {inverter = "sw 4.2"}, found the number 1 for "a".'),
        (
            MOMENT,
            '"2024"',
            'x must be a date and time without quotes, such as 2024-03-01T08:00:00Z, found the text "2024".',
        ),
        (MOMENT, "2024-03-01", "such as 2024-03-01T08:00:00Z, found the date or time 2024-03-01."),
    ],
)
def test_a_value_of_the_wrong_kind_is_refused_with_what_is_wanted(kind: Kind[Any], text: str, says: str) -> None:
    assert refusal(lambda: read(f"x = {text}").get("x", kind)).endswith(says)


@pytest.mark.parametrize("name", ["Magnet", "1a", "a-b", "a b", "ä"])
def test_a_node_name_has_lower_case_letters_digits_and_underscores_only(name: str) -> None:
    says = refusal(lambda: read(f'x = "{name}"').get("x", NAME))
    assert f'lower-case letters, digits and _ that begins with a letter, in quotes, found the text "{name}"' in says


def test_an_integer_beyond_all_floats_is_no_number() -> None:
    assert "x must be a number, found the number 1000" in refusal(lambda: read("x = 1" + "0" * 400).get("x", NUMBER))


def test_a_choice_is_refused_with_all_choices_and_the_nearest() -> None:
    says = refusal(lambda: read('kind = "wtlp"').one_of("kind", ("wltp", "s1")))
    assert says == 'bench.toml:1: kind "wtlp" is none of wltp, s1. Nearest: wltp.'


def test_tables_that_are_none_are_refused() -> None:
    assert refusal(lambda: read("channel = 3").tables("channel")) == (
        "bench.toml:1: channel must be a list of tables ([[channel]]), found the number 3."
    )
    assert refusal(lambda: read("time = 3").table("time")) == "bench.toml:1: time must be a table, found the number 3."
    assert read("").tables("channel") == [] and read("").table("time") is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a = 1\nb 2\n", "bench.toml:2: is not TOML: Expected '=' after a key in a key/value pair (column 3)."),
        ("noise = 0,1\n", "(column 10): decimals take a point, not a comma."),
        ("a = 1\na = 2\n", "bench.toml:2: is not TOML: Cannot overwrite a value (column 6): this key is written twice"),
        ("[a]\n[a]\n", "opened twice: put its keys together, or open it as [[...]] where there are several."),
        ('a = "C:\\data"\n', "write a backslash twice, or put the text in single quotes."),
        ("unit = Nm\n", 'text stands in quotes ("like this")'),
        ("\n\na = [1,\n", "bench.toml:3: is not TOML: "),
        ("a = 2024-02-31\n", "bench.toml:1: is not TOML: "),
        ("a = " + "9" * 5000, "bench.toml: holds an integer of thousands of digits. Correct it."),
        ("x = 1\ny = " + "[" * 1000, "bench.toml:2: is nested deeper than 32 levels. Write it flatter."),
        ("x = " + "{a = " * 1000, "is nested deeper than 32 levels"),
        ("a" + ".a" * 100_000 + " = 1", "is nested deeper than 32 levels"),
        ('"a"' + '."a"' * 1000 + " = 1", "is nested deeper than 32 levels"),
    ],
)
def test_what_is_not_toml_is_refused_at_its_line(text: str, says: str) -> None:
    assert says in refusal(lambda: read(text))


@pytest.mark.parametrize("begin", ['a = "', 'a = """', "a = '''"])
@pytest.mark.parametrize("end", ["", "\\"])
def test_a_text_that_nothing_ends_is_refused_at_once(begin: str, end: str) -> None:
    text = begin + r"\"" * 100_000 + end
    begun = process_time()  # it took half a minute, and by the square of its length more
    assert "is not TOML" in refusal(lambda: read(text))
    assert process_time() - begun < 5


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b'a = 1\nb = "\xe9"\n', "bench.toml:2: byte 0xE9 is not UTF-8 text. Save the file as UTF-8."),
        ("a = 1".encode("utf-16"), "bench.toml:1: is UTF-16, not UTF-8. Save it as UTF-8."),
        (b"#" * 4_000_001, "bench.toml: has 4,000,001 bytes, over the limit of 4,000,000: is it the right file?"),
    ],
)
def test_bytes_that_are_no_text_of_ours_are_refused(data: bytes, says: str) -> None:
    assert refusal(lambda: read(data)) == says


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    says = refusal(lambda: toml_file.read(tmp_path / "no.toml", "no.toml", SCHEMA))
    assert says == "no.toml: cannot be read: No such file or directory. Check path and permissions."


@pytest.mark.parametrize(
    ("schema", "says"),
    [
        ("whyhot.bench/2", 'schema "whyhot.bench/2" is newer than this whyhot reads: install a newer whyhot.'),
        ("whyhot.bench/x", 'schema "whyhot.bench/x" is unknown: write "whyhot.bench/1".'),
        (
            "whyhot.motor/1",
            'schema "whyhot.motor/1" is not that of this kind of file, "whyhot.bench/1": is it the right file?',
        ),
    ],
)
def test_another_schema_is_refused(schema: str, says: str) -> None:
    assert refusal(lambda: read(f'\nschema = "{schema}"')) == f"bench.toml:2: {says}"


def test_the_schema_may_be_left_out() -> None:
    read('motor = "m.toml"').only({"motor"})


@given(st.text(alphabet="ab=.[]{}\"'#,\\\n 1", max_size=60))
def test_any_text_is_read_or_refused_in_one_line(text: str) -> None:
    try:
        table = read(text)
    except TomlError as error:
        assert str(error).startswith("bench.toml:") and "\n" not in str(error)
    else:
        assert all((key,) in table.lines for key in table.values)
