"""The next commands of a text: a line each where one is too short, and laid out once."""

from __future__ import annotations

from pathlib import Path

import pytest

from replay.show.words.onward import on_page, onward

TEXT = (
    "Next              whyhot accept d-7f31beef · whyhot view a_long_name_of_a_session_of_today ·\n"
    "                  whyhot report d-7f31beef"
)


def test_commands_that_do_not_fit_have_a_line_each_and_stay_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    once = onward(TEXT, Path("demo/store"))
    told = [line.removeprefix("Next").strip() for line in once.splitlines()]
    assert told == [
        "whyhot accept --store demo/store d-7f31beef",
        "whyhot view --store demo/store a_long_name_of_a_session_of_today",
        "whyhot report --store demo/store d-7f31beef",
    ]
    assert onward(once) == once, "the demo's text is laid out by its own stores, then by the command line"


def test_commands_of_a_page_name_a_store_that_is_not_the_default_one() -> None:
    page = '<p>A <code>whyhot lineage a1</code>, <code>whyhot ageing</code>, <code>whyhot sql --store x "FROM a"</code>'
    assert on_page(page, Path("whyhot-store")) == page
    named = "--store &#x27;a &amp; b&#x27;"
    assert on_page(page, Path("a & b")) == (
        f"<p>A <code>whyhot lineage {named} a1</code>, <code>whyhot ageing {named}</code>, "
        '<code>whyhot sql --store x "FROM a"</code>'
    )
