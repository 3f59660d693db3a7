"""A key changes with the code that computes its answer, and with no other."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ingest.facts import facts as ledger_facts
from ingest.facts.store import Store
from made import can_bench
from made.places import ROOT
from replay.cli import main
from replay.engine.runs import sources
from replay.studies.diagnosis.answer import Diagnosis
from replay.studies.diagnosis.diagnose import diagnose

DOORS = (
    "replay.engine.runs.runs",
    "replay.studies.characterise.calibrate",
    "replay.studies.diagnosis.diagnose",
    "replay.studies.ageing.assess",
)
Touch = Callable[[str], None]


@pytest.fixture
def touch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Touch]:
    """Adds a comment to a source file, in a copy of ours that keys are made from."""
    copy = tmp_path / "sources"
    for package in ("twin", "ingest", "analytics", "replay"):
        for path in (ROOT / package).rglob("*.py"):
            target = copy / path.relative_to(ROOT)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, target)
    monkeypatch.setattr(sources, "ROOT", copy)
    sources.code_of.cache_clear()

    def added(name: str) -> None:
        with (copy / name).open("a", encoding="utf-8") as file:
            file.write("# another word\n")
        sources.code_of.cache_clear()

    yield added
    sources.code_of.cache_clear()


def stored(folder: Path, seconds: int) -> Path:
    """A store of one drive of a small motor."""
    can_bench.write_files(folder)
    can_bench.write_log(folder / "1_drive.blf", seconds, 1)
    bench = ["--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")]
    assert main(["ingest", str(folder / "1_drive.blf"), *bench, "--store", str(folder / "store")]) == 0
    return folder / "store"


def test_the_generator_of_kernels_is_in_every_key(touch: Touch) -> None:
    before = [sources.code_of(door) for door in DOORS]
    touch("twin/compiled/codegen.py")
    assert all(sources.code_of(door) != code for door, code in zip(DOORS, before, strict=True))


@pytest.mark.parametrize(
    "name",
    [
        *(path.relative_to(ROOT).as_posix() for path in sorted((ROOT / "twin" / "paper").glob("*.py"))),
        *("twin/filters/ukf.py", "replay/show/plots/plots.py", "replay/cli/replay.py", "twin/__init__.py"),
    ],
)
def test_what_no_answer_is_made_of_is_in_no_key(touch: Touch, name: str) -> None:
    before = [sources.code_of(door) for door in DOORS]
    touch(name)
    assert [sources.code_of(door) for door in DOORS] == before


def test_each_study_is_in_its_own_key_alone(touch: Touch) -> None:
    for study, asked in (
        ("replay/studies/diagnosis/search.py", "replay.studies.diagnosis.diagnose"),
        ("replay/studies/ageing/lives.py", "replay.studies.ageing.assess"),
        ("analytics/insulation/fleet/outlying.py", "replay.studies.ageing.assess"),
    ):
        before = {door: sources.code_of(door) for door in DOORS}
        touch(study)
        assert {door for door in DOORS if sources.code_of(door) != before[door]} == {asked}


def test_a_replay_is_known_until_code_changes_that_computes_it(
    touch: Touch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = ["--store", str(stored(tmp_path, 60))]

    def run() -> tuple[str, str]:
        capsys.readouterr()
        assert main(["replay", "1_drive", "--json", *store]) == 0
        (one,) = json.loads(capsys.readouterr().out)["runs"]
        return one["run"], one["digest"]

    first = run()
    touch("twin/paper/ekf.py")
    touch("replay/studies/diagnosis/search.py")
    assert run() == first
    touch("twin/compiled/codegen.py")
    other = run()
    assert other[0] != first[0]
    assert other[1] == first[1], "another key, the same numbers"


def test_a_diagnosis_is_read_back_until_code_changes_that_computes_it(
    touch: Touch, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class SearchedError(Exception):
        pass

    def searched(*_: object) -> None:
        raise SearchedError

    where = ["--store", str(stored(tmp_path, 1000))]
    assert main(["diagnose", "--on", "1_drive", *where]) == 0
    monkeypatch.setattr("replay.studies.diagnosis.diagnose._answered", searched)
    with Store.open(tmp_path / "store") as store:
        facts = ledger_facts.at(store.ledger)

        def asked() -> Diagnosis:
            return diagnose(store, facts, [facts.session("1_drive")], [], None, "testing")

        found = asked()
        touch("twin/paper/ekf.py")
        touch("replay/studies/ageing/lives.py")
        assert asked() == found
        touch("twin/compiled/codegen.py")
        with pytest.raises(SearchedError):
            asked()
