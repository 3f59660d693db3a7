"""The store as it was: its facts of then, and nothing that is written to it is kept."""

from __future__ import annotations

from datetime import UTC, datetime, tzinfo
from pathlib import Path

import pytest

from ingest.errors import LedgerError
from ingest.facts import facts, ledger
from ingest.facts.as_of import store_as_of
from ingest.facts.events import SignalDatabaseRegistered
from ingest.facts.store import Store
from ingest.facts.store_check import check


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three databases, each an event, and the seal."""
    with Store.open(tmp_path / "store", create=True) as store:
        for name in "abc":
            sha256 = store.archive.seal(name.encode())
            store.ledger.append(f"database-{sha256}", SignalDatabaseRegistered(sha256=sha256, name=f"{name}.dbc"))
        (store.folder / "decoded").mkdir(exist_ok=True)
    return tmp_path / "store"


def names(store: Store) -> list[str]:
    return [one.name for one in facts.at(store.ledger).databases.values()]


def test_facts_and_bytes_are_those_of_then(folder: Path) -> None:
    with store_as_of(folder, "2") as then:
        assert names(then) == ["a.dbc", "b.dbc"]
        assert then.archive.read(next(iter(facts.at(then.ledger).databases))) == b"a"
        assert [*then.archive] == [], "read where they lie, and not copied"
        assert check(then).damages == []
        head = then.ledger.head()
    with Store.open(folder) as now:
        second = now.ledger.events()[1]
    with store_as_of(folder, second.recorded) as then:
        assert (head.position, then.ledger.head()) == (2, head), "a time is the last event up to it"


def test_what_is_written_to_it_is_thrown_away(folder: Path) -> None:
    before = sorted((path, path.stat().st_mtime_ns) for path in folder.rglob("*") if path.is_file())
    with store_as_of(folder, "2") as then:
        sha256 = then.archive.seal(b"new")
        then.ledger.append("database-x", SignalDatabaseRegistered(sha256=sha256, name="new.dbc"))
        assert names(then)[-1] == "new.dbc"
        where = then.folder
    assert not where.exists()
    after = sorted((path, path.stat().st_mtime_ns) for path in folder.rglob("*") if path.is_file())
    assert [one for one in after if "sqlite-" not in one[0].name] == [x for x in before if "sqlite-" not in x[0].name]
    with Store.open(folder) as now:
        assert names(now) == ["a.dbc", "b.dbc", "c.dbc"]


def test_before_the_first_event_there_is_nothing_and_after_the_last_a_line(folder: Path) -> None:
    with store_as_of(folder, "1999-01-01") as then:
        assert names(then) == []
    with pytest.raises(LedgerError, match="as of 9: the ledger ends at event 4"), store_as_of(folder, "9"):
        pass


def test_a_check_says_since_which_event_a_clock_was_wrong(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Earlier(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> Earlier:
            return cls(2001, 1, 1, tzinfo=UTC)

    with Store.open(folder) as store:
        assert not any("a clock was wrong" in line for line in check(store).hints)
        monkeypatch.setattr(ledger, "datetime", Earlier)
        (says,) = [line for line in check(store).hints if "a clock was wrong" in line]
    assert says.startswith("event 1 says it was recorded on ") and says.endswith("give --as-of a number")
