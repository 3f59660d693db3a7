"""`whyhot move` from the command line; the move itself is tested in `tests/ingest/facts/test_move.py`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from unittest.mock import patch

import pytest

from ingest.facts.store import MARK, Store
from made.events import raw
from made.postgres import postgres, why_none
from replay.cli import main

Capture = pytest.CaptureFixture[str]
HOST = "postgresql://lab@db.example/whyhot"


@pytest.fixture(autouse=True)
def head(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A store of one event in the working folder."""
    monkeypatch.chdir(tmp_path)
    with Store.open(Path("whyhot-store"), create=True) as store:
        store.ledger.append("file-a", raw("a"))
    with Store.open(Path("whyhot-store")) as store:
        return str(store.ledger.head())


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["move", "sqlite"], "its ledger is in its folder already: nothing was moved"),
        (
            ["move", "http://lab@h/x"],
            "http://lab@h/x: is not the URL of a PostgreSQL server: give one like postgresql://",
        ),
        (["move", "Sqlite"], "Sqlite: is not the URL of a PostgreSQL server"),
        (["move", "postgresql://lab:pw@h/x"], "postgresql://lab:***@h/x: holds a password"),
        (["move", "postgres://h/x?user=lab&password=pw"], "password=***: holds a password"),
        (["move", "files"], "its files are in its folder already: nothing was moved"),
        (["move", "s3://me:pw@lab/x"], "s3://lab/x: the URL holds a key"),
        (["move", "s3://lab"], "s3://lab: is not the URL of a place in a bucket: give one like s3://BUCKET/PREFIX"),
        (["head", "--store", "postgresql://lab:pw@h/x"], "--store postgresql://lab:***@h/x: a store is a folder"),
    ],
)
def test_what_is_no_place_is_refused_in_one_line(words: list[str], says: str, capsys: Capture) -> None:
    assert main(words) == 2
    said = capsys.readouterr().err
    assert says in said
    assert said.count("\n") == 1
    assert "pw" not in said
    assert [path.name for path in Path().iterdir()] == ["whyhot-store"]


def test_without_the_extra_the_line_says_what_to_install(capsys: Capture) -> None:
    hidden = dict.fromkeys(["ingest.facts.ledger_table", "psycopg"])
    with patch.dict(sys.modules, hidden):
        assert main(["move", HOST]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"{HOST}: the client of PostgreSQL (psycopg) is not installed: ")
    assert "uv tool install '.[postgres]'" in said


def test_a_whyhot_that_knows_no_servers_refuses_a_store_on_one(capsys: Capture) -> None:
    Path("whyhot-store", MARK).write_text('{"schema": "whyhot.store/4"}')
    assert main(["head"]) == 2
    assert "schema 'whyhot.store/4' is not known here" in capsys.readouterr().err


def test_without_its_server_verify_calls_nothing_damaged(capsys: Capture) -> None:
    mark = {"schema": "whyhot.store/2", "ledger": {"url": "postgresql:///x?host=/nowhere", "table": "whyhot_1"}}
    Path("whyhot-store", MARK).write_text(json.dumps(mark))
    assert main(["verify"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("postgresql:///x?host=/nowhere: ")
    assert said.count("\n") == 1


@pytest.mark.skipif(why_none() is not None, reason=str(why_none()))
def test_move_says_where_the_ledger_was_and_is_and_the_head(head: str, capsys: Capture) -> None:
    with postgres() as server:
        assert main(["move", server.url]) == 0
        said = capsys.readouterr().out
        assert f"{head}, as before" in said.replace("\n                  ", " ")
        assert main(["head"]) == 0
        assert capsys.readouterr().out.strip() == head
        assert main(["verify"]) == 1  # of its one log no byte was sealed
        capsys.readouterr()
        assert main(["move", "sqlite", "--json"]) == 0
        answer = json.loads(capsys.readouterr().out)
        assert answer["schema"] == "whyhot.move/1"
        assert (answer["to"], answer["from"][:13]) == (
            str(Path("whyhot-store/ledger.sqlite").absolute()),
            "postgresql://",
        )
        assert answer["provenance"]["store_head"]["root"] in head
