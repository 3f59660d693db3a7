"""`whyhot retract` and `correct` from the command line, and what other verbs then say."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from eventsourcing.persistence import StoredEvent

from ingest.facts import facts
from ingest.facts.events import LogCorrected
from ingest.facts.facts import Facts
from ingest.facts.ledger import Ledger
from ingest.facts.store import Store
from ingest.facts.store_check import check
from replay.cli import main

Capture = pytest.CaptureFixture[str]
BENCH = """\
schema = "whyhot.bench/1"
specimen = "S01"
[time]
column = "time"
[[channel]]
signal = "T"
quantity = "temperature"
unit = "degC"
"""
WHY = ("--reason", "the wrong motor was mounted")


def _rows(first: int) -> str:
    rows = [f"2026-01-01T08:{k // 6:02}:{k % 6}0Z,{20 + k}" for k in range(first, first + 60)]
    return "\n".join(["time,T", *rows, ""])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two logs that follow each other, one session, and a table of two specimens."""
    folder = tmp_path_factory.mktemp("retract")
    (folder / "a.csv").write_text(_rows(0))
    (folder / "b.csv").write_text(_rows(60))
    (folder / "bench.toml").write_text(BENCH)
    (folder / "other.toml").write_text(BENCH.replace("[[channel]]", "[[channel]]\nnoise = 0.2"))
    (folder / "table.toml").write_text(BENCH.replace('specimen = "S01"', 'specimen_column = "who"'))
    (folder / "t.csv").write_text(
        "time,T,who\n" + "".join(f"2026-02-01T08:0{k}:00Z,2{k},S{k // 4}\n" for k in range(8))
    )
    (folder / "end.jpg").write_bytes(b"\xff\xd8 a picture")
    store = ["--store", str(folder / "store")]
    logs = [str(folder / name) for name in ("a.csv", "b.csv")]
    assert main(["ingest", *logs, "--bench", str(folder / "bench.toml"), *store]) == 0
    assert main(["ingest", str(folder / "t.csv"), "--bench", str(folder / "table.toml"), *store]) == 0
    words = ["--specimen", "S01", "--finding", "crack", "--session", "a"]
    assert main(["attach", str(folder / "end.jpg"), *words, *store]) == 0
    return folder


@pytest.fixture
def bench(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> Path:
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.setenv("WHYHOT_STORE", "store")
    monkeypatch.chdir(tmp_path)
    capsys.readouterr()
    return tmp_path


def now() -> Facts:
    with Store.open(Path("store")) as store:
        assert check(store).damages == []
        return facts.at(store.ledger)


def answered(capsys: Capture, *words: str) -> Any:
    capsys.readouterr()
    assert main([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def rows(capsys: Capture, sql: str) -> Any:
    return answered(capsys, "sql", sql)["rows"]


@pytest.mark.usefixtures("bench")
def test_a_log_taken_back_is_gone_from_every_answer_and_all_bytes_stay(capsys: Capture) -> None:
    before = now()
    assert main(["retract", "b.csv", *WHY]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[:2] == ["Taken back        log b.csv", "Reason            the wrong motor was mounted"]
    assert said[2].startswith("Session           a (") and said[2].endswith("is there now: specimen S01, kind other")
    assert [one["sources"] for one in answered(capsys, "sessions")["sessions"]] == [["a.csv"], ["t.csv"], ["t.csv"]]
    assert answered(capsys, "show", "a")["duration_s"] == 590.0
    assert rows(capsys, "SELECT name FROM files ORDER BY name") == [
        {"name": "a.csv"},
        {"name": "t.csv"},
    ]
    assert rows(capsys, "SELECT max(t_s) AS n FROM samples WHERE session_name = 'a'") == [{"n": 590.0}]
    assert rows(capsys, "SELECT count(*) AS n FROM events WHERE topic LIKE '%FactRetracted'") == [{"n": 1}]
    assert main(["verify", "--read"]) == 0
    (position,) = rows(capsys, "SELECT position FROM events WHERE topic LIKE '%FactRetracted'")
    assert main(["show", "a", "--as-of", "1"]) == 2
    assert capsys.readouterr().err.startswith("as of 1: session 'a': is not in this store."), "and is by now"
    as_it_was = answered(capsys, "sessions", "--as-of", str(position["position"] - 1))["sessions"]
    assert as_it_was[0]["sources"] == ["a.csv", "b.csv"]
    assert main(["ingest", "b.csv", "--bench", "bench.toml"]) == 1
    assert "log b.csv was taken back on " in capsys.readouterr().err
    assert main(["retract", "b.csv", "--undo", "--reason", "it was the right one"]) == 0
    assert [one.session for one in now().sessions] == [one.session for one in before.sessions]
    assert (now().files, now().decodes, now().sessions) == (before.files, before.decodes, before.sessions)


@pytest.mark.usefixtures("bench")
def test_one_specimen_of_a_table_is_taken_back_and_does_not_come_again(capsys: Capture) -> None:
    (gone,) = (one.session for one in now().sessions if one.specimen == "S1")
    assert main(["retract", gone[:8], *WHY]) == 0
    assert [one.specimen for one in now().sessions] == ["S01", "S0"]
    assert main(["ingest", "t.csv", "--bench", "table.toml"]) == 1
    assert "session t was taken back on " in capsys.readouterr().err
    assert [one.specimen for one in now().sessions] == ["S01", "S0"]


@pytest.mark.usefixtures("bench")
def test_a_session_taken_back_takes_all_its_logs_along_and_an_inspection_stays() -> None:
    assert main(["retract", "a", *WHY]) == 0
    assert [one.name for one in now().sessions] == ["t", "t"]
    assert len(now().inspections) == 1
    assert main(["retract", "end.jpg", *WHY]) == 0
    assert not now().inspections


@pytest.mark.usefixtures("bench")
@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("retract", "b.csv", "c.csv", *WHY), "c.csv: is not in this store. Nearest: "),
        (
            ("retract", "bench.toml", *WHY),
            "bench.toml: is a bench file that logs are read with: `whyhot ",
        ),
        (
            ("retract", "b.csv", "--reason", " "),
            "--reason: says nothing: write it in words, as --reason ",
        ),
        (("retract", "b.csv", "--undo", *WHY), "log b.csv stands: there is nothing to undo. Taken back: nothing"),
        (("retract", "t", *WHY), "t: is more than one: session "),
        (
            ("correct", "a", "--specimen", " ", *WHY),
            "--specimen: says nothing: write it in words, as ",
        ),
        (("correct", "a", "--batch", "", *WHY), "--batch: says nothing: write it in words, as --batch B3"),
        (("correct", "b.csv", *WHY), "nothing to correct: say what is right: --bench, --dbc, --specimen, --batch or"),
        (("correct", "b.csv", "--specimen", "S01", *WHY), "b.csv: is so already: there is nothing to correct"),
        (
            ("correct", "t.csv", "--specimen", "S1", *WHY),
            "t.csv: --specimen would give one specimen to all rows, and they are of 2 (S0, S1). Correct the names in ",
        ),
        (
            ("correct", "end.jpg", "--kind", "s1", *WHY),
            "end.jpg: is no log or session: `whyhot retract --store ",
        ),
    ],
)
def test_what_cannot_be_put_right_is_one_line_and_changes_nothing(
    capsys: Capture, words: Sequence[str], line: str
) -> None:
    before = now()
    assert main([*words]) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)
    assert said.err.startswith(line)
    assert now() == before


