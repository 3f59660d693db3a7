"""`whyhot verify` on damaged stores, and what other verbs say of them."""

from __future__ import annotations

import json
import os
import re
import shutil
import sqlite3
import sys
from contextlib import closing
from pathlib import Path

import pytest

from ingest.facts import facts, store_check
from ingest.facts.alias import reachable
from ingest.facts.store import Store
from made import can_bench
from made.places import on_disk
from replay.cli import main

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two ingested logs, one of them replayed."""
    folder = tmp_path_factory.mktemp("bench")
    can_bench.write_files(folder)
    can_bench.write_log(folder / "1_s1.blf", seconds=60, seed=1)
    can_bench.write_log(folder / "2_drive.asc", seconds=60, seed=2, start=can_bench.START + 86_400)
    logs = [str(folder / name) for name in ("1_s1.blf", "2_drive.asc")]
    words = ["ingest", *logs, "--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")]
    store = ["--store", str(folder / "store")]
    assert main([*words, *store]) == 0
    assert main(["replay", "1_s1", *store]) == 0
    return folder


@pytest.fixture
def bench(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> Path:
    """A copy of that store, as the current folder's."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.setenv("WHYHOT_STORE", "store")
    monkeypatch.chdir(tmp_path)
    capsys.readouterr()
    return tmp_path


def _change(*statements: str) -> None:
    with closing(sqlite3.connect("store/ledger.sqlite")) as connection, connection:
        for statement in statements:
            connection.execute(statement)


def _spoil(path: Path) -> None:
    path.chmod(0o644)
    path.write_bytes(path.read_bytes()[:-1] + b"?")


def _sealed(what: str) -> Path:
    """Where the bytes of a log, or of an artefact of the run, lie."""
    with Store.open(Path("store")) as store:
        known = facts.at(store.ledger)
        (run,) = known.runs.values()
        names = {one.name: sha256 for sha256, one in known.files.items()} | dict(run.artefacts)
        return on_disk(store.archive.path(names[what]))


def _verify(capsys: Capture, *words: str) -> tuple[int, dict[str, object], list[str]]:
    code = main(["verify", *words, "--json"])
    said = capsys.readouterr()
    return code, json.loads(said.out), said.err.splitlines()


def test_three_changed_events_are_three_findings_and_exit_code_1(bench: Path, capsys: Capture) -> None:
    _change("UPDATE stored_events SET state = CAST(replace(state, 'e', 'f') AS BLOB) WHERE rowid IN (2, 5, 8)")
    code, answer, lines = _verify(capsys)
    assert code == 1
    findings = answer["findings"]
    assert isinstance(findings, list)
    for position in (2, 5, 8):
        assert any(line.startswith(f"event {position} ") for line in findings)
        assert any(line.startswith(f"event {position} ") for line in lines)
    assert answer["whole"]["sealed files"] == {"whole": 10, "of": 10}  # type: ignore[index]
    assert answer["next"] == [store_check.LEDGER, "whyhot verify --read"]


def test_damage_says_what_it_affects_what_is_good_and_what_to_do(bench: Path, capsys: Capture) -> None:
    _spoil(_sealed("2_drive.asc"))
    _spoil(_sealed("frame"))
    assert main(["verify", "--read"]) == 1
    said = capsys.readouterr()
    assert sum("affects 2_drive" in line for line in said.err.splitlines()) == 1
    assert sum("affects 1_s1" in line for line in said.err.splitlines()) == 1
    assert said.out.startswith("2 findings")
    assert "8 of 10 sealed files" in said.out
    assert "6 of 6 decoded files" in said.out
    assert "whyhot ingest --store store 2_drive.asc --bench bench.toml --dbc bench.dbc" in said.out
    assert main(["ingest", "2_drive.asc", "--bench", "bench.toml", "--dbc", "bench.dbc"]) == 0
    assert main(["replay", "1_s1"]) == 0
    assert main(["verify", "--read"]) == 0, "the steps that were said mend it"


def test_a_damaged_product_affects_its_session_and_a_rebuild_mends_it(bench: Path, capsys: Capture) -> None:
    _spoil(next(Path("store/decoded").glob("*/can*.parquet"), next(Path("store/decoded").glob("*/*.parquet"))))
    code, answer, _ = _verify(capsys, "--read")
    assert code == 1
    assert len(answer["sessions_whole"]) == 1  # type: ignore[arg-type]
    assert answer["next"] == ["whyhot rebuild", "whyhot verify --read"]
    assert main(["rebuild"]) == 0
    assert main(["verify", "--read"]) == 0


