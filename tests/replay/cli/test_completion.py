"""What a shell is told to complete: verbs, options, and names of sessions, motors and diagnoses."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ingest.facts.events import BenchRegistered, DiagnosisCompleted, FactRetracted, ModelPublished
from ingest.facts.standing import whole
from ingest.facts.store import Store
from made.events import put, session, sha
from replay.cli import VERBS, main
from replay.cli.completion import SCRIPTS, candidates


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two sessions, two logs of which one was taken back, a bench file, a motor and a diagnosis."""
    folder = tmp_path / "store"
    with Store.open(folder, create=True, write=True) as opened:
        model = ModelPublished(model="4f0c", motor="servo-5kW", file="motor.toml", parent=None)
        opened.ledger.append("motor-servo-5kW", model)
        bench = BenchRegistered(sha256="b0", name="bench.toml", motor="servo-5kW", model="4f0c")
        opened.ledger.append("bench-b0", bench)
        put(opened, "my log.csv")
        put(opened, "bad.csv")
        bad = f"file-{sha('bad.csv')}"
        opened.ledger.append(
            bad, FactRetracted(fact=bad, name="bad.csv", why="a mistake", rows=[whole(sha("bad.csv"))])
        )
        opened.ledger.append("session-1", session("1", "1_s1"))
        opened.ledger.append("session-2", session("2", "2_wltp"))
        key: dict[str, object] = {"train": [], "kept": []}
        found = DiagnosisCompleted(diagnosis="7f31beef00", key=key, artefact="c", summary={})
        opened.ledger.append("diagnosis-7f31beef00", found)
    monkeypatch.setenv("WHYHOT_STORE", str(folder))
    return folder


@pytest.mark.parametrize(
    ("typed", "becomes"),
    [
        (["repl"], ["replay"]),
        (["replay", "--int"], ["--integrator"]),
        (["replay", "--level", "pro"], ["production"]),
        (["motor", "sl"], ["slice"]),
        (["show", ""], ["2_wltp", "1_s1"]),
        (["show", "--as-of", "3", "1"], ["1_s1"]),
        (["diagnose", "--on", "1_s1", "2"], ["2_wltp"]),
        (["diagnose", "--on", "1_s1", "--hold-out", ""], ["2_wltp", "1_s1"]),
        (["repeat", "1_s1", "2"], ["2_wltp"]),
        (["replay", "1_s1", "--model", "s"], ["servo-5kW"]),
        (["accept", ""], ["d-7f31beef"]),
        (["report", "d-"], ["d-7f31beef"]),
        (["motor", "export", ""], ["servo-5kW"]),
        (["bench", "export", ""], ["2_wltp", "1_s1", "bench.toml"]),
        (["forget", ""], ["my log.csv"]),
        (["correct", "m"], ["my log.csv"]),
        (["retract", "--undo", ""], ["bad.csv"]),
        (["ingest", "log"], []),
        (["replya", ""], []),
    ],
)
def test_what_is_typed_is_completed_by_what_it_names(store: Path, typed: list[str], becomes: list[str]) -> None:
    assert candidates(typed) == becomes


def test_each_verb_completes_its_options(store: Path) -> None:
    for verb in VERBS:
        assert {"--help", "--store", "--json"} <= set(candidates([verb, "-"])), verb


def test_the_store_that_is_typed_is_asked_and_without_one_nothing_is_named(store: Path, tmp_path: Path) -> None:
    assert candidates(["show", "--store", str(tmp_path / "none"), ""]) == []
    assert candidates(["show", "--store", str(store), ""]) == ["2_wltp", "1_s1"]


def test_names_are_completed_without_arithmetic_and_without_a_trace(store: Path) -> None:
    before = {path.name: path.stat().st_mtime_ns for path in store.iterdir()}
    asks = "import sys; from replay.cli import main; main(['completion', 'words', '--', 'replay', '1']); "
    code = f"{asks}print(sorted({{'numpy', 'scipy', 'pyarrow', 'duckdb'}} & set(sys.modules)))"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert told == "1_s1\n[]\n"
    after = {path.name: path.stat().st_mtime_ns for path in store.iterdir()}
    assert {name: at for name, at in after.items() if name in before} == before


@pytest.mark.parametrize("shell", SCRIPTS)
def test_the_script_is_one_that_its_shell_reads(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert script.startswith("# whyhot: ") and "whyhot completion words -- " in script
    if shutil.which(shell):
        subprocess.run([shell, "-n"], input=script, text=True, check=True)


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_bash_asks_for_the_words_as_they_were_typed(store: Path, tmp_path: Path) -> None:
    command = tmp_path / "bin" / "whyhot"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "from replay.cli import main; main()" "$@"\n')
    command.chmod(0o755)
    script = (
        'eval "$(whyhot completion bash)"; COMP_WORDS=(whyhot replay --model serv); COMP_CWORD=3; _whyhot; '
        'printf "%s|" "${COMPREPLY[@]}"'
    )
    env = {**os.environ, "PATH": f"{command.parent}{os.pathsep}{os.environ['PATH']}"}
    told = subprocess.run(["bash", "-c", script], env=env, capture_output=True, text=True, check=True)
    assert told.stdout == "servo-5kW|"
    script = script.replace("replay --model serv", "forget m")
    told = subprocess.run(
        ["bash", "-c", script.replace("=3", "=2")], env=env, capture_output=True, text=True, check=True
    )
    assert told.stdout == r"my\ log.csv|", "as a shell reads it"
