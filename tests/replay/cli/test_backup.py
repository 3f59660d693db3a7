"""`whyhot backup` and `restore` from the command line."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import pytest

from ingest.facts import archive
from ingest.facts.events import SignalDatabaseRegistered
from ingest.facts.store import Store
from replay.cli import main

Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def head(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The head of a store of two sealed files, 3 kB, in the current folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("WHYHOT_STORE", "store")
    with Store.open(Path("store"), create=True) as store:
        for name, size in (("a", 1000), ("b", 2000)):
            sha256 = store.archive.seal(name.encode() * size)
            store.ledger.append(f"database-{sha256}", SignalDatabaseRegistered(sha256=sha256, name=f"{name}.dbc"))
    with Store.open(Path("store")) as store:
        return str(store.ledger.head())


def _damage(folder: str, beginning: bytes) -> Path:
    for path in Path(folder, "archive").rglob("*"):
        if path.is_file() and path.read_bytes().startswith(beginning):
            path.chmod(0o644)
            path.write_bytes(b"x")
            return path
    raise LookupError(beginning)


def test_backup_says_what_it_copied_what_was_there_and_the_head(head: str, capsys: Capture) -> None:
    assert main(["backup", "my backup"]) == 0
    assert capsys.readouterr().out == (
        "Backed up         3 events and 2 sealed files of 3.0 kB\n"
        "There already     nothing\n"
        f"Head              {head}\n"
        "\n"
        "Next              whyhot verify --store 'my backup' --read\n"
    )
    assert main(["verify", "--read", "--store", "my backup"]) == 0
    assert f"head {head}" in capsys.readouterr().out
    assert main(["backup", "my backup", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["schema"] == "whyhot.backup/1"
    assert answer["copied"] == {"events": 0, "files": 0, "bytes": 0}
    assert answer["there"] == {"events": 3, "files": 2, "bytes": 3000}
    assert (answer["head"], answer["left"]) == (answer["provenance"]["store_head"], [])


def test_restore_makes_a_store_and_checks_it(head: str, capsys: Capture) -> None:
    assert main(["backup", "backup"]) == 0
    capsys.readouterr()
    assert main(["restore", "backup", "--store", "new"]) == 0
    assert capsys.readouterr().out == (
        "Restored          3 events and 2 sealed files of 3.0 kB\n"
        f"Head              {head}\n"
        "Checked           every event, and every byte of 2 of 2 sealed files\n"
        "\n"
        "Next              whyhot rebuild --store new\n"
    )
    assert main(["restore", "backup", "--json"]) == 2
    line = "store: is a store already, with 3 events: nothing was written; give a new folder with --store\n"
    assert capsys.readouterr().err == line
    assert main(["restore", "nowhere", "--store", "newer"]) == 2
    assert capsys.readouterr().err == "nowhere: there is no backup here: `whyhot backup nowhere` makes one\n"
    assert not Path("newer").exists()


def test_a_damaged_file_of_the_store_is_one_line_and_exit_code_1(capsys: Capture) -> None:
    path = _damage("store", b"a")
    assert main(["backup", "backup"]) == 1
    told = capsys.readouterr()
    assert told.err.startswith(f"{path}: is damaged, its 1 bytes are not those that were sealed: ")
    assert told.err.count("\n") == 1
    assert "Not copied        1 sealed file, in the lines above; all else was\n" in told.out
    assert told.out.endswith("Next              whyhot verify --store store --read\n")
    assert main(["restore", "backup", "--store", "new", "--json"]) == 1
    answer = json.loads(capsys.readouterr().out)
    assert (answer["copied"]["files"], len(answer["left"]), len(answer["damages"])) == (1, 1, 1)


def test_a_full_disk_is_that_of_the_backup(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    def full(*_: object) -> Path:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    assert main(["backup", "backup"]) == 0
    with Store.open(Path("store"), write=True) as store:
        sha256 = store.archive.seal(b"c")
        store.ledger.append(f"database-{sha256}", SignalDatabaseRegistered(sha256=sha256, name="c.dbc"))
    capsys.readouterr()
    with monkeypatch.context() as patch:
        patch.setattr(archive, "write_file", full)
        assert main(["backup", "backup"]) == 2
    assert capsys.readouterr().err == (
        "backup: the disk is full: nothing half-written was kept. Free some space and run it again.\n"
    )
    assert main(["backup", "backup"]) == 0
    assert main(["verify", "--read", "--store", "backup"]) == 0
