"""`whyhot forget`: the bytes of a log are gone from every file of a store, its facts remain, and nothing else goes."""

from __future__ import annotations

import json
import re
import shutil
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from analytics import warehouse
from ingest.facts import facts
from ingest.facts.events import AgeingAssessed, CalibrationCompleted, LogForgotten, ReplayCompleted
from ingest.facts.store import Store
from ingest.facts.store_check import StoreCheck, check
from ingest.facts.sweeping import WAREHOUSE
from made.killed import ENVIRONMENT
from replay.cli import main

Capture = pytest.CaptureFixture[str]
WHY = ("--reason", "the customer asked for it")
MARKS = {"a.csv": 21.123456789012345, "b.csv": 87.654321098765432}  # degC, in one row of each log
SAID = r"log b\.csv was forgotten on 20\d\d-\d\d-\d\d \(the customer asked for it\)"
BENCH = """\
schema = "whyhot.bench/1"
[time]
column = "time"
[[channel]]
signal = "T"
quantity = "temperature"
unit = "degC"
"""


def _rows(first: int, mark: float) -> str:
    rows = [f"2026-01-01T08:{k // 6:02}:{k % 6}0Z,{mark if k % 60 == 7 else 20 + k}" for k in range(first, first + 60)]
    return "\n".join(["time,T", *rows, ""])


