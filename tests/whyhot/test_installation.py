"""What `whyhot doctor` says of an environment where another distribution installed a package of our names."""

from __future__ import annotations

import base64
import hashlib
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from made.places import ROOT
from replay.cli import main
from whyhot import installation

FILES = {"analytics/__init__.py": '"""Ours."""\n', "analytics/query.py": "x = 1\n", "replay/__init__.py": ""}
Capture = pytest.CaptureFixture[str]


def _install(folder: Path, name: str, files: Mapping[str, str]) -> None:
    """As an installer does it: the files, and their names and hashes beside them."""
    rows = []
    for path, text in files.items():
        place = folder / path
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(text.encode())
        sha = base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest()).rstrip(b"=").decode()
        rows.append(f"{path},sha256={sha},{len(text)}")
    about = folder / f"{name}-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", encoding="utf-8")
    (about / "RECORD").write_text("\n".join([*rows, f"{name}-1.0.dist-info/RECORD,,", ""]), encoding="utf-8")


@pytest.fixture
def environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in front of everything that Python looks through for distributions, whyhot installed in it."""
    _install(tmp_path, "whyhot", FILES)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    return tmp_path


def test_nothing_is_said_of_an_installation_that_is_whole(environment: Path, capsys: Capture) -> None:
    assert installation.problems() == []
    assert main(["doctor"]) == 0
    assert capsys.readouterr().err == ""


def test_where_ledger_and_files_of_a_store_lie_is_said(tmp_path: Path, capsys: Capture) -> None:
    def said(mark: str | None, code: int = 0) -> str:
        if mark is not None:
            (tmp_path / "store.json").write_text(mark)
        assert main(["doctor", "--store", str(tmp_path)]) == code
        return "".join(capsys.readouterr())

    assert f"{tmp_path}, not there yet; " in said(None), "an empty folder is no store"
    assert f"{tmp_path}; " in said('{"schema": "whyhot.store/1"}')
    url = "postgresql://lab@db:5432/whyhot"
    server = f'{{"schema": "whyhot.store/2", "ledger": {{"url": "{url}", "table": "t"}}}}'
    assert f"{tmp_path}; its ledger in {url}; " in said(server)
    assert "store.json: schema 'whyhot.store/9' is not known here" in said('{"schema": "whyhot.store/9"}', 1)


def test_another_distribution_with_our_package_is_named_with_what_it_overwrote(
    environment: Path, capsys: Capture
) -> None:
    _install(environment, "analytics-python", {"analytics/__init__.py": "theirs = True\n"})
    assert main(["doctor"]) == 1
    both, changed = capsys.readouterr().err.splitlines()
    assert both.startswith("analytics-python installs a package analytics too, and one of the two overwrites or hides")
    assert changed.startswith("analytics/__init__.py of whyhot: missing, or not as installed: ")
    assert both.endswith(f": {installation.ADVICE}.") and changed.endswith(f": {installation.ADVICE}.")


def test_files_that_went_with_the_other_distribution_are_counted(environment: Path) -> None:
    for name in ("__init__", "query"):
        (environment / "analytics" / f"{name}.py").unlink()
    (line,) = installation.problems()
    assert line.startswith("analytics/__init__.py and 1 more of whyhot: missing, or not as installed: install whyhot")


def test_a_module_that_hides_ours_stops_every_verb_with_one_line(tmp_path: Path) -> None:
    (tmp_path / "analytics.py").write_text("", encoding="utf-8")
    code = (
        f"import sys; sys.path[:0] = [{str(tmp_path)!r}, {str(ROOT)!r}]; from replay.cli import main; main(['doctor'])"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    (line,) = done.stderr.splitlines()
    assert "analytics.py hides whyhot's package 'analytics': rename it" in line
