"""One bench file beside several motor files: each session goes by the motor file that lay there when its files came."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from ingest.catalogue.channels import load
from ingest.facts import facts
from ingest.facts.store import Store
from made import can_bench
from replay.cli import main

HOTTER = can_bench.MOTOR.replace("coefficient = 30.0", "coefficient = 60.0")
FIRST, SECOND = (hashlib.sha256(text.encode()).hexdigest() for text in (can_bench.MOTOR, HOTTER))


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("logs")
    can_bench.write_log(folder / "1_first.blf", seconds=120, seed=1)
    can_bench.write_log(folder / "2_second.blf", seconds=120, seed=2, start=can_bench.START + 86_400)
    return folder


class Bench:
    """Two folders with the same bench.toml, byte for byte, each beside a motor file of its own; one store."""

    def __init__(self, folder: Path, logs: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.folder, self.logs, self.store, self.capsys = folder, logs, folder / "store", capsys
        for name, motor in (("first", can_bench.MOTOR), ("second", HOTTER)):
            (folder / name).mkdir()
            can_bench.write_files(folder / name)
            (folder / name / "motor.toml").write_text(motor, encoding="utf-8")

    def ingest(self, beside: str, *names: str) -> str:
        self.capsys.readouterr()
        files, own = [str(self.logs / name) for name in names], self.folder / beside
        explained = ["--bench", str(own / "bench.toml"), "--dbc", str(own / "bench.dbc")]
        assert main(["ingest", *files, *explained, "--store", str(self.store)]) == 0
        return self.capsys.readouterr().out

    def replay(self) -> dict[str, dict[str, Any]]:
        """By session's name: its run under the model that its bench file named."""
        self.capsys.readouterr()
        assert main(["replay", "--json", "--store", str(self.store)]) == 0
        return {run["session_name"]: run for run in json.loads(self.capsys.readouterr().out)["runs"]}


@pytest.fixture
def bench(tmp_path: Path, logs: Path, capsys: pytest.CaptureFixture[str]) -> Bench:
    return Bench(tmp_path, logs, capsys)


def test_sessions_of_one_bench_file_each_go_by_their_own_motor_file(bench: Bench) -> None:
    bench.ingest("first", "1_first.blf")
    before = bench.replay()
    bench.ingest("second", "2_second.blf")
    after = bench.replay()
    assert {name: run["model"] for name, run in after.items()} == {"1_first": FIRST, "2_second": SECOND}
    assert after["1_first"]["digest"] == before["1_first"]["digest"]


def test_a_changed_motor_file_beside_the_same_bench_file_is_taken_when_the_log_is_given_again(bench: Bench) -> None:
    bench.ingest("first", "1_first.blf")
    before = bench.replay()["1_first"]
    said = bench.ingest("second", "1_first.blf")
    changed = bench.replay()["1_first"]
    assert (before["model"], changed["model"]) == (FIRST, SECOND)
    assert changed["session"] == before["session"], "a new version is never a new session"
    assert "already in the store" not in said


def test_a_version_that_is_given_again_counts_again(bench: Bench) -> None:
    bench.ingest("first", "1_first.blf")
    before = bench.replay()["1_first"]
    bench.ingest("second", "1_first.blf")
    assert "already in the store, its session anew" in bench.ingest("first", "1_first.blf")
    assert bench.replay()["1_first"]["digest"] == before["digest"]
    assert "already in the store, nothing new" in bench.ingest("first", "1_first.blf")


def test_a_bench_file_that_is_changed_back_counts_again(bench: Bench) -> None:
    path = bench.folder / "second" / "bench.toml"
    path.write_text(path.read_text(encoding="utf-8").replace("servo-01", "servo-02"), encoding="utf-8")
    shutil.copy(bench.folder / "first" / "motor.toml", path.parent)
    specimens = []
    for beside in ("first", "second", "first"):
        bench.ingest(beside, "1_first.blf")
        with Store.open(bench.store) as store:
            (session,) = facts.at(store.ledger).sessions
        specimens.append(session.specimen)
    assert specimens == ["servo-01", "servo-02", "servo-01"]


def test_what_is_a_boundary_is_read_from_the_motor_file_of_the_session(bench: Bench) -> None:
    boundary = '[[node]]\nname = "magnet"\ncapacity = 1200.0\n'
    held = can_bench.MOTOR.replace(boundary, '[[boundary]]\nname = "magnet"\n')
    held = held[: held.rindex("[[source]]")]
    (bench.folder / "second" / "motor.toml").write_text(held, encoding="utf-8")
    bench.ingest("first", "1_first.blf")
    bench.ingest("second", "2_second.blf")
    found = {}
    with Store.open(bench.store) as store:
        known = facts.at(store.ledger)
        for session in known.sessions:
            (magnet,) = [c for c in load(store, known, session) if c.spec.node == "magnet"]
            (entry,) = [c for c in known.decodes[session.files[0]["decode"]].channels if c["node"] == "magnet"]
            found[session.name] = magnet.spec.role, entry["region"]
    assert found == {"1_first": ("observed", "magnet"), "2_second": ("input", "boundary")}


def test_a_log_decoded_beside_two_motor_files_is_made_again_from_the_archive(bench: Bench) -> None:
    bench.ingest("first", "1_first.blf")
    bench.ingest("second", "1_first.blf")
    bench.capsys.readouterr()
    assert main(["rebuild", "--verify", "--store", str(bench.store)]) == 0, bench.capsys.readouterr().err
