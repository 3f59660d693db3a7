"""The page for insulation engineers goes as it says, on the shipped logs."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from test_docs_run import DOCS, _assert_printed, _blocks, _commands, _run

EXAMPLE = DOCS.parent / "examples" / "insulation"


def test_the_page_on_ageing_goes_as_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(EXAMPLE, tmp_path, dirs_exist_ok=True)
    (tmp_path / "3v.jpg").write_bytes(b"\xff\xd8\xff\xe0")
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("WHYHOT_STORE", raising=False)
    ran = 0
    for kind, name, block in _blocks((DOCS / "ageing.md").read_text(encoding="utf-8")):
        assert kind in ("toml", "console", "text"), f"a block of {kind} is not tested"
        if kind == "toml":
            (tmp_path / name).write_text(block, encoding="utf-8")
        elif kind == "console":
            for command, shown in _commands(block):
                assert _run(_globbed(command)) == 0, command
                _assert_printed(shown, capsys.readouterr().out, command)
                ran += 1
    assert ran == 11
    assert (tmp_path / "ageing.svg").exists()


def _globbed(command: str) -> str:
    """As a shell would hand it over."""
    words = command.split(" ")
    found = [" ".join(sorted(map(str, Path().glob(word)))) if "*" in word and "/" in word else word for word in words]
    return " ".join(found)