def run(session: str, **artefacts: str) -> ReplayCompleted:
    """A replay of a session whose artefacts are these sealed bytes."""
    named: dict[str, Any] = dict.fromkeys(("model", "motor", "level", "digest"), "m")
    empty: dict[str, Any] = {"key": {}, "environment": {}, "summary": {}, "bench": None}
    return ReplayCompleted(run=session, session=session, artefacts=artefacts, **named, **empty)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two logs that follow each other, one session; a third alone; replays of both, an artefact of which they share; a
    calibration and an assessment; a warehouse; a backup."""
    folder = tmp_path_factory.mktemp("forget")
    (folder / "a.csv").write_text(_rows(0, MARKS["a.csv"]))
    (folder / "b.csv").write_text(_rows(60, MARKS["b.csv"]))
    (folder / "c.csv").write_text(_rows(0, 30.0).replace("2026-01", "2026-03"))
    (folder / "bench.toml").write_text(BENCH)
    (folder / "end.jpg").write_bytes(b"\xff\xd8 a picture")
    store = ["--store", str(folder / "store")]
    logs = [str(folder / name) for name in ("a.csv", "b.csv", "c.csv")]
    assert main(["ingest", *logs, "--bench", str(folder / "bench.toml"), "--specimen", "S01", *store]) == 0
    with Store.open(folder / "store", write=True) as opened:
        both, alone = facts.at(opened.ledger).sessions
        seal = opened.archive.seal
        shared, table = seal(b"equal by chance"), seal(b"checks of a and b")
        marked = seal(struct.pack("<d", MARKS["b.csv"]))
        for one in (
            run(both.session, residuals=marked, heat=shared),
            run(alone.session, frame=seal(b"of c"), heat=shared),
        ):
            opened.ledger.append(f"run-{one.run}", one)
        empty: dict[str, Any] = {"key": {}, "environment": {}, "converged": True, "iterations": 1, "parameters": []}
        fit = CalibrationCompleted(
            calibration="c0ffee",
            sessions=[both.session, alone.session],
            parent="m5",
            model="m6",
            motor="servo",
            level="testing",
            log_posterior=0.0,
            errors=[],
            covariance=seal(b"learnt"),
            **empty,
        )
        opened.ledger.append("calibration-c0ffee", fit)
        answer: dict[str, Any] = {"key": {}, "answer": table, "artefacts": {}, "digest": ""}
        assessed = AgeingAssessed(assessment="a0", sessions=[both.session], **answer)
        opened.ledger.append("ageing-a0", assessed)
    assert main(["backup", str(folder / "copy"), *store]) == 0
    return folder


@pytest.fixture
def bench(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> Path:
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.setenv("WHYHOT_STORE", "store")
    monkeypatch.chdir(tmp_path)
    capsys.readouterr()
    return tmp_path


def holding(folder: str, log: str) -> list[str]:
    """The files of a store that hold the mark of a log, as text or as a number."""
    marks = (str(MARKS[log]).encode(), struct.pack("<d", MARKS[log]))
    files = sorted(path for path in Path(folder).rglob("*") if path.is_file())
    return [path.name for path in files if any(mark in path.read_bytes() for mark in marks)]


def checked(folder: str = "store") -> StoreCheck:
    with Store.open(Path(folder)) as store:
        return check(store)


def answered(capsys: Capture, *words: str, code: int = 0) -> Any:
    capsys.readouterr()
    assert main([*words, "--json"]) == code
    return json.loads(capsys.readouterr().out)


def test_the_bytes_of_a_log_are_gone_from_every_file_and_the_facts_of_it_remain(bench: Path, capsys: Capture) -> None:
    (bench / "store" / "warehouse.duckdb.broken-1").write_bytes(struct.pack("<d", MARKS["b.csv"]))
    with Store.open(bench / "store") as store:
        whole = facts.at(store.ledger)
        (raw,) = (one for one, file in whole.files.items() if file.name == "b.csv")
        decode = next(one.decode for one in whole.decodes.values() if one.raw == raw)
    assert len(holding("store", "b.csv")) >= 3
    before = holding("store", "a.csv")
    done = answered(capsys, "forget", "b.csv", *WHY)
    assert holding("store", "b.csv") == []
    assert not (bench / "store" / "decoded" / decode).exists()
    assert {name for name in before if len(name) == 64} <= {*holding("store", "a.csv")}, "the other log of its session"
    assert [one["name"] for one in done["facts"]] == ["b.csv"]
    assert done["runs_gone"] and done["removed"]["files"] >= 5
    is_now = f"a is now session {now_id('a')}"
    assert {one["kind"]: one["why"] for one in done["stale"]} == {"calibration": is_now, "ageing": is_now}
    with Store.open(bench / "store") as store:
        (forgotten,) = (one.event for one in store.ledger.events(LogForgotten))
        assert vars(forgotten) == {"raw": raw, "name": "b.csv", "size": whole.files[raw].size, "why": WHY[1]}
        there = {store.archive.read(sha256) for sha256 in store.archive}
    assert {b"equal by chance", b"of c", b"learnt"} <= there, "of the other session, or learnt"
    assert b"checks of a and b" not in there
    found = checked()
    assert found.damages == []
    assert any(re.fullmatch(SAID, hint) for hint in found.hints)
    assert not any("no event cites it" in hint for hint in found.hints)
    assert [one["sources"] for one in answered(capsys, "sessions")["sessions"]] == [["a.csv"], ["c.csv"]]


def now_id(name: str) -> str:
    with Store.open(Path("store")) as store:
        return facts.at(store.ledger).session(name).session[:12]


@pytest.mark.usefixtures("bench")
def test_a_backup_that_is_brought_up_to_date_holds_the_bytes_no_more(capsys: Capture) -> None:
    assert main(["forget", "b.csv", *WHY]) == 0
    assert holding("copy", "b.csv")
    capsys.readouterr()
    assert main(["backup", "copy"]) == 0
    removed = r"Removed           3 files of \d\.\d kB, of logs that were forgotten"
    assert re.search(removed, capsys.readouterr().out)
    assert holding("copy", "b.csv") == []
    assert checked("copy").damages == []
    assert answered(capsys, "backup", "copy")["removed"] == {"files": 0, "bytes": 0}
    assert main(["restore", "copy", "--store", "new"]) == 0
    assert checked("new").damages == []
    assert holding("new", "b.csv") == []
    assert any(re.fullmatch(SAID, hint) for hint in checked("new").hints)


@pytest.mark.usefixtures("bench")
@pytest.mark.parametrize(
    "words",
    [
        ("ingest", "b.csv", "--bench", "bench.toml"),
        ("attach", "b.csv", "--specimen", "S01", "--finding", "crack"),
        ("retract", "b.csv", "--undo", *WHY),
        ("retract", "b.csv", *WHY),
    ],
)
def test_what_was_forgotten_does_not_come_again(capsys: Capture, words: tuple[str, ...]) -> None:
    assert main(["forget", "b.csv", *WHY]) == 0
    shutil.copy("b.csv", "other.csv")
    given = [word.replace("b.csv", "other.csv") if words[0] in ("ingest", "attach") else word for word in words]
    capsys.readouterr()
    before = len(checked().hints)
    assert main(given) in (1, 2)
    said = capsys.readouterr().err
    assert re.search(SAID + ": its bytes are gone for good, and this store takes them in no more\n$", said)
    assert said.count("\n") == 1
    assert holding("store", "b.csv") == []
    assert len(checked().hints) == before


@pytest.mark.usefixtures("bench")
def test_a_session_that_was_taken_back_before_does_not_come_back_without_its_log(capsys: Capture) -> None:
    assert main(["retract", "c", *WHY]) == 0
    assert main(["forget", "c.csv", *WHY]) == 0
    capsys.readouterr()
    assert main(["retract", "c", "--undo", *WHY]) == 2
    assert capsys.readouterr().err.startswith("log c.csv was forgotten on ")
    assert main(["retract", "a", *WHY]) == 0
    assert main(["forget", "b.csv", *WHY]) == 0
    assert main(["retract", "a", "--undo", "--reason", "of what is left of it"]) == 0
    assert [one["sources"] for one in answered(capsys, "sessions")["sessions"]] == [["a.csv"]]


@pytest.mark.usefixtures("bench")
def test_as_of_an_earlier_time_its_facts_are_there_and_its_bytes_are_told_to_be_gone(capsys: Capture) -> None:
    with Store.open(Path("store")) as store:
        then, session = str(store.ledger.head().position), facts.at(store.ledger).session("a").session
    assert main(["forget", "c.csv", *WHY]) == 0
    assert main(["forget", "b.csv", *WHY]) == 0
    names = [one["sources"] for one in answered(capsys, "sessions", "--as-of", then)["sessions"]]
    assert names == [["a.csv", "b.csv"], ["c.csv"]]
    for words in (("show", "a"), ("lineage", "b.csv:3"), ("lineage", f"{session}/T")):
        assert main([*words, "--as-of", then]) == 2
        said = capsys.readouterr().err
        assert re.search(SAID + ": its (samples|bytes) are gone$", said.strip()), words
        assert said.count("\n") == 1
    for sql in ("SELECT count(*) AS n FROM sessions", "SELECT count(DISTINCT session) + 1 AS n FROM samples"):
        assert answered(capsys, "sql", sql, "--as-of", then)["rows"] == [{"n": 2}]
    assert main(["sql", "SELECT 1", "--as-of", then]) == 0
    assert re.search(SAID + ": its samples are in no answer", capsys.readouterr().err)


@pytest.mark.usefixtures("bench")
@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a", "a: is no log but session a: only whole logs are forgotten: name those that it is of: a.csv, b.csv"),
        ("bench.toml", "bench.toml: is a bench file that logs are read with: "),
        ("x.csv", "x.csv: is not in this store. Nearest: "),
    ],
)
def test_only_logs_are_forgotten_and_all_or_none(capsys: Capture, text: str, line: str) -> None:
    assert main(["forget", "b.csv", text, *WHY]) == 2
    said = capsys.readouterr().err
    assert (said.startswith(line), said.count("\n")) == (True, 1)
    assert holding("store", "b.csv")


def test_the_tables_for_sql_are_those_that_are_removed(tmp_path: Path) -> None:
    for name in (warehouse.FILE, f"{warehouse.FILE}.broken-1", f"{warehouse.BUILDING}x"):
        (tmp_path / name).touch()
    assert len([*tmp_path.glob(WAREHOUSE)]) == 3


AT_EACH_CHANGE = """
import json, os, shutil, sys
from pathlib import Path
from ingest.facts.ledger import Ledger
from ingest.facts.store import Store
from ingest.facts.store_check import check
from ingest.intake.retractions import forget
from made.killed import dies_at, ended, started

