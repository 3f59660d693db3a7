"""A store answers the same with its files in a bucket or in its folder, and whichever log came first."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from ingest.facts import facts
from ingest.facts.events import DiagnosisCompleted, ReplayCompleted
from ingest.facts.move_files import move_files
from ingest.facts.store import Store
from made import can_bench
from made.bucket import BucketServer, bucket_server, with_keys
from made.postgres import postgres, why_none
from replay.cli import main

Capture = pytest.CaptureFixture[str]
ASKED = "SELECT channel, count(*), min(value), max(value) FROM samples GROUP BY ALL ORDER BY ALL"
RUNS = "SELECT run, channel, max(residual_K) FROM residuals GROUP BY ALL ORDER BY ALL"


@pytest.fixture(scope="module")
def bucket() -> Iterator[BucketServer]:
    with pytest.MonkeyPatch.context() as patch, bucket_server() as started:
        with_keys(patch)
        yield started


@pytest.fixture(scope="module")
def stores(tmp_path_factory: pytest.TempPathFactory, bucket: BucketServer) -> dict[str, Path]:
    """The same two sessions twice: files in the folder, and in the bucket. The logs lie beside the stores."""
    folder = tmp_path_factory.mktemp("bench")
    can_bench.write_files(folder)
    logs = [str(folder / f"{i}.blf") for i in (0, 1)]
    for i, log in enumerate(logs):
        can_bench.write_log(Path(log), seconds=460, seed=i, start=can_bench.START + i * 86_400)
    here, there = folder / "here", folder / "there"
    setup = ["--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")]
    assert main(["ingest", logs[0], *setup, "--store", str(here)]) == 0
    shutil.copytree(here, there)
    move_files(there, bucket.url())
    for store in (here, there):
        assert main(["ingest", logs[1], *setup, "--store", str(store)]) == 0
        assert main(["replay", "--store", str(store)]) == 0
        assert main(["diagnose", "--on", "0", "1", "--store", str(store)]) == 0
    return {"here": here, "there": there}


def digests(store: Path) -> dict[str, str]:
    """Of each run, and the SHA-256 of each diagnosis, by their ids."""
    with Store.open(store) as opened:
        done = [one.event for one in opened.ledger.events()]
    runs = {one.run: one.digest for one in done if isinstance(one, ReplayCompleted)}
    return runs | {one.diagnosis: one.artefact for one in done if isinstance(one, DiagnosisCompleted)}


def products(store: Path) -> dict[str, dict[str, str]]:
    """SHA-256 of each file that was decoded, by the ids of the decodes."""
    with Store.open(store) as opened:
        return {one.decode: one.products for one in facts.at(opened.ledger).decodes.values()}


def both(stores: dict[str, Path], capsys: Capture, *words: str) -> tuple[Any, Any]:
    """What a command answers of the one and the other, as JSON without what names the store."""
    found = []
    for store in stores.values():
        capsys.readouterr()
        assert main([*words, "--store", str(store), "--json"]) == 0
        answer = json.loads(capsys.readouterr().out.replace(str(store), "STORE"))
        answer.pop("provenance")
        found.append(answer)
    return found[0], found[1]


def test_files_and_digests_of_runs_and_a_diagnosis_are_equal(stores: dict[str, Path], bucket: BucketServer) -> None:
    found = digests(stores["here"])
    assert len(found) >= 3
    assert digests(stores["there"]) == found
    lying = [path for part in ("archive", "decoded") for path in (stores["here"] / part).glob("*/*")]
    files = {str(path.relative_to(stores["here"])) for path in lying}
    assert {name.removeprefix("store/") for name in bucket.names()} == {*files, "whyhot.json"}
    assert not [*stores["there"].glob("*/*/*")]


@pytest.mark.skipif(why_none() is not None, reason=why_none() or "")
def test_ledger_in_a_server_files_in_a_bucket_and_two_processes_give_the_same_digests(
    stores: dict[str, Path], bucket: BucketServer, tmp_path: Path
) -> None:
    bench, far = stores["here"].parent, tmp_path / "far"
    words = ["--bench", str(bench / "bench.toml"), "--dbc", str(bench / "bench.dbc"), "--store", str(far)]
    assert main(["ingest", str(bench / "0.blf"), *words]) == 0
    with postgres() as server:
        move_files(far, bucket.url("far"))
        assert main(["move", server.url, "--store", str(far)]) == 0
        assert main(["ingest", str(bench / "1.blf"), *words]) == 0
        assert main(["replay", "--workers", "2", "--store", str(far)]) == 0
        found = digests(far)
        assert main(["verify", "--read", "--store", str(far)]) == 0
    assert found.items() <= digests(stores["here"]).items() and len(found) == 2


def test_logs_taken_in_and_replayed_in_another_order_give_equal_samples_runs_and_diagnoses(
    stores: dict[str, Path], tmp_path: Path
) -> None:
    folder, store = stores["here"].parent, ["--store", str(tmp_path / "store")]
    setup = ["--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")]
    for log in ("1.blf", "0.blf"):
        assert main(["ingest", str(folder / log), *setup, *store]) == 0
    for words in (["replay", "1", "0"], ["diagnose", "--on", "0", "1"]):
        assert main([*words, *store]) == 0
    assert digests(tmp_path / "store") == digests(stores["here"])
    assert products(tmp_path / "store") == products(stores["here"])


@pytest.mark.parametrize(
    "words", [["sql", ASKED], ["sql", RUNS], ["sql", ASKED, "--as-of", "6"], ["show", "0"], ["lineage", "0.blf:5"]]
)
def test_what_is_asked_of_both_is_answered_alike(stores: dict[str, Path], words: list[str], capsys: Capture) -> None:
    here, there = both(stores, capsys, *words)
    assert here == there
    assert len(json.dumps(here)) > 100


def test_of_a_session_sql_reads_the_files_of_its_channel_alone(
    stores: dict[str, Path], bucket: BucketServer, capsys: Capture
) -> None:
    """Beside them, of the first file of each kind what it holds."""
    assert main(["sql", "SELECT 1 AS one", "--store", str(stores["there"])]) == 0
    with Store.open(stores["there"]) as store:
        known = facts.at(store.ledger)
        decode, name = max((session.files[0]["decode"], session.name) for session in known.sessions)
    bucket.asked.clear()
    question = f"SELECT avg(value) FROM samples WHERE session_name = '{name}' AND channel = 'MotorSpeed'"
    assert main(["sql", question, "--store", str(stores["there"])]) == 0
    read = {key for method, key in bucket.asked if method == "GET" and decode in key}
    assert read == {f"store/decoded/{decode}/Drive.parquet"}


def test_the_state_says_where_files_are(
    stores: dict[str, Path], capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WHYHOT_STORE", str(stores["there"]))
    capsys.readouterr()
    assert main([]) == 0
    assert " MB here and the files in s3://lab/store · head " in capsys.readouterr().out


def test_it_cannot_leave_the_store(stores: dict[str, Path], bucket: BucketServer, capsys: Capture) -> None:
    from analytics.warehouse import connect

    bucket.objects["other/t.parquet"] = bucket.objects[next(one for one in bucket.names() if one.endswith(".parquet"))]
    with connect(stores["there"]) as connection, pytest.raises(Exception, match="disabled by configuration"):
        connection.execute("FROM read_parquet('s3://lab/other/t.parquet')")


def test_verify_and_rebuild_read_every_byte_there(stores: dict[str, Path], capsys: Capture) -> None:
    assert main(["verify", "--read", "--store", str(stores["there"])]) == 0
    assert main(["rebuild", "--verify", "--store", str(stores["there"])]) == 0
    assert "each equal to what it was" in capsys.readouterr().out


def test_a_forgotten_log_is_gone_from_the_bucket(
    stores: dict[str, Path], bucket: BucketServer, tmp_path: Path, capsys: Capture
) -> None:
    shutil.copytree(stores["here"], tmp_path / "store")
    move_files(tmp_path / "store", bucket.url("copy"))
    with Store.open(tmp_path / "store") as store:
        [raw] = [one.sha256 for one in facts.at(store.ledger).files.values() if one.name == "1.blf"]
        [decode] = facts.at(store.ledger).decodes_of(raw)
    assert [one for one in bucket.names("copy/") if raw in one or decode.decode in one]
    words = ["forget", "1.blf", "--reason", "the customer asked for it", "--store", str(tmp_path / "store")]
    assert main(words) == 0
    assert not [one for one in bucket.names("copy/") if raw in one or decode.decode in one]
    assert main(["verify", "--read", "--store", str(tmp_path / "store")]) == 0


@pytest.mark.parametrize("verb", ["sql FROM+samples", "show 0", "replay", "verify --read", "rebuild", "move files"])
def test_a_server_that_lets_nobody_in_is_one_line(
    stores: dict[str, Path], bucket: BucketServer, verb: str, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bucket, "fault", lambda method, key: "denied")
    capsys.readouterr()
    words = [word.replace("+", " ") for word in verb.split()]
    assert main([*words, "--store", str(stores["there"])]) == 2
    said = capsys.readouterr().err.strip()
    assert "is refused (" in said
    assert said.count("\n") == 0


def test_without_the_extra_sql_says_what_to_install(stores: dict[str, Path], capsys: Capture) -> None:
    with patch.dict(sys.modules, {"fsspec": None}):
        assert main(["sql", "SELECT 1", "--store", str(stores["there"])]) == 2
    said = capsys.readouterr().err.strip()
    assert "what SQL needs to read a bucket (fsspec) is not installed: " in said
    assert "uv tool install '.[s3]'" in said
    assert main(["show", "0", "--store", str(stores["there"])]) == 0
