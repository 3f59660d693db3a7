"""`whyhot accept`: a diagnosis's extended model and bench file become current, once, and everything follows."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ingest.facts import facts as ledger_facts
from ingest.facts.events import BenchRegistered, DiagnosisCompleted, ModelExtended, ModelPublished
from ingest.facts.store import Store
from made import can_bench
from replay.cli import main
from replay.engine.files.bench_text import corrected
from replay.engine.files.models import find_model, model_of
from replay.studies.diagnosis.answer import ChainStep, Diagnosis, Named, document

CAUSES = {"loss.magnet.speed2": True, "sensor.magnet.bias": True, "input.current.gain": False}
UNSAYABLE = "sensor.magnet.hold"  # a fault of the record


@pytest.fixture(scope="module")
def ingested(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("accept")
    can_bench.write_files(folder)
    can_bench.write_log(folder / "1_learn.blf", seconds=120)
    words = ["ingest", str(folder / "1_learn.blf"), "--bench", str(folder / "bench.toml")]
    assert main([*words, "--dbc", str(folder / "bench.dbc"), "--store", str(folder / "store")]) == 0
    return folder / "store"


@pytest.fixture
def store_folder(ingested: Path, tmp_path: Path) -> Path:
    """A copy of the store, for each test to write to."""
    shutil.copytree(ingested, tmp_path / "store")
    return tmp_path / "store"


def named(cause: str, improved: bool) -> Named:
    return Named(
        id=cause,
        says="a cause",
        members=[],
        estimate=1.0,
        ci95=[0.5, 1.5],
        unit="W",
        typical_W=None,
        largest_effect_K=3.0,
        largest_effect_node="magnet",
        largest_effect_session="1",
        largest_effect_t_s=60.0,
        formula="",
        log_bayes_factor=40.0,
        probability=0.99,
        member_probability=0.9,
        indistinguishable_from=[],
        separating_test=None,
        significant=True,
        identified=True,
        improved=improved,
        why_not_improved=None if improved else "kept sessions are no better",
    )


def diagnosed(
    folder: Path,
    number: str,
    causes: dict[str, bool],
    model: bool = True,
    bench: bool = True,
    parent: str | None = None,
) -> dict[str, str | None]:
    """A sealed diagnosis of the session, as a study leaves it: extended files, the document and its facts."""
    with Store.open(folder, write=True) as store:
        facts = ledger_facts.at(store.ledger)
        (session,) = facts.sessions
        old_bench = facts.bench_of(session)
        assert old_bench is not None
        old_model = parent or model_of(facts, session)
        motor = store.archive.read(old_model) + f"# extended by {number}\n".encode()
        new_model = store.archive.seal(motor) if model else None
        text = corrected(store.archive.read(old_bench.sha256), old_bench.name, {"sensor.magnet.bias": 1.5}, number)
        new_bench = store.archive.seal(text) if bench else None
        extended = {
            "parent": old_model if model else None,
            "model": new_model,
            "parent_bench": old_bench.sha256 if bench else None,
            "bench": new_bench,
        }
        found = Diagnosis(
            diagnosis=number,
            motor="servo-5kW",
            level="testing",
            model=old_model,
            train=[session.session],
            held_out=[],
            train_names=[session.name],
            held_out_names=[],
            opened_before=False,
            shown=[],
            causes=[replace(named(cause, improved), sayable=cause != UNSAYABLE) for cause, improved in causes.items()],
            rivals=[],
            unknown=[],
            masked=[],
            recalibrated_model=None,
            extended_model=new_model,
            extended_bench=new_bench,
            gain=[],
            log_score_gain=None,
            log_score_gain_lower=None,
            few_kept_data=False,
            candidates=200,
            dropped=[],
            steps=120,
            null_log_bayes_factor=3.0,
            threshold=6.0,
            next_test=None,
            chain=_chain(store, list(causes), extended),
        )
        artefact = store.archive.seal(json.dumps(document(found, {})).encode())
        stream = f"diagnosis-{number}"
        if new_model:
            published = ModelPublished(model=new_model, motor="servo-5kW", file="motor.toml", parent=old_model)
            store.ledger.append("motor-servo-5kW", published)
        if new_bench:
            registered = BenchRegistered(
                sha256=new_bench, name=old_bench.name, motor=old_bench.motor, model=old_bench.model
            )
            store.ledger.append(f"bench-{new_bench}", registered)
        if new_model or new_bench:
            store.ledger.append(stream, ModelExtended(diagnosis=number, **extended))
        completed = DiagnosisCompleted(diagnosis=number, key={}, artefact=artefact, summary={})
        store.ledger.append(stream, completed)
        return extended


def _chain(store: Store, causes: list[str], extended: dict[str, str | None]) -> list[ChainStep]:
    """A step a cause: motor files of their own up to the last, which has the extended files."""

    def step(number: int, model: str | None, bench: str | None) -> ChainStep:
        benches = {str(extended["parent_bench"]): bench} if bench else {}
        return ChainStep(
            step=number,
            id=causes[number - 1] if number > 0 else None,
            told_together=[],
            formula="",
            log_bayes_factor=None,
            sessions_better=0,
            sessions=1,
            left_out_mae_K={"magnet": 1.0},
            kept_mae_K={},
            model=model,
            bench=bench,
            benches=benches,
        )

    between = [store.archive.seal(f"# {number} steps\n".encode()) for number in range(len(causes))]
    steps = [step(number, model, None) for number, model in enumerate(between)]
    return [*steps, step(len(causes), extended["model"], extended["bench"])]


def accept(folder: Path, capsys: pytest.CaptureFixture[str], text: str, code: int = 0) -> dict[str, Any]:
    capsys.readouterr()
    assert main(["accept", text, "--json", "--store", str(folder)]) == code
    answer: dict[str, Any] = json.loads(capsys.readouterr().out)
    return answer


def current(folder: Path, as_of: str | None = None) -> tuple[str, str]:
    """Model and bench file of the session."""
    with Store.open(folder) as store:
        facts = ledger_facts.at(store.ledger, as_of)
        bench = facts.bench_of(facts.sessions[0])
        assert bench is not None
        return model_of(facts, facts.sessions[0]), bench.sha256


def head(folder: Path) -> int:
    with Store.open(folder) as store:
        return store.ledger.head().position


def test_model_and_bench_file_become_current(store_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = diagnosed(store_folder, "4f0cbeef00000001", CAUSES | {UNSAYABLE: True})
    before = head(store_folder)
    answer = accept(store_folder, capsys, "d-4f0c")
    assert answer["schema"] == "whyhot.acceptance/1"
    assert answer["diagnosis"] == "4f0cbeef00000001"
    assert answer["causes"] == list(CAUSES), "improved or not"
    assert {key: answer[key] for key in made} == made
    assert (answer["written"], answer["other_specimens"]) == (True, {})
    assert answer["provenance"]["store_head"]["position"] == before + 1
    assert current(store_folder) == (made["model"], made["bench"])
    assert current(store_folder, as_of=str(before)) == (made["parent"], made["parent_bench"])


def test_a_diagnosis_taken_back_leaves_the_files_before_it_current(
    store_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = diagnosed(store_folder, "4f0cbeef00000001", CAUSES)
    accept(store_folder, capsys, "d-4f0c")
    words = ["--reason", "the sensor was wrong", "--store", str(store_folder)]
    assert main(["retract", "d-4f0c", *words]) == 0
    assert "Current           motor.toml " in capsys.readouterr().out
    assert current(store_folder) == (made["parent"], made["parent_bench"])
    with Store.open(store_folder) as store:
        assert find_model(ledger_facts.at(store.ledger), "servo-5kW") == made["parent"], "the last that counts"
    assert main(["accept", "d-4f0c", "--store", str(store_folder)]) == 2
    assert capsys.readouterr().err.startswith("diagnosis d-4f0cbeef0000 was taken back on ")
    assert main(["retract", "d-4f0c", "--undo", *words]) == 0
    assert current(store_folder) == (made["model"], made["bench"])


def test_what_learnt_from_a_session_that_was_taken_back_is_not_accepted(
    store_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    diagnosed(store_folder, "4f0cbeef00000001", CAUSES)
    assert main(["retract", "1_learn", "--reason", "a mistake", "--store", str(store_folder)]) == 0
    before = head(store_folder)
    capsys.readouterr()
    assert main(["accept", "d-4f0c", "--store", str(store_folder)]) == 2
    line = "diagnosis d-4f0cbeef0000: session 1_learn was taken back on "
    assert capsys.readouterr().err.startswith(line)
    assert head(store_folder) == before


def test_a_replay_after_it_is_another_run_of_the_same_session(
    store_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = diagnosed(store_folder, "4f0cbeef00000001", CAUSES)

    def replayed() -> dict[str, Any]:
        capsys.readouterr()
        assert main(["replay", "1_learn", "--json", "--store", str(store_folder)]) == 0
        (run,) = json.loads(capsys.readouterr().out)["runs"]
        return dict(run)

    before = replayed()
    accept(store_folder, capsys, "d-4f0c")
    after = replayed()
    assert after["session"] == before["session"]
    assert (before["model"], after["model"]) == (made["parent"], made["model"])
    # Its numbers are the parent's: the bench file did it.
    assert after["mae_K"]["magnet"] > before["mae_K"]["magnet"] + 0.05
    assert after["mae_K"]["yoke"] == pytest.approx(before["mae_K"]["yoke"], abs=0.05)


def test_accepting_again_says_so_and_writes_nothing(store_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    diagnosed(store_folder, "4f0cbeef00000001", CAUSES)
    accept(store_folder, capsys, "4f0cbeef00000001")
    before = head(store_folder)
    assert accept(store_folder, capsys, "4F0C")["written"] is False
    assert head(store_folder) == before
    assert main(["accept", "d-4f0c", "--store", str(store_folder)]) == 0
    assert "was accepted before: nothing was written" in capsys.readouterr().out


def test_a_diagnosis_of_the_extended_model_continues_the_chain(
    store_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    diagnosed(store_folder, "aaaa000000000001", CAUSES)
    accept(store_folder, capsys, "d-aaaa")
    second = diagnosed(store_folder, "bbbb000000000002", CAUSES)
    accept(store_folder, capsys, "d-bbbb")
    assert current(store_folder) == (second["model"], second["bench"])
    assert accept(store_folder, capsys, "d-aaaa")["written"] is False


def test_the_last_of_two_from_the_same_model_is_current_and_the_first_can_be_taken_again(
    store_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = diagnosed(store_folder, "aaaa000000000001", CAUSES)
    second = diagnosed(store_folder, "bbbb000000000002", CAUSES)
    for text, made in (("d-aaaa", first), ("d-bbbb", second), ("d-aaaa", first)):
        assert accept(store_folder, capsys, text)["written"] is True
        assert current(store_folder) == (made["model"], made["bench"])


def test_only_what_was_extended_changes(store_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, _ = current(store_folder)
    of_bench = diagnosed(store_folder, "aaaa000000000001", {"sensor.magnet.bias": True}, model=False)
    answer = accept(store_folder, capsys, "d-aaaa")
    assert (answer["parent"], answer["model"]) == (None, None)
    assert current(store_folder) == (model, of_bench["bench"])
    of_model = diagnosed(store_folder, "bbbb000000000002", {"loss.magnet.speed2": True}, bench=False)
    assert accept(store_folder, capsys, "d-bbbb")["bench"] is None
    assert current(store_folder) == (of_model["model"], of_bench["bench"])


def test_the_first_steps_of_a_chain_can_be_accepted_alone(
    store_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = diagnosed(store_folder, "4f0cbeef00000001", CAUSES)
    bench = current(store_folder)[1]
    assert main(["accept", "d-4f0c", "--steps", "2", "--json", "--store", str(store_folder)]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["causes"] == list(CAUSES)[:2] and answer["bench"] is None
    assert answer["model"] != made["model"] and current(store_folder) == (answer["model"], bench)
    assert main(["accept", "d-4f0c", "--steps", "3", "--store", str(store_folder)]) == 0
    assert current(store_folder) == (made["model"], made["bench"])
    for steps in ("0", "4"):
        capsys.readouterr()
        assert main(["accept", "d-4f0c", "--steps", steps, "--store", str(store_folder)]) == 2
        says = f"diagnosis d-4f0cbeef0000: no files of {steps} steps; steps with files: 1, 2, 3.\n"
        assert capsys.readouterr().err == says


def test_steps_can_be_accepted_where_the_whole_chain_has_no_files(
    store_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    diagnosed(store_folder, "4f0cbeef00000001", {UNSAYABLE: True} | CAUSES, model=False, bench=False)
    assert main(["accept", "d-4f0c", "--store", str(store_folder)]) == 2
    capsys.readouterr()
    assert main(["accept", "d-4f0c", "--steps", "2", "--json", "--store", str(store_folder)]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["causes"] == list(CAUSES)[:1], "a fault of the record is in no file"
    assert current(store_folder)[0] == answer["model"]


def test_sessions_that_go_on_with_another_model_are_said(
    store_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = hashlib.sha256(b"other").hexdigest()
    with Store.open(store_folder, write=True) as store:
        other = store.archive.seal(can_bench.MOTOR.replace("240.0", "250.0").encode())
        published = ModelPublished(model=other, motor="servo-5kW", file="motor.toml", parent=None)
        store.ledger.append("motor-servo-5kW", published)
    model, _ = current(store_folder)
    made = diagnosed(store_folder, "aaaa000000000001", {"loss.magnet.speed2": True}, bench=False, parent=other)
    assert main(["accept", "d-aaaa", "--store", str(store_folder)]) == 0
    assert capsys.readouterr().err == (
        f"session 1_learn: goes on with model {model[:8]}: say --model {str(made['model'])[:8]} to replay it.\n"
    )


def test_other_specimens_that_go_on_with_the_accepted_files_too_are_said(
    ingested: Path, store_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    can_bench.write_log(tmp_path / "2_other.blf", seconds=60)
    words = ["--bench", str(ingested.parent / "bench.toml"), "--dbc", str(ingested.parent / "bench.dbc")]
    store = ["--store", str(store_folder)]
    diagnosed(store_folder, "4f0cbeef00000001", {"sensor.magnet.bias": True}, model=False)
    assert main(["ingest", str(tmp_path / "2_other.blf"), "--specimen", "M8", *words, *store]) == 0
    capsys.readouterr()
    assert main(["accept", "d-4f0c", *store]) == 0
    assert "Also for          1 session of M8: they have these files too." in capsys.readouterr().out
    assert accept(store_folder, capsys, "d-4f0c")["other_specimens"] == {"M8": 1}


@pytest.mark.parametrize(
    ("causes", "why"),
    [
        ({}, "it named no cause"),
        ({"loss.magnet.speed2": False}, "loss.magnet.speed2 changes neither motor nor bench file"),
        ({UNSAYABLE: True}, f"no file can say {UNSAYABLE}"),
    ],
)
def test_a_diagnosis_with_nothing_to_accept_is_refused(
    store_folder: Path, capsys: pytest.CaptureFixture[str], causes: dict[str, bool], why: str
) -> None:
    diagnosed(store_folder, "4f0cbeef00000001", causes, model=False, bench=False)
    before = head(store_folder)
    answer = accept(store_folder, capsys, "d-4f0c", code=2)
    assert answer["error"] == (f"diagnosis d-4f0cbeef0000: there is nothing to accept: {why}. Models stay as they are.")
    assert head(store_folder) == before


def test_an_unknown_or_ambiguous_diagnosis_is_refused_with_what_there_is(
    store_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert accept(store_folder, capsys, "d-1", code=2)["error"] == (
        'diagnosis "d-1" is not in this store: it holds none yet: `whyhot diagnose --on S...`'
    )
    for number in ("4f0c000000000001", "4f0d000000000002"):
        diagnosed(store_folder, number, CAUSES)
    assert accept(store_folder, capsys, "d-9", code=2)["error"] == (
        'diagnosis "d-9" is not in this store: it holds d-4f0c00000000, d-4f0d00000000.'
    )
    assert accept(store_folder, capsys, "d-4f0", code=2)["error"] == (
        'diagnosis "d-4f0" is the beginning of more than one: it holds d-4f0c00000000, d-4f0d00000000.'
    )


def test_what_accepting_changes_is_shown_and_the_current_files_come_out_by_their_names(
    store_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def out(*words: str, code: int = 0) -> bytes:
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.toml"
        assert main([*words, "-o", str(path), "--store", str(store_folder)]) == code
        return path.read_bytes() if path.exists() else b""

    made = diagnosed(store_folder, "4f0cbeef00000001", CAUSES)
    (tmp_path / "out").mkdir()
    beside = tmp_path / "out" / "motor.toml"
    words = ["-o", str(beside.with_name("mine.toml")), "--store", str(store_folder)]
    assert main(["bench", "export", "1_learn", *words]) == 0
    assert capsys.readouterr().out.endswith(f" servo-5kW -o {beside}\n"), "where the bench file looks for it"
    motor, bench = out("motor", "export", "servo-5kW"), out("bench", "export", "bench.toml")
    assert (motor.decode(), bench.decode()) == (can_bench.MOTOR, can_bench.BENCH), "as ingested, until one is accepted"
    capsys.readouterr()
    assert main(["accept", "d-4f0c", "--store", str(store_folder)]) == 0
    said = capsys.readouterr().out.splitlines()
    at = said.index(f"Changes of model {str(made['model'])[:8]}")
    where, *lines = said[at + 1 : at + 4]
    assert where == '    [[source]] node = "magnet"', "behind what the lines stand"
    assert lines == ["  + # extended by 4f0cbeef00000001", ""]
    assert '  + cause = "sensor.magnet.bias"' in said[said.index(f"Changes of bench file {str(made['bench'])[:8]}") :]
    assert out("motor", "export", "servo-5kW") == motor + b"# extended by 4f0cbeef00000001\n"
    assert out("motor", "export", str(made["parent"])[:12]) == motor
    assert out("bench", "export", "bench.toml") == out("bench", "export", "1_learn") != bench
    assert out("bench", "export", str(made["parent_bench"])[:12]) == bench
    capsys.readouterr()
    assert out("bench", "export", "nobody", code=2) == out("motor", "export", "nobody", code=2) == b""
    of_bench, of_model = capsys.readouterr().err.splitlines()
    assert of_bench.startswith(
        'bench file "nobody" is no bench file, nor a session that has one, of this store. Known: '
    )
    assert of_model.startswith('model "nobody" is no model of this store. Known: servo-5kW ')
    assert "ends in .toml" not in of_model, "a file is what is asked for"