CHANGES = [(os, ("write", "fsync", "replace", "mkdir", "unlink", "rmdir", "chmod")), (Ledger, ("_try_insert",))]

def forgets(folder):
    with Store.open(folder, write=True) as store:
        forget(store, ["b.csv"], "the customer asked for it")

def state(folder):
    with Store.open(folder) as store:
        found = check(store)
        hints = [one for one in found.hints if "SQLite" not in one]
        there = sorted(str(path.relative_to(folder)) for path in folder.glob("[a-w]*/**/*"))
        return [one.says for one in found.damages], [one.replace(str(folder), "") for one in hints], there

here = Path(sys.argv[1])
whole = here / "whole"
shutil.copytree(here / "store", whole)
forgets(whole)
codes, seen, wrong = [], set(), []
for call in range(1000):
    folder = here / f"killed-{call}"
    shutil.copytree(here / "store", folder)
    codes.append(ended(started(lambda: dies_at(call, lambda: forgets(folder), CHANGES))))
    damages, hints, _ = state(folder)
    wrong += damages
    seen |= {"still here" for one in hints if "is still here, and log b.csv was forgotten on" in one}
    forgets(folder)
    wrong += [f"{call}: {state(folder)}"] * (state(folder) != state(whole))
    shutil.rmtree(folder)
    if codes[-1] == 0:
        break
print(json.dumps({"codes": codes, "seen": sorted(seen), "wrong": wrong}))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs fork and kill -9")
def test_killed_before_each_change_of_the_disk_the_store_is_whole_and_the_next_finishes_it(bench: Path) -> None:
    (bench / "store" / "warehouse.duckdb").write_bytes(b"old tables")
    command = [sys.executable, "-c", AT_EACH_CHANGE, str(bench)]
    done = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["wrong"] == []
    assert result["seen"] == ["still here"]
    assert result["codes"][-1] == 0
    assert set(result["codes"][:-1]) == {-9}
    assert len(result["codes"]) > 15
