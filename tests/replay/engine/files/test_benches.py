"""A bench file of a store is found by what people call it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from ingest.facts.events import BenchRegistered, Event
from ingest.facts.facts import Facts, fold
from ingest.facts.ledger_row import Recorded
from made.events import session
from replay.engine.files.benches import current_bench
from replay.errors import ReplayDataError

BENCHES = {
    sha256: BenchRegistered(sha256=sha256, name=f"{sha256[0]}.toml", motor=None, model=None)
    for sha256 in ("1a2b3c4d", "2b3c4d5e")
}


def _facts(**bench_of: str) -> Facts:
    """Sessions, each an id, with the bench file of each; all are called by the first letter of their id."""
    events: list[Event] = [*BENCHES.values()]
    events += [replace(session(one, one[0]), bench=bench) for one, bench in bench_of.items()]
    rows = [Recorded(n, f"s{n}", 0, event, None, "", "", None, None, "") for n, event in enumerate(events, 1)]
    return fold(rows)


def test_a_session_called_as_an_id_begins_is_the_session() -> None:
    facts = _facts(**{"1-drive": "2b3c4d5e"})
    assert current_bench(facts, "1").sha256 == "2b3c4d5e"
    assert current_bench(facts, "1a2b").sha256 == "1a2b3c4d"
    with pytest.raises(ReplayDataError, match="is no bench file, nor a session"):
        current_bench(facts, "2b")  # nobody types so little of an id by intent


def test_sessions_of_one_name_may_have_one_bench_file() -> None:
    assert current_bench(_facts(ta="1a2b3c4d", tb="1a2b3c4d"), "t").sha256 == "1a2b3c4d"
    with pytest.raises(ReplayDataError, match="is not one bench file of this store"):
        current_bench(_facts(ta="1a2b3c4d", tb="2b3c4d5e"), "t")
