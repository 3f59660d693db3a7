"""Output in another encoding than UTF-8: a German Windows pipe, a terminal of plain ASCII."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

LOG = "t [s];T_Rücken [°C];R [Ω]\n" + "".join(f"{i};{20 + i / 10};{i}\n" for i in range(60))
WORDS = (["show", "prüfung"], ["sessions"], ["--help"], ["show", "Übung"], ["ingest", "fehlt.csv"])


# Several commands in one process of this encoding, so that its start is waited for once: behind what each prints its
# exit code between two marks.
COMMANDS = """
import json, sys
from replay.cli import main
for words in json.loads(sys.argv[1]):
    try:
        code = main(words)
    except SystemExit as ended:
        code = ended.code
    print(f"\\0{code}", end="\\0")
    sys.stdout.flush()
"""


def _whyhot(folder: Path, encoding: str, *commands: Sequence[str]) -> list[tuple[str, int]]:
    """What each command prints, and its exit code."""
    env = {**os.environ, "PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}
    run = [sys.executable, "-u", "-c", COMMANDS, json.dumps(commands)]
    done = subprocess.run(run, cwd=folder, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=True)
    told = done.stdout.decode(encoding).split("\0")  # raises where it is of another encoding
    assert len(told) == 2 * len(commands) + 1
    return [(says, int(code)) for says, code in zip(told[::2], told[1::2], strict=False)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("encoding")
    (folder / "prüfung.csv").write_text(LOG, encoding="utf-8")
    return folder


@pytest.mark.parametrize("encoding", ["cp1252", "ascii", "cp850"])
def test_every_answer_comes_out_in_another_encoding(folder: Path, encoding: str) -> None:
    told = _whyhot(folder, encoding, ["inspect", "prüfung.csv"], ["ingest", "prüfung.csv"], *WORDS)
    for says, code in told:
        assert "Traceback" not in says
        assert code in (0, 1, 2) and says
    shown, _ = told[2]
    assert ("T_R\\xfccken" if encoding == "ascii" else "T_Rücken") in shown
    assert ("degC" if encoding == "ascii" else "°C") in shown


def test_json_reads_back_as_it_was(folder: Path) -> None:
    ((ascii_text, _),) = _whyhot(folder, "ascii", ["inspect", "prüfung.csv", "--json"])
    ((text, _),) = _whyhot(folder, "utf-8", ["inspect", "prüfung.csv", "--json"])
    told = [json.loads(ascii_text), json.loads(text)]
    assert told[0] == told[1]
    assert told[0]["files"][0]["name"] == "prüfung.csv"


def test_a_minus_a_terminal_lacks_is_a_hyphen() -> None:
    script = "from replay.cli.encoding import fit_output; fit_output(); print('−1.7 K → 2 °C ± 1')"
    env = {**os.environ, "PYTHONIOENCODING": "ascii"}
    told = subprocess.run([sys.executable, "-c", script], env=env, capture_output=True, check=True)
    assert told.stdout.decode("ascii").strip() == "-1.7 K -> 2 degC +- 1"
