"""Output in another encoding than UTF-8: a German Windows pipe, a terminal of plain ASCII."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

LOG = "t [s];T_Rücken [°C];R [Ω]\n" + "".join(f"{i};{20 + i / 10};{i}\n" for i in range(60))
WORDS = (["show", "prüfung"], ["sessions"], ["--help"], ["show", "Übung"], ["ingest", "fehlt.csv"])


def _whyhot(folder: Path, encoding: str, *words: str) -> subprocess.CompletedProcess[bytes]:
    env = {**os.environ, "PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}
    command = [sys.executable, "-c", "from replay.cli import main; raise SystemExit(main())", *words]
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, check=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("encoding")
    (folder / "prüfung.csv").write_text(LOG, encoding="utf-8")
    return folder


@pytest.mark.parametrize("encoding", ["cp1252", "ascii", "cp850"])
def test_every_answer_comes_out_in_another_encoding(folder: Path, encoding: str) -> None:
    words = [["inspect", "prüfung.csv"], ["ingest", "prüfung.csv"], *WORDS]
    for told in (_whyhot(folder, encoding, *one) for one in words):
        says = (told.stdout + told.stderr).decode(encoding)  # raises where it is of another encoding
        assert "Traceback" not in says
        assert told.returncode in (0, 1, 2) and says
    shown = _whyhot(folder, encoding, "show", "prüfung").stdout.decode(encoding)
    assert ("T_R\\xfccken" if encoding == "ascii" else "T_Rücken") in shown
    assert ("degC" if encoding == "ascii" else "°C") in shown


def test_json_reads_back_as_it_was(folder: Path) -> None:
    told = [json.loads(_whyhot(folder, one, "inspect", "prüfung.csv", "--json").stdout) for one in ("ascii", "utf-8")]
    assert told[0] == told[1]
    assert told[0]["files"][0]["name"] == "prüfung.csv"


def test_a_minus_a_terminal_lacks_is_a_hyphen() -> None:
    script = "from replay.cli.encoding import fit_output; fit_output(); print('−1.7 K → 2 °C ± 1')"
    env = {**os.environ, "PYTHONIOENCODING": "ascii"}
    told = subprocess.run([sys.executable, "-c", script], env=env, capture_output=True, check=True)
    assert told.stdout.decode("ascii").strip() == "-1.7 K -> 2 degC +- 1"