@pytest.mark.parametrize(
    ("statement", "affected"),
    [
        ("UPDATE stored_events SET state=x'00' WHERE topic LIKE '%ModelPublished'", {"1_s1", "2_drive"}),
        ("UPDATE stored_events SET state=x'00' WHERE topic LIKE '%MotorRegistered'", {"1_s1", "2_drive"}),
        ("DELETE FROM stored_events WHERE topic LIKE '%BenchRegistered'", {"1_s1", "2_drive"}),
        ("DELETE FROM stored_events WHERE originator_id LIKE 'file-%' AND rowid > 6", {"2_drive"}),
    ],
)
def test_damage_to_a_motor_and_missing_events_affect_the_sessions_on_them(
    bench: Path, capsys: Capture, statement: str, affected: set[str]
) -> None:
    _change(statement)
    code, answer, _ = _verify(capsys)
    assert code == 1
    assert {name for one in answer["damages"] for name in one["affects"]} == affected  # type: ignore[attr-defined]
    assert set(answer["sessions_whole"]) == {"1_s1", "2_drive"} - affected  # type: ignore[call-overload]


@pytest.mark.parametrize(
    "thing",
    [
        "TRIGGER other AFTER INSERT ON stored_events BEGIN DELETE FROM stored_events WHERE rowid = 1; END",
        "VIEW other AS SELECT * FROM stored_events",
        "TABLE other (a)",
        "COLUMN other",
    ],
    ids=lambda thing: thing.split()[0],
)
def test_what_whyhot_never_made_in_the_database_of_the_ledger_is_found(
    bench: Path, capsys: Capture, thing: str
) -> None:
    _change(f"ALTER TABLE stored_events ADD {thing}" if thing.startswith("COLUMN") else f"CREATE {thing}")
    code, _, (first, *_) = _verify(capsys)
    assert code == 1
    assert f"{thing.split()[0].lower()} other: whyhot made none" in first


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_a_pipe_in_place_of_a_sealed_file_is_damage_and_nobody_waits_for_it(bench: Path, capsys: Capture) -> None:
    log = _sealed("1_s1.blf")
    log.unlink()
    os.mkfifo(log)
    code, _, lines = _verify(capsys, "--read")
    assert code == 1
    assert any(log.name in line and "pipe or device" in line for line in lines)


@pytest.mark.parametrize(
    ("harm", "says"),
    [
        ("rows", "holds no event, though 10 sealed files and 2 decoded logs are here"),
        ("empty", "is an empty file"),
        ("gone", "is missing"),
    ],
)
def test_a_ledger_without_its_events_is_one_finding(bench: Path, capsys: Capture, harm: str, says: str) -> None:
    ledger = Path("store/ledger.sqlite")
    if harm == "rows":
        _change("DELETE FROM stored_events")
    else:
        ledger.unlink()
    if harm == "empty":
        ledger.touch()
    code, answer, _ = _verify(capsys)
    findings = answer["findings"]
    assert isinstance(findings, list)
    assert (code, len(findings)) == (1, 1) and findings[0].startswith(f"{ledger.absolute()}: {says}")
    assert answer["next"] == [store_check.LEDGER, "whyhot verify --read"]


def test_a_new_store_without_logs_is_intact(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WHYHOT_STORE", str(tmp_path / "store"))
    with Store.open(tmp_path / "store", create=True):
        pass
    assert main(["verify", "--read"]) == 0


@pytest.mark.parametrize("harm", ["cut", "empty", "gone"])
def test_sealed_files_are_checked_without_a_ledger_too(bench: Path, capsys: Capture, harm: str) -> None:
    log, path = _sealed("1_s1.blf"), Path("store/ledger.sqlite")
    _spoil(log)
    whole = path.read_bytes()
    path.write_bytes(whole[:1000] if harm == "cut" else b"")
    if harm == "gone":
        path.unlink()
    code, answer, lines = _verify(capsys, "--read")
    assert code == 1
    assert answer["whole"]["sealed files"] == {"whole": 9, "of": 10}  # type: ignore[index]
    assert any(log.name in line for line in lines)
    assert any("ledger.sqlite" in line for line in lines)


def test_what_is_wrong_only_at_first_reading_is_no_alarm(bench: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from ingest.facts.archive import Archive

    real, seen = Archive.damage, set()

    def flaky(archive: Archive, sha256: str, read: bool = True) -> str | None:
        if sha256 in seen:
            return real(archive, sha256, read)
        seen.add(sha256)
        return f"{sha256}: is damaged"

    monkeypatch.setattr(Archive, "damage", flaky)
    with Store.open(Path("store")) as store:
        found = store_check.check(store)
    assert found.damages == []
    assert sum("was read wrong at first and right after" in line for line in found.hints) == 10


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE stored_events SET state=NULL WHERE rowid=3",
        "UPDATE stored_events SET state='text' WHERE rowid=3",
        "UPDATE stored_events SET originator_version='x' WHERE rowid=3",
        "UPDATE stored_events SET topic=x'ff' WHERE rowid=3",
        "UPDATE stored_events SET state=CAST('{\"v\": 1}' AS BLOB) WHERE rowid=3",
        "UPDATE stored_events SET state=NULL WHERE rowid=(SELECT max(rowid) FROM stored_events)",
        "DELETE FROM stored_events WHERE rowid=3",
        "UPDATE stored_events SET rowid=rowid+1000 WHERE rowid>4",
        "UPDATE stored_events SET rowid=9223372036854775807 WHERE rowid=(SELECT max(rowid) FROM stored_events)",
    ],
)
def test_no_verb_reads_a_damaged_ledger_and_each_says_so_in_a_line(
    bench: Path, capsys: Capture, statement: str
) -> None:
    _change(statement)
    for words in (["head"], ["sessions"], ["sql", "FROM events"], ["ingest", "1_s1.blf"], ["show", "1_s1"], ["replay"]):
        assert main(words) == 2, words
        said = capsys.readouterr()
        assert len(said.err.splitlines()) == 1, words
        assert "`whyhot verify --store store` lists all damage" in said.err or "restore" in said.err, words
    assert main(["verify"]) == 1


