"""The next commands that verbs print run as they are printed."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

import pytest

from made import can_bench
from made.onward import followed
from replay.cli.asked import asked_by
from replay.show.words.onward import BETWEEN, DEFAULT_STORE, on_store, onward
from replay.show.words.terminal import labelled


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("my bench")
    can_bench.write_files(folder)
    can_bench.write_log(folder / "1 s1.blf", seconds=90, seed=1)
    can_bench.write_log(folder / "2_s1.blf", seconds=90, seed=1, start=can_bench.START + 86_400)
    return folder


def test_every_next_command_runs_as_it_is_printed(
    bench: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the first look at logs on, what is printed is followed, and what that prints, until all is done."""
    monkeypatch.chdir(bench)
    logs = ["1 s1.blf", "2_s1.blf", "--dbc", "bench.dbc"]
    store = ["--store", "the store"]
    monkeypatch.setenv("WHYHOT_STORE", "the store")
    begin = [
        ["inspect", *logs, "--bench", "bench.toml"],
        ["morning", *logs, "--bench", "bench.toml", *store],
        ["ingest", *logs, "--bench", "bench.toml", *store],
        ["sessions", *store],
        [],
        ["repeat", "1 s1", "2_s1", "--report", "repeat.html", *store],
        ["replay", "2_s1", *store],
        ["attach", "motor.toml", "--specimen", "servo-01", "--finding", "none", *store],
        ["bench", "export", "bench.toml", "-o", "the store/again.toml", *store],
    ]
    by = followed(begin, capsys)
    assert {verb for verb, said in by.items() if said} >= {words[0] if words else "" for words in begin} | {"show"}
    assert any(one.startswith("whyhot show --store 'the store' '") for said in by.values() for one in said)
    typed = "whyhot repeat --store &#x27;the store&#x27; &#39;1 s1&#39; 2_s1"
    assert typed in Path("repeat.html").read_text(encoding="utf-8"), "as it was typed"
    (kept,) = (one for one in by["morning"] if one.endswith("--ingest"))
    assert "--bench bench.toml --dbc bench.dbc" in kept, "read as they were looked at"
    put_right = [
        ["correct", "2_s1", "--kind", "wltp", "--reason", "as the bench says", *store],
        ["backup", "a copy", *store],
        ["restore", "a copy", "--store", "as it was"],
        ["retract", "2_s1.blf", "--reason", "the pump stood", *store],
        ["forget", "2_s1.blf", "--reason", "the pump stood", *store],
    ]
    by = followed(put_right, capsys)
    assert {verb for verb, said in by.items() if said} >= {words[0] for words in put_right} - {"forget"}


def test_a_page_says_every_option_that_it_was_asked_with() -> None:
    args = Namespace(on=["1 s1", "2_s2"], model=None, level="production")
    assert asked_by("diagnose", args, hold_out=[]) == "whyhot diagnose --on '1 s1' 2_s2 --level production"
    args = Namespace(on=["1_s1"], model="m.toml", level="testing")
    assert asked_by("diagnose", args, hold_out=["3"]) == "whyhot diagnose --on 1_s1 --hold-out 3 --model m.toml"


def test_the_default_store_is_not_said() -> None:
    text = "\n".join(labelled("Next", "whyhot sessions"))
    assert onward(text) == text
    assert onward(text, Path("other")) == "Next              whyhot sessions --store other"


def test_a_store_is_said_once() -> None:
    elsewhere = "Next              `whyhot restore BACKUP --store NEW`, or whyhot sessions"
    assert onward(elsewhere, Path("other")) == f"{elsewhere} --store other"
    once = onward("next: whyhot show a · whyhot --help", Path("other"))
    assert once == "next: whyhot show --store other a · whyhot --help"
    assert onward(once, Path("third")) == once


def test_commands_too_long_for_one_line_have_one_each() -> None:
    commands = [f"whyhot {verb} {'x' * 40}" for verb in ("accept", "view", "report")]
    text = onward("\n".join(["Answer            none", *labelled("Next", BETWEEN.join(commands))]))
    first, *further = text.split("\n")[1:]
    assert [first.removeprefix("Next").strip(), *map(str.strip, further)] == commands
    assert all(line.startswith(" " * 18 + "whyhot") for line in further)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("a: is damaged: `whyhot rebuild` makes it again", "a: is damaged: `whyhot rebuild --store x` makes it again"),
        ("a: is missing; next: whyhot rebuild; `whyhot verify` says of all", None),
        (
            "no backup: `whyhot restore BACKUP --store NEW` makes one",
            "no backup: `whyhot restore BACKUP --store NEW` makes one",
        ),
        ("It is a diagnosis: `whyhot report d-1`", "It is a diagnosis: `whyhot report --store x d-1`"),
        ("`whyhot sessions` lists them", "`whyhot sessions --store x` lists them"),
        ("`whyhot motor check motor.toml` says more", "`whyhot motor check motor.toml` says more"),
        ("whyhot replay needs the package numba", "whyhot replay needs the package numba"),
    ],
)
def test_what_mends_a_store_names_it_in_a_refusal(line: str, said: str | None) -> None:
    both = "a: is missing; next: whyhot rebuild --store x; `whyhot verify --store x` says of all"
    assert on_store(line, Path("x")) == (said or both)
    assert on_store(line, DEFAULT_STORE) == line