@pytest.mark.usefixtures("bench")
def test_a_session_that_went_with_its_log_says_how_it_comes_back(capsys: Capture) -> None:
    """The command is one that a shell reads, whatever the log is called."""
    shutil.copy("a.csv", "my log.csv")
    Path("my log.csv").write_text(Path("a.csv").read_text().replace("2026-01-01", "2026-03-01"))
    assert main(["ingest", "my log.csv", "--bench", "bench.toml"]) == 0
    assert main(["retract", "my log.csv", *WHY]) == 0
    for words in (["retract", "my log", "--undo", *WHY], ["retract", "my log", *WHY]):
        capsys.readouterr()
        assert main(words) == 2
        back = "`whyhot retract --store store 'my log.csv' --undo --reason TEXT` brings it back"
        assert back in capsys.readouterr().err


def test_a_retraction_and_what_it_makes_of_the_sessions_are_one_transaction(
    bench: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    transactions: list[set[str]] = []
    insert = Ledger._insert

    def counted(ledger: Ledger, rows: Sequence[StoredEvent], after: int) -> Sequence[int] | None:
        transactions.append({row.topic.removeprefix("whyhot:") for row in rows})
        return insert(ledger, rows, after)

    monkeypatch.setattr(Ledger, "_insert", counted)
    assert main(["retract", "b.csv", *WHY]) == 0
    assert transactions == [{"FactRetracted", "SessionRecorded", "SessionRegrouped"}, {"LedgerSealed"}]


@pytest.mark.usefixtures("bench")
def test_what_a_log_is_of_is_corrected_and_stays_so(capsys: Capture) -> None:
    before = now().session("a").session
    done = answered(capsys, "correct", "a", "--specimen", "S02", "--kind", "s1", *WHY)
    assert {tuple(one) for one in done["changes"].values()} == {("specimen", "kind")}
    session = now().session("a")
    assert (session.specimen, session.kind, session.kind_why) == ("S02", "s1", "given when the file was ingested")
    assert now().session(before) == session, "the old id leads to it"
    assert main(["correct", "b.csv", "--batch", "B7", *WHY]) == 0
    assert now().session("a") == session.__class__(**{**vars(session), "batch": "B7"})


@pytest.mark.usefixtures("bench")
def test_a_log_is_read_again_with_another_bench_file_from_its_sealed_bytes(capsys: Capture) -> None:
    old = now().session("a")
    Path("a.csv").unlink()
    Path("b.csv").unlink()
    assert main(["correct", "b.csv", "--bench", "other.toml", *WHY]) == 0
    assert "log a.csv: bench other.toml " in capsys.readouterr().out
    new = now().session("a")
    assert new.session == old.session and new.bench != old.bench
    assert {file["decode"] for file in new.files}.isdisjoint(file["decode"] for file in old.files)


def test_a_correction_that_was_stopped_is_finished_by_the_same_command(
    bench: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = now().session("a")
    words = ["correct", "a", "--bench", "other.toml", *WHY]
    with monkeypatch.context() as patch:
        patch.setattr("ingest.intake.intake.group_files", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        assert main(words) == 130
    assert now().session("a") == old
    assert main(words) == 0
    assert now().session("a").bench != old.bench
    with Store.open(Path("store")) as store:
        corrected = [one.event for one in store.ledger.events(LogCorrected)]
    assert [one.why for one in corrected if isinstance(one, LogCorrected)] == [WHY[1]] * 2