def test_the_head_of_a_report_is_what_verify_takes(bench: Path, capsys: Capture) -> None:
    assert main(["report", "1_s1"]) == 0
    page = Path("report.html").read_text(encoding="utf-8")
    (head,) = set(re.findall(r"[0-9]+:[0-9a-f]{64}", page))
    position, _, root = head.partition(":")
    for since in (head, f"{position} {root[:16]}", f"{position}:{root[:12]}"):
        assert main(["verify", "--since", since]) == 0, since
        assert main(["verify", "--since", since.replace(root[:12], "0" * 12)]) == 1, since
    assert main(["verify", "--since", f"{position}:{root[:8]}"]) == 2
    assert main(["verify", "--since", f"{position}:{root}0"]) == 2


@pytest.mark.skipif(sys.platform != "linux", reason="names of folders that only Linux takes")
@pytest.mark.parametrize("name", ["a?b", "a\\b", "a*[1]{2}", "a'b\"#%41\n", os.fsdecode(b"a\xe9b")])
def test_a_store_works_under_any_path(bench: Path, capsys: Capture, name: str) -> None:
    Path("odd").mkdir()
    store = ["--store", f"odd/{name}"]
    for words in (
        ["ingest", "1_s1.blf", "--bench", "bench.toml", "--dbc", "bench.dbc"],
        ["sessions", "--json"],
        ["show", "1_s1"],
        ["replay", "1_s1"],
        ["report", "1_s1"],
        ["sql", "SELECT count(*) FROM samples"],
        ["export", "1_s1", "--to", "parquet", "--out", f"{name}.parquet"],
        ["rebuild", "--verify"],
        ["verify", "--read"],
    ):
        assert main([*words, *store]) == 0, (words, capsys.readouterr().err)
    assert [path.name for path in Path("odd").iterdir()] == [name]
    assert reachable(Path("~")) == Path.cwd() / "~"  # and Arrow begins at a home there


def test_a_damaged_backup_is_mended_from_its_store(bench: Path, capsys: Capture) -> None:
    assert main(["backup", "copy"]) == 0
    log = Path("copy/archive") / _sealed("1_s1.blf").relative_to("store/archive")
    _spoil(log)
    capsys.readouterr()
    assert main(["verify", "--read", "--store", "copy"]) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert "Next whyhot backup --store STORE copy --read, if it is the backup of STORE; else" in said
    assert main(["backup", "copy", "--read"]) == 0
    assert main(["verify", "--read", "--store", "copy"]) == 0


def test_workers_find_the_same_damage(bench: Path, capsys: Capture) -> None:
    with Store.open(bench / "store") as store:
        _spoil(on_disk(store.archive.path(next(iter(store.archive)))))
        product = next(path for path in sorted((bench / "store" / "decoded").rglob("*.parquet")))
    _spoil(product)
    answers = []
    for words in ([], ["--workers", "2"]):
        assert main(["verify", "--read", *words]) == 1
        said = capsys.readouterr()
        answers.append((said.out, said.err))
    assert answers[0] == answers[1]
    assert answers[0][1].count("is damaged") == 2
    assert main(["verify", "--workers", "2"]) == 2
    assert capsys.readouterr().err.endswith(
        "--workers and --scheduler read sealed files and products: give --read too.\n"
    )


def test_an_ingest_says_that_files_are_here_which_no_event_names(bench: Path, capsys: Capture) -> None:
    _change("DELETE FROM stored_events")
    assert main(["ingest", "2_drive.asc", "--bench", "bench.toml", "--dbc", "bench.dbc"]) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert "holds no event, though 10 sealed files and 2 decoded logs are here: its events were deleted" in line
    assert main(["ingest", "1_s1.blf", "--bench", "bench.toml", "--dbc", "bench.dbc"]) == 0
    assert capsys.readouterr().err == ""
